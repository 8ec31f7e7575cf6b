"""Association probabilities of tuples: exact sums where these are short, else one sampler that says its error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assoc._parameters import checked_time_limit
from assoc._system.imports import removed_attribute
from assoc._system.interrupts import interruptible
from assoc._system.wrong_types import explains_wrong_types
from assoc._text.shown import Shown
from assoc._types import Array, Floats, Ints
from assoc.packing.packing import Packing
from assoc.packing.prepare import prepare
from assoc.packing.run import Run, infeasible
from assoc.problem import AssignmentProblem, taken_problem
from assoc.ranking.columns import AllColumns, price_all_columns
from assoc.ranking.sampler import estimates
from assoc.ranking.sums import Plan, is_short, plan_clusters, sum_clusters, swept_in_logarithms
from assoc.ranking.sweep import Graph
from assoc.solvers.exact.parameters import ExactParameters
from assoc.solvers.exact.solve import solve as exact
from assoc.solvers.greedy.solve import greedy_choice
from assoc.solvers.methods import EXACT_METHODS

if TYPE_CHECKING:
    import pandas as pd

WIDEST = 22
"""Measurements that may be open at a time in an exact sum."""
_EXACT = 1e-8
"""What rounding may change of a sum that is called exact."""
_FOR_PRICES, _FOR_SUMS = 0.3, 0.5
"""Shares of the time limit: for multipliers, and for these and the sums together."""
_FOR_CHAINS = 0.8
"""Share of the time left that a search for a good solution leaves to the chains that begin with it."""
_UNDERFLOW = 745.0
"""A tuple whose reduced cost is above this weighs nothing."""


@dataclass(frozen=True, slots=True, repr=False)
class Marginals(Shown):
    """Probability of each tuple to be an association.

    Attributes
    ----------
    tuples : int32 array, shape (T, S)
        Every distinct tuple of the problem, false alarms (singletons) among them.
    probability : float array, shape (T,)
        Among all solutions, each of which weighs exp(-cost).
    error : float array, shape (T,)
        Standard error of the probability: 0 where it is exact, above 0 elsewhere, 1 where nothing is known in the time.
    exact : bool array, shape (T,)
        Whether the probability is an exact sum, up to rounding (1e-8).
    """

    tuples: NDArray[np.int32]
    probability: Floats
    error: Floats
    exact: NDArray[np.bool_]

    if not TYPE_CHECKING:  # or any name would seem to exist
        __getattr__ = removed_attribute

    def to_frame(self) -> pd.DataFrame:
        """One row per tuple: the sensors' indices, probability, error, exact."""
        import pandas as pd

        columns = {f"sensor_{s + 1}": self.tuples[:, s] for s in range(self.tuples.shape[1])}
        return pd.DataFrame({**columns, "probability": self.probability, "error": self.error, "exact": self.exact})

    def __repr__(self) -> str:
        worst = self.error.max(initial=0.0)
        return f"Marginals({len(self.tuples)} tuples, {self.exact.sum()} exact, largest error {worst:.3g})"


@explains_wrong_types
@interruptible()
def marginals(problem: AssignmentProblem | ArrayLike, *, time_limit: float | None = None) -> Marginals:
    """Return the association probability of every tuple.

    Parameters
    ----------
    problem : AssignmentProblem or array_like
        Costs are negative log likelihood ratios, so that a solution weighs exp(-cost). An array of costs is taken as by
        `assign`.
    time_limit : float, optional
        Seconds for all; what is not done by then has error 1.

    Raises
    ------
    InfeasibleError
        There is no solution.
    InvalidInputError
        The problem is none, or the time limit is not positive.

    Notes
    -----
    With all solutions x and their costs c(x), P(t) = sum_{x contains t} exp(-c(x)) / sum_x exp(-c(x)). Clusters of
    tuples are independent. Those that an elimination over measurements sums with a table of at most 2^22 entries are
    summed (`assoc.ranking.sweep`), in logarithms where costs are so large that all weights underflow and the tables
    are small (`assoc.ranking.sums`); all others are sampled by several Markov chains (`assoc.ranking.sampler`),
    whose differences give the standard error. Where chains all stay in one part of a large set of solutions, such an
    error is too small: no sample can show what it never met.
    """
    return weighed(taken_problem(problem), checked_time_limit(time_limit))


def weighed(
    problem: AssignmentProblem, time_limit: float | None = None, widest: int = WIDEST, length: float = 1.0
) -> Marginals:
    """`marginals` with at most ``widest`` measurements open in sums, and chains ``length`` times as long as usual."""
    run = Run(0, time_limit=time_limit, methods=EXACT_METHODS)
    tuples, index = _distinct(problem.tuples)
    count = len(tuples)
    probability, error, exact = np.full(count, 0.5), np.ones(count), np.zeros(count, dtype=np.bool_)
    if not run.should_stop():
        limit = run.time_limit
        columns = price_all_columns(problem, run.part(0, None if limit is None else _FOR_PRICES * limit))
        column = np.full(count, -1, dtype=np.int64)
        column[index[columns.origin]] = np.arange(len(columns.origin))
        found = _of_columns(problem, columns, column[index], (run, widest, length))
        where = index[np.append(columns.origin, columns.single)]
        probability[where], error[where], exact[where] = (part[: len(where)] for part in found)
    return Marginals(tuples.astype(np.int32), probability, error, exact)


def _distinct(tuples: NDArray[np.int32]) -> tuple[NDArray[np.int32], Ints]:
    """The distinct tuples in lexicographic order, and the index of each tuple among them."""
    order = np.lexsort(tuples.T[::-1])
    new = np.ones(len(tuples), dtype=np.bool_)
    new[1:] = (tuples[order[1:]] != tuples[order[:-1]]).any(axis=1)
    index = np.empty(len(tuples), dtype=np.int64)
    index[order] = np.cumsum(new) - 1
    return tuples[order[new]], index


def _of_columns(
    problem: AssignmentProblem, columns: AllColumns, column: Ints, work: tuple[Run, int, float]
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Probability, error and whether it is exact, of the N columns, and of the R rows to be in none of them.

    ``column`` is the column of each tuple of the problem, -1 for none.
    """
    run, widest, length = work
    num, rows = len(columns.weights), len(columns.slack)
    graph = _graph(columns)
    # the reduced costs of a solution add up to its cost but for a constant, whatever the multipliers
    priced = np.append(columns.duals, 0.0)[columns.rows].sum(axis=1)
    with np.errstate(over="ignore"):
        weights, free = np.exp(priced - columns.weights), np.exp(np.where(columns.slack, columns.duals, -np.inf))
    plan = plan_clusters(graph, np.zeros(num), widest, False)
    if (~columns.slack & (np.diff(graph.ptr) == 0)).any():
        # a measurement that must be covered and is in no tuple
        raise infeasible(prepare(problem).packing, run)
    probability = np.ones(num + rows)
    summed = sum_clusters(plan, weights, free, run.deadline(_FOR_SUMS), probability[:num], probability[num:])
    label = np.append(_label(graph, plan), plan.label)
    lost = np.unique(label[(label >= 0) & (label < summed) & ~np.isfinite(probability)])
    for c in lost.tolist():
        steps = plan.steps[plan.ends[c - 1] if c else 0 : plan.ends[c]]
        if is_short(steps) and not run.should_stop():
            duals = np.where(columns.slack, columns.duals, -np.inf)
            swept_in_logarithms(steps, priced - columns.weights, duals, probability[:num], probability[num:])
    rounding = _rounding(problem, columns, label, lost)
    done = (label >= 0) & (label < summed) & np.isfinite(probability)
    exact = done & (rounding <= _EXACT)
    probability[~done] = 0.5
    error = np.where(done, np.where(exact, 0.0, rounding), 1.0)
    # sampled: clusters that are too wide, or whose sums lost their digits; not those that time did not suffice for
    open_ = ~done & (label < summed)
    if open_.any():
        start = greedy_choice(prepare(problem).packing, run)
        if start is None and not run.should_stop():
            raise infeasible(prepare(problem).packing, run)
        if start is not None:
            best = column[prepare(problem).packing.origin[_improved(prepare(problem).packing, start, run)]]
            found = estimates(columns, open_[:num], open_[num:], best[best >= 0], run, length)
            if found is not None:
                probability[open_] = found[0]
                error[open_] = np.minimum(np.maximum(found[1], rounding[open_]), 1.0)
    return np.clip(probability, 0.0, 1.0), error, exact


def _improved(packing: Packing, start: Ints, run: Run) -> Ints:
    """Columns of the best solution that `exact` finds with next to no branching; the start without time."""
    limit = None if run.time_limit is None else run.time_limit - _FOR_CHAINS * run.remaining()
    part = run.part(0, limit)
    part.start = part.fallback = start
    return start if part.should_stop() else exact(packing, ExactParameters(nodes=1), part).columns


def _graph(columns: AllColumns) -> Graph:
    """Rows as vertices, columns as edges."""
    column, sensor = np.nonzero(columns.rows >= 0)
    row = columns.rows[column, sensor]
    ptr = np.append(0, np.cumsum(np.bincount(row, minlength=columns.slack.size)))
    return Graph(columns.rows.astype(np.int64), ptr, column[np.argsort(row, kind="stable")])


def _label(graph: Graph, plan: Plan) -> Array:
    """Cluster of each edge, of its first vertex."""
    if not len(graph.ends):
        return np.zeros(0, dtype=np.int64)
    first = np.argmax(graph.ends >= 0, axis=1)
    return plan.label[graph.ends[np.arange(len(first)), first]]


def _rounding(problem: AssignmentProblem, columns: AllColumns, label: Array, lost: Array) -> Floats:
    """How far rounding may move the probabilities of each column and row at most; at most 1.

    Logarithms of weights are differences of costs, which may cancel. Columns that weigh nothing do not count, but in
    ``lost`` clusters all do: there what counts is far above the multipliers.
    """
    num, clusters = len(columns.weights), int(label.max(initial=-1)) + 2
    near = (columns.reduced <= _UNDERFLOW) | np.isin(label[:num], lost)
    size = np.abs(problem.costs[columns.origin]) + np.abs(columns.weights)
    own = np.abs(columns.duals)
    if columns.single.size:
        own = own + np.abs(prepare(problem).single_cost)
    largest = np.zeros(clusters)
    np.maximum.at(largest, label[:num][near] + 1, size[near])
    np.maximum.at(largest, label[num:] + 1, own)
    rows = np.bincount(label[num:] + 1, minlength=clusters)
    found = 4.0 * float(np.finfo(float).eps) * (columns.rows.shape[1] + 2) * rows * largest
    return np.minimum(found, 1.0)[label + 1]
