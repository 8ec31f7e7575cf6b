"""The k lightest solutions of one component or of many: enumeration where it is quick, else branching first.

Enumeration (enumeration.py) is quick where the multipliers' bound is near the optimum. Where it is not, the
component is branched as in branch_and_bound.py (are two measurements of the same source or not?), the
multipliers are improved at every node, and what is left of a node is enumerated as soon as a small budget
suffices. The two answers exclude each other, so that every solution is in exactly one leaf.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.branching.doubtful_pairs import doubtful_pairs
from assoc.packing.branching.nodes import OpenNodes, hard_sweeps, index_by_row, push_children, reduced_of, smooth_sweeps
from assoc.packing.packing import Packing
from assoc.ranking.enumeration import NOT_COMPLETE, cut_of, enumerate_solutions, new_store

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
    ) -> None:
        self._packing = packing
        self._budget = budget
        self._deadline = deadline
        self._k = k
        self._limit = limit
        self._tolerance = tolerance
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
        return self._open.given_up < float(cut_of(self._store, self._k, self._limit, self._tolerance))

    @property
    def proven(self) -> float:
        """Every solution that was not found weighs at least this."""
        cut = float(cut_of(self._store, self._k, self._limit, self._tolerance))
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
                self._packing.cols,
                self._packing.weights,
                *self._open.arrays,
                self._open.count,
                self._k,
                self._limit,
                self._tolerance,
                target - self.nodes,
                self._budget + self._packing.num_rows,
                self._store,
                self._deadline,
            )
            self.nodes += done
            if not self.done and self.nodes < target and not is_over(self._deadline):
                self._open.grow()


@njit
def _sorted_store(store: Any) -> Any:
    key, slot, _, chosen, meta = store
    order = np.argsort(-key[: meta[0]])
    weights = np.empty(meta[0])
    columns = np.empty((meta[0], chosen.shape[1]), np.int32)
    for i in range(meta[0]):
        weights[i] = -key[order[i]]
        columns[i] = chosen[slot[order[i]]]
    return weights, columns


@njit
def _rank(
    cols: Any, weights: Floats, arena: Any, first: Any, size: Any, node_duals: Floats, node_slack: Any,
    node_bound: Floats, num_open: int, k: int, limit: float, tolerance: float, node_limit: int, budget: int,
    store: Any, deadline: float
) -> Any:  # fmt: skip
    """Search depth first; the number of open nodes, the nodes done, and the store.

    Stops early with nodes open when there is no room left for two children, or time is over.
    """
    num_sensors = cols.shape[1]
    num_rows = node_duals.shape[1]
    most = 1
    for t in range(num_open):
        most = max(most, size[t])
    active = np.empty(most, np.int32)
    own_cols = np.empty((most, num_sensors), np.int32)
    row_ptr = np.zeros(num_rows + 1, np.int64)
    row_cols = np.empty(most * num_sensors, np.int32)
    reduced = np.empty(most)
    blocked = np.empty(most, np.int32)
    primal = np.empty(most)
    slack_primal = np.empty(num_rows)
    duals = np.empty(num_rows)
    kept_duals = np.empty(num_rows)
    together = np.zeros(num_rows)
    partners = np.empty(num_rows, np.int32)
    pairs = np.zeros((1, 2), np.int32)
    doubts = np.empty(1)
    values = np.empty(1)
    nodes = 0
    while num_open > 0 and nodes < node_limit:
        top = num_open - 1
        num = size[top]
        if num_open + 1 >= first.size or first[top] + 2 * num > arena.size:
            break
        num_open = top
        cut = cut_of(store, k, limit, tolerance)
        if node_bound[top] >= cut:
            continue
        nodes += 1
        active[:num] = arena[first[top] : first[top] + num]
        duals[:] = node_duals[top]
        kept_duals[:] = duals
        slack = node_slack[top].copy()
        lower = node_bound[top]
        temperature = 0.0
        closed = False
        over = False
        for level in range(3):
            over = is_over(deadline)
            if over:
                break
            index_by_row(cols, active, num, row_ptr, row_cols)
            if level > 0:
                smooth_sweeps(
                    slack, row_ptr, row_cols, num, duals, reduced, primal, slack_primal, temperature, 60, 1.5, deadline
                )
            reduced_of(cols, weights, active, num, duals, reduced)
            if not hard_sweeps(slack, row_ptr, row_cols, duals, reduced, 2):
                closed = True
                break
            bound = 0.0
            for r in range(num_rows):
                bound += duals[r]
            if bound >= lower:
                lower = bound
                kept_duals[:] = duals
            if lower >= cut:
                closed = True
                break
            kept = 0
            for a in range(num):
                if bound + reduced[a] < cut:
                    active[kept] = active[a]
                    reduced[kept] = reduced[a]
                    kept += 1
            if level == 0 or kept < num:
                num = kept
                index_by_row(cols, active, num, row_ptr, row_cols)
                for a in range(num):
                    own_cols[a] = cols[active[a]]
                steps, store = enumerate_solutions(
                    own_cols, active, reduced[:num], slack, duals, row_ptr, row_cols, 0, num_rows,
                    bound, k, limit, tolerance, budget, True, store, blocked, deadline,
                )  # fmt: skip
                if steps != NOT_COMPLETE:
                    closed = True
                    break
                cut = cut_of(store, k, limit, tolerance)
            gap = cut - lower if cut < np.inf else max(0.1 * abs(lower), 1e3 * tolerance)
            temperature = max(gap * (0.1 if level == 0 else 0.03), tolerance)
        if over:
            # the node's columns and multipliers are as they were; what it listed already is known again
            num_open = top + 1
            nodes -= 1
            break
        if closed or lower >= cut:
            continue
        index_by_row(cols, active, num, row_ptr, row_cols)
        duals[:] = kept_duals
        reduced_of(cols, weights, active, num, duals, reduced)
        smooth_sweeps(
            slack, row_ptr, row_cols, num, duals, reduced, primal, slack_primal, temperature, 60, 1.0, deadline
        )
        # with distinct columns there always is one: without an open question enumeration would have been complete
        doubtful_pairs(cols, active, slack, row_ptr, row_cols, primal, together, partners, pairs, doubts, values)
        one, two = pairs[0]
        num_open = push_children(
            cols, active, num, one, two, values[0], lower, kept_duals, slack, arena, first, size, node_duals,
            node_slack, node_bound, top,
        )  # fmt: skip
    return num_open, nodes, store


@njit
def rank_components(
    cols: Any, reduced: Floats, slack: Any, duals: Floats, row_ptr: Any, row_cols: Any, row_start: Any, budget: int,
    k: int, room: float, tolerance: float, deadline: float
) -> Any:  # fmt: skip
    """Enumerate the k lightest solutions of each component of a packing.

    Parameters
    ----------
    cols, slack, row_ptr, row_cols, row_start
        Of the packing; ``row_cols`` is reordered.
    reduced, duals : float arrays
        Reduced costs and multipliers.
    budget : int
        Decisions for each component at the most, beyond one for each of its rows.
    k : int
        Solutions to keep for each.
    room : float
        How far above their bounds all components together may be.
    tolerance : float
        Differences of weight that are ties.
    deadline : float
        When time is over (clock.py).

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
    num_components = row_start.size - 1
    start = np.zeros(num_components + 1, np.int64)
    weights = np.empty(64)
    pointer = np.zeros(65, np.int64)
    columns = np.empty(256, np.int32)
    proven = np.full(num_components, -np.inf)
    names = np.arange(reduced.size).astype(np.int32)
    blocked = np.empty(reduced.size, np.int32)
    count = 0
    for c in range(num_components):
        top, end = row_start[c], row_start[c + 1]
        base = 0.0
        for r in range(top, end):
            base += duals[r]
        limit = base + room
        steps, store = enumerate_solutions(
            cols, names, reduced, slack, duals, row_ptr, row_cols, top, end,
            base, k, limit, tolerance, budget + end - top, False, new_store(end - top),
            blocked, deadline,
        )  # fmt: skip
        if steps != NOT_COMPLETE:
            proven[c] = cut_of(store, k, limit, tolerance)
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
