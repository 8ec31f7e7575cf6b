"""Moves of the tabu search: forced insertion with ejection, tenure, aspiration.

The gain of every column is kept up to date: it changes only for columns on rows that changed. A move inserts
the column of least gain that is not tabu; what it ejects may not return for ``tenure`` moves, unless it
would lead to a solution better than the best (aspiration). Rows that a move leaves open are filled at once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assoc._compiled import njit
from assoc.solvers.local_search import Cover, insert, insertion_gain, penalised
from assoc.solvers.metaheuristic import Part

if TYPE_CHECKING:
    from assoc.solvers.tabu import TabuParameters

Floats = NDArray[np.float64]


class TabuSearch:
    """The current solution of one part and its tabu list."""

    def __init__(self, part: Part, parameters: TabuParameters) -> None:
        self.parameters = parameters
        self.weights = penalised(part.packing) if part.packing.is_axial else part.packing.weights
        self.until = np.zeros(part.packing.num_columns, dtype=np.int64)
        self.clock = 1
        self.owner: NDArray[np.int32] | None = None if part.best is None else part.best.copy()

    def iterate(self, part: Part, rng: np.random.Generator) -> None:
        """Some moves, then exact sub-steps on the best solution they met."""
        packing, p = part.packing, self.parameters
        if self.owner is None:
            self.owner = part.best.copy() if part.best is not None else Cover.empty(packing).owner
        elif part.best is not None and part.stalled and part.stalled % p.restart == 0:
            self.owner = part.best.copy()
            self.until[:] = 0
        best = self.owner.copy()
        self.clock = _moves(
            packing.cols,
            self.weights,
            packing.row_ptr,
            packing.row_cols,
            part.reduced,
            self.owner,
            best,
            self.until,
            self.clock,
            p.moves,
            p.tenure,
            part.temperature,
            rng,
        )
        weight = part.polish(best)
        part.offer(best, weight)
        if p.clusters and not part.closed:
            weight += part.improve(best, rng, p.clusters)
            if part.offer(best, weight):
                self.owner = best


@njit
def _moves(
    cols: Any,
    weights: Floats,
    row_ptr: Any,
    row_cols: Any,
    reduced: Floats,
    owner: Any,
    best: Any,
    until: Any,
    clock: int,
    moves: int,
    tenure: int,
    temperature: float,
    rng: Any,
) -> int:
    """Move; ``owner`` becomes the last solution, ``best`` the best one met; the clock after that."""
    num, num_sensors = cols.shape
    gain = np.empty(num)
    for j in range(num):
        gain[j] = insertion_gain(cols, weights, owner, j)
    changed = np.empty(4 * num_sensors * (num_sensors + 1), np.int32)
    ejected = np.empty(num_sensors, np.int32)
    current = 0.0
    record = 0.0
    for _ in range(moves):
        clock += 1
        chosen = -1
        least = np.inf
        for j in range(num):
            if gain[j] < least and (until[j] < clock or current + gain[j] < record - 1e-9):
                inside = False
                for s in range(num_sensors):
                    if cols[j, s] >= 0:
                        inside = owner[cols[j, s]] == j
                        break
                if not inside:
                    least = gain[j]
                    chosen = j
        if chosen < 0:
            # everything is tabu: a random column is forced in
            chosen = rng.integers(0, num)
            if owner[_first(cols, chosen)] == chosen:
                continue
        current += gain[chosen]
        count = 0
        for s in range(num_sensors):
            r = cols[chosen, s]
            if r >= 0 and owner[r] >= 0:
                seen = False
                for i in range(count):
                    seen = seen or ejected[i] == owner[r]
                if not seen:
                    ejected[count] = owner[r]
                    count += 1
        for i in range(count):
            until[ejected[i]] = clock + tenure + rng.integers(0, tenure + 1)
        num_changed = insert(cols, owner, chosen, changed, 0)
        # rows left open take the best column that is free for them
        last = num_changed
        for i in range(last):
            r = changed[i]
            if owner[r] >= 0:
                continue
            fill, most = -1, -1e-12
            for k in range(row_ptr[r], row_ptr[r + 1]):
                j = row_cols[k]
                if weights[j] < most and until[j] < clock and _free(cols, owner, j):
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
            best[:] = owner
    return clock


@njit
def _first(cols: Any, j: int) -> int:
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0:
            return cols[j, s]
    return 0


@njit
def _free(cols: Any, owner: Any, j: int) -> bool:
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0 and owner[cols[j, s]] >= 0:
            return False
    return True
