"""Branch and bound on a packing: dual ascent at every node, branching on pairs of measurements.

A node is a set of columns and, for some rows, the duty to be covered. Its bound comes from the parent's
multipliers, improved by smoothed passes at temperatures of the order of the gap that is left (bounds.py);
columns whose reduced cost exceeds the gap are dropped. Branching asks of two measurements of different
sensors whether they have the same source (the rule of Ryan and Foster for set partitioning): *together*
drops the columns with only one of them, *apart* those with both. The smoothed primal values tell for which
pair the answer is most in doubt.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._compiled import njit
from assoc.solvers.packing import Packing

Floats = NDArray[np.float64]

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
    """

    def __init__(self, packing: Packing, duals: Floats, incumbent: float, tolerance: float) -> None:
        self._packing = packing
        self.tolerance = tolerance
        self.weight = incumbent
        self.columns: NDArray[np.int32] | None = None
        self.nodes = 0
        num, rows = packing.num_columns, packing.num_rows
        depth = 64
        self._arena = np.empty(max(8 * num, 1024), dtype=np.int32)
        self._arena[:num] = np.arange(num)
        self._first = np.zeros(depth, dtype=np.int64)
        self._size = np.zeros(depth, dtype=np.int64)
        self._duals = np.zeros((depth, rows))
        self._slack = np.zeros((depth, rows), dtype=np.bool_)
        self._bound = np.full(depth, -np.inf)
        self._size[0] = num
        self._duals[0] = np.where(packing.slack, np.minimum(duals, 0.0), duals)
        self._slack[0] = packing.slack
        self._open = 1

    @property
    def done(self) -> bool:
        """Whether nothing is left to search: the incumbent is optimal to within the tolerance."""
        return self._open == 0

    @property
    def lower_bound(self) -> float:
        """No solution weighs less."""
        # whole-numbered weights: what is not better by the tolerance is not better at all
        proved = self.weight if self._packing.granularity else self.weight - self.tolerance
        if self._open:
            proved = min(proved, float(self._bound[: self._open].min()))
        return proved

    def run(self, nodes: int) -> None:
        """Search until ``nodes`` more nodes are done or nothing is left."""
        target = self.nodes + nodes
        found = np.empty(self._packing.num_rows, dtype=np.int32)
        while self._open and self.nodes < target:
            self._open, self.weight, count, done = _search(
                self._packing.cols,
                self._packing.weights,
                self._arena,
                self._first,
                self._size,
                self._duals,
                self._slack,
                self._bound,
                self._open,
                self.weight,
                self.tolerance,
                target - self.nodes,
                found,
            )
            self.nodes += done
            if count >= 0:
                self.columns = found[:count].copy()
            if self._open and self.nodes < target:
                self._grow()

    def _grow(self) -> None:
        self._arena = np.concatenate([self._arena, np.empty_like(self._arena)])
        self._first, self._size, self._duals, self._slack, self._bound = (
            np.concatenate([a, np.zeros_like(a)])
            for a in (self._first, self._size, self._duals, self._slack, self._bound)
        )


@njit
def index_by_row(cols: Any, active: Any, num: int, row_ptr: Any, row_cols: Any) -> None:
    """List for each row the positions in ``active`` of the columns that use it."""
    num_sensors = cols.shape[1]
    num_rows = row_ptr.size - 1
    row_ptr[:] = 0
    for a in range(num):
        for s in range(num_sensors):
            r = cols[active[a], s]
            if r >= 0:
                row_ptr[r + 1] += 1
    for r in range(num_rows):
        row_ptr[r + 1] += row_ptr[r]
    place = row_ptr[:num_rows].copy()
    for a in range(num):
        for s in range(num_sensors):
            r = cols[active[a], s]
            if r >= 0:
                row_cols[place[r]] = a
                place[r] += 1


@njit
def _reduced(cols: Any, weights: Floats, active: Any, num: int, duals: Floats, reduced: Floats) -> None:
    num_sensors = cols.shape[1]
    for a in range(num):
        j = active[a]
        value = weights[j]
        for s in range(num_sensors):
            r = cols[j, s]
            if r >= 0:
                value -= duals[r]
        reduced[a] = value


@njit
def _hard(slack: Any, row_ptr: Any, row_cols: Any, duals: Floats, reduced: Floats, sweeps: int) -> bool:
    """Hard-minimum passes; False when a row that must be covered has no column."""
    for _ in range(sweeps):
        for r in range(slack.size):
            least = -duals[r] if slack[r] else np.inf
            for k in range(row_ptr[r], row_ptr[r + 1]):
                least = min(least, reduced[row_cols[k]])
            if least == np.inf:
                return False
            if least != 0.0:
                duals[r] += least
                for k in range(row_ptr[r], row_ptr[r + 1]):
                    reduced[row_cols[k]] -= least
    return True


@njit
def _smooth(
    slack: Any,
    row_ptr: Any,
    row_cols: Any,
    num: int,
    duals: Floats,
    reduced: Floats,
    primal: Floats,
    slack_primal: Floats,
    temperature: float,
    passes: int,
    relaxation: float,
) -> None:
    """Smoothed passes (bounds.py) from multipliers whose reduced costs are given."""
    for a in range(num):
        primal[a] = math.exp(min(-reduced[a] / temperature, 500.0))
    for r in range(slack.size):
        slack_primal[r] = math.exp(min(duals[r] / temperature, 500.0)) if slack[r] else 0.0
    for sweep in range(passes):
        omega = relaxation if sweep >= 5 else 1.0
        worst = 0.0
        for r in range(slack.size):
            if row_ptr[r] == row_ptr[r + 1]:
                continue
            total = slack_primal[r]
            for k in range(row_ptr[r], row_ptr[r + 1]):
                total += primal[row_cols[k]]
            if not 1e-200 < total < 1e200:
                continue
            worst = max(worst, abs(total - 1.0))
            step = omega * math.log(total)
            factor = math.exp(-step)
            duals[r] -= temperature * step
            slack_primal[r] *= factor
            for k in range(row_ptr[r], row_ptr[r + 1]):
                primal[row_cols[k]] *= factor
        if worst < 0.01:
            break


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
def _doubtful_pairs(
    cols: Any, active: Any, slack: Any, row_ptr: Any, row_cols: Any, primal: Floats, together: Floats, partners: Any,
    pairs: Any, doubts: Floats, values: Floats
) -> int:  # fmt: skip
    """Fill ``pairs`` with those of which it is least clear whether they belong together; how many there are."""
    num_sensors = cols.shape[1]
    doubts[:] = -1.0
    counts = np.zeros(slack.size, np.int64)
    for r in range(slack.size):
        num = 0
        for k in range(row_ptr[r], row_ptr[r + 1]):
            a = row_cols[k]
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
            doubt = y * (1.0 - y)
            # where both rows always appear together and must be covered there is nothing to decide
            open_question = slack[r] or slack[q] or counts[q] < degree or counts[q] < row_ptr[q + 1] - row_ptr[q]
            if open_question and doubt > doubts[-1]:
                place = doubts.size - 1
                while place > 0 and doubts[place - 1] < doubt:
                    doubts[place] = doubts[place - 1]
                    values[place] = values[place - 1]
                    pairs[place] = pairs[place - 1]
                    place -= 1
                doubts[place] = doubt
                values[place] = y
                pairs[place, 0], pairs[place, 1] = r, q
            together[q] = 0.0
            counts[q] = 0
    count = 0
    while count < doubts.size and doubts[count] >= 0.0:
        count += 1
    return count


@njit
def _child_bound(
    cols: Any, active: Any, num: int, slack: Any, row_ptr: Any, row_cols: Any, parent_duals: Floats,
    parent_reduced: Floats, duals: Floats, reduced: Floats, primal: Floats, slack_primal: Floats,
    one: int, two: int, joined: bool, temperature: float
) -> float:  # fmt: skip
    """Estimate the bound of a child by a few passes; ``inf`` when it has no solution."""
    num_sensors = cols.shape[1]
    duals[:] = parent_duals
    for a in range(num):
        uses = 0
        for s in range(num_sensors):
            r = cols[active[a], s]
            if r == one or r == two:
                uses += 1
        dropped = uses == 1 if joined else uses == 2
        reduced[a] = np.inf if dropped else parent_reduced[a]
    if joined:
        slack[one] = False
        slack[two] = False
    for a in range(num):
        primal[a] = math.exp(-reduced[a] / temperature)
    for r in range(slack.size):
        slack_primal[r] = math.exp(duals[r] / temperature) if slack[r] else 0.0
    possible = True
    for _ in range(6):
        for r in range(slack.size):
            if row_ptr[r] == row_ptr[r + 1]:
                continue
            total = slack_primal[r]
            for k in range(row_ptr[r], row_ptr[r + 1]):
                total += primal[row_cols[k]]
            if not 1e-200 < total < 1e200:
                continue
            step = math.log(total)
            factor = 1.0 / total
            duals[r] -= temperature * step
            slack_primal[r] *= factor
            for k in range(row_ptr[r], row_ptr[r + 1]):
                primal[row_cols[k]] *= factor
    for a in range(num):
        if reduced[a] < np.inf:
            value = parent_reduced[a]
            for s in range(num_sensors):
                r = cols[active[a], s]
                if r >= 0:
                    value += parent_duals[r] - duals[r]
            reduced[a] = value
    possible = _hard(slack, row_ptr, row_cols, duals, reduced, 1)
    if not possible:
        return np.inf
    bound = 0.0
    for r in range(slack.size):
        bound += duals[r]
    return bound


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
) -> Any:
    """Search depth first; the number of open nodes, the incumbent's weight, its columns, the nodes done.

    Stops early with nodes open when there is no room left for two children.
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
        temperature = 0.0
        for level in range(3):
            index_by_row(cols, active, num, row_ptr, row_cols)
            if level > 0:
                _smooth(slack, row_ptr, row_cols, num, duals, reduced, primal, slack_primal, temperature, 60, 1.5)
            _reduced(cols, weights, active, num, duals, reduced)
            if not _hard(slack, row_ptr, row_cols, duals, reduced, 2):
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
        if pruned or lower >= incumbent - tolerance:
            continue
        index_by_row(cols, active, num, row_ptr, row_cols)
        branch_duals[:] = duals
        _reduced(cols, weights, active, num, duals, reduced)
        _smooth(slack, row_ptr, row_cols, num, branch_duals, reduced, primal, slack_primal, temperature, 60, 1.0)
        candidates = _doubtful_pairs(
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
            _reduced(cols, weights, active, num, duals, reduced)
            best_score = -1.0
            for i in range(candidates):
                one, two = pairs[i]
                score = 1.0
                for joined in range(2):
                    child_slack[:] = slack
                    gain = _child_bound(
                        cols, active, num, child_slack, row_ptr, row_cols, duals, reduced, branch_duals,
                        child_reduced, primal, slack_primal, one, two, joined == 1, temperature,
                    ) - lower  # fmt: skip
                    score *= min(max(gain, 1e-4 * (incumbent - lower)), 1.1 * (incumbent - lower))
                if score > best_score:
                    best_score, pick = score, i
        one, two = pairs[pick]
        value = values[pick]
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
            node_duals[num_open] = duals
            node_slack[num_open] = slack
            if joined:
                node_slack[num_open, one] = False
                node_slack[num_open, two] = False
            node_bound[num_open] = lower
            num_open += 1
    return num_open, incumbent, count_found, nodes
