"""Where false alarms come from: their density at each measurement, by the plots that lie near it.

The last plots of each sensor are kept. Of those near a measurement, the nearest three of each turn may be of targets:
only the others show clutter, and the density follows from the distance within which there are six of them, in units of
the sensor's noise. A wind farm, a shore or a road returns many plots from the same place in every turn; targets that
fly together are as dense, but go on: a place must surely have returned plots in more than half of the turns before.

Some of it stands: plots that lie together are of one site. There the density is that of the site, by as many plots as
came from it. Ships at anchor are sites, too, but are detected as often as any target, whereas turbines flicker: of the
sites about a measurement, clutter must explain hits and misses better than targets do.

A place must also have predicted its plots surely better than tracks did (`assoc.tracking.records.prequential`), each by
what came before: where targets circle, each is near its own track. In the first turns nobody can be sure, and what may
be a place is in doubt unless tracks, or surely targets that stand, have predicted its plots better.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import betainc, betaln, gammaincinv

from assoc._types import Array
from assoc.scene.scan import Scan
from assoc.sensors import Sensor
from assoc.tracking.records.prequential import NEEDED

_TURNS, _PLOTS = 10.0, 16_000
"""Plots are kept for so many turns, and at most so many of a sensor: with an eighth in one turn no place shows."""
# of so many neighbours, and this many of a turn may be of targets; the density follows from so many others
_LOOKED_AT, _TARGETS, _OTHERS = 64, 3, 6
# a site so many standard deviations away adds less than floats can tell
_FAR = 20.0
# it is clutter of a place at so many times the density of false alarms, and so many plots a turn within this distance:
# traffic is less dense
_LEAST, _IN_GATE, _GATE = 30.0, 0.002, 4.0
# of so many turns before, these at least must have had plots: then it is 95 % sure that more than half of all have
_SURE = 0.95
_NEEDED = [
    next((h for h in range(n) if sum(math.comb(n + 1, k) for k in range(h + 1)) >= _SURE * 2.0 ** (n + 1)), n)
    for n in range(int(_TURNS) + 1)
]
YOUNG = float(math.ceil(-math.log2(1.0 - _SURE)) - 1)
"""With fewer turns before no place is sure: what is dense may be targets that fly together."""
ONE_SAYS = 0.5 * NEEDED
"""Largest vote: no measurement alone shows that a place predicts better than tracks, it may be of a new target."""
# where no place shows so many measurements of a scan are weighed; one shows by the nearest so many gains
_WEIGHED, _GAINS = 64, 16
# returns of one point are no denser than noise lets them be
_NEAREST = 1.0
# a plot is of a site if it lies where so many of a target's would; of the nearest so many sites
_OWN, _SITES = 0.99, 8
# a target falls silent for longer, or is hidden, once in a hundred turns
_SILENT = -math.log(100.0)


Points = tuple[Array, Array, Array, Array]


@dataclass(frozen=True, eq=False)
class ClutterMap:
    """The last plots of S sensors."""

    places: tuple[Array, ...]
    """In units of the noise, azimuths from 0 to a full turn; (n_s, d_s) each."""
    clocks: tuple[Array, ...]
    """Turns of the sensor when they came; (n_s,) each."""
    clock: Array
    """Turns of each sensor so far, (S,)."""
    votes: tuple[Array, ...]
    """Evidence of each plot that its place predicted it better than tracks did; (n_s,) each."""
    sites: tuple[Array, ...]
    """Number of the point to which each plot came back, (n_s,) each."""

    around: tuple[Any, ...]
    """After how many units each component comes back, 0: never; (d_s,) each."""

    @cached_property
    def _trees(self) -> tuple[cKDTree, ...]:
        return tuple(map(_tree, self.places, self.around))

    @cached_property
    def _points(self) -> tuple[Points, ...]:
        """`_middles` of each sensor's sites."""
        return tuple(map(_middles, self.sites, self.places, self.around))

    @staticmethod
    def empty(sensors: Sequence[Sensor]) -> ClutterMap:
        """No plots."""
        none = [np.zeros((0, sensor.position_part.dim)) for sensor in sensors]
        nothing = tuple(np.zeros(0) for _ in sensors)
        around = tuple(map(_around, sensors))
        return ClutterMap(tuple(none), nothing, np.zeros(len(sensors)), nothing, nothing, around)

    def arrays(self) -> dict[str, Array]:
        """Everything as plain arrays."""
        found = {f"places.{s}": array for s, array in enumerate(self.places)}
        for name, arrays in (("clocks", self.clocks), ("votes", self.votes), ("sites", self.sites)):
            found |= {f"{name}.{s}": array for s, array in enumerate(arrays)}
        return found | {"clock": self.clock}

    def restored(self, arrays: Mapping[str, Array]) -> ClutterMap:
        """The map, of as many sensors as this one, from the `arrays` of another."""
        sensors = range(len(self.places))
        names = ("places", "clocks", "votes", "sites")
        places, clocks, votes, sites = (tuple(arrays[f"{name}.{s}"] for s in sensors) for name in names)
        return ClutterMap(places, clocks, arrays["clock"], votes, sites, self.around)

    def used_and_found(
        self, sensors: Sequence[Sensor], scan: Scan, elsewhere: Sequence[Array] | None = None
    ) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        """Logarithms of densities relative to that of the sensor's false alarms, >= 0: those in use, and all.

        In the first turns, in use are those in doubt: where tracks have not predicted better so far. All also hold
        places where they have. At the scan's measurements, or ``elsewhere``: at others, (m_s, d_s) for each sensor.
        """
        found = []
        for s, sensor in enumerate(sensors):
            at = _places(sensor, scan.measurements[s] if elsewhere is None else elsewhere[s])
            if scan.sectors is not None and scan.sectors[s, 0] == scan.sectors[s, 1]:
                # what reports by itself, and does not look, returns no clutter of a place
                found.append((np.zeros(len(at)), np.zeros(len(at))))
            else:
                found.append(self._densities(sensor, s, at))
        used, every = zip(*found, strict=True)
        return used, every

    def _densities(self, sensor: Sensor, s: int, at: Array) -> tuple[Array, Array]:
        """See `used_and_found`: of these places ``at``."""
        places, clocks, votes, sites = (known[s] for known in (self.places, self.clocks, self.votes, self.sites))
        now = float(self.clock[s])
        n, part = len(at), sensor.position_part
        result, used = np.zeros(n), np.zeros(n, dtype=np.bool_)
        before = int(min(round(now), _TURNS))
        age, turns = np.rint(now - clocks), max(before, 1)
        # plots are kept in order; where few turns are left of them, as in crowds, no place can be sure
        known = np.count_nonzero(np.diff(age)) + 1
        if len(places) <= _OTHERS or not n or known - (age[-1] == 0.0) < _NEEDED[before]:
            return result, result
        units, d, around = _units(sensor), part.dim, self.around[s]
        # volume of a ball of radius 1, and false alarms there in these turns
        ball = math.pi ** (d / 2.0) / math.gamma(d / 2.0 + 1.0)
        usual = part.false_alarm_rate / part.volume * float(np.prod(units)) * turns * ball
        least = max(_LEAST, _IN_GATE * turns / (_GATE**d * usual))
        # tracks know too little of the first turns
        told = votes * (clocks >= YOUNG - 1.0)
        tree, near_by = self._trees[s], (_OTHERS / (least * usual)) ** (1.0 / d)
        # few places are dense: only there many neighbours are sought
        farther = np.asarray(tree.query(at, [_OTHERS + 1], distance_upper_bound=near_by)[0])[:, 0]
        dense = np.flatnonzero(farther < near_by)
        if before >= YOUNG:
            # where no place shows, as in crowds, some in turn tell whether one is there
            some = (np.arange(len(dense)) + round(now)) % max(math.ceil(len(dense) / _WEIGHED), 1) == 0
            dense = dense[some | _near_gains(at[dense], places, told, 2.0 * near_by, around)]
        if not len(dense):
            return result, result
        # among so many are enough others, whatever their turns; in eights, as numpy sums: zeros change nothing then
        most = min(8 * math.ceil((known * _TARGETS + _OTHERS) / 8.0), len(places))
        distance, near = (np.asarray(array) for array in tree.query(at[dense], most))
        turn = age[near]
        nearer = _nearer_of_turn(turn)
        others = np.cumsum(nearer >= _TARGETS, axis=1)
        last = np.argmax(others == _OTHERS, axis=1)
        within = np.arange(near.shape[1]) <= last[:, None]
        hits = ((nearer == 0) & within & (turn > 0)).sum(axis=1)
        often = np.flatnonzero((others[:, -1] >= _OTHERS) & (hits >= _NEEDED[before]))
        if not len(often):
            return result, result
        dense, distance, near, within, last = (array[often] for array in (dense, distance, near, within, last))
        radius = np.maximum(distance[np.arange(len(dense)), last], _NEAREST)
        # the volume of an ellipsoid as they lie: many places are flat
        off = _off(places[near], at[dense, None], around)
        spread = (off * (within / (last[:, None] + 1.0))[:, :, None]).swapaxes(1, 2) @ off * (d + 2.0)
        size = np.minimum(np.sqrt(np.linalg.det(spread + _NEAREST**2 * np.eye(d))), radius**d)
        ratio = (last + 1) / (size * usual)
        denser = np.flatnonzero(ratio > least)
        if not len(denser):
            return result, result
        dense, near, within, ratio = (array[denser] for array in (dense, near, within, ratio))
        # or of the sites there: those far away add nothing
        _, row, count, middle = self._points[s]
        found = tree.query(at[dense], min(_LOOKED_AT, len(places)), distance_upper_bound=_FAR)
        apart, about = (np.asarray(array) for array in found)
        some = 8 * math.ceil(np.count_nonzero(np.isfinite(apart), axis=1).max() / 8.0)
        apart, about = apart[:, :some], np.minimum(about[:, :some], len(places) - 1)
        square = (_off(middle[row[about]], at[dense, None], around) ** 2).sum(axis=2)
        spread = 1.0 + 1.0 / count[row[about]]
        each = np.exp(-0.5 * square / spread) * (2.0 * math.pi * spread) ** (-0.5 * d)
        standing = np.where(np.isfinite(apart), each, 0.0).sum(axis=1) * ball / usual
        result[dense] = np.log(np.maximum(np.maximum(ratio, standing), 1.0))
        P = sensor.detection_probability
        if before < YOUNG:
            # of what is about the place, nothing: targets that fly alone are predicted well, and near by
            sure = (flicker_ratio(sites, clocks, P, now)[near] * within).sum(axis=1) > -NEEDED
            used[dense] = ((votes[near] * within).sum(axis=1) >= 0.0) & sure
            return np.where(used, result, 0.0), result
        if told[told > 0.0].sum() > NEEDED:
            about = np.asarray(tree.query(at[dense], min(_LOOKED_AT, len(places)))[1])
            shown = told[about].sum(axis=1) > NEEDED
            if shown.any():
                flickers = flicker_ratio(sites, clocks, P, None)
                used[dense] = shown & (flickers[about].sum(axis=1) > 0.0)
        return np.where(used, result, 0.0), result

    def after(
        self, sensors: Sequence[Sensor], scan: Scan, turns: Array, votes: Sequence[Array] | None = None
    ) -> ClutterMap:
        """The map after a scan in which each sensor made so many turns, (S,).

        `votes` (n_s,) are those of its plots. Sensors that did not look have no turns to compare: they keep none.
        """
        kept: list[tuple[Array, ...]] = []
        votes = [np.zeros(len(z)) for z in scan.measurements] if votes is None else votes
        for s, sensor in enumerate(sensors):
            fresh = np.arange(len(votes[s]) if turns[s] > 0.0 else 0)
            when = np.concatenate([self.clocks[s], np.full(len(fresh), self.clock[s])])
            last = slice(max(int(np.searchsorted(when, self.clock[s] - _TURNS)), len(when) - _PLOTS), None)
            at = _places(sensor, scan.measurements[s][fresh])
            own = self._found_at(s, at)
            pairs = (self.places[s], at), (self.votes[s], votes[s][fresh]), (self.sites[s], own)
            places, said, sites = (np.concatenate(pair)[last] for pair in pairs)
            kept.append((places, when[last], said, sites))
        places_of_all, clocks, votes_of_all, sites_of_all = zip(*kept, strict=True)
        return ClutterMap(places_of_all, clocks, self.clock + turns, votes_of_all, sites_of_all, self.around)

    def _found_at(self, s: int, at: Array) -> Array:
        """Sites of the sensor's plots ``at`` in a scan, given those of all before: numbers, the same or new ones, (n,).

        No two of a scan are of one; those that more plots came back to are likelier, as tables of a Chinese restaurant
        are.
        """
        d, around, sites = at.shape[1], self.around[s], self.sites[s]
        none = float(sites.max(initial=0.0)) + 1.0
        fresh = none + np.arange(len(at))
        if not len(sites) or not len(at):
            return fresh
        number, _, count, mean = self._points[s]
        gate = 2.0 * gammaincinv(0.5 * d, _OWN)
        tree, most = _tree(mean, around), [*range(1, min(_SITES, len(number)) + 1)]
        apart, near = (np.asarray(found) for found in tree.query(at, most, distance_upper_bound=math.sqrt(2.0 * gate)))
        who, which = np.nonzero(np.isfinite(apart))
        site, spread = near[who, which], 1.0 + 1.0 / count[near[who, which]]
        square = apart[who, which] ** 2 / spread
        fit = square + d * np.log(spread) - 2.0 * np.log(count[site])
        free = np.ones(len(number), dtype=np.bool_)
        for k in np.argsort(fit, kind="stable").tolist():
            if square[k] <= gate and fresh[who[k]] >= none and free[site[k]]:
                free[site[k]] = False
                fresh[who[k]] = number[site[k]]
        return fresh


def _units(sensor: Sensor) -> Array:
    return np.sqrt(np.diagonal(sensor.position_part.covariance))


def _around(sensor: Sensor) -> Any:
    """After how many units each component comes back, 0: never."""
    angular = sensor.position_part.angular
    pairs = zip(_units(sensor), angular, strict=False)
    return [(2.0 * math.pi + 1e-9) / unit if turning else 0.0 for unit, turning in pairs][: sensor.position_part.dim]


def _tree(places: Array, around: Any) -> cKDTree:
    """Searched for neighbours; made in half the time, and hardly slower, for not being balanced."""
    return cKDTree(places, boxsize=around, balanced_tree=False, compact_nodes=False)


def _middles(sites: Array, places: Array, around: Any) -> Points:
    """Of each site its number; the row of each plot among these; and of each site how many plots, and their mean."""
    number, first, row, count = np.unique(sites, return_index=True, return_inverse=True, return_counts=True)
    off, period = _off(places, places[first][row], around), np.array(around)
    mean = places[first] + np.stack([np.bincount(row, column) for column in off.T], axis=1) / count[:, None]
    turning = period > 0.0
    # twice: what is hardly below 0 comes to a full turn
    mean[:, turning] = np.mod(np.mod(mean[:, turning], period[turning]), period[turning])
    return number, row, count, mean


def flicker_ratio(sites: Array, clocks: Array, probability: float, now: float | None) -> Array:
    """How likely the turns with plots of each plot's site are, (n,), if it flickers rather than stands as targets do.

    Logarithms of ratios, those of a site shared among its plots. A target is detected with this probability, or silent
    for some turns, which is rare; what flickers returns plots at any rate up to half of it. The first plot of a site
    and the last do not count: what moves comes by once, what stood may have left. With ``now`` it is still there.
    """
    _, row, count = np.unique(sites, return_inverse=True, return_counts=True)
    order = np.lexsort((clocks, row))
    when, site = clocks[order], row[order]
    ends = np.append(np.diff(site) > 0, True)
    # turns without a plot until the next of the site
    later = np.where(ends, when + 1.0 if now is None else now, np.roll(when, -1))
    gap = np.maximum(np.rint(later - when) - 1.0, 0.0)
    missed = np.bincount(site, gap)
    hits, most = np.maximum(count - (2.0 if now is None else 1.0), 0.0), 0.5 * probability
    target = hits * math.log(probability) + np.bincount(site, np.maximum(gap * math.log1p(-probability), _SILENT))
    flicker = betaln(hits + 1.0, missed + 1.0) + np.log(betainc(hits + 1.0, missed + 1.0, most) / most)
    return np.asarray(((flicker - target) / count)[row])


def _near_gains(at: Array, places: Array, told: Array, apart: float, around: Any) -> Array:
    """Whether the evidence of plots for a place, so near or nearer, might suffice, were there none against it; (n,)."""
    gained = told > 0.0
    if not len(at) or not gained.any():
        return np.zeros(len(at), dtype=np.bool_)
    near = np.asarray(_tree(places[gained], around).query(at, _GAINS, distance_upper_bound=apart)[1])
    return np.asarray(np.append(told[gained], 0.0)[near].sum(axis=1) > NEEDED)


def _nearer_of_turn(turn: Array) -> Array:
    """How many before each in its row are of the same turn, of neighbours by their distances (K, n)."""
    nearer = np.zeros(turn.shape, dtype=np.int64)
    for one in np.unique(turn).tolist():
        own = turn == one
        nearer += own * (np.cumsum(own, axis=1) - 1)
    return nearer


def _off(one: Array, other: Array, around: Any) -> Array:
    """Differences of places, the short way round."""
    off, period = one - other, np.array(around)
    return np.asarray(off - period * np.rint(off / np.where(period > 0.0, period, np.inf)))


def _places(sensor: Sensor, measured: Array) -> Array:
    """Measurements in units of the noise."""
    part = sensor.position_part
    z = measured[:, : part.dim].copy()
    turning = list(part.angular[: part.dim])
    z[:, turning] = np.mod(z[:, turning], 2.0 * math.pi)
    return np.asarray(z / _units(sensor))
