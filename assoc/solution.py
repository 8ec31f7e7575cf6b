"""A solver's answer: chosen tuples, cost, and certificate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    import pandas as pd

OPTIMALITY_TOLERANCE = 1e-6

_SHOWN = 10


class TracePoint(NamedTuple):
    """A point in a solver's history."""

    iteration: int
    """Number of iterations so far; each solver's documentation defines them."""
    seconds: float
    """Seconds since the solver started, without compile time."""
    cost: float
    """Cost of the best solution known."""
    lower_bound: float
    """Best valid lower bound known."""


@dataclass(frozen=True, slots=True)
class Solution:
    """A feasible choice of tuples with its certificate.

    Attributes
    ----------
    tuples : int32 array, shape (K, S)
        The chosen tuples in lexicographic order, including false alarms (singletons).
    indices : int array, shape (K,)
        The same tuples as rows of ``problem.tuples``.
    cost : float
        Total cost.
    lower_bound : float
        No solution of the problem costs less.
    status : str
        "optimal" when the gap is closed to 1e-6 * max(1, abs(cost)), else "feasible".
    solver : str
        Name of the solver.
    iterations : int
        Iterations used.
    runtime : float
        Seconds from the problem to this solution, without compile time.
    stopped_by : str
        Why the solver stopped: "gap", "iterations", "converged", "time_limit", "callback", "interrupted"
        (a program was asked to end), or "memory_limit".
    duals : tuple of float arrays
        One multiplier per measurement of each sensor, which prove the bound: with them
        every tuple's reduced cost is >= 0 up to rounding. Empty where the proof was by enumeration.
    trace : tuple of TracePoint
        History of cost and bound, thinned out beyond 100,000 points.
    parameters : mapping
        The solver's parameters.
    compile_time : float
        Seconds spent on compiling kernels (once after installation) or loading them (once in a process); they count in
        a time limit, not in ``runtime``.
    gains : mapping
        What moves of ``exact`` ("tabu", "genetic", "sub-steps", "regions", "branching") lowered the cost by, in all.
    """

    tuples: NDArray[np.int32]
    indices: NDArray[np.intp]
    cost: float
    lower_bound: float
    solver: str
    iterations: int
    runtime: float
    stopped_by: str = "converged"
    duals: tuple[NDArray[np.float64], ...] = ()
    trace: tuple[TracePoint, ...] = ()
    parameters: Mapping[str, Any] = field(default_factory=dict)
    compile_time: float = 0.0
    gains: Mapping[str, float] = field(default_factory=dict)

    @property
    def gap(self) -> float:
        """Upper bound on the distance to the optimal cost: ``cost - lower_bound`` >= 0."""
        return self.cost - self.lower_bound

    @property
    def status(self) -> str:
        """Whether the gap is closed ("optimal") or not ("feasible")."""
        return "optimal" if self.gap <= OPTIMALITY_TOLERANCE * max(1.0, abs(self.cost)) else "feasible"

    @property
    def num_targets(self) -> int:
        """Number of chosen tuples with at least two measurements."""
        return int((np.count_nonzero(self.tuples, axis=1) >= 2).sum())

    @property
    def pairs(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns that are assigned to each other, from 0, as by scipy's ``linear_sum_assignment``.

        Raises
        ------
        InvalidInputError
            The problem has not two lists.
        """
        if self.tuples.shape[1] != 2:
            raise InvalidInputError(f"pairs: expected a solution of two lists, got {self.tuples.shape[1]}; see tuples")
        rows, columns = (self.tuples[self.tuples.all(axis=1)].T - 1).astype(np.intp)
        return rows, columns

    def to_frame(self) -> pd.DataFrame:
        """One row per chosen tuple: columns ``sensor_1`` .. ``sensor_S`` (0: missed) and ``measurements``."""
        import pandas as pd

        columns = [f"sensor_{s + 1}" for s in range(self.tuples.shape[1])]
        frame = pd.DataFrame(self.tuples, columns=columns)
        frame["measurements"] = np.count_nonzero(self.tuples, axis=1)
        return frame

    def __repr__(self) -> str:
        return (
            f"Solution({self.solver}: cost {self.cost:.6g}, lower bound {self.lower_bound:.6g}, {self.status}, "
            f"{len(self.tuples)} tuples, {self.num_targets} targets, {1e3 * self.runtime:.3g} ms)"
        )

    def _repr_html_(self) -> str:
        """HTML for notebooks: the certificate, and the first targets."""
        from assoc._text.html import escape, facts, table

        certificate = {
            "solver": self.solver,
            "status": self.status,
            "cost": f"{self.cost:.6g}",
            "lower bound": f"{self.lower_bound:.6g}",
            "gap": f"{self.gap:.3g}",
            "targets": self.num_targets,
            "tuples": len(self.tuples),
            "iterations": self.iterations,
            "stopped by": self.stopped_by,
            "runtime": f"{1e3 * self.runtime:.3g} ms",
        }
        targets = self.tuples[np.count_nonzero(self.tuples, axis=1) >= 2]
        headers = [f"sensor {s + 1}" for s in range(self.tuples.shape[1])]
        shown = table(headers, targets[:_SHOWN].tolist(), numbers=range(len(headers)))
        rest = len(targets) - _SHOWN
        more = f"<p>... and {rest} more</p>" if rest > 0 else ""
        return f"<p>{escape(repr(self))}</p>{facts(certificate)}{shown}{more}"
