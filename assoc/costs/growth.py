"""Candidate tuples grown sensor by sensor from the compatible pairs."""

from __future__ import annotations

import math

import numpy as np

from assoc._system.compiled import njit
from assoc._types import Array
from assoc.costs.arrays import ScanArrays, SensorArrays
from assoc.costs.estimation import Fit
from assoc.costs.gating import SLACK, Gates, degrees_of_freedom
from assoc.costs.limits import refuse, too_many
from assoc.costs.pairs import Pairs
from assoc.costs.prices import PositionPrior, prices
from assoc.costs.range_rates import RangeRates
from assoc.sensors.codes import BEARING

# an azimuth predicted with a larger standard deviation (rad) is not trusted to rule measurements out
_TRUSTED = 0.03
# grown tuples are fitted in blocks of about this size
_BLOCK = 500_000


@njit
def _extend(
    rows: Array, t: int, second: Array, start: Array, azimuth: Array, middle: Array, half: Array, limit: int
) -> tuple[Array, Array, int]:
    """Grow each tuple by each measurement of sensor t that pairs with all its members.

    With `middle` and `half` only azimuths in that interval are taken. Stops once `limit` are exceeded. Returns parents
    (K,), measurements (K,) and the number of rows that were grown.
    """
    parent, added = np.empty(1024, np.int64), np.empty(1024, np.int32)
    count = 0
    for k in range(len(rows)):
        if count > limit:
            return parent[:count], added[:count], k
        lead = 0
        while rows[k, lead] < 0:
            lead += 1
        a = rows[k, lead]
        for e in range(start[a, t], start[a, t + 1]):
            b = second[e]
            if len(half) and half[k] < math.pi:
                off = azimuth[b] - middle[k]
                off -= 2.0 * math.pi * round(off / (2.0 * math.pi))
                if abs(off) > half[k]:
                    continue
            fits = True
            for s in range(lead + 1, t):
                c = rows[k, s]
                if c < 0:
                    continue
                low, high = start[c, t], start[c, t + 1]
                while low < high:
                    mid = (low + high) // 2
                    if second[mid] < b:
                        low = mid + 1
                    else:
                        high = mid
                if low == start[c, t + 1] or second[low] != b:
                    fits = False
                    break
            if not fits:
                continue
            if count == len(parent):
                longer, more = np.empty(2 * count, np.int64), np.empty(2 * count, np.int32)
                for i in range(count):
                    longer[i], more[i] = parent[i], added[i]
                parent, added = longer, more
            parent[count], added[count] = k, b
            count += 1
    return parent[:count], added[:count], len(rows)


def _windows(sensors: SensorArrays, fit: Fit, rows: Array, chi: Array, t: int, limit: float) -> tuple[Array, Array]:
    """Azimuths at bearing sensor t for each tuple: middle and half width; pi where all must be tried."""
    _, position, covariance = fit(rows, False)
    dx, dy = position[:, 0] - sensors.position[t, 0], position[:, 1] - sensors.position[t, 1]
    away = np.maximum(dx * dx + dy * dy, 1e-12)
    u, v = -dy / away, dx / away
    variance = u * u * covariance[:, 0, 0] + 2 * u * v * covariance[:, 0, 1] + v * v * covariance[:, 1, 1]
    # the chi-square value of the grown tuple may be at most `limit`; twice that far for bent models
    room = np.maximum(limit - chi, 1.0) if math.isfinite(limit) else np.full(len(rows), np.inf)
    half = 2.0 * np.sqrt(room * (variance + sensors.covariance[t, 0, 0]))
    return np.arctan2(dy, dx), np.where(variance < _TRUSTED**2, half, math.pi)


def grow(
    sensors: SensorArrays,
    scan: ScanArrays,
    fit: Fit,
    pairs: Pairs,
    gates: Gates,
    *,
    rates: RangeRates | None = None,
    prior: PositionPrior | None = None,
    number: int,
    max_tuples: int,
) -> tuple[Array, Array]:
    """Candidate tuples of two or more measurements: the row of `scan` for each sensor, or -1, (K, S), and costs (K,).

    A tuple is a candidate if each pair in it passes the pair gate, its chi-square value passes the joint gate of its
    degrees of freedom, and its cost is below zero, the cost of its measurements as false alarms. Range rates and the
    prior of positions have no part in the gates; their price is part of the cost. On the way, a tuple is given up only
    if no tuple that contains it can be a candidate: chi-square values only grow with a tuple, so one above the largest
    gate ahead, or above all that further detections can take off the cost, is of no use. LimitExceededError, naming the
    scan `number`, for more than `max_tuples`.
    """
    count = len(sensors.dim)
    second_owner = scan.owner[pairs.second]
    rows: Array = np.empty((0, count), np.int32)
    chi: Array = np.empty(0)
    price: Array = np.empty(0)
    worth: Array = np.empty(0)
    priced = rates is not None or prior is not None
    for t in range(1, count):
        grown_rows, grown_chi = _grown(sensors, scan, fit, pairs, gates, rows, chi, t, number, max_tuples)
        chosen = np.flatnonzero(second_owner == t) if count > 2 else slice(None)
        new = np.full((len(pairs.first[chosen]), count), -1, dtype=np.int32)
        new[np.arange(len(new)), scan.owner[pairs.first[chosen]]] = pairs.first[chosen]
        new[:, t] = pairs.second[chosen]
        rows = np.concatenate([rows, new, grown_rows])
        chi = np.concatenate([chi, pairs.chi[chosen], grown_chi])
        worth = (rows >= 0) @ sensors.gain - sensors.base
        if priced:
            fresh = rows[len(price) :]
            price = np.append(price, prices(sensors, scan, fresh, rates, prior, *fit(fresh, False)[1:]))
        total = chi + price if priced else chi
        hopeful: Array = 0.5 * total < worth + gates.future[t + 1] + (SLACK if t + 1 < count else 0.0)
        if not hopeful.all():
            rows, chi, worth = rows.compress(hopeful, axis=0), chi[hopeful], worth[hopeful]
            price = price[hopeful] if priced else price
        if len(rows) > max_tuples:
            raise refuse(number, len(rows), max_tuples)
    costs = 0.5 * (chi + price if priced else chi) - worth
    good = (chi <= gates.joint[degrees_of_freedom(sensors, rows >= 0)]) & (costs < 0.0)
    return rows.compress(good, axis=0), costs[good]


def _grown(
    sensors: SensorArrays,
    scan: ScanArrays,
    fit: Fit,
    pairs: Pairs,
    gates: Gates,
    rows: Array,
    chi: Array,
    t: int,
    number: int,
    max_tuples: int,
) -> tuple[Array, Array]:
    """The tuples grown by sensor t that may still become candidates, and their chi-square values."""
    count = rows.shape[1]
    if not len(rows):
        return rows, chi
    later = int(sensors.dim[t + 1 :].sum())
    largest = float(gates.joint[-1])
    kept_rows, kept_chi, so_far = [np.empty((0, count), np.int32)], [np.empty(0)], len(rows)
    low = 0
    while low < len(rows):
        part = slice(low, low + _BLOCK)
        middle = half = np.empty(0)
        if sensors.code[t] == BEARING:
            middle, half = _windows(sensors, fit, rows[part], chi[part], t, largest)
        parent, added, done = _extend(
            rows[part], t, pairs.second, pairs.start, scan.z[:, 0].copy(), middle, half, _BLOCK
        )
        low += done
        grown = rows[part].take(parent, axis=0)
        grown[:, t] = added
        value = fit(grown, True)[0]
        detected = grown >= 0
        freedom = np.minimum(degrees_of_freedom(sensors, detected) + later + 1, len(gates.joint) - 1)
        hopeful = value <= gates.joint[freedom] + SLACK
        hopeful &= 0.5 * value < detected @ sensors.gain - sensors.base + gates.future[t + 1] + SLACK
        kept_rows.append(grown.compress(hopeful, axis=0))
        kept_chi.append(value[hopeful])
        so_far += len(kept_chi[-1])
        if so_far > max_tuples or too_many(so_far - len(rows), low / len(rows), max_tuples):
            raise refuse(number, len(rows) + (so_far - len(rows)) * len(rows) / low, max_tuples)
    return np.concatenate(kept_rows), np.concatenate(kept_chi)
