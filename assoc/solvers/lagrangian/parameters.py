"""Parameters of the Lagrangian relaxation."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from assoc._parameters import Parameters


@dataclass(frozen=True)
class LagrangianParameters(Parameters):
    """Parameters of ``lagrangian``.

    Attributes
    ----------
    iterations : int
        Subgradient steps, each with one 2-D relaxation and one recovery.
    gap : float
        Stop when cost - bound <= gap * max(1, abs(cost)).
    step : float
        Factor of Polyak's step; halved after ``patience`` iterations in which the bound did not rise.
    patience : int
        See ``step``; after ten halvings the method has converged.
    warm_start : bool
        Start from the smoothed dual ascent; else from u = 0, as in the paper.
    polish : bool
        Improve every recovered solution by dimensionwise search and insertion with ejection, and the
        best one at the end by cluster search.
    """

    iterations: int = field(default=100, metadata={"help": "subgradient steps"})
    gap: float = field(default=1e-9, metadata={"help": "stop at this relative gap"})
    step: float = field(default=1.0, metadata={"help": "factor of Polyak's step"})
    patience: int = field(default=5, metadata={"help": "steps without a better bound until the factor is halved"})
    warm_start: bool = field(default=True, metadata={"help": "start from the smoothed dual ascent, not from 0"})
    polish: bool = field(default=True, metadata={"help": "improve recovered solutions by local search"})

    def __post_init__(self) -> None:
        self._whole("iterations", "patience")
        self._number("gap", least=0.0, most=1.0)
        self._number("step", least=1e-6, most=10.0)
        for name in ("warm_start", "polish"):
            self._require(isinstance(getattr(self, name), (bool, np.bool_)), name, "true or false")
