"""Branch and bound on a packing: the linear program at every node, branching on pairs of measurements.

A node is a set of columns and, for some rows, the duty to be covered (open_nodes.py). Its linear program is solved from
its parent's basis by the dual simplex method (packing/simplex); its bound is computed anew from the multipliers, so
that it holds whatever rounding did there. Columns and slack whose reduced cost exceeds the gap are dropped. Branching
(pairs.py) asks of two measurements of different sensors whether they have the same source: *together* drops the
columns with only one of them, *apart* those with both.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.ahead import compile_ahead, wait_for_kernels
from assoc._system.clock import is_over
from assoc._system.compiled import njit, search_njit
from assoc._system.interpreted import interpreted_only
from assoc._types import Floats
from assoc.packing.branching.open_nodes import OpenNodes, Stack, has_room, push_node, take_node
from assoc.packing.branching.pairs import (
    NEITHER,
    TOGETHER,
    WHOLE,
    Trials,
    answer,
    any_open_pair,
    decide,
    doubtful_pairs,
    new_trials,
)
from assoc.packing.packing import Packing, assemble
from assoc.packing.run import memory_allows
from assoc.packing.simplex.basis import Basis, new_basis, refactor
from assoc.packing.simplex.dual import OPTIMAL, STOPPED, Effort, restart, solve_dual
from assoc.packing.simplex.program import (
    Allowed,
    Program,
    all_allowed,
    certified,
    make_feasible,
    program_of,
    reduced_cost,
    weight_limit,
)


class Limits(NamedTuple):
    """How much better a solution must be, how many nodes are searched, and when time is over (clock.py)."""

    tolerance: float
    nodes: int
    deadline: float


class _Work(NamedTuple):
    """What the search of one packing has at hand.

    Attributes
    ----------
    cols : int32 array, shape (N, S)
        Rows of the columns, as the packing has them.
    program : Program
    basis : Basis
        Of the node at work.
    node : Allowed
        What it allows; ``active`` is room.
    trials : Trials
    duals : float array, shape (R,)
        Multipliers of the node's bound, feasible.
    key : float array, shape (N,)
        Room for what columns are sorted by.
    found, trial : int32 arrays, shape (R,)
        Columns of the best solution found, and room for another one.
    limit : float
        No solution weighs as much.
    """

    cols: NDArray[np.int32]
    program: Program
    basis: Basis
    node: Allowed
    trials: Trials
    duals: Floats
    key: Floats
    found: NDArray[np.int32]
    trial: NDArray[np.int32]
    limit: float


class BranchAndBound:
    """A depth-first search that can be stopped and continued.

    Parameters
    ----------
    packing : Packing
        One component or several; the search treats them as one.
    duals : float array, shape (R,)
        Multipliers to start from.
    incumbent : float
        Only solutions of less weight are looked for; ``inf`` if none is known.
    tolerance : float
        How much better a solution must be to count.
    deadline : float
        When time is over, by the kernels' clock (clock.py): the node at work stays open.
    memory_allows : callable, optional
        Whether the search may take so many bytes more (`Run.memory_allows`).
    """

    def __init__(
        self,
        packing: Packing,
        duals: Floats,
        incumbent: float,
        tolerance: float,
        deadline: float = np.inf,
        memory_allows: Callable[[float], bool] = memory_allows,
    ) -> None:
        self._packing = packing
        self.tolerance = tolerance
        self.weight = incumbent
        self.deadline = deadline
        self.columns: NDArray[np.int32] | None = None
        self.nodes = 0
        self._memory_allows = memory_allows
        self._open = OpenNodes(packing, np.where(packing.slack, np.minimum(duals, 0.0), duals))
        self._work: _Work | None = None

    @property
    def done(self) -> bool:
        """Whether nothing is left to search: the incumbent is optimal to within the tolerance, or memory is short."""
        return self._open.count == 0

    @property
    def out_of_memory(self) -> bool:
        """Whether nodes were given up that could hold something better."""
        return self._open.given_up < self.weight - self.tolerance

    @property
    def lower_bound(self) -> float:
        """No solution weighs less."""
        # whole-numbered weights: what is not better by the tolerance is not better at all
        proved = self.weight if self._packing.granularity else self.weight - self.tolerance
        return min(proved, self._open.least_bound)

    def run(self, nodes: int) -> None:
        """Search until ``nodes`` more nodes are done or nothing is left."""
        target = self.nodes + nodes
        while not self.done and self.nodes < target and not is_over(self.deadline):
            if self._work is None and not self._begin():
                return
            limits = Limits(self.tolerance, target - self.nodes, self.deadline)
            self._open.count, self.weight, count, done = _search(
                self._work, self._open.arrays, self._open.count, self.weight, limits
            )
            self.nodes += done
            if count >= 0:
                assert self._work is not None
                self.columns = self._work.found[:count].copy()
            if not self.done and self.nodes < target and not is_over(self.deadline):
                self._open.grow(self._memory_allows)

    def _begin(self) -> bool:
        """Make room for the search; without memory for it the root is given up."""
        rows, columns = self._packing.num_rows, self._packing.num_columns
        # two inverses, and what is known of pairs
        if not self._memory_allows(34.0 * rows * rows + 100.0 * columns):
            self._open.give_up()
            return False
        wait_for_kernels()
        self._work = _new_work(self._packing.cols, program_of(self._packing.arrays), self._packing.slack)
        return True


@njit
def _new_work(cols: Any, program: Program, slack: Any) -> _Work:
    size = program.sides.size
    return _Work(
        cols, program, new_basis(program), all_allowed(program, slack), new_trials(program), np.empty(size),
        np.empty(program.weights.size), np.empty(size, np.int32), np.empty(size, np.int32), weight_limit(program),
    )  # fmt: skip


@njit
def _greedy(work: _Work, allowed: Allowed) -> Any:
    """Take columns by ``key`` while they fit; the weight (inf when a duty is left) and their number."""
    cols, weights, trial = work.cols, work.program.weights, work.trial
    covered = np.zeros(allowed.slack.size, np.bool_)
    weight = 0.0
    count = 0
    for a in np.argsort(work.key[: allowed.active.size], kind="mergesort"):
        j = allowed.active[a]
        free = True
        duty = False
        for s in range(cols.shape[1]):
            r = cols[j, s]
            if r >= 0:
                if covered[r]:
                    free = False
                    break
                duty = duty or not allowed.slack[r]
        if free and (weights[j] < 0.0 or duty):
            weight += weights[j]
            trial[count] = j
            count += 1
            for s in range(cols.shape[1]):
                if cols[j, s] >= 0:
                    covered[cols[j, s]] = True
    for r in range(covered.size):
        if not allowed.slack[r] and not covered[r]:
            return np.inf, count
    return weight, count


@njit
def _drop(work: _Work, num: int, bound: float, cut: float) -> int:
    """Drop the columns and the slack that no solution below the cut has; how many columns are left.

    Leaves the reduced costs of those in ``key``.
    """
    node, duals = work.node, work.duals
    kept = 0
    for a in range(num):
        j = node.active[a]
        reduced = reduced_cost(work.program, duals, j)
        # a column at the cut itself stays
        if bound + reduced <= cut:
            node.active[kept] = j
            work.key[kept] = reduced
            kept += 1
        else:
            node.columns[j] = False
    for r in range(node.slack.size):
        if node.slack[r] and bound - duals[r] > cut:
            node.slack[r] = False
    return kept


@njit
def _by_values(work: _Work, allowed: Allowed) -> bool:
    """Lower the keys by the LP's values, so that these decide first; whether all of them are whole numbers."""
    basis = work.basis
    whole = True
    for a in range(allowed.active.size):
        place = basis.place[allowed.active[a]]
        if place >= 0:
            value = basis.values[place]
            whole = whole and not WHOLE < value < 1.0 - WHOLE
            work.key[a] -= value * work.limit
    return whole


@search_njit
def _search(work: _Work, stack: Stack, num_open: int, incumbent: float, limits: Limits) -> Any:
    """Search depth first; the number of open nodes, the incumbent's weight, its number of columns, the nodes done.

    Stops early with nodes open when there is no room left for two children, or time is over.
    """
    tolerance, node_limit, deadline = limits
    cols, program, basis, node, trials = work.cols, work.program, work.basis, work.node, work.trials
    count_found = -1
    nodes = 0
    # the node whose basis is at work
    at_work = -1
    while num_open > 0 and nodes < node_limit:
        top = num_open - 1
        if not has_room(stack, top):
            break
        lower = stack.bound[top]
        if lower >= incumbent - tolerance:
            num_open = top
            continue
        num = take_node(stack, top, node)
        if at_work != top:
            basis.variable[:] = stack.variable[top]
            basis.duals[:] = stack.duals[top]
            basis.anchors[:] = stack.duals[top]
            refactor(program, Allowed(node.active[:num], node.columns, node.slack), basis)
        at_work = -1
        one, two, likely = -1, -1, 0.5
        closed = False
        late = False
        while True:
            allowed = Allowed(node.active[:num], node.columns, node.slack)
            cut = min(incumbent - tolerance, work.limit)
            restart(program, allowed, basis)
            # a little more than the cut, for what rounding takes off the bound
            status, _ = solve_dual(program, allowed, basis, Effort(cut + 0.1 * tolerance, 100_000, deadline))
            if status == STOPPED and is_over(deadline):
                late = True
                break
            work.duals[:] = basis.duals
            make_feasible(program, allowed, work.duals)
            bound = certified(program, allowed, work.duals)
            lower = max(lower, bound)
            if lower >= cut:
                closed = True
                break
            num = _drop(work, num, bound, cut)
            allowed = Allowed(node.active[:num], node.columns, node.slack)
            whole = status == OPTIMAL and _by_values(work, allowed)
            weight, count = _greedy(work, allowed)
            if weight < incumbent - 1e-3 * tolerance:
                incumbent = weight
                count_found = count
                work.found[:count] = work.trial[:count]
                if lower >= incumbent - tolerance:
                    closed = True
                    break
                cut = incumbent - tolerance
                num = _drop(work, num, bound, cut)
                allowed = Allowed(node.active[:num], node.columns, node.slack)
            in_doubt = 0
            if status == OPTIMAL and not whole:
                in_doubt = doubtful_pairs(cols, basis, trials)
            if in_doubt == 0:
                one, two = any_open_pair(cols, allowed, work.trial)
                break
            which, verdict = decide(program, cols, allowed, basis, trials, in_doubt, Effort(cut, 0, deadline))
            one, two, likely = int(trials.pairs[which, 0]), int(trials.pairs[which, 1]), trials.values[which]
            if verdict == NEITHER:
                break
            num = answer(cols, allowed, (one, two), verdict == TOGETHER, trials.side)
            node.active[:num] = trials.side.active[:num]
            node.columns[:] = trials.side.columns
            node.slack[:] = trials.side.slack
        if late:
            # the node is as it was on the stack
            break
        num_open = top
        nodes += 1
        if closed:
            continue
        if one < 0:
            # columns that share a row are the same: the lightest of each kind
            allowed = Allowed(node.active[:num], node.columns, node.slack)
            for a in range(num):
                work.key[a] = program.weights[node.active[a]]
            weight, count = _greedy(work, allowed)
            if weight < incumbent:
                incumbent = weight
                count_found = count
                work.found[:count] = work.trial[:count]
            continue
        for turn in range(2):
            # the likelier side comes last, and is searched first
            joined = (turn == 1) == (likely >= 0.5)
            num = answer(cols, allowed, (one, two), joined, trials.side)
            side = Allowed(trials.side.active[:num], trials.side.columns, trials.side.slack)
            push_node(stack, num_open, side, basis, lower)
            num_open += 1
        at_work = num_open - 1
    return num_open, incumbent, count_found, nodes


def compile_branching_ahead() -> None:
    """Have the search compiled by another process, where it is not compiled yet."""
    compile_ahead(_search, compile_branching)


def compile_branching() -> None:
    """Compile the search, on three measurements of which each two could be one target."""
    with interpreted_only():
        rows = np.array([[0, 1, -1], [0, -1, 2], [-1, 1, 2]], np.int32)
        packing = assemble(rows, np.full(3, -1.0), np.ones(3, np.bool_), np.arange(3, dtype=np.int32)).component(0)
    BranchAndBound(packing, np.zeros(packing.num_rows), np.inf, 1e-9).run(10)
