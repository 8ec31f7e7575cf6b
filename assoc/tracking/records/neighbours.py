"""Which places are near others: by cells as large as what is near is far, where a tree would take longer to make."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from assoc._system.compiled import lean_inner_njit, njit
from assoc._types import Array

# cells along an axis that does not come back; those so many away, or twice, are one
_CELLS = 1 << 20
# the golden ratio of whole numbers: it spreads keys over bins
_SPREAD = -7046029254386353131


class Cells(NamedTuple):
    """Places in cells: lists of those in the same bin."""

    places: Array
    """(n, d), d at most 3."""
    around: Array
    """After how much each component comes back, 0: never; those that do are from 0 to there. (d,)."""
    side: float
    """Of a cell, at least."""
    first: Array
    """A place in each bin, or -1; as many as a power of 2."""
    following: Array
    """The next place in the bin of each, or -1; (n,)."""
    keys: Array
    """The cell of each place, (n,)."""


def cells_of(places: Array, around: Array, side: float) -> Cells:
    """Places in cells of this side."""
    return Cells(places, around, side, *_listed(places, around, side))


def near(cells: Cells, at: Array, most: int) -> tuple[Array, Array, Array]:
    """Places nearer than a side to each of those ``at``, (m, d), in no order, and no more than ``most`` of them.

    Returns their numbers and squared distances, (m, most), and how many are found, (m,).
    """
    return _near(cells, at, most)


@lean_inner_njit
def _steps(x: float, period: float, side: float, shift: int, parts: Array, row: int) -> int:
    """What the cell of a number, and those beside it, add to keys; how many they are."""
    count, here = _CELLS, int(math.floor(x / side)) & (_CELLS - 1) if period == 0.0 else 0
    if period > 0.0:
        count = min(max(int(period / side), 1), _CELLS)
        here = min(int(x / (period / count)), count - 1)
    parts[row, 0] = here << shift
    parts[row, 1] = (here + 1) % count << shift
    parts[row, 2] = (here - 1) % count << shift
    return min(count, 3)


@lean_inner_njit
def _bin(key: int, bins: int) -> int:
    return ((key * _SPREAD) >> 40) & (bins - 1)


@njit
def _listed(places: Array, around: Array, side: float) -> tuple[Array, Array, Array]:
    """The lists of `Cells`."""
    n, d = places.shape
    bins = 64
    while bins < 2 * n:
        bins *= 2
    first, following, keys = np.full(bins, -1, np.int64), np.empty(n, np.int64), np.zeros(n, np.int64)
    parts = np.empty((1, 3), np.int64)
    for k in range(n):
        for i in range(d):
            _steps(places[k, i], around[i], side, 20 * i, parts, 0)
            keys[k] += parts[0, 0]
        own = _bin(keys[k], bins)
        following[k], first[own] = first[own], k
    return first, following, keys


@lean_inner_njit
def _square(cells: Cells, k: int, at: Array, row: int) -> float:
    """Squared distance, the short way round."""
    total = 0.0
    for i in range(at.shape[1]):
        off = abs(at[row, i] - cells.places[k, i])
        if cells.around[i] > 0.0:
            off = min(off, cells.around[i] - off)
        total += off * off
    return total


@njit
def _near(cells: Cells, at: Array, most: int) -> tuple[Array, Array, Array]:
    """See `near`."""
    m, d = at.shape
    found, square, count = np.zeros((m, most), np.int64), np.zeros((m, most)), np.zeros(m, np.int64)
    parts, steps = np.zeros((3, 3), np.int64), np.ones(3, np.int64)
    for row in range(m):
        for i in range(d):
            steps[i] = _steps(at[row, i], cells.around[i], cells.side, 20 * i, parts, i)
        for x in range(steps[0]):
            for y in range(steps[1]):
                for z in range(steps[2]):
                    key = parts[0, x] + parts[1, y] + parts[2, z]
                    k = cells.first[_bin(key, cells.first.size)]
                    while k >= 0 and count[row] < most:
                        if cells.keys[k] == key:
                            apart = _square(cells, k, at, row)
                            if apart < cells.side**2:
                                found[row, count[row]], square[row, count[row]] = k, apart
                                count[row] += 1
                        k = cells.following[k]
    return found, square, count
