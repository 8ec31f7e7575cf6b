"""The k lightest solutions of a problem: rounds of growing excess, component by component."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._types import Array, Floats, Ints
from assoc.packing.kernels.heap import pop, push
from assoc.packing.packing import Packing
from assoc.packing.run import Run, infeasible
from assoc.ranking.columns import AllColumns
from assoc.ranking.component_ranking import FIRST_BUDGET, ComponentRanking, rank_components
from assoc.ranking.enumeration import Wanted
from assoc.ranking.head_start import HeadStart

Columns = NDArray[np.int32]

# excess of a round, as a multiple of that of the best known solution
_AHEAD = 1.1
# weights that differ by less than this share of the summed magnitudes are ties
_TIE = 1e-12


@dataclass(slots=True)
class Found:
    """The solutions proved to be the lightest."""

    chosen: list[Columns]
    """Columns of each solution, lightest first."""
    rest: float
    """Lower bound on the weights of all other solutions."""
    nodes: int = 0
    """Nodes of branch and bound."""
    known: Columns | None = None
    """Columns of the lightest solution found, where none is proved to be the lightest."""


@dataclass(slots=True)
class _Lists:
    """Ranked solutions of each component: weights, columns, and a lower bound on the others' weights."""

    weights: list[Floats] = field(default_factory=list)
    columns: list[list[Columns]] = field(default_factory=list)
    proven: list[float] = field(default_factory=list)


class Deepening:
    """Rounds of growing excess D until k solutions are proved to be the lightest; ``ahead`` comes before branching."""

    def __init__(self, columns: AllColumns, k: int, run: Run, ahead: HeadStart, budget: int = FIRST_BUDGET) -> None:
        self._columns = columns
        self._k = k
        self._run = run
        self._ahead = ahead
        self._budget = budget
        self._nodes = 0
        self._tolerance = _TIE * columns.scale
        self._known: Columns | None = None
        self._known_weight = np.inf

    def run(self) -> Found:
        """Return the k lightest solutions, or those proved when time is over; InfeasibleError if there is none."""
        columns = self._columns
        if self._run.should_stop():
            return Found([], columns.bound)
        steps = np.concatenate([columns.reduced, columns.slack_reduced[columns.slack]])
        steps = np.unique(steps[steps > self._tolerance])
        # two deviations of a row for each solution wanted are a fair first guess of the excess
        deviations = 2 * self._k
        best = Found([], columns.bound)
        while True:
            excess = self._excess(steps, deviations)
            found = self._round(excess)
            if (len(found.chosen), found.rest) > (len(best.chosen), best.rest):
                best = found
            best.nodes, best.known = self._nodes, self._known
            if len(best.chosen) >= self._k or excess == np.inf or self._run.should_stop():
                break
            # the head start's excess may exceed that of twice as many deviations
            deviations = 2 * max(deviations, int(np.searchsorted(steps, excess)) if self._ahead.weight < np.inf else 0)
        if not best.chosen and best.rest == np.inf:
            raise infeasible(columns.keep(np.inf))
        return best

    def _excess(self, steps: Floats, deviations: int) -> float:
        """Return the excess of a round: that of so many deviations, or of the best known solution if larger."""
        if deviations >= steps.size:
            return np.inf
        known = self._ahead.weight - self._columns.bound + 4.0 * self._tolerance
        # a little more than that of the solution, so that the others do not need another round
        return max(float(steps[deviations]), _AHEAD * known) if known < np.inf else float(steps[deviations])

    def _round(self, excess: float) -> Found:
        """Rank all solutions of at most this excess; fewer than k if there are fewer."""
        columns = self._columns
        beyond = columns.bound + excess
        packing = columns.keep(excess)
        if bool((~packing.slack & (np.diff(packing.row_ptr) == 0)).any()):
            return Found([], beyond)
        duals = columns.duals[packing.row_origin]
        # rows without columns stay uncovered and use up some of the excess
        room = excess + (columns.bound - float(duals.sum())) + self._tolerance
        if room <= 0.0:
            return Found([], beyond)
        lists = self._rank_components(packing, duals, room)
        if lists is None:
            return Found([], columns.bound)
        lower = np.array(
            [
                min(weights[0], proven) if weights.size else proven
                for weights, proven in zip(lists.weights, lists.proven, strict=True)
            ]
        )
        if np.isposinf(lower).any():
            return Found([], np.inf)
        total_lower = math.fsum(lower)
        unlisted = total_lower + (np.array(lists.proven) - lower)
        rest = min(beyond, float(unlisted.min(initial=np.inf)))
        if any(weights.size == 0 for weights in lists.weights):
            return Found([], rest)
        start = np.concatenate([[0], np.cumsum([weights.size for weights in lists.weights])]).astype(np.int64)
        weights = np.concatenate([*lists.weights, np.zeros(0)])
        total, choice = merge(start, weights, self._k + 1)
        if total[0] < self._known_weight:
            self._known, self._known_weight = _origins(packing, lists, choice[0]), float(total[0])
        # a full list excludes what is lighter than its last solution by more than a tie; if all tie, than its first
        ties = float(np.minimum([weights[0] for weights in lists.weights] - lower, self._tolerance).sum())
        # solutions far above the bound may weigh more than all that the tolerance is a share of: their sums are rounded
        sums = float(np.abs(lower).sum()) + (abs(rest) if math.isfinite(rest) else 0.0)
        ties += 4.0 * self._tolerance + 4.0 * sys.float_info.epsilon * (lower.size + 1) * sums
        proved = min(int(np.searchsorted(total, rest + ties, side="right")), self._k)
        if proved < total.size:
            rest = min(rest, float(total[proved]))
        return Found([_origins(packing, lists, pick) for pick in choice[:proved]], rest)

    def _rank_components(self, packing: Packing, duals: Floats, room: float) -> _Lists | None:
        """Rank every component; None where the head start shows that more excess is needed."""
        reduced = self._columns.reduced[packing.origin]
        wanted = Wanted(self._k, room, self._tolerance, self._budget, self._run.deadline())
        start, weights, pointer, columns, proven = rank_components(packing.arrays, reduced, duals, wanted)
        lists = _Lists()
        for c in range(packing.num_components):
            part = slice(start[c], start[c + 1])
            lists.weights.append(weights[part])
            lists.columns.append([columns[pointer[i] : pointer[i + 1]] for i in range(start[c], start[c + 1])])
            lists.proven.append(float(proven[c]))
        hard = np.flatnonzero(np.isneginf(proven))
        if hard.size and not self._ahead.taken:
            self._ahead.take()
            if np.inf > self._ahead.weight - self._columns.bound > room:
                return None
        bounds = np.add.reduceat(duals, packing.row_start[:-1]) if hard.size else np.zeros(0)
        # the excess that the ranked components need is not available to the others
        used = sum(part[0] - bound for part, bound in zip(lists.weights, bounds, strict=False) if part.size)
        for index in hard:
            # a component that there was no time for is bounded by its multipliers
            lists.proven[index] = float(bounds[index])
            if not self._run.should_stop():
                self._branch(packing, duals, int(index), float(bounds[index] + room - used), lists)
                if lists.weights[index].size:
                    used += lists.weights[index][0] - bounds[index]
        return lists

    def _branch(self, packing: Packing, duals: Floats, c: int, limit: float, lists: _Lists) -> None:
        """Rank a component that enumeration could not finish; fill in its lists."""
        component = packing.component(c)
        component_duals = duals[packing.row_start[c] : packing.row_start[c + 1]]
        ranking = ComponentRanking(
            component,
            component_duals,
            self._k,
            limit,
            self._tolerance,
            deadline=self._run.deadline,
            memory_allows=self._run.memory_allows,
        )
        # about ten milliseconds of work between two checks of the clock
        turn = max(1, 100_000 // max(component.num_columns, 1))
        while not ranking.done and not self._run.should_stop():
            ranking.run(turn)
        self._nodes += ranking.nodes
        if ranking.out_of_memory:
            self._run.stopped_by = self._run.stopped_by or "memory_limit"
        first = int(packing.col_start[c])
        found, chosen = ranking.solutions()
        lists.weights[c] = found
        lists.columns[c] = [solution + np.int32(first) for solution in chosen]
        # before its first node is done the search has no bound
        lists.proven[c] = max(ranking.proven, lists.proven[c])


def _origins(packing: Packing, lists: _Lists, pick: NDArray[np.int32]) -> Columns:
    """Return the columns of one solution from each component's list."""
    picked = [columns[i] for columns, i in zip(lists.columns, pick, strict=True)]
    return packing.origin[np.concatenate([np.zeros(0, np.int32), *picked])]


@njit
def merge(start: Ints, weights: Floats, k: int) -> Any:
    """Combine the ranked lists of independent components into the k lightest choices of one of each.

    List c is ``weights[start[c]:start[c + 1]]``, ascending and not empty. Returns m <= k weights, ascending, and the
    index into each component's list, (m, C).
    """
    num_lists = start.size - 1
    total = np.zeros(1)
    steps = 0
    for c in range(num_lists):
        if start[c + 1] - start[c] > 1:
            steps += 1
    # one level for each list of two or more: the combination of the lists before, and the index in this one
    before = np.empty((steps, 1), np.int32)
    which = np.empty((steps, 1), np.int32)
    level = 0
    for c in range(num_lists):
        first = start[c]
        length = start[c + 1] - first
        if length == 1:
            total += weights[first]
            continue
        room = min(k, total.size * length)
        if room > before.shape[1]:
            before = _wider(before, room)
            which = _wider(which, room)
        result = np.empty(room)
        heap = np.empty(total.size)
        item = np.empty(total.size, np.int64)
        index = np.zeros(total.size, np.int64)
        size = 0
        # combination t of the lists before enters once t - 1 has been used with this list's first solution
        push(heap, item, size, total[0] + weights[first], 0)
        size += 1
        for n in range(room):
            value = heap[0]
            t = item[0]
            size -= 1
            pop(heap, item, size)
            result[n] = value
            before[level, n] = t
            which[level, n] = index[t]
            if index[t] == 0 and t + 1 < total.size:
                push(heap, item, size, total[t + 1] + weights[first], t + 1)
                size += 1
            index[t] += 1
            if index[t] < length:
                push(heap, item, size, total[t] + weights[first + index[t]], t)
                size += 1
        total = result
        level += 1
    choice = np.zeros((total.size, num_lists), np.int32)
    for n in range(total.size):
        t = n
        level = steps
        for c in range(num_lists - 1, -1, -1):
            if start[c + 1] - start[c] > 1:
                level -= 1
                choice[n, c] = which[level, t]
                t = before[level, t]
    return total, choice


@inner_njit
def _wider(array: Array, columns: int) -> Any:
    result = np.empty((array.shape[0], columns), np.int32)
    for i in range(array.shape[0]):
        for k in range(array.shape[1]):
            result[i, k] = array[i, k]
    return result
