"""Convert an assignment problem to packing form, and solutions back."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc.packing.packing import Packing, assembled
from assoc.problem import AssignmentProblem
from assoc.solution import Solution

# costs above this many times the relevant ones are lowered; relevant costs below this are scaled up, for tolerances
_FAR, _SMALL = 2.0**12, 2.0**-10


class CappedCosts(NamedTuple):
    """A replacement for another problem, with costs in a range that doubles can order."""

    problem: AssignmentProblem
    """The same tuples at equal or lower costs, in another unit."""
    unit: float = 1.0
    """The unit of its costs, a power of two."""
    lowered: NDArray[np.bool_] | None = None
    """Tuples that cost less than in the other problem, (M,); None if the problem is unchanged."""
    trace_ceiling: float = math.inf
    """Solutions that cost less than this, in the other problem's unit, have no lowered tuple."""

    def restored(self, problem: AssignmentProblem, solution: Solution) -> Solution:
        """The solution as one of the other problem; its bounds are valid there, as no cost is lower there."""
        if self.lowered is None:
            return solution
        cost = math.fsum(problem.costs[solution.indices].tolist())
        bound = min(math.nextafter(solution.lower_bound * self.unit, -math.inf), cost)
        duals = tuple(given * self.unit for given in solution.duals)
        return replace(solution, cost=cost, lower_bound=bound, duals=duals)

    def alters(self, solution: Solution) -> bool:
        """Whether a solution has a lowered tuple."""
        return self.lowered is not None and bool(self.lowered[solution.indices].any())


class PreparedArrays(NamedTuple):
    """The arrays of a prepared problem, as kernels take them; see `Prepared` and `Packing`."""

    cols: NDArray[np.int32]
    weights: NDArray[np.float64]
    slack: NDArray[np.bool_]
    origin: NDArray[np.int32]
    row_origin: NDArray[np.int32]
    single: NDArray[np.int64]
    row_ptr: NDArray[np.int64]
    row_cols: NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Prepared:
    """A problem in packing form, and the data to convert solutions back."""

    packing: Packing
    """``origin`` are rows of ``problem.tuples``, ``row_origin`` global row numbers."""
    offset: float
    """Cost of all measurements as false alarms, all singletons (0 without dummies)."""
    single: NDArray[np.int64]
    """With dummies, the cheapest singleton tuple of each global row; empty without."""
    single_cost: NDArray[np.float64]
    """Its cost."""

    @property
    def arrays(self) -> PreparedArrays:
        """The columns and the data to convert solutions back, as kernels take them."""
        packing = self.packing
        given = packing.cols, packing.weights, packing.slack, packing.origin, packing.row_origin
        return PreparedArrays(*given, self.single, packing.row_ptr, packing.row_cols)


def with_capped_costs(problem: AssignmentProblem) -> Iterator[CappedCosts]:
    """Yield the problem with far too large costs lowered, then with fewer of them lowered, until none is.

    A cost that is meant to exclude a tuple (a "big M") destroys the digits of all costs added to it. If the best (or
    next) solution with lowered costs has no lowered tuple, it is also the best (or next) of the problem itself.
    """
    costs = problem.costs
    low, high = (float(costs.min()), float(costs.max())) if costs.size else (0.0, 0.0)
    least = abs(low) or float(np.min(costs, where=costs > 0.0, initial=1.0))
    if high <= _FAR * least and not 0.0 < max(-low, high) < _SMALL:
        yield CappedCosts(problem)
        return
    # every solution has a tuple of at least this cost: the largest of the measurements' least costs
    counts = max(-low, _dearest_need(problem)) or least
    while True:
        shift = min(math.frexp(counts)[1], 0) if counts < _SMALL else 0
        # more than the difference of two solutions of relevant costs, each between -size and size
        size = counts * float(problem.sizes.sum())
        ceiling = 8.0 * size if high > _FAR * counts else np.inf
        lowered = costs > ceiling
        if shift == 0 and not lowered.any():
            yield CappedCosts(problem)
            return
        new_costs = np.ldexp(np.minimum(costs, ceiling), -shift)
        new_problem = AssignmentProblem(problem.tuples, new_costs, problem.sizes, dummy=problem.dummy)
        yield CappedCosts(new_problem, math.ldexp(1.0, shift), lowered, ceiling - size)
        if not lowered.any():
            return
        counts = float(costs[costs <= max(_FAR * counts, float(costs[lowered].min()))].max())


def _dearest_need(problem: AssignmentProblem) -> float:
    """The largest, over the measurements that must be used, of the least cost of a tuple with it; at least 0."""
    sizes = problem.sizes.astype(np.int64)
    must = np.repeat(problem.dummy | (sizes == sizes.min()), sizes)
    least = np.full(must.size, np.inf)
    _lower_to_least(problem.tuples, problem.costs, sizes.cumsum() - sizes, least)
    return float(least[must].max(initial=0.0))


@njit
def _lower_to_least(
    tuples: NDArray[np.int32], costs: NDArray[np.float64], offsets: NDArray[np.int64], least: NDArray[np.float64]
) -> None:
    """Lower each row's value to the least cost of a tuple that has it."""
    for k in range(costs.size):
        for s in range(offsets.size):
            if tuples[k, s] > 0:
                r = offsets[s] + tuples[k, s] - 1
                if costs[k] < least[r]:
                    least[r] = costs[k]


def prepare(problem: AssignmentProblem, *, every_tuple: bool = False) -> Prepared:
    """Convert a problem to packing form; the result is cached with the problem, which is immutable.

    With ``every_tuple`` also tuples that cost no less than their singletons become columns; this is not cached.
    """
    if problem._prepared is not None and not every_tuple:
        return problem._prepared
    sizes = problem.sizes.astype(np.int64)
    offsets = sizes.cumsum() - sizes
    arrays: Any
    if problem.dummy:
        arrays, whole, single, single_cost = _prepare_with_dummies(
            problem.tuples, problem.costs, offsets, int(sizes.sum()), math.inf if every_tuple else 0.0
        )
    else:
        slack = np.repeat(sizes > sizes.min(), sizes)
        arrays, whole = _prepare_without_dummies(problem.tuples, problem.costs, offsets, slack)
        single, single_cost = np.zeros(0, dtype=np.int64), np.zeros(0)
    packing = Packing(*(*arrays, 1.0 if whole else 0.0))
    # every bound contains this sum: exact to the last digit
    offset = math.fsum(single_cost.tolist()) if single_cost.any() else 0.0
    prepared = Prepared(packing, offset, single, single_cost)
    if not every_tuple:
        problem._prepared = prepared
    return prepared


@njit
def _prepare_with_dummies(
    tuples: NDArray[np.int32], costs: NDArray[np.float64], offsets: NDArray[np.int64], total: int, limit: float
) -> Any:
    """Arrays of the packing, whether its weights are whole numbers, and the singletons with their costs."""
    rows, weights, origin, single, single_cost = _columns_with_dummies(tuples, costs, offsets, total, limit)
    arrays = assembled(rows, weights, np.ones(total, np.bool_), origin)
    return arrays, _whole_numbers(weights), single, single_cost


@njit
def _prepare_without_dummies(
    tuples: NDArray[np.int32], costs: NDArray[np.float64], offsets: NDArray[np.int64], slack: NDArray[np.bool_]
) -> Any:
    """Arrays of the packing, and whether its weights are whole numbers."""
    rows, origin = np.empty(tuples.shape, np.int32), np.empty(costs.size, np.int32)
    # copied: the problem's arrays are read-only, and numba would compile kernels again for those
    weights = np.empty(costs.size)
    for j in range(costs.size):
        weights[j], origin[j] = costs[j], j
        for s in range(offsets.size):
            rows[j, s] = tuples[j, s] + offsets[s] - 1
    return assembled(rows, weights, slack, origin), _whole_numbers(weights)


@njit
def _whole_numbers(weights: NDArray[np.float64]) -> bool:
    """Whether all weights are whole numbers, small enough that tolerances relative to their sums stay below 1."""
    if weights.size == 0:
        return False
    total = 0.0
    for j in range(weights.size):
        total += abs(weights[j])
        if not (total < 9e8 and weights[j] == math.floor(weights[j])):
            return False
    return True


@inner_njit
def _columns_with_dummies(
    tuples: NDArray[np.int32], costs: NDArray[np.float64], offsets: NDArray[np.int64], total: int, limit: float
) -> Any:
    """Cheapest singleton of each row, and the columns whose weight is below the limit."""
    num_tuples, num_sensors = tuples.shape
    single = np.full(total, -1, np.int64)
    single_cost = np.zeros(total)
    for j in range(num_tuples):
        size = 0
        row = -1
        for s in range(num_sensors):
            if tuples[j, s] > 0:
                size += 1
                row = offsets[s] + tuples[j, s] - 1
        if size == 1 and (single[row] < 0 or costs[j] < single_cost[row]):
            single[row] = j
            single_cost[row] = costs[j]
    weights = np.empty(num_tuples)
    origin = np.empty(num_tuples, np.int32)
    count = 0
    for j in range(num_tuples):
        size = 0
        weight = costs[j]
        for s in range(num_sensors):
            if tuples[j, s] > 0:
                size += 1
                weight -= single_cost[offsets[s] + tuples[j, s] - 1]
        if size > 1 and weight < limit:
            weights[count] = weight
            origin[count] = j
            count += 1
    rows = np.empty((count, num_sensors), np.int32)
    for k in range(count):
        j = origin[k]
        for s in range(num_sensors):
            i = tuples[j, s]
            rows[k, s] = offsets[s] + i - 1 if i > 0 else -1
    return rows, weights[:count].copy(), origin[:count].copy(), single, single_cost
