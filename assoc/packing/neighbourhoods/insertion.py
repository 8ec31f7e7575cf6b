"""Insertion with ejection: the local search that all heuristic solvers share.

A cover is stored as the owner of each row: the chosen column that uses it, or -1. Inserting a column ejects
the owners of its rows; other columns can then use their other rows. Changed rows are tried again until nothing
improves.

Without dummies some rows must be covered. A penalty larger than any sum of weights is then subtracted from each
column for every such row, so that covering comes before cost.
"""

from __future__ import annotations

import numpy as np

from assoc._system.clock import is_over
from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats, Ints
from assoc.packing.kernels.columns import choose
from assoc.packing.packing import Packing, PackingArrays

# columns tried between two checks of the clock: about a millisecond
_LOOK = 50_000


def search_arrays(packing: Packing) -> PackingArrays:
    """Return the packing with weights for searches: penalised ones if rows must be covered."""
    arrays = packing.arrays
    return arrays._replace(weights=penalised(arrays)) if packing.is_axial else arrays


@njit
def penalised(packing: PackingArrays) -> Floats:
    """Weights less a penalty for every row without slack that a column covers."""
    cols, weights, slack = packing.cols, packing.weights, packing.slack
    widest = 0.0
    for weight in weights:
        widest = max(widest, abs(weight))
    penalty = 2.0 * widest * cols.shape[1] + 1.0
    result = weights.copy()
    for j in range(result.size):
        for s in range(cols.shape[1]):
            if cols[j, s] >= 0 and not slack[cols[j, s]]:
                result[j] -= penalty
    return result


@njit
def add_greedily(packing: PackingArrays, order: Ints, owner: Ints) -> None:
    """Add columns in the given order while they fit; columns of rows that all have slack only at negative weight."""
    cols, weights, slack = packing.cols, packing.weights, packing.slack
    num_sensors = cols.shape[1]
    for j in order:
        fits = True
        duty = False
        for s in range(num_sensors):
            r = cols[j, s]
            if r >= 0:
                if owner[r] >= 0:
                    fits = False
                    break
                duty = duty or not slack[r]
        if fits and (weights[j] < 0.0 or duty):
            choose(cols, j, owner)


@inner_njit
def insertion_gain(cols: Ints, weights: Floats, owner: Ints, j: int) -> float:
    """Weight of column j less that of the columns it would eject; negative is good."""
    num_sensors = cols.shape[1]
    change = weights[j]
    for s in range(num_sensors):
        r = cols[j, s]
        if r >= 0 and owner[r] >= 0:
            k = owner[r]
            counted = False
            for q in range(s):
                if cols[j, q] >= 0 and owner[cols[j, q]] == k:
                    counted = True
                    break
            if not counted:
                change -= weights[k]
    return change


@inner_njit
def insert(cols: Ints, owner: Ints, j: int, changed: Ints, num_changed: int) -> int:
    """Eject the owners of column j's rows and insert it; append rows that lost their owner to ``changed``."""
    num_sensors = cols.shape[1]
    for s in range(num_sensors):
        r = cols[j, s]
        if r >= 0:
            k = owner[r]
            if k >= 0 and k != j:
                for q in range(num_sensors):
                    if cols[k, q] >= 0:
                        owner[cols[k, q]] = -1
                        changed[num_changed] = cols[k, q]
                        num_changed += 1
    for s in range(num_sensors):
        if cols[j, s] >= 0:
            owner[cols[j, s]] = j
            changed[num_changed] = cols[j, s]
            num_changed += 1
    return num_changed


@njit
def insert_and_eject(packing: PackingArrays, owner: Ints, rows: Ints, deadline: float) -> float:
    """Insert with ejection at ``rows`` and all rows that change, until time is over; return the sum of the gains."""
    cols, weights, row_ptr, row_cols = packing.cols, packing.weights, packing.row_ptr, packing.row_cols
    num_sensors = cols.shape[1]
    queue = np.empty(owner.size, np.int32)
    waiting = np.zeros(owner.size, np.bool_)
    changed = np.empty(num_sensors * (num_sensors + 1), np.int32)
    head, count = 0, 0
    for r in rows:
        queue[count] = r
        waiting[r] = True
        count += 1
    total = 0.0
    unseen = 0
    while count > 0:
        r = queue[head]
        unseen += row_ptr[r + 1] - row_ptr[r]
        if unseen > _LOOK:
            unseen = 0
            if is_over(deadline):
                break
        head = (head + 1) % owner.size
        count -= 1
        waiting[r] = False
        best, chosen = -1e-12, -1
        for k in range(row_ptr[r], row_ptr[r + 1]):
            j = row_cols[k]
            if owner[r] == j:
                continue
            gain = insertion_gain(cols, weights, owner, j)
            if gain < best - 1e-12 * abs(weights[j]):
                best, chosen = gain, j
        if chosen >= 0:
            total += best
            num_changed = insert(cols, owner, chosen, changed, 0)
            for i in range(num_changed):
                q = changed[i]
                if not waiting[q]:
                    waiting[q] = True
                    queue[(head + count) % owner.size] = q
                    count += 1
    return total
