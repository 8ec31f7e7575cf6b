"""The k lightest solutions of one component or of many: enumeration where it is quick, else branching first.

Enumeration (enumeration.py) is quick where the multipliers' bound is near the optimum. Elsewhere the component is
branched as in packing/branching (do two measurements have the same source?): the linear program gives every node its
best multipliers, and a node is enumerated as soon as a small budget suffices for the columns that remain. A search
that takes long is restarted with cuts, split on counts. Enumeration ignores cuts and counts: it may list solutions of
another part, at their true weights; a known solution is not listed again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc._system.kernels.sorting import order_of
from assoc._types import Floats
from assoc.packing.branching.counts import USUAL, Leaf, Splitting, begin_leaf, most_rows, split_on_counts
from assoc.packing.branching.node import (
    Work,
    allowed_at,
    branch,
    drop,
    keep_side,
    new_work,
    open_node,
    relax,
    work_memory,
)
from assoc.packing.branching.open_nodes import OpenNodes, Stack, has_room, push_node
from assoc.packing.branching.pairs import (
    NEITHER,
    TOGETHER,
    any_open_pair,
    certain_pairs,
    decide,
    doubtful_pairs,
    part_certain,
)
from assoc.packing.branching.root import plain_root, root_with_cuts
from assoc.packing.kernels.heap import doubled
from assoc.packing.packing import Packing, PackingArrays
from assoc.packing.run import memory_allows, never
from assoc.packing.simplex.dual import OPTIMAL, STOPPED, Effort
from assoc.packing.simplex.program import Allowed, reduced_cost
from assoc.ranking.enumeration import (
    NOT_COMPLETE,
    PricedColumns,
    Store,
    Wanted,
    cut_of,
    enumerate_solutions,
    new_store,
    new_store_inside,
)

FIRST_BUDGET = 3000
NODE_BUDGET = 500
# an unlimited budget
_ALL = 1 << 60


class ComponentRanking:
    """Branch and bound for the k lightest solutions of one component; can be stopped and continued.

    The component's columns are distinct; multipliers (R,) to start from are feasible. Solutions weigh less than
    ``limit``, and weights that differ by no more than the tolerance are ties. A node is branched after ``budget``
    decisions of enumeration beyond one for each row. At the deadline (`Run.deadline`) the current node stays open.
    ``splitting`` says when a search that restarts with cuts is split on counts.
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
        deadline: Callable[[], float] = never,
        memory_allows: Callable[[float], bool] = memory_allows,
        splitting: Splitting = USUAL,
    ) -> None:
        self._packing = packing
        self._deadline = deadline
        self._memory_allows = memory_allows
        self._wanted = Wanted(k, limit, tolerance, budget + packing.num_rows, np.inf)
        self._store = new_store(packing.num_rows)
        self._root = plain_root(packing, duals)
        self._open = OpenNodes(self._root)
        self._work: Work | None = None
        # the parts of the root not searched yet, the least bound last
        self._waiting: list[Leaf] = []
        self._splitting, self._split_at = splitting, splitting.after
        self.nodes = 0
        self.parts_begun = 0

    @property
    def done(self) -> bool:
        """Whether nothing is left to search."""
        return self._open.count == 0 and not self._waiting

    @property
    def out_of_memory(self) -> bool:
        """Whether nodes were given up that could hold one of the k lightest."""
        return self._open.given_up < float(cut_of(self._store, self._wanted))

    @property
    def proven(self) -> float:
        """Lower bound on the weight of all solutions not found."""
        cut = float(cut_of(self._store, self._wanted))
        waiting = self._waiting[-1].bound if self._waiting else np.inf
        return min(cut, self._open.least_bound, waiting)

    def solutions(self) -> tuple[Floats, list[NDArray[np.int32]]]:
        """Return weights (ascending) and the columns of each solution."""
        weights, chosen = _sorted_store(self._store)
        return weights, [columns[: int(np.argmax(columns < 0))] for columns in chosen]

    def run(self, nodes: int) -> None:
        """Search until ``nodes`` more nodes are done or nothing is left."""
        target = self.nodes + nodes
        while not self.done and self.nodes < target and not is_over(self._deadline()):
            if self._work is None and not self._begin():
                return
            if self._open.count == 0:
                given_up = self._open.given_up
                self.parts_begun += 1
                self._open, self._work = begin_leaf(self._packing, self._waiting.pop(), given_up, self._work)
            elif self.nodes >= self._split_at and self._split():
                continue
            limit = min(target, max(self._split_at, self.nodes + 1))
            self._open.count, done, *store = _rank(
                self._work,
                self._open.arrays,
                self._open.count,
                self._wanted._replace(deadline=self._deadline()),
                self._store,
                limit - self.nodes,
            )
            self._store = Store(*store)
            self.nodes += done
            if self._open.count and self.nodes < limit and not is_over(self._deadline()):
                self._open.grow(self._memory_allows)

    def _split(self) -> bool:
        """Restart with cuts, split on counts, if that raises the bound; whether it does."""
        # a split that does not pay now may pay with a lower cutoff
        self._split_at = 2 * self.nodes
        packing, cut = self._packing, float(cut_of(self._store, self._wanted))
        # the memory of this search and of a second one
        needed = 2.0 * work_memory(most_rows(packing), packing.num_columns, packing.num_sensors)
        if not (cut < np.inf and self._open.given_up == np.inf and self._memory_allows(needed)):
            return False
        root = root_with_cuts(packing, self._root.duals, cut, self._deadline())
        leaves = split_on_counts(packing, root, cut, cut, self._deadline(), self._splitting.pays)
        proven = self.proven
        if min((leaf.bound for leaf in leaves), default=cut) <= proven + self._splitting.raised * (cut - proven):
            return False
        self._waiting = sorted(leaves, key=lambda leaf: -leaf.bound)
        self._open.count = 0
        return True

    def _begin(self) -> bool:
        """Allocate the search; without memory for it the root is given up."""
        packing = self._packing
        if not self._memory_allows(work_memory(packing.num_rows, packing.num_columns, packing.num_sensors)):
            self._open.give_up()
            return False
        self._work = new_work(packing.arrays, self._root.program, self._root.slack)
        return True


@njit
def _sorted_store(store: Store) -> Any:
    order = order_of(-store.key[: store.num[0]])
    weights = np.empty(order.size)
    columns = np.empty((order.size, store.columns.shape[1]), np.int32)
    for i in range(order.size):
        weights[i] = -store.key[order[i]]
        copy_to(columns[i], store.columns[store.slot[order[i]]])
    return weights, columns


@inner_njit
def _priced(work: Work, num: int) -> PricedColumns:
    """The columns of the current node with its multipliers, indexed by row."""
    cols, active = work.cols, work.node.active
    num_sensors = cols.shape[1]
    active_cols = np.empty((num, num_sensors), np.int32)
    reduced = np.empty(num)
    row_ptr = np.zeros(work.trial.size + 1, np.int64)
    for a in range(num):
        reduced[a] = reduced_cost(work.program, work.duals, active[a])
        for s in range(num_sensors):
            active_cols[a, s] = cols[active[a], s]
            if active_cols[a, s] >= 0:
                row_ptr[active_cols[a, s] + 1] += 1
    for r in range(work.trial.size):
        row_ptr[r + 1] += row_ptr[r]
    row_cols = np.empty(row_ptr[-1], np.int32)
    at = row_ptr[:-1].copy()
    for a in range(num):
        for s in range(num_sensors):
            r = active_cols[a, s]
            if r >= 0:
                row_cols[at[r]] = a
                at[r] += 1
    return PricedColumns(
        active_cols, active[:num].copy(), work.weights, reduced, work.node.slack, work.duals, row_ptr, row_cols,
        np.empty(num, np.int32),
    )  # fmt: skip


@inner_njit
def _question(work: Work, allowed: Allowed, status: int, effort: Effort) -> Any:
    """The pair to branch on, the decision about it (`decide`), and whether it is likelier together."""
    program, cols, basis, trials = work.program, work.cols, work.basis, work.trials
    if status == OPTIMAL:
        count = doubtful_pairs(cols, basis, trials)
        if count > 0:
            which, verdict = decide(program, cols, allowed, basis, trials, count, effort)
            return (trials.pairs[which, 0], trials.pairs[which, 1]), verdict, trials.values[which] >= 0.5
        which, verdict = -1, NEITHER
        count = certain_pairs(cols, allowed, basis, trials, work.trial)
        if count > 0:
            which, verdict = part_certain(program, cols, allowed, basis, trials, count, effort)
        if which >= 0:
            return (trials.pairs[which, 0], trials.pairs[which, 1]), verdict, True
    first, second = any_open_pair(cols, allowed, work.trial)
    if first < 0:
        # columns share no rows: branch on whether one is used
        for j in allowed.active:
            for s in range(cols.shape[1]):
                for t in range(s + 1, cols.shape[1]):
                    if cols[j, s] >= 0 and cols[j, t] >= 0 and (allowed.slack[cols[j, s]] or allowed.slack[cols[j, t]]):
                        first, second = int(cols[j, s]), int(cols[j, t])
    return (first, second), NEITHER, True


@njit
def _rank(work: Work, stack: Stack, num_open: int, wanted: Wanted, store: Store, node_limit: int) -> Any:
    """Search depth first; the number of open nodes, the nodes done, and the arrays of the store.

    Stops early with nodes open when there is no room left for two children, or time is over. The arrays are a plain
    tuple: when Ctrl-C interrupts the conversion of a record, numba calls its class without having found it.
    """
    deadline = wanted.deadline
    budget = wanted.budget
    nodes = 0
    # the node whose basis is loaded
    at_work = -1
    while num_open > 0 and nodes < node_limit:
        top = num_open - 1
        if not has_room(stack, top) or is_over(deadline):
            break
        cut = min(cut_of(store, wanted), work.limit)
        lower = stack.bound[top]
        if lower >= cut:
            num_open = top
            continue
        num = open_node(work, stack, top, at_work)
        at_work = -1
        status, bound = relax(work, num, cut, deadline)
        if status == STOPPED and is_over(deadline):
            break
        lower = max(lower, bound)
        if lower < cut:
            num = drop(work, num, bound, cut)
            wanted_here = Wanted(wanted.k, wanted.limit, wanted.tolerance, budget, deadline)
            budget = wanted.budget
            steps, store = enumerate_solutions(_priced(work, num), 0, work.trial.size, bound, wanted_here, True, store)
            cut = min(cut_of(store, wanted), work.limit)
            if steps == NOT_COMPLETE and is_over(deadline):
                # the node is unchanged on the stack; solutions it has listed already are recognised
                break
            if steps != NOT_COMPLETE:
                lower = cut
        num_open = top
        nodes += 1
        if lower >= cut:
            continue
        num = drop(work, num, bound, cut)
        allowed = allowed_at(work, num)
        pair, verdict, likely = _question(work, allowed, status, Effort(cut, 0, deadline))
        if pair[0] < 0:
            # nothing to branch on: enumerate the node from the stack again, without a budget
            num_open, nodes, budget = top + 1, nodes - 1, _ALL
            continue
        if verdict == NEITHER:
            num_open = branch(work, stack, top, num, pair, likely, lower)
        else:
            num = keep_side(work, num, pair, verdict == TOGETHER)
            push_node(stack, top, allowed_at(work, num), work.basis, lower)
            num_open = top + 1
        at_work = num_open - 1
    return num_open, nodes, store.key, store.slot, store.marks, store.columns, store.num


@njit
def rank_components(packing: PackingArrays, reduced: Floats, duals: Floats, wanted: Wanted) -> Any:
    """Enumerate the k lightest solutions of each of C components of a packing, whose ``row_cols`` are reordered.

    The budget in ``wanted`` is for each component, beyond one decision for each row; the limit is the total excess of
    all components over their bounds.

    Returns start (C + 1,), weights, pointer, columns and proven (C,): component c has the solutions ``start[c]:start[c
    + 1]``, lightest first; solution i has the columns ``columns[pointer[i]:pointer[i + 1]]``; proven is a lower bound
    on a component's unlisted solutions, -inf where the budget or the time did not suffice.
    """
    row_start = packing.row_start
    num_components = row_start.size - 1
    start = np.zeros(num_components + 1, np.int64)
    weights = np.empty(64)
    pointer = np.zeros(65, np.int64)
    columns = np.empty(256, np.int32)
    proven = np.full(num_components, -np.inf)
    names = np.empty(reduced.size, np.int32)
    for j in range(names.size):
        names[j] = j
    priced = PricedColumns(
        packing.cols, names, packing.weights, reduced, packing.slack, duals, packing.row_ptr, packing.row_cols,
        np.empty(reduced.size, np.int32),
    )  # fmt: skip
    room = wanted.limit
    count = 0
    for c in range(num_components):
        top, end = row_start[c], row_start[c + 1]
        base = 0.0
        for r in range(top, end):
            base += duals[r]
        wanted_here = Wanted(wanted.k, base + room, wanted.tolerance, wanted.budget + end - top, wanted.deadline)
        steps, store = enumerate_solutions(priced, top, end, base, wanted_here, False, new_store_inside(end - top))
        if steps != NOT_COMPLETE:
            proven[c] = cut_of(store, wanted_here)
            lightest, chosen = _sorted_store(store)
            if lightest.size:
                # the excess that this component needs is not available to the others
                room -= lightest[0] - base
            for i in range(lightest.size):
                if count == weights.size:
                    weights, pointer = doubled(weights), doubled(pointer)
                weights[count] = lightest[i]
                at = pointer[count]
                while at + chosen.shape[1] > columns.size:
                    columns = doubled(columns)
                for t in range(chosen.shape[1]):
                    if chosen[i, t] < 0:
                        break
                    columns[at] = chosen[i, t]
                    at += 1
                count += 1
                pointer[count] = at
        start[c + 1] = count
    return start, weights[:count].copy(), pointer[: count + 1].copy(), columns, proven
