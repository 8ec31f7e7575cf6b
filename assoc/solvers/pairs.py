"""Two lists without dummies: the exact solver's answer by one matching of the problem as it is, without a packing."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._parameters import values_of
from assoc._types import Floats, Ints
from assoc.packing.bounds.priced import TOLERANCE
from assoc.packing.kernels.matching import match_rows
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.solution import Solution


def proved_pairs(problem: AssignmentProblem, run: Run, parameters: Any) -> Solution | None:
    """Match all of the shorter list; None for other problems, or where rounding or a missing pair leaves no proof."""
    if problem.dummy or problem.num_sensors != 2 or not problem.num_tuples:
        return None
    upright = bool(problem.sizes[0] > problem.sizes[1])
    graph = _graph_of_matrix(problem._matrix, upright) if problem._matrix is not None else _graph(problem, upright)
    found = match_rows(graph.indptr, graph.indices, graph.costs, int(problem.sizes.max()))
    if found is None:
        return None
    cost = math.fsum(graph.costs[found.row_edge].tolist())
    if cost - found.bound > TOLERANCE * max(1.0, abs(found.bound)):
        return None
    run.record(1, cost, min(found.bound, cost))
    first: NDArray[Any] = np.arange(found.row_edge.size)
    second, indices = graph.indices[found.row_edge], graph.place(found.row_edge)
    duals = found.row_duals, found.column_duals
    if upright:
        order = np.argsort(second)
        first, second, indices, duals = second[order], order, indices[order], duals[::-1]
    return Solution(
        tuples=np.stack([first + 1, second + 1], axis=1).astype(np.int32),
        indices=indices,
        cost=cost,
        lower_bound=min(found.bound, cost),
        solver="exact",
        iterations=1,
        runtime=run.runtime(),
        stopped_by=run.stopped_by or "converged",
        duals=duals,
        trace=tuple(run.trace),
        parameters=values_of(parameters),
        compile_time=run.compile_time(),
    )


class _Graph(NamedTuple):
    """Pairs of two lists: row i, of the shorter list, has edges ``indptr[i]:indptr[i + 1]``."""

    indptr: Ints
    indices: Ints
    costs: Floats
    place: Callable[[NDArray[Any]], NDArray[Any]]
    """Which tuples of the problem edges are."""


def _graph(problem: AssignmentProblem, upright: bool) -> _Graph:
    """The tuples of a problem; ``upright``: the second list is the shorter one."""
    columns = np.ascontiguousarray(problem.tuples.T)
    rows, others = columns[int(upright)], columns[int(not upright)]
    # copied: numba would compile kernels again for read-only arrays
    indices, costs = others.astype(np.int64) - 1, problem.costs.copy()
    order: NDArray[Any] | None = None
    if (rows[1:] < rows[:-1]).any():
        order = np.argsort(rows, kind="stable")
        rows, indices, costs = rows[order], indices[order], costs[order]
    indptr = np.searchsorted(rows, np.arange(1, problem.sizes.min() + 2))
    return _Graph(indptr, indices, costs, lambda edges: edges if order is None else order[edges])


def _graph_of_matrix(matrix: Floats, upright: bool) -> _Graph:
    """All pairs of a matrix."""
    costs = np.ascontiguousarray(matrix.T) if upright else matrix
    n, m = costs.shape
    indptr, indices = np.arange(0, n * m + 1, m), np.tile(np.arange(m), n)
    return _Graph(indptr, indices, costs.reshape(-1), lambda edges: edges % m * n + edges // m if upright else edges)
