"""Murty's ranking of two-dimensional assignments, compiled.

Every solution found is a node; its children split the solutions that are left of it: child i keeps the
choices of the rows before i and forbids that of row i. What makes it quick [2]_:

- a child needs one shortest augmenting path from row i, priced by its parent's multipliers,
- and before that only a bound: the cheapest way out of row i plus the cheapest way into its column,
- rows of large bounds come first, so that the children that matter are the small ones,
- a child is evaluated only when its bound comes up, and its multipliers only when it is a solution's turn,
- only solutions up to some excess over the best are looked for, with the edges whose reduced cost (by the
  first multipliers) allows it; if they are fewer than k, again with a larger excess.

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

from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.kernels.heap import pop, push
from assoc.packing.kernels.matching import match_sparse
from assoc.ranking.murty.children import ALONE, clear, make_node, may_stay_alone, open_children, search_path, set_taboo


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
    push(heap_key, heap_item, 0, cost, -1)
    counts[1] = 1
    push(best, best_item, 0, -cost, 0)
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
        pop(heap_key, heap_item, counts[1])
        node = 0
        if item >= 0:
            exact = item & 1
            place = (item >> 1) % num_rows
            parent = (item >> 1) // num_rows
            row = order[parent, place]
            alone = may_stay_alone(parent, row, edge_of, order, fixed, forbidden, row_alone)
            set_taboo(
                parent, place, columns, edge_of, order, fixed, forbidden, taboo_row, taboo_column, taboo_edge, True
            )
            if exact == 0:
                counts[3] += 1
                length, num_reached, _ = search_path(
                    parent, row, alone, worst - node_cost[parent], costs, columns, row_ptr, row_edges, row_alone,
                    column_alone, edge_of, row_of, u, v, taboo_row, taboo_column, taboo_edge, room,
                )  # fmt: skip
                clear(room, num_reached)
                if length < np.inf:
                    value = node_cost[parent] + length
                    if counts[2] < k:
                        push(best, best_item, counts[2], -value, 0)
                        counts[2] += 1
                    elif value < -best[0]:
                        pop(best, best_item, k - 1)
                        push(best, best_item, k - 1, -value, 0)
                    push(heap_key, heap_item, counts[1], value, item | 1)
                    counts[1] += 1
                elif worst < np.inf:
                    # longer than allowed, or there is none
                    limits[0] = min(limits[0], worst)
            else:
                node = counts[0]
                make_node(
                    node, parent, place, alone, costs, columns, row_ptr, row_edges, row_alone, column_alone, edge_of,
                    row_of, u, v, order, fixed, forbidden, node_cost, taboo_row, taboo_column, taboo_edge, room,
                )  # fmt: skip
            set_taboo(
                parent, place, columns, edge_of, order, fixed, forbidden, taboo_row, taboo_column, taboo_edge, False
            )
            if exact == 0:
                continue
        counts[0] += 1
        # also those of the k-th solution: what they cost bounds the rest
        worst = min(limits[1], -best[0] if counts[2] >= k else np.inf)
        counts[1] = open_children(
            node, worst, costs, rows, columns, index, row_alone, column_alone, edge_of, u, v, order, fixed,
            node_cost, taboo_row, taboo_column, heap_key, heap_item, counts[1], limits,
        )  # fmt: skip
