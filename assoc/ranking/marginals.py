"""Association probabilities of tuples, as guaranteed intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assoc._parameters import checked_time_limit
from assoc._system.door import door
from assoc._system.interrupts import interruptible
from assoc._text.shown import Shown
from assoc._types import Array, Floats
from assoc.errors import InvalidInputError
from assoc.packing.prepare import prepare
from assoc.packing.run import Run, infeasible
from assoc.problem import AssignmentProblem
from assoc.ranking.block_prices import LIGHTEST, ROUNDING
from assoc.ranking.clusters import cluster_problems, distinct
from assoc.ranking.columns import AllColumns, price_all_columns
from assoc.ranking.estimates.sampler import estimates
from assoc.ranking.estimates.swept import of_tuples, swept
from assoc.ranking.kbest import checked_k, rank
from assoc.ranking.pairs.windows import window_bounds
from assoc.ranking.partition_function import log_partition
from assoc.ranking.tuple_sums import WIDEST, sums_and_bounds
from assoc.solvers.greedy.fallback import prepare_fallback
from assoc.solvers.greedy.solve import greedy_choice
from assoc.solvers.methods import EXACT_METHODS

if TYPE_CHECKING:
    import pandas as pd


METHODS = ("auto", "certified", "estimate")
# where intervals are wider than this, probabilities are estimated
_WIDE = 0.02
# share of the time for sweeps
_FOR_SWEEPS = 0.5
# seconds that chains take to begin, for each measurement of each column, at most
_ENTRY = 5e-7
# inverse temperatures at which the unseen weight is bounded
_EXPONENTS = (1.0, 0.5, 0.0)
# intervals up to this width need no listing, nor do those of two lists unless they say next to nothing
_NARROW, _NARROW_PAIRS = 2e-9, 0.5
# share of the weight that sums may always lose to rounding
_ROUNDING = 1e-12
# a column this far above the solutions listed weighs nothing at any of these temperatures but the last, which counts
_FAR = 4000.0


@dataclass(frozen=True, slots=True, repr=False)
class Marginals(Shown):
    """Probability of each tuple to be an association.

    Attributes
    ----------
    tuples : int32 array, shape (T, S)
        Every distinct tuple of the problem, false alarms (singletons) among them.
    probability : float array, shape (T,)
        Best estimate between the bounds: from the k best of its cluster, or from sums around it where they are surer;
        where bounds are wide, from a truncated sweep over the cluster, or sampled.
    lower, upper : float arrays, shape (T,)
        Bounds on the probability among all solutions.
    unseen : float
        The width of the widest interval.
    listed : int
        Number of solutions listed, over all clusters.
    error : float
        How far the estimates may be off where bounds are wide: the largest change between two truncated sweeps, or the
        largest standard error of what is sampled, by the spread of several chains. 0: bounds are wide nowhere.
    """

    tuples: NDArray[np.int32]
    probability: Floats
    lower: Floats
    upper: Floats
    unseen: float
    listed: int
    error: float = 0.0

    def to_frame(self) -> pd.DataFrame:
        """One row per tuple that can have a probability: the sensors' indices, probability, lower, upper."""
        import pandas as pd

        columns = {f"sensor_{s + 1}": self.tuples[:, s] for s in range(self.tuples.shape[1])}
        frame = pd.DataFrame({**columns, "probability": self.probability, "lower": self.lower, "upper": self.upper})
        return frame[frame["upper"] > 0.0].reset_index(drop=True)

    def __repr__(self) -> str:
        return f"Marginals({len(self.tuples)} tuples, {self.listed} solutions listed, unseen weight {self.unseen:.3g})"


@door
@interruptible()
def marginals(
    problem: AssignmentProblem, k: int = 100, *, time_limit: float | None = None, method: str = "auto"
) -> Marginals:
    """Return the association probability of every tuple, by sums around it and the k best solutions.

    Parameters
    ----------
    problem : AssignmentProblem
        Costs are negative log likelihood ratios, so that a solution weighs exp(-cost).
    k : int, default 100
        Solutions to list for each cluster of tuples (``problem.components()``); clusters are independent, so
        that k of each give narrower intervals than k of the whole problem.
    time_limit : float, optional
        Seconds for all; the fewer solutions are proved, the wider the intervals.
    method : {"auto", "certified", "estimate"}
        "auto": where intervals stay wide, probabilities are estimated, by truncated sweeps where few sets of
        measurements matter, else by sampling (`assoc.ranking.estimates`); the intervals never are. "certified":
        nothing is estimated. "estimate": clusters that need it are only estimated, and their intervals are [0, 1].

    Raises
    ------
    InfeasibleError
        There is no solution, or none was found in the time.
    InvalidInputError
        ``k`` is not a whole number >= 1, the time limit is not positive, or the method is not one of these.

    Notes
    -----
    With all solutions x of a cluster and their costs c(x),

        P(t) = sum_{x contains t} exp(-c(x)) / sum_x exp(-c(x)).

    Let W be the weight of the k best (relative to the best), W(t) that of those with tuple t, and U an upper
    bound on the weight of all others. Each of the others may contain t or not, therefore

        W(t) / (W + U)  <=  P(t)  <=  (W(t) + U) / (W + U),

    and W(t) / W lies between. The others are bounded by two facts: their excess E over the dual bound is at
    least d, where the ranking stopped; and Z(a), the sum of exp(-a E) over all solutions, is at most
    ``exp(partition_function.log_partition(...))``. For any a in [0, 1], since E >= d,

        sum_{others} exp(-E)  <=  exp(-(1 - a) d) ( Z(a) - sum_{k best} exp(-a E) ).

    a = 1 gives the plain partition function, a = 0 the number of solutions times the weight of the next one; U is
    the least bound over several a.

    Two other ways do not weaken as scenes grow: clusters in which few measurements are open at a time are summed
    (``ranking/sweep.py``, ``ranking/tuple_sums.py``); with dummies ``ranking/block_prices.py`` bounds each tuple by
    sums over blocks of measurements whose surroundings are priced, and with two sensors ``ranking/pairs/windows.py``
    by sums around it. The narrowest bound counts, and where these leave no width to speak of, nothing is listed.
    """
    checked_k(k)
    if method not in METHODS:
        raise InvalidInputError(f"method: expected one of {', '.join(METHODS)}, got {method!r}")
    return bounded(problem, k, Run(0, time_limit=checked_time_limit(time_limit), methods=EXACT_METHODS), method)


def bounded(problem: AssignmentProblem, k: int, run: Run, method: str, widest: int = WIDEST) -> Marginals:
    """`marginals`, with sums over clusters of three sensors and more that have at most ``widest`` vertices open."""
    # the fallback for clusters that there is no time for
    prepare_fallback(prepare(problem).packing, run)
    tuples, index = distinct(problem.tuples)
    # a ranking prepares its columns before it checks the clock, which takes about as long as all this did
    begin = run.runtime() / max(problem.num_tuples, 1)
    probability, lower, upper = np.ones((3, len(tuples)))
    # how far estimates may be off; nan: none was needed
    error = np.full(len(tuples), np.nan)
    listed = 0
    waiting = np.ones(problem.num_tuples, dtype=bool)
    narrow = _NARROW if len(problem.sizes) > 2 else _NARROW_PAIRS
    known = without_listing(problem, index, len(tuples), run, widest, method != "estimate")
    for cluster, which in cluster_problems(problem):
        if known is not None and len(which) and np.ptp(known[1:, index[which]], axis=0).max() <= narrow:
            waiting[which] = False
            probability[index[which]], lower[index[which]], upper[index[which]] = known[:, index[which]]
            continue
        if run.should_stop() or run.remaining() < begin * len(which):
            listed += 1
            _guess(problem, index[waiting], index, probability, lower, upper, run)
            break
        waiting[which] = False
        # a cluster that is the whole problem has its greedy solution already
        clock = run if cluster is problem else run.part(0, run.time_limit)
        found = _unbounded(cluster, clock) if method == "estimate" else _of_cluster(cluster, k, clock, method)
        shares, share, count, estimated = found
        listed += count
        # a tuple that is listed twice is one tuple: each solution has it once, in either row
        touched, total = _totals(index[which], shares, len(tuples))
        probability[touched] = np.minimum(total, 1.0)
        lower[touched] = probability[touched] * (1.0 - share)
        upper[touched] = np.minimum(lower[touched] + share, 1.0)
        if estimated is not None:
            probability[touched] = np.clip(_totals(index[which], estimated[0], len(tuples))[1], 0.0, 1.0)
            error[touched] = _totals(index[which], estimated[1], len(tuples))[1]
    if known is not None:
        narrower = (known[2] - known[1] < upper - lower) & (np.isnan(error) | (known[2] - known[1] < _WIDE))
        lower, upper = np.maximum(lower, known[1]), np.minimum(upper, known[2])
        # the two kinds of bounds may meet at a point, but for rounding
        upper = np.maximum(upper, lower)
        probability = np.where(narrower, known[0], probability)
    probability = np.clip(probability, lower, upper)
    unseen, spread = float((upper - lower).max(initial=0.0)), float(np.nan_to_num(error).max(initial=0.0))
    return Marginals(tuples.astype(np.int32), probability, lower, upper, unseen, listed, spread)


def without_listing(
    problem: AssignmentProblem, index: NDArray[np.int64], num: int, run: Run, widest: int, bounds: bool
) -> Floats | None:
    """Estimate and bounds of each distinct tuple, (3, T), by sums, windows or blocks; None without time."""
    if run.should_stop():
        return None
    share = run.part(0, None if run.time_limit is None else 0.4 * run.time_limit)
    columns = price_all_columns(problem, share)
    two = len(problem.sizes) == 2 and problem.dummy
    found = _of_two_lists(columns, problem.sizes, share) if two else sums_and_bounds(columns, share, widest, bounds)
    # logarithms of weights are differences of costs, which may cancel
    counts = -columns.weights > LIGHTEST
    used = columns.rows[counts]
    single = prepare(problem).single_cost
    largest = float(np.abs(problem.costs[columns.origin[counts]]).max(initial=0.0))
    if problem.dummy:
        largest += np.abs(single[used[used >= 0]]).max(initial=0.0)
    largest += np.abs(columns.duals).max(initial=0.0)
    sums = 4.0 * (used.shape[1] + 2) * columns.slack.size * largest
    rounding = float(np.finfo(float).eps * sums)
    estimate, lower, upper = found
    lower, upper = np.maximum(lower - rounding, 0.0), np.minimum(upper + rounding, 1.0)
    known = np.repeat([[0.0], [0.0], [1.0]], num, axis=1)
    where = np.append(columns.origin, columns.single)
    known[:, index[where]] = np.stack([np.clip(estimate, lower, upper), lower, upper])[:, : len(where)]
    return known


def _of_two_lists(columns: AllColumns, sizes: NDArray[np.integer], run: Run) -> tuple[Floats, Floats, Floats]:
    """Estimate and bounds of the columns of a problem with two sensors, and of its rows."""
    counts = -columns.weights > LIGHTEST
    first, second = columns.rows[counts].T
    n, m = sizes.tolist()
    found = window_bounds(first, second - n, -columns.weights[counts], (n, m), run)
    # the others weigh nothing
    kept = np.append(counts, np.ones(n + m, dtype=bool))
    estimate, lower, upper = np.zeros((3, kept.size))
    estimate[kept], lower[kept], upper[kept] = found
    upper[~kept] = ROUNDING
    return estimate, lower, upper


def _guess(
    problem: AssignmentProblem, waiting: NDArray[np.int64], index: NDArray[np.int64], probability: Floats,
    lower: Floats, upper: Floats, run: Run,
) -> None:  # fmt: skip
    """Fill in the clusters not ranked when time is over: the greedy solution, with the interval [0, 1]."""
    chosen = np.zeros(probability.size)
    chosen[index[_greedy(problem, run)]] = 1.0
    probability[waiting], lower[waiting], upper[waiting] = chosen[waiting], 0.0, 1.0


def _greedy(problem: AssignmentProblem, run: Run) -> NDArray[np.int64]:
    """Rows of the tuples of the greedy solution."""
    prepared = prepare(problem)
    packing = prepared.packing
    columns = run.fallback if run.fallback is not None else greedy_choice(packing, run)
    if columns is None:
        raise infeasible(packing, run)
    alone = np.ones(prepared.single.size, dtype=bool)
    if alone.size:
        used = packing.cols[columns]
        alone[packing.row_origin[used[used >= 0]]] = False
    return np.concatenate([packing.origin[columns].astype(np.int64), prepared.single[alone]])


def _totals(index: NDArray[np.int64], values: Floats, num: int) -> tuple[NDArray[np.intp], Floats]:
    """Return the distinct tuples of a cluster, and the sum of the values of each."""
    touched, number = np.unique(index, return_inverse=True)
    return touched, np.asarray(np.bincount(number.reshape(-1), values), dtype=np.float64)


def _of_cluster(
    problem: AssignmentProblem, k: int, run: Run, method: str
) -> tuple[Floats, float, int, tuple[Floats, Floats] | None]:
    """Each tuple's share in the weight of the k best, the share of the unseen rest, and the number listed.

    And where they leave much open: estimates, and how far these may be off.
    """
    everything = run
    if method != "certified" and run.time_limit is not None:
        run = run.part(0, 0.6 * run.time_limit)
    # rank one more than is listed: its cost bounds the rest
    ranking = rank(problem, k + 1, None, run)
    solutions = ranking.solutions[:k]
    rest = min([ranking.rest, *(solution.lower_bound for solution in ranking.solutions[k:])])
    cost_of = np.array([solution.cost for solution in solutions])
    weights = np.exp(cost_of.min() - cost_of)
    total = float(weights.sum())
    weight_of = np.zeros(problem.num_tuples)
    for solution, weight in zip(solutions, weights, strict=True):
        weight_of[solution.indices] += weight
    others = _others(problem, ranking.columns, cost_of, rest, run)
    share = others / (total + others) if others < np.inf else 1.0
    # large costs have fewer exact digits than their differences need; sums lose as much as errors below this
    rounding = 2.0 * float(np.finfo(float).eps * np.abs(cost_of).max())
    if rounding > _ROUNDING:
        share = min(share + 4.0 * rounding, 1.0)
    # the share of a tuple in every listed solution is 1, whatever rounding did to the sums
    columns = ranking.columns
    if method == "certified" or share <= _WIDE:
        return np.minimum(weight_of / total, 1.0), share, len(solutions), None
    starts = [solutions[0].indices, solutions[-1].indices]
    estimated = _estimated(columns, starts, problem.num_tuples, everything)
    return np.minimum(weight_of / total, 1.0), share, len(solutions), estimated


def _unbounded(problem: AssignmentProblem, run: Run) -> tuple[Floats, float, int, tuple[Floats, Floats] | None]:
    """Like `_of_cluster`, but only estimates: without, those of the greedy solution."""
    columns = price_all_columns(problem, run.part(0, None if run.time_limit is None else 0.4 * run.time_limit))
    start = _greedy(problem, run)
    shares = np.zeros(problem.num_tuples)
    shares[start] = 1.0
    return shares, 1.0, 0, _estimated(columns, [start], problem.num_tuples, run)


def _estimated(columns: AllColumns, starts: list[Array], num: int, run: Run) -> tuple[Floats, Floats] | None:
    """Estimates of a cluster's tuples, and how far they may be off: by sweeps, or by chains from solutions."""
    found = swept(columns, run.deadline(_FOR_SWEEPS))
    if found is not None:
        share = of_tuples(columns, found, num)
        return share[0], np.abs(share[0] - share[1])
    return _sampled(columns, starts, num, run) if run.remaining() > _ENTRY * columns.rows.size else None


def _sampled(columns: AllColumns, starts: list[Array], num: int, run: Run) -> tuple[Floats, Floats] | None:
    """Sampled probabilities of the tuples of a cluster, and their standard errors, from these solutions (tuples)."""
    column = np.full(num, -1, dtype=np.int64)
    column[columns.origin] = np.arange(len(columns.origin))
    found = estimates(columns, [column[start][column[start] >= 0] for start in starts], run)
    if found is None:
        return None
    share = of_tuples(columns, found, num)
    return share.mean(axis=0), share.std(axis=0, ddof=1) / np.sqrt(len(share))


def _others(problem: AssignmentProblem, columns: AllColumns, listed: Floats, rest: float, run: Run) -> float:
    """Bound the weight, relative to the best's, of all unlisted solutions, each of which costs at least ``rest``."""
    if rest == np.inf:
        return 0.0
    bound = columns.bound + columns.offset
    excess = np.maximum(listed - bound, 0.0)
    smallest = np.inf
    if run.should_stop():
        return smallest
    rounding = _rounding(problem, columns, float(excess.max()))
    least = max(rest - bound - rounding, 0.0)
    packing = columns.keep(np.inf)
    for a in _EXPONENTS:
        if run.should_stop():
            break
        log_all = log_partition(columns, a, deadline=run.deadline, packing=packing)
        # all in logarithms: counts of solutions overflow
        with np.errstate(over="ignore"):
            seen = float(np.exp(-a * (excess + rounding) - log_all).sum())
            left = max(1.0 - seen, 0.0) + _ROUNDING
            log_left = log_all + np.log(left) - (1.0 - a) * least + (float(excess.min()) + 2.0 * rounding)
            smallest = min(smallest, float(np.exp(log_left)))
    return smallest


def _rounding(problem: AssignmentProblem, columns: AllColumns, excess: float) -> float:
    """Bound the difference between the sum of a solution's reduced costs and its cost less the bound.

    Weights are differences of costs, and reduced costs are differences of weights: their rounding error is a share of
    the largest operand, however small the difference. Columns far above the solutions listed do not count.
    """
    near = columns.reduced <= excess + _FAR
    rows = max(columns.slack.size, 1)
    single = prepare(problem).single_cost
    costs = problem.costs[columns.origin[near]]
    largest = np.abs(columns.weights[near]).max(initial=0.0) + np.abs(costs).max(initial=0.0)
    sums = rows * (largest + excess) + np.abs(columns.duals).sum() + np.abs(single).sum() + abs(columns.offset)
    return max(8.0 * float(np.finfo(float).eps * sums), columns.error)
