"""Dimensionwise search: split the sensors into two parts and re-match the halves of all tuples, exactly.

Every chosen tuple splits into two halves, one for each part of the sensors; an uncovered measurement is also a half.
The cheapest pairing of halves is a two-dimensional assignment over the listed tuples (kernels/matching.py). An
unmatched half becomes a tuple, if that is listed, or false alarms. The search repeats all splits (one sensor against
the others for S = 3, all 2^(S-1) - 1 bipartitions for S up to 6) until none improves.

References
----------
D. Karapetyan and G. Gutin, "Local search heuristics for the multidimensional assignment problem", Journal
of Heuristics 17, 201-249 (2011).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import now
from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Ints
from assoc.packing.kernels.columns import choose_matched, sum_of_weights
from assoc.packing.kernels.matching import match_sparse
from assoc.packing.packing import Packing, PackingArrays

_MOST_SPLITS_FOR = 6


def improve_dimensionwise(packing: Packing, owner: NDArray[np.int32], deadline: float = np.inf) -> float:
    """Re-match halves until no split improves; return the change of weight (<= 0).

    ``owner`` (R,) is the chosen column of each row, or -1, every row without slack covered; changed in place. No split
    is begun after the deadline (clock.py).
    """
    return float(_improve(packing.arrays, owner, splits(packing.cols.shape[1]), deadline))


def splits(num_sensors: int) -> NDArray[np.int64]:
    """Return the bipartitions of the sensors as bit sets: all for up to 6 sensors, else one against the others."""
    if num_sensors <= _MOST_SPLITS_FOR:
        # a set and its complement are the same split
        return np.arange(1, max(1 << (num_sensors - 1), 2), dtype=np.int64)
    return np.left_shift(np.int64(1), np.arange(num_sensors, dtype=np.int64))


@njit
def _improve(packing: PackingArrays, owner: Ints, masks: Ints, deadline: float) -> float:
    """Re-match by one split after the other; return the change of weight."""
    cols, slack, row_ptr, row_cols = packing.cols, packing.slack, packing.row_ptr, packing.row_cols
    num_sensors = cols.shape[1]
    sensor = np.zeros(owner.size, np.int64)
    for r in range(owner.size):
        if row_ptr[r] < row_ptr[r + 1]:
            for s in range(num_sensors):
                if cols[row_cols[row_ptr[r]], s] == r:
                    sensor[r] = s
    # halves that must be matched should be the rows of the assignment
    must = 0
    for r in range(owner.size):
        if not slack[r]:
            must |= 1 << sensor[r]
    everything = (1 << num_sensors) - 1
    total = 0.0
    quiet, at = 0, 0
    timed = deadline < np.inf
    while quiet < masks.size and not (timed and now() > deadline):
        mask = masks[at]
        if must & mask == 0:
            mask = everything & ~mask
        change = _rematch(packing, owner, sensor, mask)
        total += change
        quiet = 1 if change < 0.0 else quiet + 1
        at = (at + 1) % masks.size
    return total


@inner_njit
def _halves(cols: Ints, owner: Ints, sensor: Ints, mask: int, side: int, half: Ints, size: Ints, first: Ints) -> int:
    """Number the halves on one side (1: sensors in ``mask``): each row's half, sizes, and a row of each."""
    count = 0
    num_sensors = cols.shape[1]
    for r in range(owner.size):
        if (mask >> sensor[r]) & 1 != side:
            continue
        k = owner[r]
        if k < 0:
            half[r] = count
            size[count] = 1
            first[count] = r
            count += 1
            continue
        leader = True
        members = 0
        for s in range(num_sensors):
            q = cols[k, s]
            if q >= 0 and (mask >> s) & 1 == side:
                members += 1
                if q < r:
                    leader = False
        if leader:
            for s in range(num_sensors):
                q = cols[k, s]
                if q >= 0 and (mask >> s) & 1 == side:
                    half[q] = count
            size[count] = members
            first[count] = r
            count += 1
    return count


@inner_njit
def _match_of(cols: Ints, j: int, mask: int, side: int, half: Ints, size: Ints) -> int:
    """The half that is column j's part on a side; -1 if it has no rows there, -2 if its part is not one whole half."""
    found = -1
    members = 0
    whole = True
    # a single return: with several, numba counts array references at each call, which takes longer than the rest
    for s in range(cols.shape[1]):
        q = cols[j, s]
        if q >= 0 and (mask >> s) & 1 == side:
            whole = whole and (found < 0 or half[q] == found)
            found = half[q]
            members += 1
    if not whole or (found >= 0 and members != size[found]):
        found = -2
    return found


@inner_njit
def _rematch(packing: PackingArrays, owner: Ints, sensor: Ints, mask: int) -> float:
    """Re-match the halves of one split; return the change of weight (0: nothing better)."""
    cols, weights, slack = packing.cols, packing.weights, packing.slack
    row_ptr, row_cols = packing.row_ptr, packing.row_cols
    num_rows = owner.size
    half = np.empty(num_rows, np.int64)
    left_size, left_first = np.empty(num_rows, np.int64), np.empty(num_rows, np.int64)
    right_size, right_first = np.empty(num_rows, np.int64), np.empty(num_rows, np.int64)
    num_left = _halves(cols, owner, sensor, mask, 1, half, left_size, left_first)
    num_right = _halves(cols, owner, sensor, mask, 0, half, right_size, right_first)
    left_alone, left_column = np.zeros(num_left), np.full(num_left, -1, np.int64)
    right_alone, right_column = np.zeros(num_right), np.full(num_right, -1, np.int64)
    left_must = 0
    for r in range(num_rows):
        if not slack[r]:
            if (mask >> sensor[r]) & 1:
                left_alone[half[r]] = np.inf
            else:
                right_alone[half[r]] = np.inf
    for q in range(num_right):
        if right_size[q] > 1:
            r = right_first[q]
            for k in range(row_ptr[r], row_ptr[r + 1]):
                j = row_cols[k]
                if (
                    weights[j] < right_alone[q]
                    and _match_of(cols, j, mask, 1, half, left_size) == -1
                    and _match_of(cols, j, mask, 0, half, right_size) == q
                ):
                    right_alone[q] = weights[j]
                    right_column[q] = j
    indptr = np.empty(num_left + 1, np.int64)
    capacity = 16
    for p in range(num_left):
        capacity += row_ptr[left_first[p] + 1] - row_ptr[left_first[p]]
        left_must += left_alone[p] == np.inf
    indices, column = np.empty(capacity, np.int64), np.empty(capacity, np.int64)
    costs = np.empty(capacity)
    count = 0
    for p in range(num_left):
        indptr[p] = count
        r = left_first[p]
        for k in range(row_ptr[r], row_ptr[r + 1]):
            j = row_cols[k]
            if _match_of(cols, j, mask, 1, half, left_size) != p:
                continue
            q = _match_of(cols, j, mask, 0, half, right_size)
            if q >= 0:
                indices[count] = q
                column[count] = j
                costs[count] = weights[j]
                count += 1
            elif q == -1 and weights[j] < left_alone[p]:
                left_alone[p] = weights[j]
                left_column[p] = j
    indptr[num_left] = count
    price = right_alone.copy()
    if left_must == num_left and num_left == num_right:
        # all on the left must be matched, so that all on the right will be
        for q in range(num_right):
            price[q] = 0.0
    before = sum_of_weights(cols, weights, owner)
    row_edge = np.empty(num_left, np.int64)
    u, v = np.empty(num_left), np.empty(num_right)
    after = match_sparse(indptr, indices[:count], costs[:count], left_alone, price, row_edge, u, v)
    if not after < before - 1e-9 * max(1.0, abs(before)):
        return 0.0
    previous = owner.copy()
    owner[:] = -1
    choose_matched(cols, row_edge, (indices, column), (left_column, right_column), owner)
    # summed as before: else rounding of costs that cancel could look like an improvement again and again
    change = sum_of_weights(cols, weights, owner) - before
    if change < 0.0:
        return change
    copy_to(owner, previous)
    return 0.0
