"""Coarse gates of tracks and measurements: sorted by one component, then boxes."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from assoc._system.compiled import inner_njit, njit
from assoc._types import Array
from assoc.errors import LimitExceededError
from assoc.filters.base import Expected
from assoc.filters.measurement import Measurement

MOST_PAIRS = 20_000_000
"""Most pairs of tracks and measurements; more occur only with useless predictions."""

_TURN = 2.0 * math.pi


def near_pairs(expected: Expected, measurements: Array, angular: tuple[bool, ...], gate: float) -> tuple[Array, Array]:
    """Pairs of tracks and measurements that may pass a chi-square gate: all that pass, and some more.

    ``expected`` are (B, d) and (B, d, d), measurements (M, d), the gate a squared Mahalanobis distance. Returns tracks
    and measurements, int (K,), ordered by both. LimitExceededError for more than `MOST_PAIRS`.
    """
    h, z = expected.mean, measurements
    if not len(h) or not len(z):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    # not compiled once more for arrays that are read only, as those of scenes are, or a part of larger ones
    covariance, z = (np.require(one, requirements=("C", "W")) for one in (expected.covariance, z))
    tracks, found = _sweep(h, covariance, z, _turning(angular), gate, MOST_PAIRS)
    if len(tracks) > MOST_PAIRS:
        # ordered by track: extrapolated to those left
        expected_pairs = len(tracks) * len(h) / (int(tracks[-1]) + 1)
        raise LimitExceededError(
            f"about {expected_pairs:.3g} pairs of {len(h)} tracks and {len(z)} measurements in their gates, at most "
            f"{MOST_PAIRS} are allowed; lower gate_probability, or end uncertain tracks sooner"
        )
    return tracks, found


@lru_cache(maxsize=64)
def _turning(angular: tuple[bool, ...]) -> Array:
    return np.array(angular, dtype=np.bool_)


@njit
def _sweep(h: Array, covariance: Array, z: Array, turning: Array, gate: float, most: int) -> tuple[Array, Array]:
    """Pairs whose components are all within reach, sorted by track; at most one more than ``most``."""
    num = h.shape[0]
    reach = _reach(covariance, gate)
    axis = _axis(reach, z, turning)
    low, high = np.zeros(num, np.int64), np.full(num, z.shape[0], np.int64)
    most_within = num * z.shape[0]
    order = np.arange(z.shape[0])
    if axis >= 0:
        order = np.argsort(z[:, axis], kind="mergesort")
        along = z[order, axis]
        most_within = 0
        for t in range(num):
            low[t] = np.searchsorted(along, h[t, axis] - reach[t, axis], side="left")
            high[t] = np.searchsorted(along, h[t, axis] + reach[t, axis], side="right")
            most_within += high[t] - low[t]
    # in a wide gate there are many more than are within reach
    tracks = np.empty(min(most_within, 64 + 8 * num), np.int64)
    found = np.empty(tracks.size, np.int64)
    count = 0
    for t in range(num):
        first = count
        for k in range(low[t], high[t]):
            if _inside(h[t], z[order[k]], reach[t], turning):
                if count == tracks.size:
                    tracks, found = _doubled(tracks), _doubled(found)
                tracks[count] = t
                found[count] = order[k]
                count += 1
                if count > most:
                    return tracks[:count].copy(), found[:count].copy()
        # number by number: assigning the slice would compile an error message about lengths
        ordered = np.sort(found[first:count])
        for k in range(ordered.size):
            found[first + k] = ordered[k]
    return tracks[:count].copy(), found[:count].copy()


@inner_njit
def _axis(reach: Array, z: Array, turning: Array) -> int:
    """The component in which a gate is the smallest share of all measurements; -1: all are angles, without order."""
    axis, widest = -1, 0.0
    for i in range(z.shape[1]):
        if not turning[i]:
            total = 0.0
            for t in range(len(reach)):
                total += reach[t, i]
            share = (z[:, i].max() - z[:, i].min()) / max(total / len(reach), 1e-300)
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
    angular: tuple[bool, ...],
    gate: float,
    most: int,
) -> tuple[Array, Array]:
    """Pairs of partial tuples and measurements that may pass a chi-square gate; at most one more than ``most``.

    ``expected`` is as for `near_pairs`, of each of B partial tuples, whose tracks are ``track`` (B,); only measurements
    that are ``near`` the track are tried. Returns tuples and measurements, int (K,), ordered by both.
    """
    arrays = track, near.first, near.found, np.require(measurements, requirements=("C", "W")), _turning(angular)
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


@inner_njit
def _inside(h: Array, z: Array, reach: Array, turning: Array) -> bool:
    """Whether no residual is larger than its reach."""
    for i in range(h.size):
        off = abs(z[i] - h[i])
        if turning[i]:
            off %= _TURN
            off = min(off, _TURN - off)
        if not off <= reach[i]:
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
    axis = _axis(reach, z, turning) if track.size and len(z) else -1
    order, along = near, np.empty(0)
    if axis >= 0:
        # those near a track in their order along the axis: the gate of a tuple is far narrower than the track's
        order = near.copy()
        for t in range(len(first) - 1):
            part = near[first[t] : first[t + 1]]
            order[first[t] : first[t + 1]] = part[np.argsort(z[part, axis], kind="mergesort")]
        along = z[order, axis]
    for row in range(track.size):
        low, high = first[track[row]], first[track[row] + 1]
        if axis >= 0:
            start, part = low, along[low:high]
            low = start + np.searchsorted(part, h[row, axis] - reach[row, axis], side="left")
            high = start + np.searchsorted(part, h[row, axis] + reach[row, axis], side="right")
        begin = count
        for k in range(low, high):
            if _inside(h[row], z[order[k]], reach[row], turning):
                if count == rows.size:
                    rows, found = _doubled(rows), _doubled(found)
                rows[count], found[count] = row, order[k]
                count += 1
                if count > most:
                    return rows[:count].copy(), found[:count].copy()
        ordered = np.sort(found[begin:count])
        for k in range(ordered.size):
            found[begin + k] = ordered[k]
    return rows[:count].copy(), found[:count].copy()


def angular_components(sensor: Measurement) -> tuple[bool, ...]:
    """Which components of a measurement are angles; none for models that are not sensors."""
    return getattr(sensor, "angular", (False,) * sensor.dim)[: sensor.dim]
