"""Lagrangian relaxation: two sensors are matched exactly, the constraints of the others are priced."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from assoc.solvers.run import Outcome, Parameters, Run

if TYPE_CHECKING:
    from assoc.solvers.packing import Packing


@dataclass(frozen=True)
class LagrangianParameters(Parameters):
    """Parameters of the Lagrangian relaxation.

    Attributes
    ----------
    iterations : int
        Subgradient steps on one component at the most.
    patience : int
        A component is left after so many steps without a better bound or solution.
    step : float
        Factor of the Polyak step (best cost - relaxed cost) / |g|^2; it is halved while the bound stalls.
    gap : float
        A component is left when its gap is below this share of its cost (0: only when it is closed).
    warm_start : bool
        Start from the multipliers of a short smoothed dual ascent (bounds.py) instead of zero.
    polish : bool
        Improve recovered solutions by insertion with ejection and dimensionwise search.
    """

    iterations: int = field(default=300, metadata={"help": "subgradient steps on one component at the most"})
    patience: int = field(default=60, metadata={"help": "steps without progress before a component is left"})
    step: float = field(default=1.0, metadata={"help": "factor of the Polyak step"})
    gap: float = field(default=0.0, metadata={"help": "relative gap at which a component is left"})
    warm_start: bool = field(default=True, metadata={"help": "start from a short smoothed dual ascent"})
    polish: bool = field(default=True, metadata={"help": "improve recovered solutions by local search"})

    def __post_init__(self) -> None:
        self._require(self.iterations >= 1, "iterations", "a whole number >= 1")
        self._require(self.patience >= 1, "patience", "a whole number >= 1")
        self._require(0 < self.step <= 2, "step", "a number above 0, at most 2")
        self._require(0 <= self.gap < float("inf"), "gap", "a number >= 0")


def solve(packing: Packing, parameters: LagrangianParameters, run: Run) -> Outcome:
    """Raise the multipliers step by step; one iteration is one relaxed 2-D assignment with its recovery.

    References
    ----------
    S. Deb, M. Yeddanapudi, K. Pattipati, Y. Bar-Shalom, A generalized S-D assignment algorithm for
    multisensor-multitarget state estimation, IEEE Transactions on Aerospace and Electronic Systems 33 (1997).
    """
    from assoc.solvers.relaxation import relax

    return relax(packing, parameters, run)


parameters = LagrangianParameters
