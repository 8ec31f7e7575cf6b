"""Shortest augmenting paths: Dijkstra from every row that is not matched, with a heap or on a matrix.

A row's slack is a private column at which any path can end.
"""

from __future__ import annotations

import numpy as np

from assoc._system.compiled import inner_njit
from assoc._types import Floats, Ints
from assoc.packing.kernels.heap import doubled, pop, push
from assoc.packing.kernels.partial_matching import Costs, State


@inner_njit
def _augment(indices: Ints, edge_row: Ints, previous: Ints, state: State, start: int, j: int) -> None:
    """Match along the path that ends in column j, back to the row where it starts."""
    row_edge, owner = state.row_edge, state.owner
    while True:
        k = previous[j]
        i = edge_row[k]
        after = row_edge[i]
        row_edge[i] = k
        owner[j] = i
        if i == start:
            break
        j = indices[after]


@inner_njit
def augment_all(problem: Costs, state: State, num_pending: int) -> bool:
    """Augment along a shortest path from each pending row; False if a row that must be matched cannot be."""
    indptr, indices, unsigned, _, row_slack, above = problem
    row_edge, u, v, owner, pending = state
    m = v.size
    distance = np.full(m, np.inf)
    closed = np.zeros(m, np.bool_)
    previous = np.empty(m, np.int64)
    reached = np.empty(m, np.int64)
    tree_row = np.empty(m + 1, np.int64)
    tree_distance = np.empty(m + 1)
    heap_key = np.empty(64)
    heap_column = np.empty(64, np.int64)
    edge_row = np.empty(indices.size, np.int64)
    for i in range(indptr.size - 1):
        for k in range(indptr[i], indptr[i + 1]):
            edge_row[k] = i
    for at in range(num_pending):
        start = pending[at]
        num_reached, num_tree = 0, 0
        size = 0
        sink_distance, sink_row, sink_column = np.inf, -1, -1
        i, d = start, 0.0
        while True:
            tree_row[num_tree] = i
            tree_distance[num_tree] = d
            num_tree += 1
            if d + row_slack[i] - u[i] < sink_distance:
                sink_distance = d + row_slack[i] - u[i]
                sink_row, sink_column = i, -1
            for k in range(indptr[i], indptr[i + 1]):
                near = unsigned[k]
                if closed[near]:
                    continue
                value = d + max(0.0, above[k] - u[i] - v[near])
                if value < distance[near] and value < sink_distance:
                    if distance[near] == np.inf and owner[near] >= 0:
                        reached[num_reached] = near
                        num_reached += 1
                    previous[near] = k
                    if owner[near] < 0:
                        # a path may end here: nothing farther away counts from now on
                        sink_distance, sink_column = value, indices[k]
                        continue
                    distance[near] = value
                    if size == heap_key.size:
                        heap_key = doubled(heap_key)
                        heap_column = doubled(heap_column)
                    push(heap_key, heap_column, size, value, indices[k])
                    size += 1
            found = False
            while size > 0:
                d = heap_key[0]
                j = heap_column[0]
                size -= 1
                pop(heap_key, heap_column, size)
                if not closed[j] and d == distance[j]:
                    found = True
                    break
            if not found or d >= sink_distance:
                break
            closed[j] = True
            i = owner[j]
        if sink_distance == np.inf:
            return False
        for t in range(num_tree):
            u[tree_row[t]] += sink_distance - tree_distance[t]
        for t in range(num_reached):
            j = reached[t]
            if closed[j]:
                v[j] -= max(0.0, sink_distance - distance[j])
                closed[j] = False
            distance[j] = np.inf
        if sink_column >= 0:
            _augment(indices, edge_row, previous, state, start, sink_column)
        elif sink_row != start:
            j = indices[row_edge[sink_row]]
            row_edge[sink_row] = -1
            _augment(indices, edge_row, previous, state, start, j)
    return True


@inner_njit
def _matrix(problem: Costs, m: int) -> Floats:
    """The costs above the columns' bases as a matrix, ``inf`` where there is no edge; a view if all are there."""
    indptr, indices, above = problem.indptr, problem.indices, problem.above
    n = indptr.size - 1
    if indptr[n] == n * m:
        complete = True
        for i in range(n):
            complete &= indptr[i] == i * m
            for j in range(m):
                complete &= indices[i * m + j] == j
        if complete:
            return above[: n * m].reshape((n, m))
    matrix = np.full((n, m), np.inf)
    for i in range(n):
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            matrix[i, j] = min(matrix[i, j], above[k])
    return matrix


@inner_njit
def augment_dense(problem: Costs, state: State, num_pending: int) -> bool:
    """The same on a matrix of the costs: with many edges the nearest column is found faster by a look at all."""
    indptr, indices, _, costs, row_slack, above = problem
    row_edge, u, v, owner, pending = state
    n, m = row_slack.size, v.size
    matrix, mate = _matrix(problem, m), np.full(n, -1, np.int64)
    for i in range(n):
        if row_edge[i] >= 0:
            mate[i] = indices[row_edge[i]]
    distance, previous = np.empty(m), np.empty(m, np.int64)
    # columns: those that are still open, then those that are closed, the last first
    order = np.arange(m).astype(np.uint64)
    tree_distance = np.empty(m)
    for at in range(num_pending):
        start = pending[at]
        num_open = m
        distance[:] = np.inf
        sink_distance, sink_row, sink_column = np.inf, -1, -1
        i, d = start, 0.0
        while True:
            if d + row_slack[i] - u[i] < sink_distance:
                sink_distance, sink_row = d + row_slack[i] - u[i], i
            least, nearest, row, shift = np.inf, -1, matrix[i], d - u[i]
            for t in range(num_open):
                far = order[t]
                value, known = shift + row[far] - v[far], distance[far]
                if value < known:
                    distance[far], previous[far], known = value, i, value
                if known < least or (known == least and owner[far] < 0):
                    least, nearest = known, t
            if least >= sink_distance:
                break
            j = np.int64(order[nearest])
            # rounding may make a reduced cost negative
            d = max(d, least)
            if owner[j] < 0:
                sink_distance, sink_column = d, int(j)
                break
            num_open -= 1
            order[nearest], order[num_open] = order[num_open], order[nearest]
            tree_distance[num_open] = d
            i = owner[j]
        if sink_distance == np.inf:
            return False
        u[start] += sink_distance
        for t in range(num_open, m):
            u[owner[order[t]]] += sink_distance - tree_distance[t]
            v[order[t]] -= sink_distance - tree_distance[t]
        if sink_column >= 0:
            j = np.int64(sink_column)
        elif sink_row == start:
            continue
        else:
            j = mate[sink_row]
            mate[sink_row] = -1
        while True:
            i = previous[j]
            owner[j], mate[i], j = i, j, mate[i]
            if i == start:
                break
    for i in range(n):
        row_edge[i] = -1
        for k in range(indptr[i], indptr[i + 1]):
            if indices[k] == mate[i] and (row_edge[i] < 0 or costs[k] < costs[row_edge[i]]):
                row_edge[i] = k
    return True
