"""Branch and bound on a packing: the linear program at every node, branching on pairs of measurements.

A node is a set of columns and a set of rows that must be covered (open_nodes.py). Its linear program is solved from
its parent's basis by the dual simplex method (packing/simplex); its bound is recomputed from the multipliers, so that
it is valid despite rounding. Columns and slack whose reduced cost exceeds the gap are dropped. Branching (pairs.py)
decides whether two measurements of different sensors have the same source: *together* drops the columns with only one
of them, *apart* those with both.

A search to the end makes several *passes*. Each searches for solutions below an *aim*, at first near the root's bound,
as if the aim were the incumbent's weight: few columns and few nodes remain, whatever the incumbent. A pass that finds
no solution proves the aim as a bound, and the next aim is higher. The best solution that a pass finds is optimal.
Passes before the last one are cheap, as trees grow fast with the gap. If they take many nodes, the root is split on
counts (counts.py), if that pays, and passes search its parts, the least bound first.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import wait_for_kernels
from assoc._types import Floats
from assoc.errors import LimitExceededError
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.counts import USUAL, Leaf, Splitting, begin_leaf, most_rows, split_on_counts
from assoc.packing.branching.depth_first import Limits, search_depth_first
from assoc.packing.branching.node import Work, new_work, work_memory
from assoc.packing.branching.open_nodes import OpenNodes
from assoc.packing.branching.root import plain_root, root_with_cuts
from assoc.packing.packing import Packing
from assoc.packing.run import FIRST_NODES, Run, memory_allows, never

# the first and the last aim, as shares of the gap between the root's bound and the incumbent, and their growth
_FIRST, _LAST, _GROWTH = 0.05, 0.9, 1.7
# a split is judged by the savings of passes with aims so many times as far
_FARTHER = 3.0


class BranchAndBound:
    """A depth-first search, of one component or several as one, that can be stopped and continued.

    Only solutions that weigh less than the incumbent (``inf``: none is known) by the tolerance are searched for, from
    multipliers (R,). At the deadline (`Run.deadline`) the current node stays open. A search ``to_the_end`` has cuts at
    the root, goes in passes, the first with an aim above ``floor``, a known lower bound, and splits its root on counts
    (``splitting``).
    """

    def __init__(
        self,
        packing: Packing,
        duals: Floats,
        incumbent: float,
        tolerance: float,
        deadline: Callable[[], float] = never,
        memory_allows: Callable[[float], bool] = memory_allows,
        *,
        to_the_end: bool = False,
        floor: float = -np.inf,
        splitting: Splitting = USUAL,
    ) -> None:
        self._packing = packing
        self.tolerance = tolerance
        self.weight = incumbent
        self._deadline = deadline
        self.columns: NDArray[np.int32] | None = None
        self.nodes = 0
        self._memory_allows = memory_allows
        self._to_the_end = to_the_end
        self._root = plain_root(packing, np.where(packing.slack, np.minimum(duals, 0.0), duals))
        self._open = OpenNodes(self._root)
        self._work: Work | None = None
        # the parts of the root: all of them, and those that this pass has yet to search, the least bound last
        self._leaves: list[Leaf] = []
        self._waiting: list[Leaf] = []
        self._splitting, self._split_at = splitting, splitting.after
        # this pass searches for solutions below the aim; earlier ones proved that none is below the floor
        self._aim, self._floor = np.inf, floor

    @property
    def done(self) -> bool:
        """Whether nothing is left to search: the incumbent is optimal to within the tolerance, or memory is short."""
        if self._floor >= self.weight - self.tolerance:
            return True
        over = self._open.count == 0 and self._least_waiting >= min(self._aim, self.weight - self.tolerance)
        return over and (self._aim >= self.weight - self.tolerance or self._open.given_up < np.inf)

    @property
    def out_of_memory(self) -> bool:
        """Whether nodes were given up that could have a better solution."""
        return self._open.given_up < self.weight - self.tolerance

    @property
    def lower_bound(self) -> float:
        """Lower bound on all solutions' weights."""
        if self._searched < self.weight - self.tolerance:
            return self._searched
        # with whole-numbered weights, a solution that is not better by a tolerance below 1 is not better at all
        whole = self.tolerance < self._packing.granularity
        return self.weight if whole else self.weight - self.tolerance

    def run(self, nodes: int) -> None:
        """Search until ``nodes`` more nodes are done or nothing is left."""
        target = self.nodes + nodes
        while not self.done and self.nodes < target and not is_over(self._deadline()):
            if self._work is None and not self._begin():
                return
            if self._open.count and self._splits():
                # the bound that this pass has proved stays; the rest of the pass searches the parts
                self._floor = self._searched
                self._begin_pass()
                continue
            limits = Limits(self.tolerance, self._aim, target - self.nodes, self._deadline())
            self._open.count, self.weight, count, done = search_depth_first(
                self._work, self._open.arrays, self._open.count, self.weight, limits
            )
            self.nodes += done
            if count >= 0:
                assert self._work is not None
                self.columns = self._work.found[:count].copy()
            if not self.done and self.nodes < target and not is_over(self._deadline()):
                if self._open.count:
                    self._open.grow(self._memory_allows)
                elif self._least_waiting < min(self._aim, self.weight - self.tolerance):
                    self._next_leaf()
                else:
                    self._next_pass()

    def _begin(self) -> bool:
        """Allocate the search; without memory for it the root is given up."""
        if not self._memory_allows(self._room()):
            self._open.give_up()
            return False
        wait_for_kernels()
        root = self._root
        if self._to_the_end:
            root = root_with_cuts(self._packing, root.duals, self.weight - self.tolerance, self._deadline())
            self._root = root
            self._open = OpenNodes(root)
            self._set_aim()
        self._work = new_work(self._packing.arrays, root.program, root.slack)
        return True

    def _room(self) -> float:
        """Bytes that a search takes with the most cuts and counts."""
        rows = most_rows(self._packing) if self._to_the_end else float(self._packing.num_rows)
        return work_memory(rows, self._packing.num_columns, self._packing.num_sensors)

    @property
    def _least_waiting(self) -> float:
        """Lower bound on the parts that this pass has yet to search."""
        return self._waiting[-1].bound if self._waiting else np.inf

    @property
    def _searched(self) -> float:
        """Lower bound on all solutions except the incumbent."""
        return max(self._floor, min(self._aim, self._open.least_bound, self._least_waiting))

    @property
    def _root_bound(self) -> float:
        """The bound from which aims are set: that of the root, or the least of its parts."""
        root = float(self._root.program.sides @ self._root.duals)
        return max(root, min((leaf.bound for leaf in self._leaves), default=root))

    def _next_pass(self) -> None:
        """Restart at the root or its parts with a higher aim."""
        self._floor = max(self._floor, self._aim)
        self._splits()
        self._begin_pass()

    def _begin_pass(self) -> None:
        """Begin at the root or its parts."""
        self._waiting = self._leaves.copy()
        if self._waiting:
            self._next_leaf()
        else:
            self._open = OpenNodes(self._root)
        self._set_aim()

    def _splits(self) -> bool:
        """Split the root on counts, where the search is long and that pays; whether the parts are new."""
        known = self._to_the_end and self.weight < np.inf and self._open.given_up == np.inf
        if not known or self.nodes < self._split_at:
            return False
        # a split that does not pay now may pay with a better incumbent or another aim
        self._split_at = 2 * self.nodes
        # the memory of this search and of a second one
        if not self._memory_allows(2.0 * self._room()):
            return False
        cutoff, bound = self.weight - self.tolerance, self._root_bound
        goal = min(bound + _FARTHER * (self._aim - bound), cutoff)
        leaves = split_on_counts(self._packing, self._root, cutoff, goal, self._deadline(), self._splitting.pays)
        least = min((leaf.bound for leaf in leaves), default=cutoff)
        if least < bound + self._splitting.raised * (goal - bound):
            return False
        self._floor = max(self._floor, least)
        self._leaves = sorted(leaves, key=lambda leaf: -leaf.bound)
        return True

    def _next_leaf(self) -> None:
        """Begin the unsearched part of least bound."""
        given_up = self._open.given_up
        self._open, self._work = begin_leaf(self._packing, self._waiting.pop(), given_up, self._work)

    def _set_aim(self) -> None:
        """Set the aim to a share of the gap above the root's bound, or one step above the bound proved so far."""
        root = self._root_bound
        gap = self.weight - root
        aim = root + max(_FIRST * gap, _GROWTH * (self._floor - root))
        # without an incumbent there is no gap; a gap that is only rounding may have no share larger than 0
        farther = max(root, self._floor) < aim < root + _LAST * gap
        self._aim = aim if 0.0 < gap < np.inf and farther else np.inf


def first_solution(packing: Packing, run: Run, nodes: int = FIRST_NODES) -> NDArray[np.int32] | None:
    """Return the columns of a complete solution; None if there is none, or time or nodes are used up."""
    if bool((~packing.slack & (np.diff(packing.row_ptr) == 0)).any()):
        return None
    chosen = []
    for c in range(packing.num_components):
        part = packing.component(c)
        search = BranchAndBound(part, dual_bound(part, run=run), np.inf, 1e-9, run.deadline, run.memory_allows)
        while search.columns is None and not search.done and search.nodes < nodes and not run.should_stop():
            search.run(20)
        if search.columns is None and not search.done and not run.should_stop():
            run.stopped_by = "iterations"
        if search.columns is None:
            if search.out_of_memory:
                raise LimitExceededError("no memory to find out whether there is a solution; split the problem")
            return None
        chosen.append(part.origin[search.columns])
    return np.concatenate(chosen) if chosen else np.zeros(0, dtype=np.int32)
