"""Candidate tuples of arrival times: emissions found by dividing space and time, and what they contend for.

Growing tuples station by station would list all parts of what many stations hear: 2^20 of 20 arrival times. What is
sought are emissions instead, places and times that many arrival times agree with. For a cell of places each arrival
time is an interval of times of emission; where intervals overlap, the gains of their stations bound what a target there
can be worth. Cells that can hold none are given up, others are halved until they are as small as the gates. There
each time at which most intervals overlap is where a fit starts. A cell where each station has at most one arrival time
is not halved if these are one emission, or few: their parts are all it can hold. Arrival times that neighbouring cells
share are fitted once.

Of what few stations hear all parts are listed. Of many, an optimal association gives a target every arrival time that
fits it and that no other target has. So an emission is listed without an arrival time, or with a worse one of that
station, only where the better one fits an emission that could stand beside it, and may fit that better: what it adds to
each is seen from where the emission lies, and from where it would lie without that station. To take an arrival
time from a target wins no more than that it fits better, so that an emission made of what cheaper ones have contends
for nothing and is listed as it is.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Array
from assoc.costs.arrays import SensorArrays
from assoc.costs.arrivals.fit import (
    Receivers,
    arrival_costs,
    descend,
    fit,
    fit_arrivals,
    needed,
    receivers_of,
    times_of,
)
from assoc.costs.gating import SLACK, chi_square_quantiles
from assoc.costs.limits import refuse
from assoc.costs.prices import PositionPrior
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene

# emissions that are found before doubles are taken out
_AT_ONCE = 4096
# each halving leaves one cell that waits: more than there are halvings of four axes down to the least noise
_WAITING = 1024
# neighbouring cells hold the same arrival times: so many sets that were fitted are remembered
_SETTLED = 16384
_ROUNDS = 20
# of so many stations all parts of what they hear are listed
_FEW = 8


class Heard(NamedTuple):
    """What S stations heard in a scan of N arrival times, and what decides whether it is of one emission."""

    picks: Array
    """Arrival times, station after station, each sorted, (N,)."""
    first: Array
    """Where those of each station begin, (S + 1,)."""
    gain: Array
    """What an arrival time takes off a cost, (S,)."""
    reach: Array
    """How far, in seconds, it may be from when it was due, (S,)."""
    joint: Array
    """Limits of chi-square by degrees of freedom."""


@inner_njit
def _nearest(picks: Array, low: int, high: int, time: float) -> int:
    """Row of the sorted arrival times picks[low : high] nearest to a time; -1: there is none."""
    if low == high:
        return -1
    k = low + int(np.searchsorted(picks[low:high], time))
    return k - 1 if k == high or (k > low and time - picks[k - 1] < picks[k] - time) else k


@inner_njit
def _settle(r: Receivers, heard: Heard, row: Array, at: Array) -> float:
    """Let an emission take what it hears: fit `row` (S,), take the nearest within `reach` of each station, again.

    `at` (4,) becomes the position and time. Then what fits worst is left out until the rest passes its gate. Returns
    the gains of the rest less half its chi-square, 0 if there is none.
    """
    picks, first, gain, reach, joint = heard.picks, heard.first, heard.gain, heard.reach, heard.joint
    times, dropped = np.empty(len(row)), 0
    for turn in range(_ROUNDS + len(row)):
        count, worth = 0, 0.0
        for s in range(len(row)):
            times[s] = picks[row[s]] if row[s] >= 0 else math.nan
            count += 1 if row[s] >= 0 else 0
            worth += gain[s] if row[s] >= 0 else 0.0
        if count < 2:
            return 0.0
        chi, _, mean, x, y, z, _ = descend(r, times, (at[0], at[1], at[2]))
        at[0], at[1], at[2], at[3] = x, y, z, mean
        changed, worst, most = 0, 0, -1.0
        for s in range(len(row)):
            due = _due(r, s, at)
            if row[s] >= 0 and r.weight[s] * (times[s] - due) ** 2 > most:
                worst, most = s, r.weight[s] * (times[s] - due) ** 2
            if dropped == 0 and turn < _ROUNDS:
                k = _nearest(picks, first[s], first[s + 1], due)
                if k >= 0 and abs(picks[k] - due) > reach[s]:
                    k = -1
                changed += 1 if k != row[s] else 0
                row[s] = k
        if changed > 0:
            continue
        if chi <= joint[max(count - 3, 0)]:
            return worth - 0.5 * chi
        row[worst], dropped = -1, dropped + 1
    return 0.0


@inner_njit
def _due(r: Receivers, s: int, at: Array) -> float:
    """When station s hears an emission at a position and time (4,)."""
    dx, dy, dz = at[0] - r.site[s, 0], at[1] - r.site[s, 1], at[2] - r.site[s, 2]
    return at[3] + math.sqrt(dx * dx + dy * dy + dz * dz) / r.speed[s]


@inner_njit
def _lone(heard: Heard, edges: Array, begin: float, finish: float, row: Array) -> bool:
    """Whether each station has at most one arrival time whose interval reaches into one of times; `row` is of them."""
    first = heard.first
    for s in range(len(row)):
        row[s] = -1
        # of the first the interval is whole, of later ones what earlier ones leave
        length = edges[2 * first[s] + 1] - edges[2 * first[s]] if first[s] < first[s + 1] else 0.0
        for k in range(first[s], first[s + 1]):
            if edges[2 * k + 1] - length <= finish and edges[2 * k + 1] >= begin:
                if row[s] >= 0:
                    return False
                row[s] = k
    return True


@inner_njit
def _whole(r: Receivers, heard: Heard, row: Array, at: Array) -> float:
    """Worth of arrival times `row` (S,), if they are one emission, to which `at` (4,) moves; else 0."""
    times, worth, count = np.full(len(row), math.nan), 0.0, 0
    for s in range(len(row)):
        if row[s] >= 0:
            times[s], worth, count = heard.picks[row[s]], worth + heard.gain[s], count + 1
    chi, _, at[3], at[0], at[1], at[2], _ = descend(r, times, (at[0], at[1], at[2]))
    for s in range(len(row)):
        if row[s] >= 0 and abs(times[s] - _due(r, s, at)) > heard.reach[s]:
            return 0.0
    return worth - 0.5 * chi if chi <= heard.joint[max(count - 3, 0)] else 0.0


@inner_njit
def _parts(r: Receivers, heard: Heard, base: float, row: Array, at: Array, rows: Array, places: Array) -> int:
    """List in `rows` and `places` what arrival times `row` (S,) can be: an emission, or the largest parts that are.

    Fits begin at `at`. Returns how many there are; -1 if of many arrival times not all are one emission.
    """
    part, spot, heard_by, found, enough = row.copy(), at.copy(), 0, 0, 4 if r.half[2] > 0.0 else 3
    for s in range(len(row)):
        heard_by += 1 if row[s] >= 0 else 0
    if _whole(r, heard, part, spot) > base:
        copy_to(rows[0], part)
        copy_to(places[0], spot)
        return 1
    if heard_by > _FEW:
        return -1
    listed = np.empty(1 << heard_by, np.int64)
    # sets of arrival times as bits, the larger ones first
    for size in range(heard_by - 1, enough - 1, -1):
        for bits in range(1 << heard_by):
            count, k, worth = 0, 0, 0.0
            for s in range(len(row)):
                part[s] = -1
                if row[s] >= 0:
                    if bits >> k & 1:
                        part[s], count, worth = row[s], count + 1, worth + heard.gain[s]
                    k += 1
            if count != size or worth <= base:
                continue
            inside = False
            for m in range(found):
                inside = inside or bits & listed[m] == bits
            if inside:
                continue
            copy_to(spot, at)
            if _whole(r, heard, part, spot) > base and found < len(rows) - 1:
                copy_to(rows[found], part)
                copy_to(places[found], spot)
                listed[found], found = bits, found + 1
    return found


@inner_njit
def _intervals(r: Receivers, heard: Heard, cell: Array, edges: Array, steps: Array) -> int:
    """When an emission in a cell may have been heard as each arrival time: from, to, and what each adds; how many."""
    picks, first, gain, reach = heard.picks, heard.first, heard.gain, heard.reach
    count = 0
    for s in range(len(first) - 1):
        near = far = 0.0
        for i in range(3):
            below, above = cell[2 * i] - r.site[s, i], cell[2 * i + 1] - r.site[s, i]
            inside, outside = max(below, -above, 0.0), max(-below, above)
            near, far = near + inside * inside, far + outside * outside
        near, far, end = math.sqrt(near) / r.speed[s], math.sqrt(far) / r.speed[s], -math.inf
        for k in range(first[s], first[s + 1]):
            # one arrival time of a station counts
            edges[count] = max(picks[k] - far - reach[s], end)
            end = picks[k] - near + reach[s]
            edges[count + 1] = end
            steps[count], steps[count + 1] = gain[s], -gain[s]
            count += 2
    return count


@inner_njit
def _slot(r: Receivers, row: Array, at: Array) -> int:
    """Where it is remembered that these arrival times were fitted from a sixteenth of the region around `at`."""
    slot = 0
    for i in range(2):
        slot = 4 * slot + min(max(int(2.0 + 2.0 * (at[i] - r.middle[i]) / r.half[i]), 0), 3)
    for one in row:
        slot = (31 * slot + one + 1) % _SETTLED
    return slot


@inner_njit
def _same(one: Array, other: Array) -> bool:
    """Whether two rows are equal."""
    for s in range(len(one)):
        if one[s] != other[s]:
            return False
    return True


@njit
def _emissions(r: Receivers, heard: Heard, base: float, cells: Array, waiting: int) -> tuple[Array, Array, int]:
    """Emissions in the first `waiting` of the cells (C, 6), low and high of x, y and z; until there are many.

    Rows of the sorted arrival times or -1, int32 (F, S), positions and times (F, 4), and how many cells still wait.
    """
    picks, first, gain, reach = heard.picks, heard.first, heard.gain, heard.reach
    stations = len(gain)
    most = _AT_ONCE + len(picks) + (1 << _FEW)
    rows, places, found = np.empty((most, stations), np.int32), np.empty((most, 4)), 0
    edges, steps = np.empty(2 * len(picks)), np.empty(2 * len(picks))
    row, at = np.empty(stations, np.int32), np.empty(4)
    # arrival times from which was fitted, and whose parts were listed
    settled, listed_of = np.full((_SETTLED, stations), -2, np.int32), np.full((_SETTLED, stations), -2, np.int32)
    slowest, closest, enough = r.speed[0], reach[0], 4 if r.half[2] > 0.0 else 3
    for s in range(stations):
        slowest, closest = min(slowest, r.speed[s]), min(closest, reach[s])
    while waiting > 0 and found < _AT_ONCE:
        waiting -= 1
        cell = cells[waiting]
        count = _intervals(r, heard, cell, edges, steps)
        order = np.argsort(edges)
        width, widest = 0.0, 0
        for i in range(3):
            if cell[2 * i + 1] - cell[2 * i] > width:
                width, widest = cell[2 * i + 1] - cell[2 * i], i
            at[i] = 0.5 * (cell[2 * i] + cell[2 * i + 1])
        small = width <= 2.0 * slowest * closest
        level, hopeful, heard_by, begin, finish = 0.0, 0, 0, 0.0, 0.0
        for j in range(count):
            level += steps[order[j]]
            heard_by += 1 if order[j] % 2 == 0 else -1
            # fewer determine no position: those of two are surfaces full of cells
            if heard_by < enough or level <= base or j + 1 == count:
                continue
            if steps[order[j]] < 0.0 or steps[order[j + 1]] > 0.0:
                continue
            begin = begin if hopeful > 0 else edges[order[j]]
            finish = edges[order[j + 1]]
            hopeful += 1
            if not small:
                continue
            at[3] = 0.5 * (edges[order[j]] + edges[order[j + 1]])
            for i in range(3):
                at[i] = 0.5 * (cell[2 * i] + cell[2 * i + 1])
            for s in range(stations):
                due = _due(r, s, at)
                row[s] = _nearest(picks, first[s], first[s + 1], due)
                if row[s] >= 0 and abs(picks[row[s]] - due) > 2.0 * reach[s]:
                    row[s] = -1
            slot = _slot(r, row, at)
            if _same(settled[slot], row):
                continue
            copy_to(settled[slot], row)
            if _settle(r, heard, row, at) > base:
                copy_to(rows[found], row)
                copy_to(places[found], at)
                found += 1
        if hopeful > 0 and not small and _lone(heard, edges, begin, finish, row):
            slot = _slot(r, row, at)
            # what has been listed of these arrival times is all that the cell can hold
            listed = 0 if _same(listed_of[slot], row) else _parts(r, heard, base, row, at, rows[found:], places[found:])
            if listed >= 0:
                copy_to(listed_of[slot], row)
                found, hopeful = found + listed, 0
        if hopeful > 0 and not small:
            cells[waiting + 1] = cell
            cells[waiting, 2 * widest + 1] = at[widest]
            cells[waiting + 1, 2 * widest] = at[widest]
            waiting += 2
    return rows[:found], places[:found], waiting


@njit
def _is_part(rows: Array) -> Array:
    """Whether each of M emissions has no arrival time that one of the others has not, too, bool (M,)."""
    result = np.zeros(len(rows), np.bool_)
    for m in range(len(rows)):
        for u in range(len(rows)):
            part = u != m
            for s in range(rows.shape[1]):
                if rows[m, s] >= 0 and rows[m, s] != rows[u, s]:
                    part = False
                    break
            if part:
                result[m] = True
                break
    return result


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
    rows, places = _found(r, Heard(picks, first, arrays.gain, reach, joint), arrays.base, scan.index, max_tuples)
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


def _found(r: Receivers, heard: Heard, base: float, number: int, max_tuples: int) -> tuple[Array, Array]:
    """Emissions, each once: rows of the sorted arrival times, int32 (M, S), positions and times (M, 4)."""
    low, high = r.middle - r.half, r.middle + r.half
    cells = np.zeros((_WAITING, 6))
    cells[0] = np.stack([low, high], axis=1).ravel()
    rows, places, waiting = np.zeros((0, len(r.speed)), np.int32), np.zeros((0, 4)), 1
    while waiting:
        new, at, waiting = _emissions(r, heard, base, cells, waiting)
        rows, index = np.unique(np.concatenate([rows, new]), axis=0, return_index=True)
        places = np.concatenate([places, at])[index]
        if len(rows) > max_tuples:
            raise refuse(number, len(rows), max_tuples)
    # what is part of another emission is that one, badly fitted
    whole = ~_is_part(rows)
    return rows[whole], places[whole]


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
