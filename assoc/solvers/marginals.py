"""Association probabilities of tuples, as intervals that hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assoc.problem import AssignmentProblem
from assoc.solution import Solution
from assoc.solvers.complete import Complete
from assoc.solvers.kbest import checked_k, rank
from assoc.solvers.partition import log_partition

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]

# inverse temperatures at which the unseen weight is bounded
_EXPONENTS = (1.0, 0.75, 0.5, 0.0)


@dataclass(frozen=True, slots=True)
class Marginals:
    """Probability of each tuple to be an association.

    Attributes
    ----------
    tuples : int32 array, shape (T, S)
        Every distinct tuple of the problem, false alarms (singletons) among them.
    probability : float array, shape (T,)
        Share of the tuple's solutions in the weight of the k best.
    lower, upper : float arrays, shape (T,)
        The probability among all solutions lies between.
    unseen : float
        Share of the whole weight that solutions beyond the k best can have at most: the width of each
        interval.
    solutions : tuple of Solution
        The k best.
    """

    tuples: NDArray[np.int32]
    probability: Floats
    lower: Floats
    upper: Floats
    unseen: float
    solutions: tuple[Solution, ...]

    def to_frame(self) -> pd.DataFrame:
        """One row per tuple that can have a probability: the sensors' indices, probability, lower, upper."""
        import pandas as pd

        columns = {f"sensor_{s + 1}": self.tuples[:, s] for s in range(self.tuples.shape[1])}
        frame = pd.DataFrame({**columns, "probability": self.probability, "lower": self.lower, "upper": self.upper})
        return frame[frame["upper"] > 0.0].reset_index(drop=True)


def marginals(problem: AssignmentProblem, k: int = 100, *, time_limit: float | None = None) -> Marginals:
    """Return the association probability of every tuple, from the k best solutions.

    Parameters
    ----------
    problem : AssignmentProblem
        Costs are negative log likelihood ratios, so that a solution weighs exp(-cost).
    k : int, default 100
        Solutions to list.
    time_limit : float, optional
        Seconds for the ranking; with fewer solutions proved the intervals are wider.

    Raises
    ------
    InfeasibleError
        There is no solution.
    InvalidInputError
        ``k`` is not a whole number >= 1, or the time limit is not positive.

    Notes
    -----
    With all solutions x of cost c(x),

        P(t) = sum_{x contains t} exp(-c(x)) / sum_x exp(-c(x)).

    Let W be the weight of the k best (relative to the best), W(t) that of those with tuple t, and U an upper
    bound on the weight of all others. Each of the others may contain t or not, therefore

        W(t) / (W + U)  <=  P(t)  <=  (W(t) + U) / (W + U),

    and W(t) / W lies between. Two things are known of the others: their excess E over the dual bound is at
    least d, where the ranking stopped; and Z(a), the sum of exp(-a E) over all solutions, is at most what
    ``partition.log_partition`` says. For any a in [0, 1], since E >= d,

        sum_{others} exp(-E)  <=  exp(-(1 - a) d) ( Z(a) - sum_{k best} exp(-a E) ).

    a = 1 is the plain partition function, a = 0 the number of solutions times the weight of the next; U is
    the least of several.
    """
    # one more than is listed: its cost bounds all that are not
    ranking = rank(problem, checked_k(k) + 1, time_limit)
    listed = ranking.solutions[:k]
    rest = min([ranking.rest, *(solution.lower_bound for solution in ranking.solutions[k:])])
    best = min(solution.cost for solution in listed)
    weights = np.exp(best - np.array([solution.cost for solution in listed]))
    total = float(weights.sum())
    tuples, place = np.unique(problem.tuples, axis=0, return_inverse=True)
    own = np.zeros(len(tuples))
    for solution, weight in zip(listed, weights, strict=True):
        own[place.reshape(-1)[solution.indices]] += weight
    others = _others(problem, ranking.columns, listed, rest)
    # what every listed solution has, it has with certainty up to the others; sums lose digits
    own = np.minimum(own, total)
    share = others / (total + others) if others < np.inf else 1.0
    lower = own / total * (1.0 - share)
    return Marginals(
        tuples=tuples.astype(np.int32),
        probability=own / total,
        lower=lower,
        upper=np.minimum(lower + share, 1.0),
        unseen=share,
        solutions=tuple(listed),
    )


def _others(problem: AssignmentProblem, columns: Complete, listed: list[Solution], rest: float) -> float:
    """Bound the weight, relative to that of the best, of all solutions that are not listed and cost ``rest``."""
    if rest == np.inf:
        return 0.0
    bound = columns.bound + columns.offset
    excess = np.maximum(np.array([solution.cost for solution in listed]) - bound, 0.0)
    least = max(rest - bound, 0.0)
    sensor_of = np.repeat(np.arange(problem.num_sensors), problem.sizes)
    smallest = np.inf
    for a in _EXPONENTS:
        log_all = log_partition(columns, sensor_of, a)
        # all in logarithms: counts of solutions overflow
        seen = float(np.exp(-a * excess - log_all).sum())
        left = max(1.0 - seen, 0.0) + 1e-12
        with np.errstate(over="ignore"):
            smallest = min(smallest, float(np.exp(log_all + np.log(left) - (1.0 - a) * least + excess.min())))
    return smallest
