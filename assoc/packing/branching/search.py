"""Branch and bound on a packing: dual ascent at every node, branching on pairs of measurements.

A node is a set of columns and, for some rows, the duty to be covered (nodes.py). Its bound comes from the parent's
multipliers, improved by smoothed passes at temperatures of the order of the gap that is left; columns whose reduced
cost exceeds the gap are dropped. Branching (branching.py) asks of two measurements of different sensors whether they
have the same source: *together* drops the columns with only one of them, *apart* those with both.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.branching.doubtful_pairs import child_bound, doubtful_pairs
from assoc.packing.branching.nodes import OpenNodes, hard_sweeps, index_by_row, push_children, reduced_of, smooth_sweeps
from assoc.packing.packing import Packing

# pairs that are tried on both sides before one is branched on
CANDIDATES = 8


class Search:
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
    """

    def __init__(
        self, packing: Packing, duals: Floats, incumbent: float, tolerance: float, deadline: float = np.inf
    ) -> None:
        self._packing = packing
        self.tolerance = tolerance
        self.weight = incumbent
        self.deadline = deadline
        self.columns: NDArray[np.int32] | None = None
        self.nodes = 0
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
            self._open.count, self.weight, count, done = _search(
                self._packing.cols,
                self._packing.weights,
                *self._open.arrays,
                self._open.count,
                self.weight,
                self.tolerance,
                target - self.nodes,
                found,
                self.deadline,
            )
            self.nodes += done
            if count >= 0:
                self.columns = found[:count].copy()
            if not self.done and self.nodes < target and not is_over(self.deadline):
                self._open.grow()


@njit
def _greedy(cols: Any, weights: Floats, active: Any, order: Any, slack: Any, covered: Any, found: Any) -> Any:
    """Take columns in ``order`` while they fit; the weight (inf when a duty is left) and their number."""
    num_sensors = cols.shape[1]
    covered[:] = False
    weight = 0.0
    count = 0
    for a in order:
        j = active[a]
        fits = True
        duty = False
        for s in range(num_sensors):
            r = cols[j, s]
            if r >= 0:
                if covered[r]:
                    fits = False
                    break
                duty = duty or not slack[r]
        if fits and (weights[j] < 0.0 or duty):
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
def _search(
    cols: Any,
    weights: Floats,
    arena: Any,
    first: Any,
    size: Any,
    node_duals: Floats,
    node_slack: Any,
    node_bound: Floats,
    num_open: int,
    incumbent: float,
    tolerance: float,
    node_limit: int,
    found: Any,
    deadline: float,
) -> Any:
    """Search depth first; the number of open nodes, the incumbent's weight, its columns, the nodes done.

    Stops early with nodes open when there is no room left for two children, or time is over.
    """
    num_sensors = cols.shape[1]
    num_rows = node_duals.shape[1]
    most = 0
    for t in range(num_open):
        most = max(most, size[t])
    active = np.empty(most, np.int32)
    row_ptr = np.zeros(num_rows + 1, np.int64)
    row_cols = np.empty(most * num_sensors, np.int32)
    reduced = np.empty(most)
    primal = np.empty(most)
    slack_primal = np.empty(num_rows)
    duals = np.empty(num_rows)
    branch_duals = np.empty(num_rows)
    covered = np.empty(num_rows, np.bool_)
    trial = np.empty(num_rows, np.int32)
    together = np.zeros(num_rows)
    partners = np.empty(num_rows, np.int32)
    pairs = np.zeros((CANDIDATES, 2), np.int32)
    doubts = np.empty(CANDIDATES)
    values = np.empty(CANDIDATES)
    child_slack = np.empty(num_rows, np.bool_)
    child_reduced = np.empty(most)
    count_found = -1
    nodes = 0
    while num_open > 0 and nodes < node_limit:
        top = num_open - 1
        num = size[top]
        if num_open + 1 >= first.size or first[top] + 2 * num > arena.size:
            break
        num_open = top
        if node_bound[top] >= incumbent - tolerance:
            continue
        nodes += 1
        active[:num] = arena[first[top] : first[top] + num]
        duals[:] = node_duals[top]
        slack = node_slack[top].copy()
        lower = node_bound[top]
        pruned = False
        over = False
        temperature = 0.0
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
                pruned = True
                break
            bound = 0.0
            for r in range(num_rows):
                bound += duals[r]
            lower = max(lower, bound)
            if lower >= incumbent - tolerance:
                pruned = True
                break
            kept = 0
            for a in range(num):
                if bound + reduced[a] <= incumbent - tolerance:
                    active[kept] = active[a]
                    reduced[kept] = reduced[a]
                    kept += 1
            if level == 0 or kept < num:
                # an early look for a better incumbent shrinks everything that follows
                order = np.argsort(reduced[:kept])
                weight, count = _greedy(cols, weights, active, order, slack, covered, trial)
                if weight < incumbent - 1e-3 * tolerance:
                    incumbent = weight
                    count_found = count
                    found[:count] = trial[:count]
            num = kept
            gap = incumbent - lower if incumbent < np.inf else max(1.0, 0.1 * abs(lower))
            temperature = max(gap * (0.1 if level == 0 else 0.03), 1e-3 * tolerance)
        if over:
            # the node's columns and multipliers are as they were
            num_open = top + 1
            nodes -= 1
            break
        if pruned or lower >= incumbent - tolerance:
            continue
        index_by_row(cols, active, num, row_ptr, row_cols)
        branch_duals[:] = duals
        reduced_of(cols, weights, active, num, duals, reduced)
        smooth_sweeps(
            slack, row_ptr, row_cols, num, branch_duals, reduced, primal, slack_primal, temperature, 60, 1.0, deadline
        )
        candidates = doubtful_pairs(
            cols, active, slack, row_ptr, row_cols, primal, together, partners, pairs, doubts, values
        )
        if candidates == 0:
            # no two columns compete any more: the greedy choice is this node's optimum
            order = np.argsort(reduced[:num])
            weight, count = _greedy(cols, weights, active, order, slack, covered, trial)
            if weight < incumbent:
                incumbent = weight
                count_found = count
                found[:count] = trial[:count]
            continue
        pick = 0
        if candidates > 1:
            reduced_of(cols, weights, active, num, duals, reduced)
            best_score = -1.0
            for i in range(candidates):
                # as good a pair as any when time is over
                if is_over(deadline):
                    break
                one, two = pairs[i]
                score = 1.0
                for joined in range(2):
                    child_slack[:] = slack
                    gain = child_bound(
                        cols, active, num, child_slack, row_ptr, row_cols, duals, reduced, branch_duals,
                        child_reduced, primal, slack_primal, one, two, joined == 1, temperature,
                    ) - lower  # fmt: skip
                    score *= min(max(gain, 1e-4 * (incumbent - lower)), 1.1 * (incumbent - lower))
                if score > best_score:
                    best_score, pick = score, i
        one, two = pairs[pick]
        num_open = push_children(
            cols, active, num, one, two, values[pick], lower, duals, slack, arena, first, size, node_duals, node_slack,
            node_bound, top,
        )  # fmt: skip
    return num_open, incumbent, count_found, nodes
