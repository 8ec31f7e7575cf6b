"""Emissions that arrival times agree with, found by dividing space and time.

Growing tuples station by station would list all parts of what many stations hear: 2^20 of 20 arrival times. What is
sought are emissions instead, places and times that many arrival times agree with. For a cell of places each arrival
time is an interval of times of emission; where intervals overlap, the gains of their stations bound what a target there
can be worth. Cells that can hold none are given up, others are halved until they are as small as the gates. There
each time at which most intervals overlap is where a fit starts. A cell where each station has at most one arrival time
is not halved if these are one emission, or few: their parts are all it can hold. Arrival times that neighbouring cells
share are fitted once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Array
from assoc.costs.arrivals.fit import Receivers, descend
from assoc.costs.limits import refuse

# emissions that are found before doubles are taken out
_AT_ONCE = 4096
# each halving leaves one cell that waits: more than there are halvings of four axes down to the least noise
_WAITING = 1024
# neighbouring cells hold the same arrival times: so many sets that were fitted are remembered
_SETTLED = 16384
_ROUNDS = 20
# of so many arrival times all parts are fitted
_PARTS = 8


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
    if heard_by > _PARTS:
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
            if _whole(r, heard, part, spot) > base:
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
    most = _AT_ONCE + len(picks) + (1 << _PARTS)
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


def emissions(r: Receivers, heard: Heard, base: float, number: int, max_tuples: int) -> tuple[Array, Array]:
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
