"""Murty's ranking of two-dimensional assignments, compiled.

Every solution found is a node; its children partition the remaining solutions: child i keeps the
choices of the rows before i and forbids that of row i. What makes it quick [2]_:

- a child needs one shortest augmenting path from row i, priced by its parent's multipliers,
- and before that only a bound: the cheapest way out of row i plus the cheapest way into its column,
- rows of large bounds come first, so that the children that matter are the small ones,
- a child is evaluated only when its bound is the least, and gets multipliers only when it becomes a solution,
- only solutions up to some excess over the best are searched for, with the edges whose reduced cost (by the
  first multipliers) allows it; if they are fewer than k, again with a larger excess.

References
----------
.. [1] K. G. Murty, "An algorithm for ranking all the assignments in order of increasing cost", Operations
   Research 16, 682-687 (1968).
.. [2] M. L. Miller, H. S. Stone, I. J. Cox, "Optimizing Murty's ranked assignment method", IEEE Transactions
   on Aerospace and Electronic Systems 33, 851-862 (1997).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Floats
from assoc.packing.kernels.heap import pop, push
from assoc.packing.kernels.matching import match_sparse
from assoc.ranking.murty.arrays import (
    ALONE,
    Graph,
    Nodes,
    Queues,
    index_edges,
    new_forbidden,
    new_nodes,
    new_path_work,
    new_queues,
    twice,
    with_edges,
)
from assoc.ranking.murty.children import clear, make_node, may_stay_alone, open_children, search_path, set_forbidden


class Murty:
    """A ranking of k solutions that can be stopped and continued.

    Rows, columns and costs are those of each edge, (E,), at most one between two; ``row_alone`` (R,) and
    ``column_alone`` (C,) say which may stay unmatched (at no cost).
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
        num_rows, num_columns = row_alone.size, column_alone.size
        index = index_edges(rows, columns, num_rows, num_columns, np.arange(rows.size))
        self._graph = Graph(costs, rows, columns, row_alone, column_alone, *index)
        self._nodes = new_nodes(min(k, 64), num_rows, num_columns)
        self._queues = new_queues(k, num_rows)
        self.feasible = bool(_root(self._graph, self._nodes, self._queues))
        self._excess = np.inf
        if self.feasible:
            self._least = float(self._nodes.cost[0])
            self._reduced = costs - self._nodes.u[0, rows] - self._nodes.v[0, columns]
            self._tolerance = 1e-9 * (abs(self._least) + float(np.abs(costs).max(initial=0.0)))
            self._num_deviations = 2 * k
            self._begin()

    @property
    def num_found(self) -> int:
        """Solutions ranked so far."""
        return int(self._queues.counts[0])

    @property
    def done(self) -> bool:
        """Whether k solutions are ranked, or all."""
        return self.num_found >= self._k or (self._queues.counts[1] == 0 and self._queues.limits[1] == np.inf)

    @property
    def rest(self) -> float:
        """Lower bound on the cost of all solutions not found yet."""
        queues = self._queues
        return min(float(queues.limits[0]), float(queues.key[0]) if queues.counts[1] else np.inf)

    @property
    def evaluations(self) -> int:
        """Shortest paths computed."""
        return int(self._queues.counts[3])

    @property
    def duals(self) -> tuple[Floats, Floats]:
        """Multipliers of rows and columns that prove the best solution."""
        return self._nodes.u[0], self._nodes.v[0, :-1]

    def edges(self, rank: int) -> NDArray[np.int32]:
        """Return the edges of a solution, the best of which has rank 0."""
        matched = self._nodes.edge_of[rank]
        return matched[matched >= 0]

    def run(self, evaluations: int) -> None:
        """Rank until done, or until ``evaluations`` more shortest paths are computed."""
        target = self.evaluations + evaluations
        while not self.done and self.evaluations < target:
            if self._queues.counts[1] == 0:
                self._num_deviations *= 2
                self._begin()
            self._grow()
            self._drop_edges()
            _advance(self._graph, self._nodes, self._queues, self._k, min(target - self.evaluations, 1000))

    def _grow(self) -> None:
        """Double the arrays that are full."""
        queues = self._queues
        if self.num_found == self._nodes.cost.size:
            self._nodes = Nodes(*(twice(array) for array in self._nodes))
        if queues.counts[1] + 2 * self._graph.row_alone.size > queues.key.size:
            queues = queues._replace(key=twice(queues.key), item=twice(queues.item))
        if queues.counts[2] == queues.best.size < self._k:
            queues = queues._replace(best=twice(queues.best), best_item=twice(queues.best_item))
        self._queues = queues

    def _begin(self) -> None:
        """Restart from the best solution, searching only for solutions of a limited excess over it."""
        self._excess = np.inf
        if self._num_deviations < self._reduced.size:
            self._excess = float(np.partition(self._reduced, self._num_deviations)[self._num_deviations])
        queues = self._queues
        queues.limits[:] = self._least + self._excess
        queues.counts[:3] = 0, 1, 1
        queues.key[0], queues.item[0] = self._least, -1
        queues.best[0] = -self._least
        self._keep_edges()

    def _drop_edges(self) -> None:
        """Drop edges that none of the k best can use, if they are many more than those dropped already."""
        worst = -float(self._queues.best[0])
        if self._queues.counts[2] == self._k and worst - self._least < 0.5 * self._excess:
            self._excess = worst - self._least
            self._queues.limits[0] = min(self._queues.limits[0], worst)
            self._keep_edges()

    def _keep_edges(self) -> None:
        keep = np.flatnonzero(self._reduced <= self._excess + self._tolerance)
        self._graph = with_edges(self._graph, keep)


@njit
def _root(graph: Graph, nodes: Nodes, queues: Queues) -> bool:
    """Solve the problem and offer its solution; False if there is none."""
    costs, columns, row_ptr, row_edges = graph.costs, graph.columns, graph.row_ptr, graph.row_edges
    row_alone, column_alone, edge_of, row_of = graph.row_alone, graph.column_alone, nodes.edge_of, nodes.row_of
    num_rows, num_columns = row_alone.size, column_alone.size
    row_slack, column_slack = np.full(num_rows, np.inf), np.full(num_columns, np.inf)
    for r in range(num_rows):
        if row_alone[r]:
            row_slack[r] = 0.0
    for c in range(num_columns):
        if column_alone[c]:
            column_slack[c] = 0.0
    edge_costs = np.empty(row_edges.size)
    edge_columns = np.empty(row_edges.size, np.int64)
    for x in range(row_edges.size):
        edge_costs[x] = costs[row_edges[x]]
        edge_columns[x] = columns[row_edges[x]]
    matched = np.empty(num_rows, np.int64)
    own_v = np.empty(num_columns)
    cost = match_sparse(row_ptr, edge_columns, edge_costs, row_slack, column_slack, matched, nodes.u[0], own_v)
    if cost == np.inf:
        return False
    copy_to(nodes.v[0, :num_columns], own_v)
    nodes.v[0, num_columns] = 0.0
    row_of[0] = -1
    for r in range(num_rows):
        edge_of[0, r] = row_edges[matched[r]] if matched[r] >= 0 else ALONE
        if matched[r] >= 0:
            row_of[0, edge_columns[matched[r]]] = r
        nodes.order[0, r] = r
    nodes.fixed[0] = 0
    nodes.forbidden[0] = -1
    nodes.cost[0] = cost
    # the root is an open child without a parent
    push(queues.key, queues.item, 0, cost, -1)
    queues.counts[1] = 1
    push(queues.best, queues.best_item, 0, -cost, 0)
    queues.counts[2] = 1
    return True


@njit
def _advance(graph: Graph, nodes: Nodes, queues: Queues, k: int, evaluations: int) -> None:
    """Take open children by cost or bound; stop when arrays are full or the evaluations are used up."""
    num_rows = graph.row_alone.size
    node_cost = nodes.cost
    heap_key, heap_item, best, best_item, counts, limits = queues
    forbidden = new_forbidden(graph)
    work = new_path_work(graph)
    stop = counts[3] + evaluations
    while counts[1] > 0 and counts[0] < min(k, node_cost.size) and counts[3] < stop:
        if counts[1] + 2 * num_rows > heap_key.size or (counts[2] == best.size and best.size < k):
            return
        key, item = heap_key[0], heap_item[0]
        worst = min(limits[1], -best[0] if counts[2] >= k else np.inf)
        if key > worst:
            # no open child is among the k best
            limits[0] = min(limits[0], key)
            counts[1] = 0
            return
        counts[1] -= 1
        pop(heap_key, heap_item, counts[1])
        node = 0
        if item >= 0:
            exact = item & 1
            child = (item >> 1) % num_rows
            parent = (item >> 1) // num_rows
            row = nodes.order[parent, child]
            alone = may_stay_alone(graph, nodes, parent, row)
            set_forbidden(graph, nodes, forbidden, parent, child, True)
            if exact == 0:
                counts[3] += 1
                length, num_reached, _ = search_path(
                    graph, nodes, forbidden, work, parent, row, alone, worst - node_cost[parent]
                )
                clear(work, num_reached)
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
                    # the path is longer than allowed, or there is none
                    limits[0] = min(limits[0], worst)
            else:
                node = counts[0]
                make_node(graph, nodes, forbidden, work, node, parent, child, alone)
            set_forbidden(graph, nodes, forbidden, parent, child, False)
            if exact == 0:
                continue
        counts[0] += 1
        # also those of the k-th solution: their costs bound the rest
        worst = min(limits[1], -best[0] if counts[2] >= k else np.inf)
        open_children(graph, nodes, forbidden, queues, node, worst)
