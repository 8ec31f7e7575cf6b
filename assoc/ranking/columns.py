"""All distinct columns of a problem, as ranking and counting need them.

An optimum can be found without the columns of weight >= 0 of a problem with dummies (packing.py). Ranking and
counting need them, and a tuple that is listed twice must count once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc._types import Floats, Ints
from assoc.packing.bounds.dual_ascent import dual_bound, hard_pass
from assoc.packing.kernels.rounding import margin
from assoc.packing.packing import Packing, assemble
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem


@dataclass(frozen=True, slots=True)
class AllColumns:
    """All distinct columns of a problem over its measurements, with multipliers that price them."""

    rows: NDArray[np.int32]
    """Measurements of each column, numbered over all sensors, (N, S); -1 where the sensor missed."""
    weights: Floats
    """Cost of the tuple, (N,); with dummies, less the costs of its singletons."""
    origin: NDArray[np.int32]
    """Its row of ``problem.tuples``, (N,)."""
    slack: NDArray[np.bool_]
    """Whether a measurement may stay uncovered (at weight 0), (R,)."""
    duals: Floats
    """Multipliers, <= 0 where there is slack, (R,)."""
    reduced: Floats
    """Reduced costs >= 0 of the columns, (N,)."""
    slack_reduced: Floats
    """The same of leaving a row uncovered (``inf``: not allowed), (R,)."""
    bound: float
    """Sum of the multipliers."""
    error: float
    """Rounding error: a solution weighs at least the bound plus its reduced costs, less this."""
    offset: float
    """Weight plus this is the cost."""
    single: NDArray[np.int64]
    """The cheapest singleton tuple of each row, for problems with dummies; empty without."""

    @property
    def scale(self) -> float:
        """Magnitude of the numbers that light solutions are sums of; 0 only if all are 0.

        Solutions near the bound have columns of small reduced cost, whose weights are about the sums of their
        multipliers. The weights of other columns do not count, however large.
        """
        least = self.reduced[self.reduced > 0.0].min(initial=np.inf)
        priced = float(np.abs(self.weights - self.reduced).max(initial=0.0))
        return max(abs(self.bound), priced, float(least) if np.isfinite(least) else 0.0)

    def keep(self, excess: float) -> Packing:
        """Return the packing, split into components, of the columns whose reduced cost is at most ``excess``."""
        chosen = np.flatnonzero(self.reduced <= excess).astype(np.int32)
        return assemble(self.rows[chosen], self.weights[chosen], self.slack, chosen)

    def indices(self, columns: NDArray[np.integer]) -> NDArray[np.intp]:
        """Return the rows of ``problem.tuples`` of a choice of columns, completed by singletons."""
        indices = self.origin[columns].astype(np.intp)
        if self.single.size:
            alone = np.ones(self.single.size, dtype=bool)
            used = self.rows[columns]
            alone[used[used >= 0]] = False
            indices = np.concatenate([indices, self.single[alone]])
        return indices


def price_all_columns(problem: AssignmentProblem, run: Run) -> AllColumns:
    """Collect the distinct columns of a problem and price them by the dual bound's multipliers."""
    prepared = prepare(problem)
    packing = prepared.packing
    slack = slack_of(problem)
    # before the ascent, which takes the remaining time
    rows, weights, origin = distinct_columns(problem)
    # with dummies, columns of weight >= 0 have reduced costs >= 0 with any multipliers <= 0
    duals = np.zeros(slack.size)
    found = dual_bound(packing, run=run)
    hard_pass(packing, found)
    duals[packing.row_origin] = found
    return priced(rows, weights, origin, slack, duals, prepared.offset, prepared.single)


def slack_of(problem: AssignmentProblem) -> NDArray[np.bool_]:
    """Whether each measurement, numbered over all sensors, may stay uncovered."""
    sizes = problem.sizes
    return np.ones(int(sizes.sum()), dtype=np.bool_) if problem.dummy else np.repeat(sizes > sizes.min(), sizes)


def distinct_columns(problem: AssignmentProblem) -> tuple[NDArray[np.int32], Floats, NDArray[np.int32]]:
    """Return rows, weights and origin of all columns (see ``AllColumns``)."""
    prepared = prepare(problem)
    sizes = problem.sizes.astype(np.int64)
    # where this is interpreted, numpy would warn of the hash's overflow, which is intended
    with np.errstate(over="ignore"):
        return _distinct_columns(
            problem.tuples, problem.costs, np.cumsum(sizes) - sizes, prepared.single_cost, problem.dummy
        )


def priced(
    rows: NDArray[np.int32],
    weights: Floats,
    origin: NDArray[np.int32],
    slack: NDArray[np.bool_],
    duals: Floats,
    offset: float,
    single: NDArray[np.int64],
) -> AllColumns:
    """Combine columns and multipliers."""
    duals = np.where(slack, np.minimum(duals, 0.0), duals)
    reduced, least = _reduced(rows, weights, duals)
    error = margin(float(np.abs(duals).sum()), rows.shape[1]) - slack.size * least
    return AllColumns(
        rows,
        weights,
        origin,
        slack,
        duals,
        reduced,
        np.where(slack, -duals, np.inf),
        math.fsum(duals),
        error,
        offset,
        single,
    )


@njit
def _reduced(rows: Ints, weights: Floats, duals: Floats) -> Any:
    """Reduced costs, with negative ones set to 0, and the least before that."""
    reduced = np.empty(weights.size)
    least = 0.0
    for j in range(weights.size):
        total = 0.0
        for s in range(rows.shape[1]):
            if rows[j, s] >= 0:
                total += duals[rows[j, s]]
        reduced[j] = max(weights[j] - total, 0.0)
        least = min(least, weights[j] - total)
    return reduced, least


@njit
def _distinct_columns(tuples: Ints, costs: Floats, offsets: Ints, single_cost: Floats, dummy: bool) -> Any:
    """Distinct columns of two or more measurements (without dummies: all), each at its smallest cost."""
    num, num_sensors = tuples.shape
    size = 16
    while size < 2 * num:
        size *= 2
    table = np.full(size, -1, np.int32)
    origin = np.empty(num, np.int32)
    count = 0
    for j in range(num):
        measurements = 0
        mark = np.uint64(1469598103934665603)
        for s in range(num_sensors):
            if tuples[j, s] > 0:
                measurements += 1
            mark = (mark ^ np.uint64(tuples[j, s])) * np.uint64(0x9E3779B97F4A7C15)
            mark ^= mark >> np.uint64(29)
        if dummy and measurements < 2:
            continue
        at = np.int64(mark & np.uint64(size - 1))
        while table[at] >= 0:
            other = origin[table[at]]
            same = True
            for s in range(num_sensors):
                if tuples[other, s] != tuples[j, s]:
                    same = False
                    break
            if same:
                break
            at = (at + 1) & (size - 1)
        if table[at] < 0:
            table[at] = count
            origin[count] = j
            count += 1
        elif costs[j] < costs[origin[table[at]]]:
            origin[table[at]] = j
    rows = np.empty((count, num_sensors), np.int32)
    weights = np.empty(count)
    for n in range(count):
        j = origin[n]
        weights[n] = costs[j]
        for s in range(num_sensors):
            i = tuples[j, s]
            rows[n, s] = offsets[s] + i - 1 if i > 0 else -1
            if dummy and i > 0:
                weights[n] -= single_cost[rows[n, s]]
    return rows, weights, origin[:count].copy()
