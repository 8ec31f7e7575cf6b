"""Murty's ranking of two-dimensional assignments, compiled.

Every solution found is a node; its children split the solutions that are left of it: child i keeps the
choices of the rows before i and forbids that of row i. What makes it quick [2]_:

- a child needs one shortest augmenting path from row i, priced by its parent's multipliers,
- and before that only a bound: the cheapest way out of row i plus the cheapest way into its column,
- rows of large bounds come first, so that the children that matter are the small ones,
- a child is evaluated only when its bound comes up, and its multipliers only when it is a solution's turn,
- only solutions up to some excess over the best are looked for, with the edges whose reduced cost (by the
  first multipliers) allows it; if they are fewer than k, again with a larger excess.

Rows and columns that may stay alone are joined to one more node, the dummy, with potential z: a row that
stays alone is matched to it, a column that stays alone is matched by it, and a path may lead through it. The
dummy takes many at once, so that by complementary slackness its edges in use have reduced costs <= 0, not 0.

References
----------
.. [1] K. G. Murty, "An algorithm for ranking all the assignments in order of increasing cost", Operations
   Research 16, 682-687 (1968).
.. [2] M. L. Miller, H. S. Stone, I. J. Cox, "Optimizing Murty's ranked assignment method", IEEE Transactions
   on Aerospace and Electronic Systems 33, 851-862 (1997).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._compiled import njit
from assoc.solvers.assignment2d import _pop, _push, match_sparse

Floats = NDArray[np.float64]

ALONE = -1


class Murty:
    """A ranking that can be stopped and continued.

    Parameters
    ----------
    rows, columns : int32 arrays, shape (E,)
        Row and column of each edge; at most one edge between two.
    costs : float array, shape (E,)
        Cost of each edge.
    row_alone, column_alone : bool arrays, shapes (R,) and (C,)
        Whether a row or column may stay alone (at no cost).
    k : int
        Solutions wanted.
    """

    def __init__(
        self,
        rows: NDArray[np.int32],
        columns: NDArray[np.int32],
        costs: Floats,
        row_alone: NDArray[np.bool_],
        column_alone: NDArray[np.bool_],
        k: int,
    ) -> None:
        self._k = k
        self._rows, self._columns, self._costs = rows, columns, costs
        self._row_alone, self._column_alone = row_alone, column_alone
        num_rows, num_columns = row_alone.size, column_alone.size
        capacity = min(k, 64)
        self._edge_of = np.empty((capacity, num_rows), np.int32)
        self._row_of = np.empty((capacity, num_columns), np.int32)
        self._u = np.empty((capacity, num_rows))
        self._v = np.empty((capacity, num_columns + 1))
        self._order = np.empty((capacity, num_rows), np.int32)
        self._fixed = np.empty(capacity, np.int32)
        self._forbidden = np.empty((capacity, 2), np.int32)
        self._cost = np.empty(capacity)
        self._heap_key = np.empty(max(64, 4 * num_rows))
        self._heap_item = np.empty(max(64, 4 * num_rows), np.int64)
        self._best = np.empty(min(k, 64))
        self._best_item = np.empty(min(k, 64), np.int64)
        # numbers of solutions, of open children, of exact costs known, of evaluations since
        self._counts = np.zeros(4, np.int64)
        # what was left out costs at least this; what costs more is left out
        self._limits = np.array([np.inf, np.inf])
        self._index = _index(rows, columns, costs, num_rows, num_columns, np.arange(rows.size))
        self.feasible = bool(
            _root(
                costs,
                columns,
                self._index,
                row_alone,
                column_alone,
                self._edge_of,
                self._row_of,
                self._u,
                self._v,
                self._order,
                self._fixed,
                self._forbidden,
                self._cost,
                self._heap_key,
                self._heap_item,
                self._best,
                self._best_item,
                self._counts,
            )
        )
        self._excess = np.inf
        if self.feasible:
            self._reduced = costs - self._u[0, rows] - self._v[0, columns]
            self._tolerance = 1e-9 * (abs(float(self._cost[0])) + float(np.abs(costs).max(initial=0.0)))
            self._place = 2 * k
            self._begin()

    @property
    def num_found(self) -> int:
        """Solutions ranked so far."""
        return int(self._counts[0])

    @property
    def done(self) -> bool:
        """Whether k solutions are ranked, or all."""
        return self.num_found >= self._k or (self._counts[1] == 0 and self._limits[1] == np.inf)

    @property
    def rest(self) -> float:
        """No solution that is not among those found costs less."""
        return min(float(self._limits[0]), float(self._heap_key[0]) if self._counts[1] else np.inf)

    @property
    def evaluations(self) -> int:
        """Shortest paths computed."""
        return int(self._counts[3])

    @property
    def duals(self) -> tuple[Floats, Floats]:
        """Multipliers of rows and columns that prove the best solution."""
        return self._u[0], self._v[0, :-1]

    def edges(self, place: int) -> NDArray[np.int32]:
        """Return the edges of a solution."""
        own = self._edge_of[place]
        return own[own >= 0]

    def run(self, evaluations: int) -> None:
        """Rank until done or so many more shortest paths are computed."""
        target = self.evaluations + evaluations
        while not self.done and self.evaluations < target:
            if self._counts[1] == 0:
                self._place *= 2
                self._begin()
            if self.num_found == self._cost.size:
                self._grow_nodes()
            if self._counts[1] + 2 * self._row_alone.size > self._heap_key.size:
                self._heap_key, self._heap_item = _twice(self._heap_key), _twice(self._heap_item)
            if self._counts[2] == self._best.size and self._best.size < self._k:
                self._best, self._best_item = _twice(self._best), _twice(self._best_item)
            self._drop_edges()
            _advance(
                self._costs,
                self._rows,
                self._columns,
                self._index,
                self._row_alone,
                self._column_alone,
                self._edge_of,
                self._row_of,
                self._u,
                self._v,
                self._order,
                self._fixed,
                self._forbidden,
                self._cost,
                self._heap_key,
                self._heap_item,
                self._best,
                self._best_item,
                self._counts,
                self._limits,
                self._k,
                min(target - self.evaluations, 1000),
            )

    def _grow_nodes(self) -> None:
        for name in ("_edge_of", "_row_of", "_u", "_v", "_order", "_fixed", "_forbidden", "_cost"):
            setattr(self, name, _twice(getattr(self, name)))

    def _begin(self) -> None:
        """Start anew from the best solution, looking only for solutions of a limited excess over it."""
        self._excess = np.inf
        if self._place < self._reduced.size:
            self._excess = float(np.partition(self._reduced, self._place)[self._place])
        beyond = float(self._cost[0]) + self._excess
        self._limits[:] = beyond
        self._counts[:3] = 0, 1, 1
        self._heap_key[0], self._heap_item[0] = self._cost[0], -1
        self._best[0] = -self._cost[0]
        self._keep_edges()

    def _drop_edges(self) -> None:
        """Leave out edges that are in none of the k best, when that is a good deal more than before."""
        if self._counts[2] == self._k and -self._best[0] - self._cost[0] < 0.5 * self._excess:
            self._excess = -float(self._best[0]) - float(self._cost[0])
            self._limits[0] = min(self._limits[0], -float(self._best[0]))
            self._keep_edges()

    def _keep_edges(self) -> None:
        keep = np.flatnonzero(self._reduced <= self._excess + self._tolerance)
        self._index = _index(
            self._rows, self._columns, self._costs, self._row_alone.size, self._column_alone.size, keep
        )


def _twice(array: NDArray[Any]) -> NDArray[Any]:
    return np.concatenate([array, np.empty_like(array)])


@njit
def _index(rows: Any, columns: Any, costs: Floats, num_rows: int, num_columns: int, keep: Any) -> Any:
    """List the edges ``keep`` by row and by column."""
    row_ptr = np.zeros(num_rows + 1, np.int64)
    column_ptr = np.zeros(num_columns + 1, np.int64)
    for e in keep:
        row_ptr[rows[e] + 1] += 1
        column_ptr[columns[e] + 1] += 1
    for r in range(num_rows):
        row_ptr[r + 1] += row_ptr[r]
    for c in range(num_columns):
        column_ptr[c + 1] += column_ptr[c]
    row_edges = np.empty(keep.size, np.int32)
    column_edges = np.empty(keep.size, np.int32)
    row_place, column_place = row_ptr[:-1].copy(), column_ptr[:-1].copy()
    for e in keep:
        row_edges[row_place[rows[e]]] = e
        row_place[rows[e]] += 1
        column_edges[column_place[columns[e]]] = e
        column_place[columns[e]] += 1
    return row_ptr, row_edges, column_ptr, column_edges


@njit
def _root(
    costs: Floats, columns: Any, index: Any, row_alone: Any, column_alone: Any, edge_of: Any, row_of: Any,
    u: Any, v: Any, order: Any, fixed: Any, forbidden: Any, node_cost: Any, heap_key: Any, heap_item: Any,
    best: Any, best_item: Any, counts: Any,
) -> bool:  # fmt: skip
    """Solve the problem and offer its solution; False if there is none."""
    num_rows, num_columns = row_alone.size, column_alone.size
    row_ptr, row_edges = index[0], index[1]
    row_slack = np.where(row_alone, 0.0, np.inf)
    column_slack = np.where(column_alone, 0.0, np.inf)
    edge_costs = np.empty(row_edges.size)
    edge_columns = np.empty(row_edges.size, np.int64)
    for x in range(row_edges.size):
        edge_costs[x] = costs[row_edges[x]]
        edge_columns[x] = columns[row_edges[x]]
    matched = np.empty(num_rows, np.int64)
    own_v = np.empty(num_columns)
    cost = match_sparse(row_ptr, edge_columns, edge_costs, row_slack, column_slack, matched, u[0], own_v)
    if cost == np.inf:
        return False
    v[0, :num_columns] = own_v
    v[0, num_columns] = 0.0
    row_of[0] = -1
    for r in range(num_rows):
        edge_of[0, r] = row_edges[matched[r]] if matched[r] >= 0 else ALONE
        if matched[r] >= 0:
            row_of[0, edge_columns[matched[r]]] = r
        order[0, r] = r
    fixed[0] = 0
    forbidden[0] = -1
    node_cost[0] = cost
    # the root is an open child of nobody
    _push(heap_key, heap_item, 0, cost, -1)
    counts[1] = 1
    _push(best, best_item, 0, -cost, 0)
    counts[2] = 1
    return True


@njit
def _advance(
    costs: Floats, rows: Any, columns: Any, index: Any, row_alone: Any, column_alone: Any, edge_of: Any, row_of: Any,
    u: Any, v: Any, order: Any, fixed: Any, forbidden: Any, node_cost: Any, heap_key: Any, heap_item: Any,
    best: Any, best_item: Any, counts: Any, limits: Any, k: int, evaluations: int,
) -> None:  # fmt: skip
    """Take open children by cost or bound; stop when arrays are full or the evaluations are used up."""
    num_rows, num_columns = row_alone.size, column_alone.size
    row_ptr, row_edges = index[0], index[1]
    taboo_row = np.zeros(num_rows, np.bool_)
    taboo_column = np.zeros(num_columns, np.bool_)
    taboo_edge = np.zeros(costs.size, np.bool_)
    # paths lead through columns, the dummy, and from there to rows that are alone
    num_items = num_columns + 1 + num_rows
    distance = np.full(num_items, np.inf)
    previous = np.empty(num_items, np.int64)
    previous_row = np.empty(num_items, np.int64)
    closed = np.zeros(num_items, np.bool_)
    reached = np.empty(num_items, np.int64)
    tree_row = np.empty(num_rows + 1, np.int64)
    tree_distance = np.empty(num_rows + 1)
    # each edge is offered once at the most, and so is each way to and from the dummy
    queue_key = np.empty(row_edges.size + 2 * num_rows + 2 * num_columns + 2)
    queue_item = np.empty(queue_key.size, np.int64)
    room = (
        distance, previous, previous_row, closed, reached, tree_row, tree_distance, queue_key, queue_item,
    )  # fmt: skip
    stop = counts[3] + evaluations
    while counts[1] > 0 and counts[0] < min(k, node_cost.size) and counts[3] < stop:
        if counts[1] + 2 * num_rows > heap_key.size or (counts[2] == best.size and best.size < k):
            return
        key, item = heap_key[0], heap_item[0]
        worst = min(limits[1], -best[0] if counts[2] >= k else np.inf)
        if key > worst:
            # nothing that is open is among the k best
            limits[0] = min(limits[0], key)
            counts[1] = 0
            return
        counts[1] -= 1
        _pop(heap_key, heap_item, counts[1])
        node = 0
        if item >= 0:
            exact = item & 1
            place = (item >> 1) % num_rows
            parent = (item >> 1) // num_rows
            row = order[parent, place]
            alone = _may_stay_alone(parent, row, edge_of, order, fixed, forbidden, row_alone)
            _set_taboo(
                parent, place, columns, edge_of, order, fixed, forbidden, taboo_row, taboo_column, taboo_edge, True
            )
            if exact == 0:
                counts[3] += 1
                length, num_reached, _ = _search_path(
                    parent, row, alone, worst - node_cost[parent], costs, columns, row_ptr, row_edges, row_alone,
                    column_alone, edge_of, row_of, u, v, taboo_row, taboo_column, taboo_edge, room,
                )  # fmt: skip
                _clear(room, num_reached)
                if length < np.inf:
                    value = node_cost[parent] + length
                    if counts[2] < k:
                        _push(best, best_item, counts[2], -value, 0)
                        counts[2] += 1
                    elif value < -best[0]:
                        _pop(best, best_item, k - 1)
                        _push(best, best_item, k - 1, -value, 0)
                    _push(heap_key, heap_item, counts[1], value, item | 1)
                    counts[1] += 1
                elif worst < np.inf:
                    # longer than allowed, or there is none
                    limits[0] = min(limits[0], worst)
            else:
                node = counts[0]
                _make_node(
                    node, parent, place, alone, costs, columns, row_ptr, row_edges, row_alone, column_alone, edge_of,
                    row_of, u, v, order, fixed, forbidden, node_cost, taboo_row, taboo_column, taboo_edge, room,
                )  # fmt: skip
            _set_taboo(
                parent, place, columns, edge_of, order, fixed, forbidden, taboo_row, taboo_column, taboo_edge, False
            )
            if exact == 0:
                continue
        counts[0] += 1
        if counts[0] < k:
            worst = min(limits[1], -best[0] if counts[2] >= k else np.inf)
            counts[1] = _open_children(
                node, worst, costs, rows, columns, index, row_alone, column_alone, edge_of, u, v, order, fixed,
                node_cost, taboo_row, taboo_column, heap_key, heap_item, counts[1], limits,
            )  # fmt: skip


@njit
def _set_taboo(
    parent: int, place: int, columns: Any, edge_of: Any, order: Any, fixed: Any, forbidden: Any, taboo_row: Any,
    taboo_column: Any, taboo_edge: Any, on: bool
) -> None:  # fmt: skip
    """Mark (or unmark) what the child at ``place`` may not touch: its fixed rows and its forbidden edges."""
    for t in range(place):
        r = order[parent, t]
        taboo_row[r] = on
        if edge_of[parent, r] >= 0:
            taboo_column[columns[edge_of[parent, r]]] = on
    own = edge_of[parent, order[parent, place]]
    if own >= 0:
        taboo_edge[own] = on
    if place == fixed[parent]:
        node = parent
        while node >= 0 and forbidden[node, 1] != -1:
            # an entry is 2 + edge, so that 1 stands for staying alone
            if forbidden[node, 1] >= 2:
                taboo_edge[forbidden[node, 1] - 2] = on
            node = forbidden[node, 0]


@njit
def _may_stay_alone(
    parent: int, row: int, edge_of: Any, order: Any, fixed: Any, forbidden: Any, row_alone: Any
) -> bool:
    """Whether the child of ``row`` may leave that row alone."""
    if not row_alone[row] or edge_of[parent, row] == ALONE:
        return False
    if fixed[parent] < order.shape[1] and order[parent, fixed[parent]] == row:
        node = parent
        while node >= 0 and forbidden[node, 1] != -1:
            if forbidden[node, 1] == 1:
                return False
            node = forbidden[node, 0]
    return True


@njit
def _relax(room: Any, size: int, num_reached: int, item: int, value: float, edge: int, row: int) -> Any:
    """Offer a way to a column (or the dummy); the sizes of the queue and of the list of what was reached."""
    distance, previous, previous_row, closed, reached, _, _, queue_key, queue_item = room
    if closed[item] or value >= distance[item]:
        return size, num_reached
    if distance[item] == np.inf:
        reached[num_reached] = item
        num_reached += 1
    distance[item] = value
    previous[item] = edge
    previous_row[item] = row
    _push(queue_key, queue_item, size, value, item)
    return size + 1, num_reached


@njit
def _search_path(
    parent: int, row: int, alone: bool, limit: float, costs: Floats, columns: Any, row_ptr: Any, row_edges: Any,
    row_alone: Any, column_alone: Any, edge_of: Any, row_of: Any, u: Any, v: Any, taboo_row: Any, taboo_column: Any,
    taboo_edge: Any, room: Any,
) -> Any:  # fmt: skip
    """Dijkstra from a row to what its parent matched it to; length (inf: above the limit), reached, tree."""
    distance, _, _, closed, _, tree_row, tree_distance, queue_key, queue_item = room
    dummy = column_alone.size
    own = edge_of[parent, row]
    target = columns[own] if own >= 0 else dummy
    z = v[parent, dummy]
    size, num_reached, num_tree = 0, 0, 0
    # a row that leaves the dummy: its edge to it may be cheaper than tight, as those of a full node may
    i, d = row, (0.0 if own >= 0 else max(0.0, u[parent, row] + z))
    while True:
        if i >= 0:
            tree_row[num_tree] = i
            tree_distance[num_tree] = d
            num_tree += 1
            for x in range(row_ptr[i], row_ptr[i + 1]):
                e = row_edges[x]
                j = columns[e]
                if taboo_column[j] or (i == row and taboo_edge[e]):
                    continue
                value = d + max(0.0, costs[e] - u[parent, i] - v[parent, j])
                if value <= limit:
                    size, num_reached = _relax(room, size, num_reached, j, value, e, i)
            if alone if i == row else (row_alone[i] and edge_of[parent, i] != ALONE):
                value = d + max(0.0, -u[parent, i] - z)
                if value <= limit:
                    size, num_reached = _relax(room, size, num_reached, dummy, value, -1, i)
        item = -1
        while size > 0:
            d = queue_key[0]
            item = queue_item[0]
            size -= 1
            _pop(queue_key, queue_item, size)
            if not closed[item] and d == distance[item]:
                break
            item = -1
        if item < 0:
            return np.inf, num_reached, num_tree
        if item == target:
            return d, num_reached, num_tree
        closed[item] = True
        i = -1
        if item > dummy:
            i = item - dummy - 1
        elif item == dummy:
            for j in range(dummy):
                if column_alone[j] and not taboo_column[j] and row_of[parent, j] != ALONE:
                    value = d + max(0.0, z - v[parent, j])
                    if value <= limit:
                        size, num_reached = _relax(room, size, num_reached, j, value, -1, -1)
            for r in range(row_alone.size):
                if edge_of[parent, r] == ALONE and not taboo_row[r] and r != row:
                    value = d + max(0.0, u[parent, r] + z)
                    if value <= limit:
                        size, num_reached = _relax(room, size, num_reached, dummy + 1 + r, value, -1, -1)
        elif row_of[parent, item] == ALONE:
            # the dummy that held this column is free now
            value = d + max(0.0, v[parent, item] - z)
            if value <= limit:
                size, num_reached = _relax(room, size, num_reached, dummy, value, item, -1)
        else:
            i = row_of[parent, item]


@njit
def _clear(room: Any, num_reached: int) -> None:
    distance, _, _, closed, reached, _, _, _, _ = room
    for t in range(num_reached):
        distance[reached[t]] = np.inf
        closed[reached[t]] = False


@njit
def _make_node(
    node: int, parent: int, place: int, alone: bool, costs: Floats, columns: Any, row_ptr: Any, row_edges: Any,
    row_alone: Any, column_alone: Any, edge_of: Any, row_of: Any, u: Any, v: Any, order: Any, fixed: Any,
    forbidden: Any, node_cost: Any, taboo_row: Any, taboo_column: Any, taboo_edge: Any, room: Any,
) -> None:  # fmt: skip
    """Turn a child into a node: its solution and the multipliers that prove it the best of its kind."""
    distance, previous, previous_row, closed, reached, tree_row, tree_distance, _, _ = room
    dummy = column_alone.size
    row = order[parent, place]
    length, num_reached, num_tree = _search_path(
        parent, row, alone, np.inf, costs, columns, row_ptr, row_edges, row_alone, column_alone, edge_of, row_of,
        u, v, taboo_row, taboo_column, taboo_edge, room,
    )  # fmt: skip
    edge_of[node] = edge_of[parent]
    row_of[node] = row_of[parent]
    u[node] = u[parent]
    v[node] = v[parent]
    order[node] = order[parent]
    fixed[node] = place
    own = edge_of[parent, row]
    forbidden[node, 0] = parent if place == fixed[parent] else -1
    forbidden[node, 1] = own + 2 if own >= 0 else 1
    node_cost[node] = node_cost[parent] + length
    for t in range(num_tree):
        u[node, tree_row[t]] += length - tree_distance[t]
    for t in range(num_reached):
        if closed[reached[t]] and reached[t] <= dummy:
            v[node, reached[t]] -= length - distance[reached[t]]
    item = columns[own] if own >= 0 else dummy
    while True:
        i = previous_row[item]
        if i >= 0:
            edge_of[node, i] = previous[item] if item != dummy else ALONE
            if item != dummy:
                row_of[node, item] = i
            if i == row:
                break
            before = edge_of[parent, i]
            item = columns[before] if before >= 0 else dummy
        elif item == dummy:
            item = previous[item]
        else:
            row_of[node, item] = ALONE
            item = dummy
    _clear(room, num_reached)


@njit
def _open_children(
    node: int, worst: float, costs: Floats, rows: Any, columns: Any, index: Any, row_alone: Any, column_alone: Any,
    edge_of: Any, u: Any, v: Any, order: Any, fixed: Any, node_cost: Any, taboo_row: Any, taboo_column: Any,
    heap_key: Any, heap_item: Any, size: int, limits: Any,
) -> int:  # fmt: skip
    """Queue the children of a node by their bounds; the size of the queue."""
    num_rows = row_alone.size
    first = fixed[node]
    for t in range(first):
        r = order[node, t]
        taboo_row[r] = True
        if edge_of[node, r] >= 0:
            taboo_column[columns[edge_of[node, r]]] = True
    if first < num_rows:
        # the row with forbidden edges stays first, so that all other children have it fixed
        start = first + 1 if first > 0 or node > 0 else first
        bounds = np.empty(num_rows - start)
        for t in range(start, num_rows):
            bounds[t - start] = -_way_round(
                node, order[node, t], costs, rows, columns, index, row_alone, column_alone, edge_of, u, v, taboo_row,
                taboo_column,
            )  # fmt: skip
        order[node, start:] = order[node, start:][np.argsort(bounds)]
    for t in range(first, num_rows):
        r = order[node, t]
        bound = node_cost[node] + _way_round(
            node, r, costs, rows, columns, index, row_alone, column_alone, edge_of, u, v, taboo_row, taboo_column
        )
        if bound <= worst:
            if bound < np.inf:
                _push(heap_key, heap_item, size, bound, (np.int64(node) * num_rows + t) << 1)
                size += 1
        else:
            limits[0] = min(limits[0], worst)
        taboo_row[r] = True
        if edge_of[node, r] >= 0:
            taboo_column[columns[edge_of[node, r]]] = True
    for r in range(num_rows):
        taboo_row[r] = False
    taboo_column[:] = False
    return size


@njit
def _way_round(
    node: int, row: int, costs: Floats, rows: Any, columns: Any, index: Any, row_alone: Any, column_alone: Any,
    edge_of: Any, u: Any, v: Any, taboo_row: Any, taboo_column: Any
) -> float:  # fmt: skip
    """Return a bound on any path from a row to what it is matched to: the first step and the last."""
    row_ptr, row_edges, column_ptr, column_edges = index
    own = edge_of[node, row]
    z = v[node, column_alone.size]
    out = np.inf
    if own >= 0 and row_alone[row]:
        out = max(0.0, -u[node, row] - z)
    for x in range(row_ptr[row], row_ptr[row + 1]):
        e = row_edges[x]
        if e != own and not taboo_column[columns[e]]:
            out = min(out, max(0.0, costs[e] - u[node, row] - v[node, columns[e]]))
    if own < 0:
        return out + max(0.0, u[node, row] + z)
    if out == np.inf:
        return out
    column = columns[own]
    into = max(0.0, z - v[node, column]) if column_alone[column] else np.inf
    for x in range(column_ptr[column], column_ptr[column + 1]):
        e = column_edges[x]
        if e != own and not taboo_row[rows[e]]:
            into = min(into, max(0.0, costs[e] - u[node, rows[e]] - v[node, column]))
    return out + into
