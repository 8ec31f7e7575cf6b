"""Branch and bound on a packing: dual ascent at every node, branching on pairs of measurements.

A node is a set of columns and, for some rows, the duty to be covered (nodes.py). Its bound comes from the parent's
multipliers, improved by smoothed passes at temperatures of the order of the gap that is left; columns whose reduced
cost exceeds the gap are dropped. Branching (doubtful_pairs.py) asks of two measurements of different sensors whether
they have the same source: *together* drops the columns with only one of them, *apart* those with both.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import njit, search_njit
from assoc._types import Floats
from assoc.packing.branching.doubtful_pairs import child_bound, doubtful_pairs, new_child, new_doubts
from assoc.packing.branching.nodes import (
    CLOSED,
    LEVELS,
    OVER,
    Node,
    NodeArrays,
    OpenNodes,
    has_room,
    new_node,
    next_temperature,
    push_children,
    raise_bound,
    reduced_of,
    soften,
    take_node,
)  # fmt: skip
from assoc.packing.packing import Packing, PackingArrays
from assoc.packing.run import memory_allows

# pairs that are tried on both sides before one is branched on
CANDIDATES = 8


class Limits(NamedTuple):
    """How much better a solution must be, how many nodes are searched, and when time is over (clock.py)."""

    tolerance: float
    nodes: int
    deadline: float


class BranchAndBound:
    """A depth-first search that can be stopped and continued.

    Parameters
    ----------
    packing : Packing
        One component or several; the search treats them as one.
    duals : float array, shape (R,)
        Multipliers to start from (sign-correct for rows with slack).
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
        found = np.empty(self._packing.num_rows, dtype=np.int32)
        while not self.done and self.nodes < target and not is_over(self.deadline):
            limits = Limits(self.tolerance, target - self.nodes, self.deadline)
            self._open.count, self.weight, count, done = _search(
                self._packing.arrays, self._open.arrays, self._open.count, self.weight, limits, found
            )
            self.nodes += done
            if count >= 0:
                self.columns = found[:count].copy()
            if not self.done and self.nodes < target and not is_over(self.deadline):
                self._open.grow(self._memory_allows)


@njit
def _greedy(packing: PackingArrays, node: Node, num: int, covered: Any, found: Any) -> Any:
    """Take columns by their reduced costs while they fit; the weight (inf when a duty is left) and their number."""
    cols, weights, active, slack = packing.cols, packing.weights, node.active, node.slack
    num_sensors = cols.shape[1]
    covered[:] = False
    weight = 0.0
    count = 0
    for a in np.argsort(node.reduced[:num], kind="mergesort"):
        j = active[a]
        free = True
        duty = False
        for s in range(num_sensors):
            r = cols[j, s]
            if r >= 0:
                if covered[r]:
                    free = False
                    break
                duty = duty or not slack[r]
        if free and (weights[j] < 0.0 or duty):
            weight += weights[j]
            found[count] = j
            count += 1
            for s in range(num_sensors):
                r = cols[j, s]
                if r >= 0:
                    covered[r] = True
    for r in range(slack.size):
        if not slack[r] and not covered[r]:
            return np.inf, count
    return weight, count


@njit
def _most_decisive(
    packing: PackingArrays, node: Node, num: int, pairs: Any, temperature: float, lower: float, gap: float,
    deadline: float,
) -> int:  # fmt: skip
    """Return which of the doubtful pairs raises the bound most on both sides, by a few passes on each."""
    child = new_child(node)
    reduced_of(packing, node, num, node.duals)
    pick = 0
    best_score = -1.0
    for i in range(len(pairs)):
        # as good a pair as any when time is over
        if is_over(deadline):
            break
        one, two = pairs[i]
        score = 1.0
        for joined in range(2):
            gain = child_bound(packing, node, num, child, one, two, joined == 1, temperature) - lower
            score *= min(max(gain, 1e-4 * gap), 1.1 * gap)
        if score > best_score:
            best_score, pick = score, i
    return pick


@search_njit
def _search(
    packing: PackingArrays, stack: NodeArrays, num_open: int, incumbent: float, limits: Limits, found: Any
) -> Any:
    """Search depth first; the number of open nodes, the incumbent's weight, its columns, the nodes done.

    Stops early with nodes open when there is no room left for two children, or time is over.
    """
    tolerance, node_limit, deadline = limits
    node = new_node(packing, stack, num_open)
    num_rows = node.duals.size
    doubts = new_doubts(CANDIDATES, num_rows)
    covered = np.empty(num_rows, np.bool_)
    trial = np.empty(num_rows, np.int32)
    count_found = -1
    nodes = 0
    while num_open > 0 and nodes < node_limit:
        top = num_open - 1
        if not has_room(stack, top):
            break
        num_open = top
        lower = stack.bound[top]
        if lower >= incumbent - tolerance:
            continue
        nodes += 1
        num = take_node(stack, top, node)
        kept = num
        temperature = 0.0
        for level in range(LEVELS):
            cut = incumbent - tolerance
            # a column at the cut itself stays
            kept, _, lower = raise_bound(
                packing, node, num, lower, temperature, cut, np.nextafter(cut, np.inf), deadline
            )
            if kept < 0:
                break
            if level == 0 or kept < num:
                # an early look for a better incumbent shrinks everything that follows
                weight, count = _greedy(packing, node, kept, covered, trial)
                if weight < incumbent - 1e-3 * tolerance:
                    incumbent = weight
                    count_found = count
                    found[:count] = trial[:count]
            num = kept
            gap = incumbent - lower if incumbent < np.inf else max(1.0, 0.1 * abs(lower))
            temperature = next_temperature(gap, level, 1e-3 * tolerance)
        if kept == OVER:
            # the node's columns and multipliers are as they were
            num_open = top + 1
            nodes -= 1
            break
        if kept == CLOSED or lower >= incumbent - tolerance:
            continue
        soften(packing, node, num, node.duals, temperature, deadline)
        candidates = doubtful_pairs(packing.cols, node, doubts)
        if candidates == 0:
            # no two columns compete any more: the greedy choice is this node's optimum
            weight, count = _greedy(packing, node, num, covered, trial)
            if weight < incumbent:
                incumbent = weight
                count_found = count
                found[:count] = trial[:count]
            continue
        pick = 0
        if candidates > 1:
            pairs = doubts.pairs[:candidates]
            pick = _most_decisive(packing, node, num, pairs, temperature, lower, incumbent - lower, deadline)
        pair = doubts.pairs[pick, 0], doubts.pairs[pick, 1], doubts.values[pick]
        num_open = push_children(packing, stack, top, node, num, pair, lower, node.duals)
    return num_open, incumbent, count_found, nodes
