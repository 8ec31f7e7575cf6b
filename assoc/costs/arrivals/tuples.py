"""Candidate tuples of arrival times: of each emission what it may have heard, and what it contends for with others.

Of what few stations hear all parts are listed. Of many, an optimal association gives a target every arrival time that
fits it and that no other target has. So an emission is listed without an arrival time, or with a worse one of that
station, only where the better one fits an emission that could stand beside it, and may fit that better: what it adds to
each is seen from where the emission lies, and from where it would lie without that station. To take an arrival
time from a target wins no more than that it fits better, so that an emission made of what cheaper ones have contends
for nothing and is listed as it is.
"""

from __future__ import annotations

import math

import numpy as np

from assoc._system.compiled import njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Array
from assoc.costs.arrays import SensorArrays
from assoc.costs.arrivals.emissions import Heard, emissions
from assoc.costs.arrivals.fit import Receivers, arrival_costs, fit, fit_arrivals, needed, receivers_of, times_of
from assoc.costs.gating import SLACK, chi_square_quantiles
from assoc.costs.limits import refuse
from assoc.costs.prices import PositionPrior
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene

# of so many stations all parts of what they hear are listed
_FEW = 8


@njit
def _contended(
    rows: Array, least: Array, off: Array, owner: Array, gain: Array, bases: Array, viable: Array, most: Array
) -> Array:
    """Which arrival times (N,) may fit another of the `viable` among M emissions better, for each of these, (M, N).

    `least` and `off` (M, N) are bounds of what each adds to the chi-square of an emission, `bases` (M,) what all gains
    of a target must exceed. Two emissions may stand side by side if one of them is a target without
    what both have.
    """
    result = np.zeros(off.shape, np.bool_)
    worth = -bases
    for m in range(len(rows)):
        for s in range(rows.shape[1]):
            worth[m] += gain[s] if rows[m, s] >= 0 else 0.0
    for n in range(off.shape[1]):
        limit = most[owner[n]]
        for u in range(len(rows)):
            if not viable[u] or least[u, n] > limit:
                continue
            for m in range(len(rows)):
                if m == u or not viable[m] or least[u, n] >= off[m, n] or least[m, n] > limit or result[m, n]:
                    continue
                shared = 0.0
                for s in range(rows.shape[1]):
                    shared += gain[s] if rows[m, s] >= 0 and rows[m, s] == rows[u, s] else 0.0
                result[m, n] = max(worth[m], worth[u]) > shared
    return result


@njit
def _choices(options: Array, counts: Array, gain: Array, base: float, limit: int) -> Array:
    """All ways to take one option of each station (S, W), -1 for none, that could be a target, int32 (K, S).

    Up to one more than `limit`.
    """
    stations = len(counts)
    result = np.empty((16, stations), np.int32)
    found = 0
    rest = np.zeros(stations + 1)
    for s in range(stations - 1, -1, -1):
        rest[s] = rest[s + 1] + gain[s]
    chosen, worth = np.zeros(stations, np.int64), np.zeros(stations + 1)
    s = 0
    while s >= 0:
        if s == stations or chosen[s] == counts[s]:
            if s == stations:
                if found > limit:
                    break
                if found == len(result):
                    longer = np.empty((2 * found, stations), np.int32)
                    for k in range(found):
                        copy_to(longer[k], result[k])
                    result = longer
                for i in range(stations):
                    result[found, i] = options[i, chosen[i]]
                found += 1
            s -= 1
            if s >= 0:
                chosen[s] += 1
            continue
        worth[s + 1] = worth[s] + (gain[s] if options[s, chosen[s]] >= 0 else 0.0)
        if worth[s + 1] + rest[s + 1] <= base:
            chosen[s] += 1
            continue
        s += 1
        if s < stations:
            chosen[s] = 0
    return result[:found]


def grow_arrivals(
    scene: Scene, arrays: SensorArrays, scan: Scan, probability: float, prior: PositionPrior | None, max_tuples: int
) -> tuple[Array, Array]:
    """Candidate tuples (K, S) of 1-based arrival times and their costs; see `assoc.build_problem`."""
    r, count = receivers_of(scene, arrays), len(scene.sensors)
    orders = [np.argsort(z[:, 0], kind="stable") for z in scan.measurements]
    picks = np.concatenate([z[order, 0] for z, order in zip(scan.measurements, orders, strict=True)])
    first = np.append(0, np.cumsum(scan.sizes)).astype(np.int64)
    owner = np.repeat(np.arange(count), scan.sizes)
    joint = chi_square_quantiles(probability, max(count, 2))
    most = np.minimum(2.0 * np.maximum(arrays.gain, 0.0), joint[-1])
    reach = np.sqrt(most / r.weight)
    none = np.zeros((0, count), np.int32), np.zeros(0)
    if not len(picks):
        return none
    rows, places = emissions(r, Heard(picks, first, arrays.gain, reach, joint), arrays.base, scan.index, max_tuples)
    if not len(rows):
        return none
    times = np.where(rows >= 0, picks[rows], np.nan)
    # large cells lead to any place at which arrival times agree, not only to the best
    fitted = fit_arrivals(r, times)
    places = np.column_stack([fitted[2], fitted[1]])
    cost = arrival_costs(scene, arrays, times, prior, fitted)
    order = np.argsort(cost, kind="stable")[: np.count_nonzero(cost < 0.0)]
    rows, places, cost = rows[order], places[order], cost[order]
    away = np.linalg.norm(places[:, None, :3] - r.site, axis=2)
    late = picks - places[:, 3:] - (away / r.speed)[:, owner]
    off = late**2 * r.weight[owner]
    bases = cost + (rows >= 0) @ arrays.gain - 0.5 * fitted[0][order]
    if count <= _FEW:
        least, given_up = off, np.ones(off.shape, dtype=np.bool_)
    else:
        viable = _viable(rows, off, arrays.gain, bases)
        added = _added(r, places, away, rows, late, owner)
        least, off = np.minimum(off, added), np.maximum(off, added)
        given_up = _contended(rows, least, off, owner, arrays.gain, bases, viable, most)
    chosen, starts, fresh = none[0], np.zeros((0, 3)), 0
    for m in range(len(rows)):
        choices = _choices(*_options(least[m], off[m], given_up[m], most, first), arrays.gain, bases[m], max_tuples)
        chosen = np.concatenate([chosen, choices])
        starts = np.concatenate([starts, np.broadcast_to(places[m, :3], (len(choices), 3))])
        fresh += len(choices)
        if 2 * fresh > len(chosen) or len(chosen) > max_tuples or m + 1 == len(rows):
            # emissions share tuples
            chosen, index = np.unique(chosen, axis=0, return_index=True)
            starts, fresh = starts[index], 0
        if len(chosen) > max_tuples:
            raise refuse(scan.index, len(chosen) * len(rows) / (m + 1), max_tuples)
    heard = np.count_nonzero(chosen >= 0, axis=1)
    chosen, starts, heard = chosen[heard >= needed(r)], starts[heard >= needed(r)], heard[heard >= needed(r)]
    back = np.append(np.concatenate([order + 1 for order in orders]), 0)
    tuples = back[chosen].astype(np.int32)
    times = times_of(scan, tuples)
    fitted = fit(r, times, starts, True)
    # no more than are needed may agree at two places
    few = heard == needed(r)
    for found, again in zip(fitted, fit_arrivals(r, times[few]), strict=True):
        found[few] = again
    costs = arrival_costs(scene, arrays, times, prior, fitted)
    good = (fitted[0] <= joint[np.maximum(np.count_nonzero(tuples, axis=1) - 3, 0)]) & (costs < 0.0)
    return tuples[good], costs[good]


def _added(r: Receivers, places: Array, away: Array, rows: Array, late: Array, owner: Array) -> Array:
    """What each arrival time (N,) adds to the chi-square of M emissions that hear no other of its station, (M, N).

    An emission lies where it fits what it hears, so what it hears seems to fit better than it does: all is seen from
    where the emission would lie without that station, to first order. ``away`` (M, S) are distances, ``late`` (M, N)
    how much later each arrival time is than the emission expects.
    """
    axes = needed(r) - 1
    slope = np.ones((*away.shape, axes + 1))
    slope[..., :axes] = (places[:, None, :axes] - r.site[:, :axes]) / np.maximum(away * r.speed, 1e-9)[..., None]
    heard = rows >= 0
    curvature = np.einsum("ms,s,msi,msj->mij", heard, r.weight, slope, slope)
    leverage = np.einsum("s,msi,mij,msj->ms", r.weight, slope, np.linalg.pinv(curvature, hermitian=True), slope)
    # without a station that alone tells where the emission lies, it could lie anywhere
    left = np.maximum(1.0 - leverage, 1e-6)
    pulled = np.where(heard, np.take_along_axis(late, np.maximum(rows, 0), axis=1) * leverage / left, 0.0)
    scale = np.where(heard, left, 1.0 / (1.0 + leverage))
    return (late + pulled[:, owner]) ** 2 * (r.weight * scale)[:, owner]


def _viable(rows: Array, off: Array, gain: Array, bases: Array) -> Array:
    """Which emissions, the cheapest first, can be targets beside all cheaper ones, bool (M,).

    Where a cheaper one has an arrival time, what is won by taking it away is only that it fits better.
    """
    viable, best = np.zeros(len(rows), dtype=np.bool_), np.full(off.shape[1], np.inf)
    for m, row in enumerate(rows):
        heard = row >= 0
        own, won = row[heard], off[m, row[heard]]
        free = np.isinf(best[own])
        profit = np.where(free, gain[heard] - 0.5 * won, 0.5 * np.maximum(np.where(free, 0.0, best[own]) - won, 0.0))
        viable[m] = profit.sum() > bases[m] - SLACK
        if viable[m]:
            best[own] = np.minimum(best[own], won)
    return viable


def _options(least: Array, off: Array, given_up: Array, most: Array, first: Array) -> tuple[Array, Array]:
    """What an emission may have of each station, (S, W), best first, and how many: up to one that no other wants.

    Of bounds `least` and `off` of what each adds: one that surely adds more than one that no other wants is left out.
    """
    found = []
    for s in range(len(most)):
        own = np.arange(first[s], first[s + 1])
        own = own[least[own] <= most[s]]
        own = own[np.argsort(off[own], kind="stable")]
        free = np.flatnonzero(~given_up[own])
        limit = off[own[free[0]]] if len(free) else math.inf
        kept = own[(least[own] < limit) | (off[own] <= limit)]
        found.append(kept if limit <= most[s] else np.append(kept, -1))
    counts = np.array([len(own) for own in found])
    options = np.full((len(found), counts.max()), -1, dtype=np.int64)
    for s, own in enumerate(found):
        options[s, : len(own)] = own
    return options, counts
