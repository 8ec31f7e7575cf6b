"""Pairs of measurements of two sensors that may be one target: coarse search, then the chi-square gate."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from assoc._system.compiled import inner_njit, njit
from assoc._types import Array
from assoc.costs.arrays import ScanArrays, SensorArrays
from assoc.costs.estimation import Fit
from assoc.costs.gating import Gates
from assoc.costs.limits import refuse, too_many
from assoc.sensors.codes import BEARING, POSITION

# up to so many combinations trying each is quicker than a tree
_BRUTE = 100_000
# coarse pairs are fitted in blocks of about this size, so that memory grows with the pairs kept
_BLOCK = 500_000
# strips into which an area is cut at most
_STRIPS = 10_000


class Pairs(NamedTuple):
    """Compatible pairs of measurements, ordered by first, then second."""

    first: Array
    second: Array
    """Rows of the scan's arrays; the second always belongs to a later sensor."""
    chi: Array
    """Chi-square value of each pair."""
    start: Array
    """(N, S + 1): partners of measurement n in sensor t are rows start[n, t] to start[n, t + 1]."""


@inner_njit
def _may_cross(sensors: SensorArrays, scan: ScanArrays, n: int, m: int, limit: float) -> bool:
    """Whether two bearings may meet ahead of both sensors once they are moved within the gate."""
    s, t = scan.owner[n], scan.owner[m]
    dx, dy = sensors.position[t, 0] - sensors.position[s, 0], sensors.position[t, 1] - sensors.position[s, 1]
    if dx * dx + dy * dy < 1e-12:
        return True
    turn = 2.0 * math.pi
    line = math.atan2(dy, dx)
    a, b = scan.z[n, 0] - line, scan.z[m, 0] - line
    a, b = a - turn * round(a / turn), b - turn * round(b / turn)
    if 0.0 <= a <= b or b <= a <= 0.0:
        return True
    # the bearings that meet form two triangles in (a, b) with edges a = 0, b = pi and a = b: to reach them is
    # at least as far as to the nearest of these lines
    between = a - b
    between -= turn * round(between / turn)
    p, q = sensors.covariance[s, 0, 0], sensors.covariance[t, 0, 0]
    least = min(a * a / p, min((math.pi - abs(b)) ** 2 / q, between * between / (p + q)))
    return least <= limit * (1.0 + 1e-9)


@inner_njit
def _near(sensors: SensorArrays, scan: ScanArrays, n: int, m: int, limit: float) -> bool:
    """Whether two measurements may pass a gate of `limit`; errs only towards True."""
    s, t = scan.owner[n], scan.owner[m]
    if sensors.code[s] == BEARING or sensors.code[t] == BEARING:
        if sensors.code[s] == sensors.code[t]:
            return _may_cross(sensors, scan, n, m, limit)
        if sensors.code[s] == BEARING:
            n, m, t = m, n, s
        dx, dy = scan.centre[n, 0] - sensors.position[t, 0], scan.centre[n, 1] - sensors.position[t, 1]
        ball = 2.0 * limit * (scan.spread[n, 0] + scan.spread[n, 3])
        away = dx * dx + dy * dy
        if ball >= away:
            return True
        off = scan.z[m, 0] - math.atan2(dy, dx)
        off -= 2.0 * math.pi * round(off / (2.0 * math.pi))
        return abs(off) <= math.asin(math.sqrt(ball / away)) + math.sqrt(2.0 * limit * sensors.covariance[t, 0, 0])
    tall = sensors.full[s] and sensors.full[t]
    return _overlap(scan.centre, scan.spread, n, m, _wide(sensors.code[s], sensors.code[t], limit), tall)


@inner_njit
def _overlap(centre: Array, spread: Array, n: int, m: int, limit: float, tall: bool) -> bool:
    """Whether the ellipsoids of two converted measurements, added up, hold their difference; `tall`: heights count."""
    dx, dy = centre[n, 0] - centre[m, 0], centre[n, 1] - centre[m, 1]
    c0, c1, c3 = spread[n, 0] + spread[m, 0], spread[n, 1] + spread[m, 1], spread[n, 3] + spread[m, 3]
    if dx * dx + dy * dy > limit * (c0 + c3):
        return False
    det = c0 * c3 - c1 * c1
    if det > 1e-12 * c0 * c3 and dx * dx * c3 - 2.0 * dx * dy * c1 + dy * dy * c0 > limit * det:
        return False
    if not tall:
        return True
    dz = centre[n, 2] - centre[m, 2]
    c2, c4, c5 = spread[n, 2] + spread[m, 2], spread[n, 4] + spread[m, 4], spread[n, 5] + spread[m, 5]
    if dz * dz > limit * c5:
        return False
    if not det > 1e-12 * c0 * c3:
        return True
    # condition z on x and y: the Mahalanobis distance is the sum of the two parts
    k0, k1 = (c2 * c3 - c4 * c1) / det, (c4 * c0 - c2 * c1) / det
    rest = c5 - k0 * c2 - k1 * c4
    if not rest > 1e-12 * c5:
        return True
    off = dz - k0 * dx - k1 * dy
    plane = (dx * dx * c3 - 2.0 * dx * dy * c1 + dy * dy * c0) / det
    return plane + off * off / rest <= limit * (1.0 + 1e-9)


@inner_njit
def _twice_as_long(pairs: Array) -> Array:
    longer = np.empty((2 * len(pairs), 2), np.int32)
    for k in range(len(pairs)):
        longer[k, 0], longer[k, 1] = pairs[k, 0], pairs[k, 1]
    return longer


@njit
def _near_all(sensors: SensorArrays, scan: ScanArrays, limits: Array, low: int, high: int) -> Array:
    """All near pairs whose first is in low .. high, int32 (K, 2), by looking at every combination."""
    found = np.empty((1024, 2), np.int32)
    count = 0
    total = len(scan.z)
    # out of the tuple first: a field read in the loop costs a reference count each time
    centre, spread, owner, code = scan.centre, scan.spread, scan.owner, sensors.code
    for n in range(low, high):
        s = owner[n]
        x, y, size = centre[n, 0], centre[n, 1], spread[n, 0] + spread[n, 3]
        for m in range(scan.start[s + 1], total):
            t = owner[m]
            if code[s] != BEARING and code[t] != BEARING:
                dx, dy = centre[m, 0] - x, centre[m, 1] - y
                if dx * dx + dy * dy > 2.0 * limits[s, t] * (size + spread[m, 0] + spread[m, 3]):
                    continue
            if _near(sensors, scan, n, m, limits[s, t]):
                if count == len(found):
                    found = _twice_as_long(found)
                found[count, 0], found[count, 1] = n, m
                count += 1
    return found[:count]


@njit
def _wide(code: int, other: int, limit: float) -> float:
    """The gate of two sensors' ellipsoids: for bent measurement models these are added up, not their covariances."""
    return limit if code == POSITION and other == POSITION else 2.0 * limit


@njit
def _near_within(
    sensors: SensorArrays, scan: ScanArrays, t: int, rows: Array, others: Array, first: Array, last: Array, limit: float
) -> Array:
    """The near pairs of rows of one sensor, each with its window others[first : last] of sensor t, int32 (K, 2).

    In each pair the earlier sensor's comes first.
    """
    found = np.empty((1024, 2), np.int32)
    count = 0
    # out of the tuples first: a field read in the loop costs a reference count each time
    centre, spread = scan.centre, scan.spread
    s = scan.owner[rows[0]]
    located = sensors.code[s] != BEARING and sensors.code[t] != BEARING
    tall = sensors.full[s] and sensors.full[t]
    wide = _wide(sensors.code[s], sensors.code[t], limit)
    room = (1.0 + 1e-9) * wide
    # positions of the others and their variances, in the order in which windows run through them
    beside = np.empty((len(others) if located else 0, 6))
    for e in range(len(beside)):
        m = others[e]
        for i in range(3):
            beside[e, i] = centre[m, i]
        beside[e, 3], beside[e, 4], beside[e, 5] = spread[m, 0], spread[m, 3], spread[m, 5]
    for k in range(len(rows)):
        n = rows[k]
        x, y, z = centre[n, 0], centre[n, 1], centre[n, 2]
        xx, yy, zz = spread[n, 0], spread[n, 3], spread[n, 5]
        for e in range(first[k], last[k]):
            if located:
                # coordinate by coordinate: most are ruled out by one
                dx, dy, dz = x - beside[e, 0], y - beside[e, 1], z - beside[e, 2]
                if dx * dx > room * (xx + beside[e, 3]) or dy * dy > room * (yy + beside[e, 4]):
                    continue
                if tall and dz * dz > room * (zz + beside[e, 5]):
                    continue
            m = others[e]
            low, high = min(n, m), max(n, m)
            if _overlap(centre, spread, low, high, wide, tall) if located else _near(sensors, scan, low, high, limit):
                if count == len(found):
                    found = _twice_as_long(found)
                found[count, 0], found[count, 1] = low, high
                count += 1
    return found[:count]


def coarse_pairs(
    sensors: SensorArrays, scan: ScanArrays, limits: Array, *, brute: int = _BRUTE, block: int = _BLOCK
) -> Iterator[tuple[Array, float]]:
    """Blocks of coarse pairs, each with the share of the search that is done after it.

    Up to ``brute`` combinations each is tried; ``block`` combinations are looked at for a block (more for some rows).
    """
    total = len(scan.z)
    later = total - scan.start[scan.owner + 1]
    work = np.concatenate([[0], np.cumsum(later)])
    if work[-1] <= brute or (sensors.code == BEARING).all():
        low = 0
        while low < total and work[low] < work[-1]:
            high = max(low + 1, int(np.searchsorted(work, work[low] + _BRUTE, side="right")) - 1)
            yield _near_all(sensors, scan, limits, low, high), float(work[high] / work[-1])
            low = high
        return
    done = 0.0
    for s, t in itertools.combinations(range(len(sensors.dim)), 2):
        size = float(np.diff(scan.start)[[s, t]].prod())
        for pairs, share in _between(sensors, scan, s, t, float(limits[s, t]), block):
            yield pairs, (done + share * size) / work[-1]
        done += size


class _Windows(NamedTuple):
    """For measurements of one sensor the intervals of those of another that may be near them."""

    rows: Array
    """(K,); a measurement may have several intervals."""
    others: Array
    """The other sensor's measurements, in an order in which those near each other are beside each other."""
    first: Array
    last: Array
    """others[first : last] of each row, (K,)."""


def _between(
    sensors: SensorArrays, scan: ScanArrays, s: int, t: int, limit: float, block: int
) -> Iterator[tuple[Array, float]]:
    """Blocks of the near pairs of sensors s and t, each with the share of them that is done after it."""
    if sensors.code[s] == BEARING:
        # windows are those of located measurements, where there are any
        s, t = t, s
    rows, every = np.arange(scan.start[s], scan.start[s + 1]), np.arange(scan.start[t], scan.start[t + 1])
    done = 0.0
    for others in _alike(scan, every) if sensors.code[t] != BEARING else [every]:
        window = _windows(sensors, scan, rows, others, limit)
        counts = np.cumsum(window.last - window.first)
        k = 0
        while k < len(window.rows):
            so_far = counts[k - 1] if k else 0
            stop = max(k + 1, int(np.searchsorted(counts, so_far + block, side="right")))
            first, last = window.first[k:stop], window.last[k:stop]
            low, high = first.min(), last.max()
            some = window.rows[k:stop], window.others[low:high], first - low, last - low
            share = len(others) / len(every) * stop / len(window.rows)
            yield _near_within(sensors, scan, t, *some, limit), done + share
            k = stop
        done += len(others) / len(every)


def _alike(scan: ScanArrays, others: Array) -> list[Array]:
    """Located measurements by the size of their ellipsoids: a window is as wide as the largest in it asks for."""
    size = np.frexp(np.sqrt(scan.spread[others, 0] + scan.spread[others, 3]))[1]
    return [others[size == exponent] for exponent in np.unique(size)]


def _windows(sensors: SensorArrays, scan: ScanArrays, rows: Array, others: Array, limit: float) -> _Windows:
    """Measurements of a sensor near those of another; if one of the two measures bearings alone, it is the other."""
    if not len(others) or not len(rows):
        return _Windows(rows, others, np.zeros(len(rows), np.int64), np.zeros(len(rows), np.int64))
    s, t = scan.owner[rows[0]], scan.owner[others[0]]
    if sensors.code[s] == BEARING:
        return _Windows(rows, others, np.zeros(len(rows), np.int64), np.full(len(rows), len(others)))
    if sensors.code[t] != BEARING:
        return _strips(sensors, scan, rows, others, limit)
    azimuths = scan.z[others, 0]
    d = scan.centre[rows, :2] - sensors.position[t, :2]
    ball = 2.0 * limit * (scan.spread[rows, 0] + scan.spread[rows, 3])
    ratio = np.sqrt(ball / np.maximum((d**2).sum(axis=1), 1e-300))
    half = np.where(ratio < 1.0, np.arcsin(np.minimum(ratio, 1.0)), math.pi)
    half = np.minimum(half + math.sqrt(2.0 * limit * sensors.covariance[t, 0, 0]) + 1e-12, math.pi)
    middle = np.arctan2(d[:, 1], d[:, 0])
    # the circle unrolled twice, so that an interval through +-pi is one run
    unrolled = np.concatenate([azimuths - 2 * math.pi, azimuths, azimuths + 2 * math.pi])
    first = np.searchsorted(unrolled, middle - half, side="left")
    last = np.minimum(np.searchsorted(unrolled, middle + half, side="right"), first + len(others))
    return _Windows(rows, np.tile(others, 3), first, last)


def _strips(sensors: SensorArrays, scan: ScanArrays, rows: Array, others: Array, limit: float) -> _Windows:
    """Windows of measured positions: along y within strips of x, so that their number does not grow with the area."""
    wide = _wide(sensors.code[scan.owner[rows[0]]], sensors.code[scan.owner[others[0]]], limit)
    # variances of x and of y
    variance = scan.spread[:, [0, 3]]
    far = np.sqrt(wide * (variance[rows] + variance[others].max(axis=0))) * (1.0 + 1e-9)
    low = np.minimum(scan.centre[rows, :2] - far, scan.centre[others, :2].min(axis=0)).min(axis=0)
    middle, there = scan.centre[rows, :2] - low, scan.centre[others, :2] - low
    width = max(2.0 * float(np.median(far[:, 0])), float(there[:, 0].max()) / _STRIPS)
    # strips end to end, farther apart than any window reaches, make one line to search
    length = 2.0 * float(max(there[:, 1].max(), (middle + far)[:, 1].max()))
    line = np.floor(there[:, 0] / width) * length + there[:, 1]
    order = np.argsort(line, kind="stable")
    left, right = np.floor((middle - far)[:, 0] / width), np.floor((middle + far)[:, 0] / width)
    right = np.minimum(right, np.floor(there[:, 0].max() / width))
    count = np.maximum(right - left + 1, 0).astype(np.int64)
    which = np.repeat(np.arange(len(rows)), count)
    strip = left[which] + np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    at = strip * length + middle[which, 1]
    # in their order along the line: those of a block of rows are near each other, and the search is faster
    along = np.argsort(at)
    at, which = at[along], which[along]
    reach = far[which, 1] + 4.0 * np.spacing(2.0 * line.max())
    line = line[order]
    first, last = np.searchsorted(line, at - reach), np.searchsorted(line, at + reach, side="right")
    some = last > first
    return _Windows(rows[which[some]], others[order], first[some], last[some])


def compatible_pairs(
    scan: ScanArrays, fit: Fit, coarse: Iterable[tuple[Array, float]], gates: Gates, *, number: int, max_tuples: int
) -> Pairs:
    """All pairs of measurements of different sensors that pass the pair gate, of those that are `coarse_pairs`.

    LimitExceededError, naming the scan `number`, if more than `max_tuples` pass.
    """
    count = len(gates.pair)
    kept, values, so_far = [np.empty((0, 2), np.int32)], [np.empty(0)], 0
    for pairs, share in coarse:
        for k in range(0, len(pairs), _BLOCK):
            block = pairs[k : k + _BLOCK]
            rows = np.full((len(block), count), -1, dtype=np.int32)
            owners = scan.owner[block]
            np.put_along_axis(rows, owners, block, axis=1)
            chi = fit(rows, True)[0]
            passed = chi <= gates.pair[owners[:, 0], owners[:, 1]]
            kept.append(block.compress(passed, axis=0))
            values.append(chi[passed])
            so_far += len(kept[-1])
            if too_many(so_far, share, max_tuples):
                raise refuse(number, so_far / max(share, 1e-9), max_tuples)
    pairs, chi = np.concatenate(kept), np.concatenate(values)
    total = len(scan.z)
    keys = pairs[:, 0].astype(np.int64) * total + pairs[:, 1]
    if (np.diff(keys) < 0).any():
        order = np.argsort(keys, kind="stable")
        pairs, chi = pairs.take(order, axis=0), chi[order]
    first, second = np.ascontiguousarray(pairs[:, 0]), np.ascontiguousarray(pairs[:, 1])
    # ordered by first measurement, then by sensor of the second
    partners = np.bincount(first * np.int64(count) + scan.owner[second], minlength=total * count)
    starts = np.append(0, np.cumsum(partners))
    return Pairs(first, second, chi, starts[np.arange(total)[:, None] * count + np.arange(count + 1)])
