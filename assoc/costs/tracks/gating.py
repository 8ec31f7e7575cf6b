"""Coarse gates of tracks and measurements: strips of one component, sorted by another, then boxes."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from assoc._system.compiled import for_kernels, inner_njit, lean_inner_njit, njit
from assoc._system.kernels.sorting import order_of, sort_part
from assoc._types import Array
from assoc.errors import LimitExceededError
from assoc.filters.base import Expected

MOST_PAIRS = 20_000_000
"""Most pairs of tracks and measurements; more occur only with useless predictions."""


def near_pairs(expected: Expected, measurements: Array, periods: tuple[float, ...], gate: float) -> tuple[Array, Array]:
    """Pairs of tracks and measurements that may pass a chi-square gate: all that pass, and some more.

    ``expected`` are (B, d) and (B, d, d), measurements (M, d), the gate a squared Mahalanobis distance, ``periods``
    those of `assoc.filters.measurement.periods_of`. Returns tracks and measurements, int (K,), ordered by both.
    LimitExceededError for more than `MOST_PAIRS`.
    """
    h, z = expected.mean, measurements
    if not len(h) or not len(z):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    arrays = h, for_kernels(expected.covariance), for_kernels(z), _turning(periods)
    tracks, found, _ = _sweep(*arrays, gate, MOST_PAIRS)
    if len(tracks) > MOST_PAIRS:
        # ordered by track: extrapolated to those left
        expected_pairs = len(tracks) * len(h) / (int(tracks[-1]) + 1)
        raise LimitExceededError(
            f"about {expected_pairs:.3g} pairs of {len(h)} tracks and {len(z)} measurements in their gates, at most "
            f"{MOST_PAIRS} are allowed; lower gate_probability, or end uncertain tracks sooner"
        )
    return tracks, found


@lru_cache(maxsize=64)
def _turning(periods: tuple[float, ...]) -> Array:
    return np.array(periods, dtype=np.float64)


@njit
def _sweep(h: Array, covariance: Array, z: Array, turning: Array, gate: float, most: int) -> tuple[Array, Array, int]:
    """Pairs whose components are all within reach, sorted by track; at most one more than ``most``.

    The last number says how many pairs were looked at.
    """
    num = h.shape[0]
    reach = _reach(covariance, gate)
    axis = _axis(reach, z, turning, -1)
    across = _axis(reach, z, turning, axis) if axis >= 0 else -1
    # strips across one axis, in each of them sorted along the other: along a single one, windows of a growing area
    # hold ever more that is out of reach
    begin, width, strips = _strips(reach, z, across)
    order, first = _in_strips(z, axis, across, begin, width, strips)
    along = z[order, max(axis, 0)]
    tracks = np.empty(64 + 8 * num, np.int64)
    found = np.empty(tracks.size, np.int64)
    count = looked = 0
    for t in range(num):
        before = count
        low, high = 0, 0
        if across >= 0:
            low = _strip(h[t, across] - reach[t, across], begin, width, strips)
            high = _strip(h[t, across] + reach[t, across], begin, width, strips)
        for strip in range(low, high + 1):
            start, end = first[strip], first[strip + 1]
            if axis >= 0:
                start = _first(along, h[t, axis] - reach[t, axis], start, end)
                farthest = h[t, axis] + reach[t, axis]
                stop = start
                while stop < end and along[stop] <= farthest:
                    stop += 1
                end = stop
            looked += max(end - start, 0)
            for k in range(start, end):
                if _inside(h, t, z, order[k], reach, turning):
                    if count == tracks.size:
                        tracks, found = _doubled(tracks), _doubled(found)
                    tracks[count] = t
                    found[count] = order[k]
                    count += 1
                    if count > most:
                        return tracks[:count].copy(), found[:count].copy(), looked
        sort_part(found, before, count)
    return tracks[:count].copy(), found[:count].copy(), looked


@lean_inner_njit
def _first(along: Array, least: float, begin: int, end: int) -> int:
    """The first index of a sorted array's part begin .. end - 1 whose number is at least `least`; else end."""
    while begin < end:
        middle = (begin + end) // 2
        if along[middle] < least:
            begin = middle + 1
        else:
            end = middle
    return begin


@lean_inner_njit
def _ends(z: Array, i: int) -> tuple[float, float]:
    """The least and the largest number of a column."""
    least, most = z[0, i], z[0, i]
    for m in range(1, len(z)):
        least, most = min(least, z[m, i]), max(most, z[m, i])
    return least, most


@inner_njit
def _strips(reach: Array, z: Array, across: int) -> tuple[float, float, int]:
    """Where strips begin, how wide they are (a usual gate), and how many there are."""
    if across < 0:
        return 0.0, 1.0, 1
    begin, end = _ends(z, across)
    total = 0.0
    for t in range(len(reach)):
        total += reach[t, across]
    # gates wider than usual pass through many strips: no more of them than there are measurements
    width = max(2.0 * total / len(reach), (end - begin) / len(z), 1e-300)
    return begin, width, max(1, min(len(z), int((end - begin) / width) + 1))


@inner_njit
def _strip(x: float, begin: float, width: float, strips: int) -> int:
    """The strip of a place, or the nearest one."""
    at = (x - begin) / width
    if not at > 0.0:
        return 0
    return int(at) if at < strips - 1 else strips - 1


@inner_njit
def _in_strips(z: Array, axis: int, across: int, begin: float, width: float, strips: int) -> tuple[Array, Array]:
    """Measurements strip by strip, each sorted along the axis, and where strips begin in this order."""
    order = order_of(z[:, axis]) if axis >= 0 else np.arange(z.shape[0])
    first = np.zeros(strips + 1, np.int64)
    if across < 0:
        first[1] = order.size
        return order, first
    for m in range(order.size):
        first[_strip(z[m, across], begin, width, strips) + 1] += 1
    for strip in range(strips):
        first[strip + 1] += first[strip]
    place, sorted_order = first.copy(), np.empty(order.size, np.int64)
    for k in range(order.size):
        strip = _strip(z[order[k], across], begin, width, strips)
        sorted_order[place[strip]] = order[k]
        place[strip] += 1
    return sorted_order, first


@inner_njit
def _axis(reach: Array, z: Array, turning: Array, other: int) -> int:
    """The component, not the other, in which a gate is the smallest share of all measurements; -1: all are angles."""
    axis, widest = -1, 0.0
    for i in range(z.shape[1]):
        if turning[i] == 0.0 and i != other:
            total = 0.0
            for t in range(len(reach)):
                total += reach[t, i]
            least, most = _ends(z, i)
            share = (most - least) / max(total / len(reach), 1e-300)
            if share > widest:
                axis, widest = i, share
    return axis


@inner_njit
def _doubled(array: Array) -> Array:
    larger = np.empty(2 * array.size, np.int64)
    for i in range(array.size):
        larger[i] = array[i]
    return larger


class Near(NamedTuple):
    """Measurements near each track: those of track t are ``found[first[t]:first[t + 1]]``, ascending."""

    first: Array
    found: Array


def near_both(
    expected: Expected,
    track: Array,
    near: Near,
    measurements: Array,
    periods: tuple[float, ...],
    gate: float,
    most: int,
) -> tuple[Array, Array]:
    """Pairs of partial tuples and measurements that may pass a chi-square gate; at most one more than ``most``.

    ``expected`` is as for `near_pairs`, of each of B partial tuples, whose tracks are ``track`` (B,); only measurements
    that are ``near`` the track are tried. Returns tuples and measurements, int (K,), ordered by both.
    """
    arrays = track, near.first, near.found, for_kernels(measurements), _turning(periods)
    return _near_both((expected.mean, _reach(expected.covariance, gate)), *arrays, most)


@njit
def _reach(covariance: Array, gate: float) -> Array:
    """The largest residuals within a gate: ``|v_i| <= sqrt(gate S_ii)``, (B, d)."""
    num, dim = covariance.shape[:2]
    reach = np.empty((num, dim))
    for t in range(num):
        for i in range(dim):
            reach[t, i] = math.sqrt(gate * covariance[t, i, i]) * (1.0 + 1e-9)
    return reach


@lean_inner_njit
def _inside(h: Array, t: int, z: Array, m: int, reach: Array, turning: Array) -> bool:
    """Whether no residual of measurement m from row t is larger than its reach."""
    # by numbers of rows: numba counts references for each view of a row, which takes longer than the comparisons
    for i in range(turning.size):
        off = abs(z[m, i] - h[t, i])
        if turning[i] > 0.0:
            off %= turning[i]
            off = min(off, turning[i] - off)
        if not off <= reach[t, i]:
            return False
    return True


@njit
def _near_both(
    boxes: tuple[Array, Array], track: Array, first: Array, near: Array, z: Array, turning: Array, most: int
) -> tuple[Array, Array]:
    """The kernel of `near_both`; ``boxes`` are centres and reaches."""
    h, reach = boxes
    rows = np.empty(64 + 2 * track.size, np.int64)
    found = np.empty(rows.size, np.int64)
    count = 0
    for row in range(track.size):
        for k in range(first[track[row]], first[track[row] + 1]):
            if _inside(h, row, z, near[k], reach, turning):
                if count == rows.size:
                    rows, found = _doubled(rows), _doubled(found)
                rows[count], found[count] = row, near[k]
                count += 1
                if count > most:
                    return rows[:count].copy(), found[:count].copy()
    return rows[:count].copy(), found[:count].copy()
