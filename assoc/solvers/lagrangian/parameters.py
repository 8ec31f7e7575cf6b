"""Parameters of the Lagrangian relaxation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assoc._parameters import Parameters, described


@dataclass(frozen=True)
class LagrangianParameters(Parameters):
    """Parameters of ``lagrangian``."""

    iterations: int = described(100, "subgradient steps, each with one 2-D relaxation and one recovery")
    gap: float = described(1e-9, "stop when cost - bound <= gap * max(1, abs(cost))")
    step: float = described(1.0, "factor of Polyak's step")
    patience: int = described(
        5, "steps without a better bound until the factor is halved; after ten halvings the method has converged"
    )
    warm_start: bool = described(True, "start from the smoothed dual ascent, not from 0 as in the paper")
    polish: bool = described(
        True, "improve recovered solutions by local search, and the best one at the end by exact sub-steps"
    )

    def __post_init__(self) -> None:
        self._whole("iterations", "patience")
        self._number("gap", least=0.0, most=1.0)
        self._number("step", least=1e-6, most=10.0)
        for name in ("warm_start", "polish"):
            self._require(isinstance(getattr(self, name), (bool, np.bool_)), name, "true or false")
