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

from assoc._compiled import njit
from assoc.solvers.branch_and_bound import _hard, _reduced, _smooth, index_by_row
from assoc.solvers.enumeration import NOT_COMPLETE, cut_of, enumerate_solutions, new_store
from assoc.solvers.packing import Packing

Floats = NDArray[np.float64]

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
    """

    def __init__(
        self, packing: Packing, duals: Floats, k: int, limit: float, tolerance: float, *, budget: int = NODE_BUDGET
    ) -> None:
        self._packing = packing
        self._budget = budget
        self._k = k
        self._limit = limit
        self._tolerance = tolerance
        num, rows = packing.num_columns, packing.num_rows
        depth = 64
        self._store = new_store(rows)
        self._arena = np.empty(max(8 * num, 1024), dtype=np.int32)
        self._arena[:num] = np.arange(num)
        self._first = np.zeros(depth, dtype=np.int64)
        self._size = np.zeros(depth, dtype=np.int64)
        self._duals = np.zeros((depth, rows))
        self._slack = np.zeros((depth, rows), dtype=np.bool_)
        self._bound = np.full(depth, -np.inf)
        self._size[0] = num
        self._duals[0] = duals
        self._slack[0] = packing.slack
        self._open = 1
        self.nodes = 0

    @property
    def done(self) -> bool:
        """Whether nothing is left to search."""
        return self._open == 0

    @property
    def proven(self) -> float:
        """Every solution that was not found weighs at least this."""
        cut = float(cut_of(self._store, self._k, self._limit, self._tolerance))
        return min(cut, float(self._bound[: self._open].min())) if self._open else cut

    def solutions(self) -> tuple[Floats, list[NDArray[np.int32]]]:
        """Return weights (ascending) and the columns of each solution."""
        weights, chosen = _sorted_store(self._store)
        return weights, [own[: int(np.argmax(own < 0))] for own in chosen]

    def run(self, nodes: int) -> None:
        """Search until ``nodes`` more nodes are done or nothing is left."""
        target = self.nodes + nodes
        while self._open and self.nodes < target:
            self._open, done, self._store = _rank(
                self._packing.cols,
                self._packing.weights,
                self._arena,
                self._first,
                self._size,
                self._duals,
                self._slack,
                self._bound,
                self._open,
                self._k,
                self._limit,
                self._tolerance,
                target - self.nodes,
                self._budget + self._packing.num_rows,
                self._store,
            )
            self.nodes += done
            if self._open and self.nodes < target:
                self._grow()

    def _grow(self) -> None:
        self._arena = np.concatenate([self._arena, np.empty_like(self._arena)])
        self._first, self._size, self._duals, self._slack, self._bound = (
            np.concatenate([a, np.zeros_like(a)])
            for a in (self._first, self._size, self._duals, self._slack, self._bound)
        )


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
    store: Any
) -> Any:  # fmt: skip
    """Search depth first; the number of open nodes, the nodes done, and the store.

    Stops early with nodes open when there is no room left for two children.
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
    primal = np.empty(most)
    slack_primal = np.empty(num_rows)
    duals = np.empty(num_rows)
    kept_duals = np.empty(num_rows)
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
        for level in range(3):
            index_by_row(cols, active, num, row_ptr, row_cols)
            if level > 0:
                _smooth(slack, row_ptr, row_cols, num, duals, reduced, primal, slack_primal, temperature, 60, 1.5)
            _reduced(cols, weights, active, num, duals, reduced)
            if not _hard(slack, row_ptr, row_cols, duals, reduced, 2):
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
                    bound, k, limit, tolerance, budget, True, store,
                )  # fmt: skip
                if steps != NOT_COMPLETE:
                    closed = True
                    break
                cut = cut_of(store, k, limit, tolerance)
            gap = cut - lower if cut < np.inf else max(0.1 * abs(lower), 1e3 * tolerance)
            temperature = max(gap * (0.1 if level == 0 else 0.03), tolerance)
        if closed or lower >= cut:
            continue
        index_by_row(cols, active, num, row_ptr, row_cols)
        duals[:] = kept_duals
        _reduced(cols, weights, active, num, duals, reduced)
        _smooth(slack, row_ptr, row_cols, num, duals, reduced, primal, slack_primal, temperature, 60, 1.0)
        one, two, value = _doubtful_pair(cols, active, slack, row_ptr, row_cols, primal)
        place = first[top]
        for side in range(2):
            # the more likely answer is pushed last and so searched first
            joined = (side == 1) == (value >= 0.5)
            first[num_open] = place
            for a in range(num):
                j = active[a]
                uses = 0
                for s in range(num_sensors):
                    if cols[j, s] == one or cols[j, s] == two:
                        uses += 1
                if (uses != 1) if joined else (uses != 2):
                    arena[place] = j
                    place += 1
            size[num_open] = place - first[num_open]
            node_duals[num_open] = kept_duals
            node_slack[num_open] = slack
            if joined:
                node_slack[num_open, one] = False
                node_slack[num_open, two] = False
            node_bound[num_open] = lower
            num_open += 1
    return num_open, nodes, store


@njit
def _doubtful_pair(cols: Any, active: Any, slack: Any, row_ptr: Any, row_cols: Any, primal: Floats) -> Any:
    """Return the pair of rows of which it is least clear whether they belong together, and how much they do.

    With distinct columns there always is one: without an open question enumeration would have been complete.
    """
    num_sensors = cols.shape[1]
    best, first, second, value = -1.0, -1, -1, 0.0
    together = np.zeros(slack.size)
    counts = np.zeros(slack.size, np.int64)
    partners = np.empty(slack.size, np.int32)
    for r in range(slack.size):
        num = 0
        for x in range(row_ptr[r], row_ptr[r + 1]):
            a = row_cols[x]
            for s in range(num_sensors):
                q = cols[active[a], s]
                if q > r:
                    if counts[q] == 0:
                        partners[num] = q
                        num += 1
                    counts[q] += 1
                    together[q] += primal[a]
        degree = row_ptr[r + 1] - row_ptr[r]
        for i in range(num):
            q = partners[i]
            y = min(together[q], 1.0)
            # where both rows always appear together and must be covered there is nothing to decide
            is_open = slack[r] or slack[q] or counts[q] < degree or counts[q] < row_ptr[q + 1] - row_ptr[q]
            if is_open and y * (1.0 - y) > best:
                best, first, second, value = y * (1.0 - y), r, q, y
            together[q] = 0.0
            counts[q] = 0
    return first, second, value


@njit
def rank_components(
    cols: Any, reduced: Floats, slack: Any, duals: Floats, row_ptr: Any, row_cols: Any, row_start: Any, budget: int,
    k: int, room: float, tolerance: float
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

    Returns
    -------
    start : int64 array, shape (C + 1,)
        Component c has the solutions ``start[c]:start[c + 1]``, lightest first.
    weights : float array
        Their weights.
    pointer, columns : int64 and int32 arrays
        Solution i has the columns ``columns[pointer[i]:pointer[i + 1]]``.
    proven : float array, shape (C,)
        What is not among a component's solutions weighs at least this; -inf: the budget did not suffice.
    """
    num_components = row_start.size - 1
    start = np.zeros(num_components + 1, np.int64)
    weights = np.empty(64)
    pointer = np.zeros(65, np.int64)
    columns = np.empty(256, np.int32)
    proven = np.full(num_components, -np.inf)
    names = np.arange(reduced.size).astype(np.int32)
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
