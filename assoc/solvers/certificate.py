"""From a solver's choice of columns to a certified solution."""

from __future__ import annotations

import math
import sys
from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._parameters import values_of
from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats
from assoc.errors import InfeasibleError
from assoc.packing.bounds.dual_ascent import certified_bound, dual_bound, hard_pass
from assoc.packing.kernels.columns import first_row
from assoc.packing.prepare import Prepared, PreparedArrays
from assoc.packing.run import Outcome, Run
from assoc.problem import AssignmentProblem
from assoc.solution import Solution


def certify(
    problem: AssignmentProblem, prepared: Prepared, outcome: Outcome, run: Run, solver: str, parameters: Any
) -> Solution:
    """Turn a choice of columns into a solution of the problem with a valid bound.

    InfeasibleError if the choice uses a measurement twice, or leaves one out that must be used.
    """
    packing = prepared.packing
    columns = np.asarray(outcome.columns, dtype=np.int64)
    exact, indices, tuples, costs, magnitude = as_tuples(
        problem.tuples, problem.costs, problem.sizes, prepared.arrays, columns
    )
    if not exact:
        raise InfeasibleError("the solver's answer does not use every measurement exactly once")
    bound, duals = outcome.lower_bound, outcome.duals
    if bound == -np.inf and duals is not None:
        hard_pass(packing, duals)
        bound = certified_bound(packing, duals)
    # also where a bound is not a finite number
    if not bound > -np.inf:
        duals = dual_bound(packing, run=run)
        bound = certified_bound(packing, duals)
    # packing weights are differences of costs: subtract their rounding, half an epsilon for each sensor
    share = max(4.0, 0.5 * (problem.num_sensors + 3)) * sys.float_info.epsilon
    rounding = share * (magnitude + float(np.abs(prepared.single_cost).sum()))
    cost = math.fsum(costs)
    return Solution(
        tuples=tuples,
        indices=indices,
        cost=cost,
        lower_bound=min(bound + prepared.offset - rounding, cost),
        solver=solver,
        iterations=outcome.iterations,
        runtime=run.runtime(),
        stopped_by=run.stopped_by or "converged",
        duals=_duals_by_sensor(problem, prepared, duals) if duals is not None else (),
        trace=tuple(run.trace),
        parameters=values_of(parameters),
        compile_time=run.compile_time(),
        gains={move: gain * run.unit for move, gain in run.gains.items()},
    )


def costs_of(problem: AssignmentProblem, prepared: Prepared, columns: NDArray[np.integer]) -> Floats | None:
    """Costs of the tuples of a choice of columns; None for a choice that `certify` refuses."""
    chosen = np.asarray(columns, dtype=np.int64)
    exact, _, _, costs, _ = as_tuples(problem.tuples, problem.costs, problem.sizes, prepared.arrays, chosen)
    return costs if exact else None


@njit
def as_tuples(
    tuples: NDArray[np.int32],
    costs: Floats,
    sizes: NDArray[np.int32],
    prepared: PreparedArrays,
    columns: NDArray[np.int64],
) -> Any:
    """Return chosen columns as rows of ``problem.tuples`` in lexicographic order, completed by singletons.

    Returns whether each measurement is used exactly once (without dummies: each that must be), the indices, their
    tuples and costs, and the sum of the chosen weights' magnitudes. Among tuples that are listed twice it takes the
    cheaper one.
    """
    cols, weights, slack, origin, row_origin, single, _, _ = prepared
    num_sensors = sizes.size
    start = np.zeros(num_sensors + 1, np.int64)
    for s in range(num_sensors):
        start[s + 1] = start[s] + sizes[s]
    # no two tuples share a measurement: the first measurement of a tuple identifies it
    found = np.full(start[num_sensors], -1, np.int64)
    covered = np.zeros(slack.size, np.bool_)
    exact = True
    count = columns.size
    magnitude = 0.0
    for k in range(columns.size):
        j = columns[k]
        if j < 0 or j >= weights.size:
            exact = False
            continue
        j = _cheapest_copy(costs, prepared, j)
        magnitude += abs(weights[j])
        for s in range(num_sensors):
            r = cols[j, s]
            if r >= 0:
                exact = exact and not covered[r]
                covered[r] = True
        for s in range(num_sensors):
            i = tuples[origin[j], s]
            if i > 0:
                found[start[s] + i - 1] = origin[j]
                break
    if single.size > 0:
        taken = np.zeros(single.size, np.bool_)
        for r in range(slack.size):
            taken[row_origin[r]] = covered[r]
        for r in range(single.size):
            if not taken[r]:
                found[r] = single[r]
                count += 1
    for r in range(slack.size):
        exact = exact and (slack[r] or covered[r])
    indices = np.empty(count, np.int64)
    chosen = np.empty((count, num_sensors), tuples.dtype)
    prices = np.empty(count)
    count = 0
    # tuples that the first sensors missed come first
    for s in range(num_sensors - 1, -1, -1):
        for r in range(start[s], start[s + 1]):
            if found[r] >= 0 and exact:
                indices[count] = found[r]
                # element by element: assigning a row would compile code for errors of differing shapes
                for k in range(num_sensors):
                    chosen[count, k] = tuples[found[r], k]
                prices[count] = costs[found[r]]
                count += 1
    return exact, indices, chosen, prices, magnitude


@inner_njit
def _cheapest_copy(costs: Floats, prepared: PreparedArrays, j: int) -> int:
    """The cheapest column with the same rows as column j."""
    cols, origin, row_ptr, row_cols = prepared.cols, prepared.origin, prepared.row_ptr, prepared.row_cols
    # its first row: in the usual order of tuples the columns of this one are side by side
    r = first_row(cols, j)
    best = j
    for at in range(row_ptr[r], row_ptr[r + 1]):
        k = row_cols[at]
        # rounding keeps the order of weights, so few columns need the full comparison
        if prepared.weights[k] <= prepared.weights[best] and costs[origin[k]] < costs[origin[best]]:
            same = True
            for s in range(cols.shape[1]):
                same = same and cols[k, s] == cols[j, s]
            if same:
                best = k
    return best


def _duals_by_sensor(
    problem: AssignmentProblem, prepared: Prepared, duals: NDArray[np.float64]
) -> tuple[NDArray[np.float64], ...]:
    """Multipliers of the problem's measurements: those of the packing plus the singletons' costs."""
    ends = list(accumulate(problem.sizes.tolist(), initial=0))
    total = prepared.single_cost.copy() if problem.dummy else np.zeros(ends[-1])
    total[prepared.packing.row_origin] += duals
    return tuple(total[first:last] for first, last in pairwise(ends))
