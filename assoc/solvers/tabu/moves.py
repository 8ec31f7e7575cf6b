"""Moves of the tabu search: forced insertion with ejection, tenure, aspiration.

The gain of every column is kept up to date: it changes only for columns on rows that changed. A move inserts
the column of least gain that is not tabu; columns that it ejects may not return for ``tenure`` moves, unless that
leads to a solution better than the best (aspiration). Rows that a move leaves open are filled at once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import now
from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Floats, Ints
from assoc.packing.component import Component
from assoc.packing.cover import Cover
from assoc.packing.kernels.columns import first_row, fits
from assoc.packing.local_search import LocalSearch
from assoc.packing.neighbourhoods.insertion import insert, insertion_gain
from assoc.packing.packing import PackingArrays

if TYPE_CHECKING:
    from assoc.solvers.tabu.parameters import TabuParameters


# every third restart is from a new solution, the others are from the best
_FRESH = 3
# number of new solutions, of which the best is used
_COVERS = 12
# how many of them come from elsewhere (`LocalSearch.escape`), where they can
_ESCAPES = 3


class TabuSearch:
    """The current solution of one component and its tabu list."""

    def __init__(self, component: Component, parameters: TabuParameters) -> None:
        self.parameters = parameters
        self.until = np.zeros(component.packing.num_columns, dtype=np.int64)
        self.clock = 1
        self.restarts = 0
        self.escapes = 0
        self.owner: NDArray[np.int32] | None = None if component.best is None else component.best.copy()

    def iterate(self, search: LocalSearch) -> None:
        """Do some moves, then exact sub-steps on the best solution found."""
        p, component, rng = self.parameters, search.component, search.run.rng
        forced = -1
        if self.owner is None:
            self.owner = self._afresh(search)
        elif component.best is not None and component.stalled and component.stalled % p.restart == 0:
            self.restarts += 1
            self.until[:] = 0
            if self.restarts % _FRESH == 0:
                # far from the best solution: regions that no chain of moves from it reaches
                self.owner = self._afresh(search)
            else:
                self.owner = component.best.copy()
                forced = self._force(component, rng)
        if search.escapes:
            self.escapes += 1
            search.settle(search.escape(self.escapes))
        best = self.owner.copy()
        rules = (self.clock, p.moves, p.tenure, forced)
        self.clock = _moves(search.arrays, self.owner, best, self.until, rules, rng, search.deadline)
        weight = search.improve(best, exactly=False)
        component.offer(best, weight)
        if component.is_complete(best):
            weight = search.search_clusters(best, weight, p.clusters)
            if component.offer(best, weight):
                self.owner = best

    def _afresh(self, search: LocalSearch) -> NDArray[np.int32]:
        """Return the best of some new covers, from elsewhere or random greedy ones, each improved exactly."""
        component = search.component
        best, least = component.best, np.inf
        escapes = search.escapes
        for number in range(_ESCAPES if escapes else _COVERS):
            self.escapes += 1
            owner = search.escape(self.escapes) if escapes else search.random_cover(2.0 ** (number % 6))
            weight = search.settle(owner)
            if weight < least and component.is_complete(owner):
                best, least = owner, weight
            if search.over:
                break
        return Cover.empty(component.packing).owner if best is None else best.copy()

    def _force(self, component: Component, rng: np.random.Generator) -> int:
        """Return a column to insert and hold, on a row that costs much more than its multiplier allows.

        The current solution exceeds the bound by the sum of the reduced costs of its columns and of -u over its
        uncovered rows: where a term is large, a better solution is near.
        """
        assert self.owner is not None
        packing, owner = component.packing, self.owner
        excess = np.where(owner >= 0, component.reduced[owner], -component.duals) + 1e-3 * component.temperature
        excess = np.maximum(excess, 0.0)
        total = excess.sum()
        if total == 0.0:
            # large multipliers that cancel each other: rounding hides what a row costs more
            return -1
        row = int(rng.choice(excess.size, p=excess / total))
        columns = packing.row_cols[packing.row_ptr[row] : packing.row_ptr[row + 1]]
        columns = columns[columns != owner[row]]
        if columns.size == 0:
            return -1
        reduced = component.reduced[columns]
        likely = np.exp(-(reduced - reduced.min()) / component.temperature)
        return int(rng.choice(columns, p=likely / likely.sum()))


@inner_njit
def _best_insertion(
    cols: Ints, owner: Ints, gain: Floats, until: Ints, clock: int, weights: tuple[float, float], held: int
) -> int:
    """The column of least gain that is not chosen, keeps the held one, and is not tabu (or a record); -1 if none is.

    ``weights`` are those of the present solution and of the record, relative to the first.
    """
    current, record = weights
    least, chosen = np.inf, -1
    for j in range(gain.size):
        if gain[j] < least and (until[j] < clock or current + gain[j] < record - 1e-9):
            inside = owner[first_row(cols, j)] == j
            for s in range(cols.shape[1]):
                if held >= 0 and cols[j, s] >= 0 and owner[cols[j, s]] == held:
                    inside = True
            if not inside:
                least, chosen = gain[j], j
    return chosen


@inner_njit
def _owners_of(cols: Ints, owner: Ints, j: int, found: Ints) -> int:
    """List the chosen columns that share a row with column j; returns their number."""
    count = 0
    for s in range(cols.shape[1]):
        r = cols[j, s]
        if r >= 0 and owner[r] >= 0:
            seen = False
            for i in range(count):
                seen = seen or found[i] == owner[r]
            if not seen:
                found[count] = owner[r]
                count += 1
    return count


@njit
def _moves(
    packing: PackingArrays,
    owner: NDArray[np.int32],
    best: NDArray[np.int32],
    until: NDArray[np.int64],
    rules: tuple[int, int, int, int],
    rng: Any,
    deadline: float,
) -> int:
    """Do moves: ``owner`` becomes the last solution, ``best`` the best one; returns the number of moves done so far.

    The rules are the moves done before, moves to do, the tenure, and a column that is inserted first (-1: none) and
    held for a third of the moves.
    """
    cols, weights, row_ptr, row_cols = packing.cols, packing.weights, packing.row_ptr, packing.row_cols
    clock, moves, tenure, forced = rules
    num, num_sensors = cols.shape
    gain = np.empty(num)
    for j in range(num):
        gain[j] = insertion_gain(cols, weights, owner, j)
    changed = np.empty(4 * num_sensors * (num_sensors + 1), np.int32)
    ejected = np.empty(num_sensors, np.int32)
    current = 0.0
    record = 0.0
    timed = deadline < np.inf
    for move in range(moves):
        if timed and now() > deadline:
            break
        clock += 1
        held = forced if 3 * move < moves else -1
        chosen = forced
        if move > 0 or forced < 0:
            chosen = _best_insertion(cols, owner, gain, until, clock, (current, record), held)
        if chosen < 0:
            # everything is tabu: insert a random column
            chosen = rng.integers(0, num)
            if owner[first_row(cols, chosen)] == chosen or chosen == held:
                continue
        current += gain[chosen]
        for i in range(_owners_of(cols, owner, chosen, ejected)):
            until[ejected[i]] = clock + tenure + rng.integers(0, tenure + 1)
        num_changed = insert(cols, owner, chosen, changed, 0)
        # cover rows left open by the best column that fits
        last = num_changed
        for i in range(last):
            r = changed[i]
            if owner[r] >= 0:
                continue
            fill, most = -1, -1e-12
            for k in range(row_ptr[r], row_ptr[r + 1]):
                j = row_cols[k]
                if weights[j] < most and until[j] < clock and fits(cols, owner, j):
                    fill, most = j, weights[j]
            if fill >= 0 and num_changed + num_sensors <= changed.size:
                current += weights[fill]
                num_changed = insert(cols, owner, fill, changed, num_changed)
        for i in range(num_changed):
            r = changed[i]
            for k in range(row_ptr[r], row_ptr[r + 1]):
                gain[row_cols[k]] = insertion_gain(cols, weights, owner, row_cols[k])
        if current < record - 1e-9:
            record = current
            copy_to(best, owner)
    return clock
