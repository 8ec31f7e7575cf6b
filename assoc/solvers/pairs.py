"""Two lists: the exact solver's answer by one matching of the problem as it is, without a packing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._parameters import values_of
from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.bounds.priced import TOLERANCE
from assoc.packing.kernels.matching import Matching, match
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.solution import Solution


def proved_pairs(problem: AssignmentProblem, run: Run, parameters: Any) -> Solution | None:
    """Match two lists; None for other problems, or where rounding or a missing pair leaves no proof."""
    if problem.num_sensors != 2 or not problem.sizes.all() or not problem.num_tuples:
        return None
    matrix = problem._matrix
    answer = _of_tuples(problem) if matrix is None else _of_matrix(matrix)
    if answer is None:
        return None
    indices, duals, bound = answer
    if matrix is None:
        tuples, costs = problem.tuples[indices], problem.costs[indices]
    else:
        tuples, costs = np.empty((indices.size, 2), np.int32), matrix.reshape(-1)[indices]
        np.divmod(indices, matrix.shape[1], out=(tuples[:, 0], tuples[:, 1]), casting="same_kind")
        tuples += 1
    cost = math.fsum(costs.tolist())
    if cost - bound > TOLERANCE * max(1.0, abs(bound)):
        return None
    bound = min(bound, cost)
    run.record(1, cost, bound)
    return Solution(
        tuples=tuples,
        indices=indices,
        cost=cost,
        lower_bound=bound,
        solver="exact",
        iterations=1,
        runtime=run.runtime(),
        stopped_by=run.stopped_by or "converged",
        duals=duals,
        trace=tuple(run.trace),
        parameters=values_of(parameters),
        compile_time=run.compile_time(),
    )


_Answer = tuple[NDArray[Any], tuple[Floats, Floats], float]
"""The chosen tuples among the problem's, in the lexicographic order of these, (K,); multipliers of the measurements of
both lists, (n_1,) and (n_2,); and what no solution costs less than."""


def _of_matrix(matrix: Floats) -> _Answer | None:
    """Match all of the shorter list of a matrix of costs, (n_1, n_2)."""
    upright = matrix.shape[0] > matrix.shape[1]
    costs = np.ascontiguousarray(matrix.T) if upright else matrix
    n, m = costs.shape
    indptr, columns = np.arange(0, n * m + 1, m, dtype=np.int64), np.empty((n, m), np.int64)
    columns[:] = np.arange(m)
    found = match(indptr, columns.reshape(-1), costs.reshape(-1), *_slacks(n, m))
    if found is None:
        return None
    edges = found.row_edge
    return np.sort(edges % m * n + edges // m) if upright else edges, _duals(found, upright), found.bound


def _of_tuples(problem: AssignmentProblem) -> _Answer | None:
    """Match listed pairs: with dummies what is not matched costs its singleton, without all of the shorter list is."""
    upright = bool(not problem.dummy and problem.sizes[0] > problem.sizes[1])
    n, m = problem.sizes[::-1].tolist() if upright else problem.sizes.tolist()
    indptr, indices, costs, place, single = _edges(problem.tuples, problem.costs, n, m, int(upright))
    alone = problem.costs[single]
    row_slack, column_slack = (alone[:n].copy(), alone[n:].copy()) if problem.dummy else _slacks(n, m)
    found = match(indptr, indices, costs, row_slack, column_slack)
    if found is None:
        return None
    matched = np.flatnonzero(found.row_edge >= 0)
    edges, chosen = found.row_edge[matched], single[:n].copy()
    chosen[matched] = place[edges]
    if problem.dummy:
        free = np.ones(m, dtype=np.bool_)
        free[indices[edges]] = False
        # tuples that the first sensor missed come first
        chosen = np.concatenate([single[n:][free], chosen])
    elif upright:
        chosen = chosen[np.argsort(problem.tuples[chosen, 0])]
    return chosen, _duals(found, upright), found.bound


def _slacks(n: int, m: int) -> tuple[Floats, Floats]:
    """Costs of leaving rows and columns unmatched where all of the shorter list must be matched, n <= m."""
    return np.full(n, np.inf), np.full(m, np.inf if n == m else 0.0)


def _duals(found: Matching, upright: bool) -> tuple[Floats, Floats]:
    u, v = found.row_duals, found.column_duals
    return (v, u) if upright else (u, v)


@njit
def _edges(tuples: NDArray[np.int32], costs: Floats, n: int, m: int, side: int) -> Any:
    """Pairs as edges of `match`, their places among the tuples, and the cheapest singletons (n + m,), -1: none.

    Rows are the list `side`, of n measurements, columns the other one, of m.
    """
    indptr, single = np.zeros(n + 1, np.int64), np.full(n + m, -1)
    for k in range(costs.size):
        i, j = tuples[k, side], tuples[k, 1 - side]
        if i > 0 and j > 0:
            indptr[i] += 1
            continue
        r = i - 1 if i > 0 else n + j - 1
        if single[r] < 0 or costs[k] < costs[single[r]]:
            single[r] = k
    for i in range(n):
        indptr[i + 1] += indptr[i]
    indices, place = np.empty(indptr[n], np.int64), np.empty(indptr[n], np.int64)
    prices, end = np.empty(indptr[n]), indptr.copy()
    for k in range(costs.size):
        i, j = tuples[k, side], tuples[k, 1 - side]
        if i > 0 and j > 0:
            e = end[i - 1]
            end[i - 1] += 1
            indices[e], prices[e], place[e] = j - 1, costs[k], k
    return indptr, indices, prices, place, single
