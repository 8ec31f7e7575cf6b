"""The k lightest solutions of one component or of many: enumeration where it is quick, else branching first.

Enumeration (enumeration.py) is quick where the multipliers' bound is near the optimum. Where it is not, the
component is branched as in packing/branching (are two measurements of the same source or not?), the
multipliers are improved at every node, and what is left of a node is enumerated as soon as a small budget
suffices. The two answers exclude each other, so that every solution is in exactly one leaf.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import njit, search_njit
from assoc._types import Floats
from assoc.packing.branching.doubtful_pairs import doubtful_pairs, new_doubts
from assoc.packing.branching.nodes import (
    CLOSED,
    LEVELS,
    OVER,
    NodeArrays,
    OpenNodes,
    has_room,
    index_by_row,
    new_node,
    next_temperature,
    push_children,
    raise_bound,
    soften,
    take_node,
)
from assoc.packing.packing import Packing, PackingArrays
from assoc.packing.run import memory_allows
from assoc.ranking.enumeration import (
    NOT_COMPLETE,
    PricedColumns,
    Store,
    Wanted,
    cut_of,
    enumerate_solutions,
    new_store,
)

FIRST_BUDGET = 3000
NODE_BUDGET = 500


class ComponentRanking:
    """Branch and bound for the k lightest solutions of one component; can be stopped and continued.

    Parameters
    ----------
    packing : Packing
        One component, its columns distinct.
    duals : float array, shape (R,)
        Feasible multipliers to start from.
    k : int
        Solutions wanted.
    limit : float
        Only solutions that weigh less are looked for.
    tolerance : float
        Differences of weight that are ties.
    budget : int
        Decisions of enumeration at a node, beyond one for each row, before it is branched.
    deadline : float
        When time is over, by the kernels' clock (clock.py): the node at work stays open.
    memory_allows : callable, optional
        Whether the search may take so many bytes more (`Run.memory_allows`).
    """

    def __init__(
        self,
        packing: Packing,
        duals: Floats,
        k: int,
        limit: float,
        tolerance: float,
        *,
        budget: int = NODE_BUDGET,
        deadline: float = np.inf,
        memory_allows: Callable[[float], bool] = memory_allows,
    ) -> None:
        self._packing = packing
        self._deadline = deadline
        self._memory_allows = memory_allows
        self._wanted = Wanted(k, limit, tolerance, budget + packing.num_rows, deadline)
        self._store = new_store(packing.num_rows)
        self._open = OpenNodes(packing, duals)
        self.nodes = 0

    @property
    def done(self) -> bool:
        """Whether nothing is left to search."""
        return self._open.count == 0

    @property
    def out_of_memory(self) -> bool:
        """Whether nodes were given up that could hold one of the k lightest."""
        return self._open.given_up < float(cut_of(self._store, self._wanted))

    @property
    def proven(self) -> float:
        """Every solution that was not found weighs at least this."""
        cut = float(cut_of(self._store, self._wanted))
        return min(cut, self._open.least_bound)

    def solutions(self) -> tuple[Floats, list[NDArray[np.int32]]]:
        """Return weights (ascending) and the columns of each solution."""
        weights, chosen = _sorted_store(self._store)
        return weights, [own[: int(np.argmax(own < 0))] for own in chosen]

    def run(self, nodes: int) -> None:
        """Search until ``nodes`` more nodes are done or nothing is left."""
        target = self.nodes + nodes
        while not self.done and self.nodes < target and not is_over(self._deadline):
            self._open.count, done, self._store = _rank(
                self._packing.arrays,
                self._open.arrays,
                self._open.count,
                self._wanted,
                self._store,
                target - self.nodes,
            )
            self.nodes += done
            if not self.done and self.nodes < target and not is_over(self._deadline):
                self._open.grow(self._memory_allows)


@njit
def _sorted_store(store: Store) -> Any:
    order = np.argsort(-store.key[: store.num[0]], kind="mergesort")
    weights = np.empty(order.size)
    columns = np.empty((order.size, store.columns.shape[1]), np.int32)
    for i in range(order.size):
        weights[i] = -store.key[order[i]]
        columns[i] = store.columns[store.slot[order[i]]]
    return weights, columns


@search_njit
def _rank(
    packing: PackingArrays, stack: NodeArrays, num_open: int, wanted: Wanted, store: Store, node_limit: int
) -> Any:
    """Search depth first; the number of open nodes, the nodes done, and the store.

    Stops early with nodes open when there is no room left for two children, or time is over.
    """
    tolerance, deadline = wanted.tolerance, wanted.deadline
    node = new_node(packing, stack, num_open)
    num_rows = node.duals.size
    own_cols = np.empty((node.active.size, packing.cols.shape[1]), np.int32)
    blocked = np.empty(node.active.size, np.int32)
    doubts = new_doubts(1, num_rows)
    nodes = 0
    while num_open > 0 and nodes < node_limit:
        top = num_open - 1
        if not has_room(stack, top):
            break
        num_open = top
        cut = cut_of(store, wanted)
        lower = stack.bound[top]
        if lower >= cut:
            continue
        nodes += 1
        num = take_node(stack, top, node)
        kept = num
        temperature = 0.0
        for level in range(LEVELS):
            kept, bound, lower = raise_bound(packing, node, num, lower, temperature, cut, cut, deadline)
            if kept < 0:
                break
            if level == 0 or kept < num:
                index_by_row(packing.cols, node, kept)
                for a in range(kept):
                    own_cols[a] = packing.cols[node.active[a]]
                columns = PricedColumns(
                    own_cols, node.active, node.reduced[:kept], node.slack, node.duals, node.row_ptr, node.row_cols,
                    blocked,
                )  # fmt: skip
                steps, store = enumerate_solutions(columns, 0, num_rows, bound, wanted, True, store)
                if steps != NOT_COMPLETE:
                    kept = CLOSED
                    break
                cut = cut_of(store, wanted)
            num = kept
            gap = cut - lower if cut < np.inf else max(0.1 * abs(lower), 1e3 * tolerance)
            temperature = next_temperature(gap, level, tolerance)
        if kept == OVER:
            # the node's columns and multipliers are as they were; what it listed already is known again
            num_open = top + 1
            nodes -= 1
            break
        if kept == CLOSED or lower >= cut:
            continue
        soften(packing, node, num, node.best_duals, temperature, deadline)
        # with distinct columns there always is one: without an open question enumeration would have been complete
        doubtful_pairs(packing.cols, node, doubts)
        pair = doubts.pairs[0, 0], doubts.pairs[0, 1], doubts.values[0]
        num_open = push_children(packing, stack, top, node, num, pair, lower, node.best_duals)
    return num_open, nodes, store


@search_njit
def rank_components(packing: PackingArrays, reduced: Floats, duals: Floats, wanted: Wanted) -> Any:
    """Enumerate the k lightest solutions of each component of a packing.

    Parameters
    ----------
    packing
        The lists of ``row_cols`` are reordered.
    reduced, duals : float arrays
        Reduced costs and multipliers.
    wanted : Wanted
        Its budget is that of each component, beyond one decision for each of its rows; its limit is how far above
        their bounds all components together may be.

    Returns
    -------
    start : int64 array, shape (C + 1,)
        Component c has the solutions ``start[c]:start[c + 1]``, lightest first.
    weights : float array
        Their weights.
    pointer, columns : int64 and int32 arrays
        Solution i has the columns ``columns[pointer[i]:pointer[i + 1]]``.
    proven : float array, shape (C,)
        What is not among a component's solutions weighs at least this; -inf: the budget or the time did not suffice.
    """
    row_start = packing.row_start
    num_components = row_start.size - 1
    start = np.zeros(num_components + 1, np.int64)
    weights = np.empty(64)
    pointer = np.zeros(65, np.int64)
    columns = np.empty(256, np.int32)
    proven = np.full(num_components, -np.inf)
    names = np.arange(reduced.size).astype(np.int32)
    priced = PricedColumns(
        packing.cols, names, reduced, packing.slack, duals, packing.row_ptr, packing.row_cols,
        np.empty(reduced.size, np.int32),
    )  # fmt: skip
    room = wanted.limit
    count = 0
    for c in range(num_components):
        top, end = row_start[c], row_start[c + 1]
        base = 0.0
        for r in range(top, end):
            base += duals[r]
        own_wanted = Wanted(wanted.k, base + room, wanted.tolerance, wanted.budget + end - top, wanted.deadline)
        steps, store = enumerate_solutions(priced, top, end, base, own_wanted, False, new_store(end - top))
        if steps != NOT_COMPLETE:
            proven[c] = cut_of(store, own_wanted)
            own, chosen = _sorted_store(store)
            if own.size:
                # what this component needs above its bound the others cannot use
                room -= own[0] - base
            for i in range(own.size):
                if count == weights.size:
                    weights = np.concatenate((weights, np.empty(count)))
                    pointer = np.concatenate((pointer, np.empty(count, np.int64)))
                weights[count] = own[i]
                place = pointer[count]
                if place + chosen.shape[1] > columns.size:
                    columns = np.concatenate((columns, np.empty(columns.size + chosen.shape[1], np.int32)))
                for t in range(chosen.shape[1]):
                    if chosen[i, t] < 0:
                        break
                    columns[place] = chosen[i, t]
                    place += 1
                count += 1
                pointer[count] = place
        start[c + 1] = count
    return start, weights[:count].copy(), pointer[: count + 1].copy(), columns, proven
