"""Two-dimensional assignment: exact, sparse, with slack on either side, and with its duals.

Rows are matched to columns at the cost of the edge; an unmatched row or column costs its slack
(``inf``: it must be matched). Shortest augmenting paths with potentials: a cheap start by row minima, then an auction
with falling steps [2]_ where all rows and columns must be matched, else the augmenting row reduction of [1]_, then
Dijkstra with a heap from every row that is left. A row's slack is a private column at which any path can end.

The duals solve

    max  sum(u) + sum(v)   subject to   u_i + v_j <= c_ij,   u_i <= row_slack_i,   v_j <= column_slack_j

and their sum is the optimal cost.

References
----------
.. [1] R. Jonker and A. Volgenant, "A shortest augmenting path algorithm for dense and sparse linear
   assignment problems", Computing 38, 325-340 (1987).
.. [2] D. P. Bertsekas, "The auction algorithm: a distributed relaxation method for the assignment problem", Annals of
   Operations Research 14, 105-123 (1988).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats, Ints
from assoc.errors import InfeasibleError
from assoc.packing.kernels.heap import doubled, pop, push

# edges from which a dense problem is searched without a heap
_MANY = 20_000
# most steps of the row reduction for each row that is left, and where many rows of few edges make steps cheap
_STEPS, _CHEAP = 4, 256
# steps of the auction: the first as a share of the spread of a row's costs (if more, a gap between its two best), the
# next as a share of the one before, the last as a share of a gap, or of 1 for whole-numbered costs
_FIRST, _FALL, _LAST, _WHOLE = 0.05, 0.1, 0.05, 0.15
# most bids for each row with one step; rows that are left where no bids are made
_BIDS, _FEW = 40, 8
# cheapest edges of each row that dense problems are solved with at first: so many to twice as many
_CORE = 16


class Matching(NamedTuple):
    """A two-dimensional assignment and the multipliers that prove it."""

    row_edge: NDArray[np.int64]
    """The chosen edge of each row (an index into ``indices``), or -1, (n,)."""
    row_duals: Floats
    """u of the module's dual problem, (n,)."""
    column_duals: Floats
    """v of it, (m,)."""
    cost: float
    """Total cost, including that of unmatched rows and columns."""


class _Costs(NamedTuple):
    """The problem as the kernels below take it; see `match`."""

    indptr: Ints
    indices: Ints
    unsigned: Ints
    """The same: numba does not ask whether such an index is negative."""
    costs: Floats
    row_slack: Floats
    above: Floats
    """Costs less the base of the column, the cost of leaving it unmatched: high, but finite, where that must not be."""


class _State(NamedTuple):
    """A partial matching and its duals; a column's dual is ``base + v``."""

    row_edge: Ints
    u: Floats
    v: Floats
    owner: Ints
    """Row that each column is matched to, or -1."""
    pending: Ints
    """Rows that are not matched yet; their number is kept separately."""


def match(
    indptr: ArrayLike, indices: ArrayLike, costs: ArrayLike, row_slack: ArrayLike, column_slack: ArrayLike
) -> Matching:
    """Solve a sparse two-dimensional assignment; InfeasibleError if a row or column that must be matched cannot be.

    Row i has edges ``indptr[i]:indptr[i+1]``, with columns ``indices`` (E,) and costs (E,) of any sign; parallel edges
    are allowed, and ``inf`` forbids one. ``row_slack`` (n,) and ``column_slack`` (m,) are the costs of leaving one
    unmatched; ``inf`` where it must be matched.
    """
    edge_costs = np.ascontiguousarray(costs, dtype=np.float64)
    rows = np.ascontiguousarray(row_slack, dtype=np.float64)
    columns = np.ascontiguousarray(column_slack, dtype=np.float64)
    row_edge = np.empty(rows.size, np.int64)
    u, v = np.empty(rows.size), np.empty(columns.size)
    cost = match_sparse(
        np.ascontiguousarray(indptr, dtype=np.int64),
        np.ascontiguousarray(indices, dtype=np.int64),
        edge_costs,
        rows,
        columns,
        row_edge,
        u,
        v,
    )
    if cost == np.inf:
        raise InfeasibleError("not every row and column that must be matched can be")
    return Matching(row_edge, u, v, float(cost))


@njit
def match_sparse(
    indptr: Ints, indices: Ints, costs: Floats, row_slack: Floats, column_slack: Floats,
    row_edge: Ints, u: Floats, v: Floats,
) -> float:  # fmt: skip
    """Fill ``row_edge``, ``u`` and ``v``; return the total cost, ``inf`` where there is no matching."""
    n, m = row_slack.size, column_slack.size
    # a column that must be matched gets a slack so large that no matching can compensate for it
    largest = 0.0
    for k in range(indptr[n]):
        if costs[k] < np.inf:
            largest = max(largest, abs(costs[k]))
    for i in range(n):
        if row_slack[i] < np.inf:
            largest = max(largest, abs(row_slack[i]))
    for j in range(m):
        if column_slack[j] < np.inf:
            largest = max(largest, abs(column_slack[j]))
    price = 4.0 * largest * (min(n, m) + 1.0) + 1.0
    if n == m and np.all(row_slack == np.inf):
        # matching all rows matches all columns: no price, which would take digits from the duals
        price = 0.0
    base = np.empty(m)
    for j in range(m):
        base[j] = column_slack[j] if column_slack[j] < np.inf else price
        v[j] = 0.0
    owner = np.full(m, -1, np.int64)
    pending = np.empty(n, np.int64)
    above = np.empty(indptr[n])
    num_pending = 0
    for i in range(n):
        row_edge[i] = -1
        least, best = np.inf, -1
        for k in range(indptr[i], indptr[i + 1]):
            above[k] = value = costs[k] - base[indices[k]]
            if value < least:
                least, best = value, k
        if row_slack[i] <= least:
            if least == np.inf and row_slack[i] == np.inf:
                return np.inf
            u[i] = row_slack[i]
        else:
            u[i] = least
            j = indices[best]
            if owner[j] < 0:
                owner[j] = i
                row_edge[i] = best
            else:
                pending[num_pending] = i
                num_pending += 1
    problem = _Costs(indptr, indices, indices.astype(np.uint64), costs, row_slack, above)
    state = _State(row_edge, u, v, owner, pending)
    many = indices.size > _MANY
    dense = many and 4 * indices.size > n * m
    if price == 0.0 and num_pending > _FEW:
        # free columns may keep a price here, as none stays free
        if dense:
            num_pending = _solve_core(problem, state)
        if not dense or num_pending > n // 2:
            num_pending = _hold_auction(problem, state, num_pending)
    else:
        num_pending = _reduce_rows(problem, state, num_pending, _CHEAP if many and not dense else _STEPS)
    if num_pending > 0:
        if not (_augment_dense(problem, state, num_pending) if dense else _augment_all(problem, state, num_pending)):
            return np.inf
    total = 0.0
    for i in range(n):
        total += row_slack[i] if row_edge[i] < 0 else costs[row_edge[i]]
    for j in range(m):
        v[j] += base[j]
        if owner[j] < 0:
            total += column_slack[j]
    return total


@inner_njit
def _solve_core(problem: _Costs, state: _State) -> int:
    """Match the rows by their cheapest edges alone, then unmatch those that others undercut; return how many are left.

    Mostly few are: an optimal matching takes none but cheap edges.
    """
    row_edge, u, v, owner, pending = state
    places, indptr = _cheapest(problem)
    indices = np.empty(places.size, np.int64)
    above, chosen = np.empty(places.size), np.full(u.size, -1, np.int64)
    for e in range(places.size):
        indices[e], above[e] = problem.indices[places[e]], problem.above[places[e]]
    for i in range(u.size):
        pending[i] = i
    for j in range(v.size):
        owner[j] = -1
    core = _Costs(indptr, indices, indices.astype(np.uint64), above, problem.row_slack, above)
    part = _State(chosen, u, v, owner, pending)
    left = _hold_auction(core, part, u.size)
    if left > 0:
        # where the core has no matching what is found is still a beginning
        _augment_all(core, part, left)
    for i in range(u.size):
        row_edge[i] = places[chosen[i]] if chosen[i] >= 0 else -1
    return _unmatch_loose(problem, state)


@inner_njit
def _cheapest(problem: _Costs) -> tuple[Ints, Ints]:
    """About as many of the cheapest edges of each row as a core has, and where each row's begin."""
    indptr, above = problem.indptr, problem.above
    num = indptr.size - 1
    places, begin = np.empty(2 * num * _CORE, np.int64), np.zeros(num + 1, np.int64)
    for i in range(num):
        row = above[indptr[i] : indptr[i + 1]]
        limit = _limit_of_cheap(row)
        end = begin[i]
        for t in range(row.size):
            if row[t] <= limit and end < begin[i] + 2 * _CORE:
                places[end] = indptr[i] + t
                end += 1
        begin[i + 1] = end
    return places[: begin[num]].copy(), begin


@inner_njit
def _limit_of_cheap(row: Floats) -> float:
    """A cost that between one and two times as many as a core has are below or at, if halving finds one."""
    low, high = np.inf, -np.inf
    for t in range(row.size):
        low = min(low, row[t])
        if row[t] < np.inf:
            high = max(high, row[t])
    if row.size > 2 * _CORE:
        for _ in range(24):
            middle = 0.5 * (low + high)
            count = 0
            for t in range(row.size):
                count += row[t] <= middle
            if count < _CORE:
                low = middle
            else:
                high = middle
                if count <= 2 * _CORE:
                    break
    return high


@inner_njit
def _hold_auction(problem: _Costs, state: _State, num_pending: int) -> int:
    """Bring duals near optimal ones by auctions with smaller and smaller steps; return how many rows are pending.

    Unlike the row reduction it does not stall where prices rise by little, or not at all (ties). It leaves each
    matched row at its least reduced cost, as augmenting paths need it.
    """
    gap, spread, whole = _typical_gap(problem)
    step = max(gap, _FIRST * spread)
    while True:
        bids = _bid(problem, state, num_pending, (step, gap), _BIDS * state.u.size)
        last = bids <= 0 or step <= _LAST * gap or (whole and step < _WHOLE)
        if whole and last:
            # optimal duals are whole numbers, too
            for j in range(state.v.size):
                state.v[j] = math.floor(state.v[j] + 0.5)
        num_pending = _unmatch_loose(problem, state)
        if last:
            return num_pending
        step *= _FALL


@inner_njit
def _typical_gap(problem: _Costs) -> tuple[float, float, bool]:
    """Geometric means of the rows' gaps between least and second least cost, and largest; whether all are whole."""
    indptr, above = problem.indptr, problem.above
    total, wide, count, whole = 0.0, 0.0, 0, True
    for i in range(indptr.size - 1):
        least = second = np.inf
        largest = -np.inf
        for k in range(indptr[i], indptr[i + 1]):
            value = above[k]
            if value < np.inf:
                largest = max(largest, value)
            whole = whole and (value == math.floor(value) or value == np.inf)
            if value < least:
                least, second = value, least
            elif least < value < second:
                second = value
        if second < np.inf:
            total += math.log(second - least)
            wide += math.log(largest - least)
            count += 1
    if count == 0:
        return 1.0, 1.0, whole
    # few large costs, as of forbidden edges, do not move these means
    return math.exp(total / count), math.exp(wide / count), whole


@inner_njit
def _bid(problem: _Costs, state: _State, num_pending: int, sizes: tuple[float, float], bids: int) -> int:
    """Match all pending rows, each at a price that is above the second best offer by a step; return the bids left."""
    indptr, indices, unsigned, _, _, above = problem
    row_edge, _, v, owner, pending = state
    step, gap = sizes
    while num_pending > 0 and bids > 0:
        num_pending -= 1
        i = pending[num_pending]
        while i >= 0 and bids > 0:
            bids -= 1
            least, second, best = np.inf, np.inf, -1
            for k in range(indptr[i], indptr[i + 1]):
                value = above[k] - v[unsigned[k]]
                if value < least:
                    least, second, best = value, least, k
                elif value < second:
                    second = value
            if best < 0:
                break
            j = indices[best]
            # a row of one edge bids a usual gap
            v[j] -= (second - least if second < np.inf else gap) + step
            other = owner[j]
            owner[j] = i
            row_edge[i] = best
            if other >= 0:
                row_edge[other] = -1
            i = other
    return bids


@inner_njit
def _unmatch_loose(problem: _Costs, state: _State) -> int:
    """Set the rows' duals for the columns' and unmatch rows above theirs; return how many rows are not matched."""
    indptr, indices, unsigned, _, _, above = problem
    row_edge, u, v, owner, pending = state
    for i in range(u.size):
        least = np.inf
        for k in range(indptr[i], indptr[i + 1]):
            least = min(least, above[k] - v[unsigned[k]])
        u[i] = least
        e = row_edge[i]
        if e >= 0 and above[e] - v[unsigned[e]] > least:
            owner[indices[e]], row_edge[i] = -1, -1
    count = 0
    for i in range(u.size):
        if row_edge[i] >= 0:
            continue
        for k in range(indptr[i], indptr[i + 1]):
            if owner[unsigned[k]] < 0 and above[k] - v[unsigned[k]] <= u[i]:
                row_edge[i], owner[unsigned[k]] = k, i
                break
        if row_edge[i] < 0:
            pending[count] = i
            count += 1
    return count


@inner_njit
def _reduce_rows(problem: _Costs, state: _State, num_pending: int, most: int) -> int:
    """Augmenting row reduction, with ``most`` steps a row: each row takes its best column at the second best's price.

    Returns how many rows are still pending.
    """
    indptr, indices, unsigned, _, row_slack, above = problem
    row_edge, u, v, owner, pending = state
    steps = most * num_pending + 8
    left = 0
    at = 0
    while at < num_pending:
        i = pending[at]
        at += 1
        while i >= 0:
            least, second, best = np.inf, row_slack[i], -1
            for k in range(indptr[i], indptr[i + 1]):
                value = above[k] - v[unsigned[k]]
                if value < least:
                    # a parallel edge to the same column is not a second choice; it would only make the step smaller
                    second = min(second, least)
                    least, best = value, k
                elif value < second:
                    second = value
            if best < 0 or row_slack[i] <= least:
                u[i] = row_slack[i]
                break
            j = indices[best]
            if owner[j] < 0:
                u[i] = least
                owner[j] = i
                row_edge[i] = best
                break
            steps -= 1
            if steps <= 0 or second == np.inf or second <= least:
                # a tie or a row without a second choice: left to the augmenting paths
                u[i] = least
                pending[left] = i
                left += 1
                break
            u[i] = second
            v[j] -= second - least
            other = owner[j]
            owner[j] = i
            row_edge[i] = best
            row_edge[other] = -1
            i = other
    return left


@inner_njit
def _augment(indices: Ints, edge_row: Ints, previous: Ints, state: _State, start: int, j: int) -> None:
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
def _augment_all(problem: _Costs, state: _State, num_pending: int) -> bool:
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
def _augment_dense(problem: _Costs, state: _State, num_pending: int) -> bool:
    """The same on a matrix of the costs: with many edges the nearest column is found faster by a look at all."""
    indptr, indices, _, costs, row_slack, above = problem
    row_edge, u, v, owner, pending = state
    n, m = row_slack.size, v.size
    matrix, mate = np.full((n, m), np.inf), np.full(n, -1, np.int64)
    for i in range(n):
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            matrix[i, j] = min(matrix[i, j], above[k])
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
            j = sink_column
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
