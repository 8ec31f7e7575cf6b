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

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import betainc, betaln, gammaincinv

from assoc._types import Array
from assoc.scene.scan import Scan
from assoc.sensors import Sensor
from assoc.tracking.records.neighbours import Cells, cells_of, near
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
# where no place shows so many measurements are weighed in one of so many turns, and as many about sites with so many
# plots: what moves seldom has such
_WEIGHED, _EVERY, _STANDS = 64, 6, 4
# as evidence count so many of the plots about one
_MOST = 256
# multiples of it, without the whole, come near to all numbers from 0 to 1 soon
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
# returns of one point are no denser than noise lets them be
_NEAREST = 1.0
# a plot is of a site if it lies where so many of a target's would; of so many sites at most
_OWN, _SITES = 0.99, 16
# a target falls silent for longer, or is hidden, once in a hundred turns
_SILENT = -math.log(100.0)
# what is saved of each sensor
_SAVED = ("places", "clocks", "votes", "sites")


@dataclass(frozen=True, eq=False)
class Plots:
    """The last plots of a sensor, in the order in which they came."""

    places: Array
    """In units of the noise, azimuths from 0 to a full turn; (n, d)."""
    clocks: Array
    """Turns of the sensor when they came; (n,)."""
    votes: Array
    """Evidence of each plot that its place predicted it better than tracks did; (n,)."""
    sites: Array
    """Number of the point to which each plot came back, from 0 without gaps; (n,)."""
    around: Array
    """After how many units each component comes back, 0: never; (d,)."""

    @cached_property
    def tree(self) -> cKDTree:
        """The places, to be searched for neighbours."""
        return _tree(self.places, self.around)

    @cached_property
    def points(self) -> tuple[Array, Array]:
        """Of each site how many plots, and their mean."""
        sites, places, period = self.sites, self.places, self.around
        count = np.bincount(sites)
        first = np.zeros(len(count), dtype=np.int64)
        first[sites[::-1]] = np.arange(len(sites))[::-1]
        mean, later = places[first], np.flatnonzero(first[sites] != np.arange(len(sites)))
        own = sites[later]
        off = _off(places[later], mean[own], period)
        mean += np.stack([np.bincount(own, column, len(count)) for column in off.T], axis=1) / count[:, None]
        turning = period > 0.0
        # twice: what is hardly below 0 comes to a full turn
        mean[:, turning] = np.mod(np.mod(mean[:, turning], period[turning]), period[turning])
        return count, mean

    @cached_property
    def told(self) -> Array:
        """The votes, without those of the first turns, of which tracks know too little; (n,)."""
        return np.where(self.clocks >= YOUNG - 1.0, self.votes, 0.0)

    @cached_property
    def _cells(self) -> dict[float, Cells]:
        """Of all plots by a side, and of those that are evident by minus a side: they are asked for again."""
        return {}

    def with_fresh(self, at: Array, votes: Array, clock: float) -> Plots:
        """These and plots at such places with such votes, now; without those that are too old or too many."""
        clocks = np.concatenate([self.clocks, np.full(len(at), clock)])
        last = slice(max(int(np.searchsorted(clocks, clock - _TURNS)), len(clocks) - _PLOTS), None)
        pairs = (self.places, at), (self.votes, votes), (self.sites, self._found_at(at))
        places, said, sites = (np.concatenate(pair)[last] for pair in pairs)
        return Plots(places, clocks[last], said, _without_gaps(sites), self.around)

    def _found_at(self, at: Array) -> Array:
        """Sites of the plots ``at`` in a scan, given those of all before: numbers, the same or new ones, (n,).

        No two of a scan are of one; those that more plots came back to are likelier, as tables of a Chinese restaurant
        are.
        """
        d, none = at.shape[1], int(self.sites.max(initial=-1)) + 1
        fresh = none + np.arange(len(at))
        if not none or not len(at):
            return fresh
        count, mean = self.points
        gate = 2.0 * gammaincinv(0.5 * d, _OWN)
        found, square, some = near(cells_of(mean, self.around, math.sqrt(2.0 * gate)), at, _SITES)
        who, which = np.nonzero(np.arange(_SITES) < some[:, None])
        site, square = found[who, which], square[who, which]
        spread = 1.0 + 1.0 / count[site]
        within = np.flatnonzero(square <= gate * spread)
        who, site, spread = who[within], site[within], spread[within]
        fit = square[within] / spread + d * np.log(spread) - 2.0 * np.log(count[site])
        order, free = np.argsort(fit, kind="stable"), np.ones(none, dtype=np.bool_)
        for one, its in zip(who[order].tolist(), site[order].tolist(), strict=True):
            if fresh[one] >= none and free[its]:
                free[its] = False
                fresh[one] = its
        return fresh

    def densities(self, sensor: Sensor, at: Array, now: float, visit: float | None) -> tuple[Array, Array]:
        """See `ClutterMap.used_and_found`: of places ``at`` in this turn; the visit is for `_to_weigh`."""
        places, clocks, sites = self.places, self.clocks, self.sites
        n, part = len(at), sensor.position_part
        result, used = np.zeros(n), np.zeros(n, dtype=np.bool_)
        before = int(min(round(now), _TURNS))
        age, turns = np.rint(now - clocks), max(before, 1)
        # plots are kept in order; where few turns are left of them, as in crowds, no place can be sure
        known = np.count_nonzero(np.diff(age)) + 1
        if len(places) <= _OTHERS or not n or known - (age[-1] == 0.0) < _NEEDED[before]:
            return result, result
        d = part.dim
        # volume of a ball of radius 1, and false alarms there in these turns
        ball = math.pi ** (d / 2.0) / math.gamma(d / 2.0 + 1.0)
        usual = part.false_alarm_rate / part.volume * float(np.prod(_units(sensor))) * turns * ball
        least = max(_LEAST, _IN_GATE * turns / (_GATE**d * usual))
        near_by = (_OTHERS / (least * usual)) ** (1.0 / d)
        # few places are dense: only there many neighbours are sought
        dense = self._to_weigh(at, near_by, visit if before > YOUNG else None)
        if not len(dense):
            return result, result
        apart, about = (np.asarray(a) for a in self.tree.query(at[dense], min(_LOOKED_AT, len(places))))
        # among so many are enough others, whatever their turns; in eights, as numpy sums: zeros change nothing then
        most = 8 * math.ceil((known * _TARGETS + _OTHERS) / 8.0)
        close = about[:, :most]
        turn = age[close]
        nearer = _nearer_of_turn(turn)
        others = np.cumsum(nearer >= _TARGETS, axis=1)
        last = np.argmax(others == _OTHERS, axis=1)
        within = np.arange(close.shape[1]) <= last[:, None]
        hits = ((nearer == 0) & within & (turn > 0)).sum(axis=1)
        often = np.flatnonzero((others[:, -1] >= _OTHERS) & (hits >= _NEEDED[before]))
        if not len(often):
            return result, result
        dense, apart, about, close, within, last = (a[often] for a in (dense, apart, about, close, within, last))
        radius = np.maximum(apart[np.arange(len(dense)), last], _NEAREST)
        # the volume of an ellipsoid as they lie: many places are flat
        off = _off(places[close], at[dense, None], self.around)
        spread = (off * (within / (last[:, None] + 1.0))[:, :, None]).swapaxes(1, 2) @ off * (d + 2.0)
        size = np.minimum(np.sqrt(np.linalg.det(spread + _NEAREST**2 * np.eye(d))), radius**d)
        ratio = (last + 1) / (size * usual)
        denser = np.flatnonzero(ratio > least)
        if not len(denser):
            return result, result
        dense, apart, about, close, within, ratio = (a[denser] for a in (dense, apart, about, close, within, ratio))
        standing = self._of_sites(at[dense], apart, about) * ball / usual
        result[dense] = np.log(np.maximum(np.maximum(ratio, standing), 1.0))
        P, told = sensor.detection_probability, self.told
        if before < YOUNG:
            # of what is about the place, nothing: targets that fly alone are predicted well, and close by
            sure = (flicker_ratio(sites, clocks, P, now)[close] * within).sum(axis=1) > -NEEDED
            used[dense] = ((self.votes[close] * within).sum(axis=1) >= 0.0) & sure
            return np.where(used, result, 0.0), result
        if told[told > 0.0].sum() > NEEDED:
            shown = told[about].sum(axis=1) > NEEDED
            if shown.any():
                flickers = flicker_ratio(sites, clocks, P, None)
                used[dense] = shown & (flickers[about].sum(axis=1) > 0.0)
        return np.where(used, result, 0.0), result

    def _of_sites(self, at: Array, apart: Array, about: Array) -> Array:
        """Densities ``at`` places of the sites of the plots ``about`` them, so far apart: those far off add nothing."""
        adds = apart < _FAR
        some = 8 * math.ceil(np.count_nonzero(adds, axis=1).max() / 8.0)
        adds, about = adds[:, :some], about[:, :some]
        count, middle = self.points
        square = (_off(middle[self.sites[about]], at[:, None], self.around) ** 2).sum(axis=2)
        spread = 1.0 + 1.0 / count[self.sites[about]]
        each = np.exp(-0.5 * square / spread) * (2.0 * math.pi * spread) ** (-0.5 * at.shape[1])
        return np.where(adds, each, 0.0).sum(axis=1)

    def _to_weigh(self, at: Array, near_by: float, visit: float | None) -> Array:
        """Rows of ``at`` about which plots are dense: enough of them are nearer than this.

        In crowds, of many places and many plots in a turn, those with evidence for a place. Whether one shows elsewhere
        some tell at a visit (0 to 1): those about what stands, and others side by side, from this share of all on;
        below 0 there is none. Without a number all are weighed.
        """
        if near_by not in self._cells:
            self._cells[near_by] = cells_of(self.places, self.around, near_by)
        dense = np.flatnonzero(near(self._cells[near_by], at, _OTHERS + 1)[2] > _OTHERS)
        if len(dense) <= _WEIGHED or len(self.places) <= _WEIGHED * _TURNS or visit is None:
            return dense
        weighed = self._evident(at[dense], 2.0 * near_by)
        if visit >= 0.0:
            count, mean = self.points
            stands = near(cells_of(mean[count >= _STANDS], self.around, _GATE), at[dense], 1)[2] > 0
            order = np.argsort(at[dense, 0], kind="stable")
            weighed[np.flatnonzero(stands)[:_WEIGHED]] = True
            weighed[order[np.arange(_WEIGHED) + int(visit * len(dense)) - len(dense)]] = True
        return dense[weighed]

    def _evident(self, at: Array, apart: float) -> Array:
        """Whether a plot so near, or nearer, has gained, and all that are as near to it together, surely; (n,)."""
        if -apart not in self._cells:
            places, told = (known[self.told != 0.0] for known in (self.places, self.told))
            gained = places[told > 0.0]
            found, _, count = near(cells_of(places, self.around, apart), gained, _MOST)
            sums = np.where(np.arange(_MOST) < count[:, None], told[found] if len(told) else 0.0, 0.0).sum(axis=1)
            self._cells[-apart] = cells_of(gained[sums > NEEDED], self.around, apart)
        return np.asarray(near(self._cells[-apart], at, 1)[2] > 0)


@dataclass(frozen=True, eq=False)
class ClutterMap:
    """The last plots of S sensors."""

    plots: tuple[Plots, ...]
    """Those of each sensor."""
    clock: Array
    """Turns of each sensor so far, (S,)."""

    @staticmethod
    def empty(sensors: Sequence[Sensor]) -> ClutterMap:
        """No plots."""
        none, nothing = np.zeros(0), np.zeros(0, dtype=np.int64)
        plots = (Plots(np.zeros((0, s.position_part.dim)), none, none, nothing, _around(s)) for s in sensors)
        return ClutterMap(tuple(plots), np.zeros(len(sensors)))

    def arrays(self) -> dict[str, Array]:
        """Everything as plain arrays."""
        found = {f"{name}.{s}": getattr(own, name) for name in _SAVED for s, own in enumerate(self.plots)}
        return found | {"clock": self.clock}

    def restored(self, arrays: Mapping[str, Array]) -> ClutterMap:
        """The map, of as many sensors as this one, from the `arrays` of another."""
        plots = []
        for s, own in enumerate(self.plots):
            places, clocks, votes, sites = (arrays[f"{name}.{s}"] for name in _SAVED)
            plots.append(Plots(places, clocks, votes, np.unique(sites, return_inverse=True)[1], own.around))
        return ClutterMap(tuple(plots), arrays["clock"])

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
                now = float(self.clock[s])
                visits, since = divmod(round(now) + 2 * s, _EVERY)
                visit = visits * _GOLDEN % 1.0 if since == 0 else -1.0
                found.append(self.plots[s].densities(sensor, at, now, visit))
        used, every = zip(*found, strict=True)
        return used, every

    def returned(self, sensors: Sequence[Sensor]) -> Array:
        """Plots a turn of the last turns that came from places in use, (S,); 0 in the first turns."""
        found = np.zeros(len(sensors))
        for s, (sensor, own, now) in enumerate(zip(sensors, self.plots, self.clock.tolist(), strict=True)):
            if now > YOUNG:
                dense = own.densities(sensor, own.places, now, None)[0] > 0.0
                found[s] = np.count_nonzero(dense) / min(now, _TURNS)
        return found

    def after(
        self, sensors: Sequence[Sensor], scan: Scan, turns: Array, votes: Sequence[Array] | None = None
    ) -> ClutterMap:
        """The map after a scan in which each sensor made so many turns, (S,).

        `votes` (n_s,) are those of its plots. Sensors that did not look have no turns to compare: they keep none.
        """
        kept = []
        votes = [np.zeros(len(z)) for z in scan.measurements] if votes is None else votes
        for s, (own, sensor) in enumerate(zip(self.plots, sensors, strict=True)):
            some = slice(None if turns[s] > 0.0 else 0)
            at = _places(sensor, scan.measurements[s][some])
            kept.append(own.with_fresh(at, votes[s][some], float(self.clock[s])))
        return ClutterMap(tuple(kept), self.clock + turns)


def _units(sensor: Sensor) -> Array:
    return np.sqrt(np.diagonal(sensor.position_part.covariance))


def _around(sensor: Sensor) -> Array:
    """After how many units each component comes back, 0: never."""
    angular = sensor.position_part.angular
    pairs = zip(_units(sensor), angular, strict=False)
    found = [(2.0 * math.pi + 1e-9) / unit if turning else 0.0 for unit, turning in pairs]
    return np.array(found[: sensor.position_part.dim])


def _tree(places: Array, around: Array) -> cKDTree:
    """Searched for neighbours; made in half the time, and hardly slower, for not being balanced."""
    return cKDTree(places, boxsize=around, balanced_tree=False, compact_nodes=False)


def _without_gaps(sites: Array) -> Array:
    """The same numbers of sites, from 0."""
    return np.asarray(np.cumsum(np.bincount(sites) > 0)[sites] - 1)


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


def _nearer_of_turn(turn: Array) -> Array:
    """How many before each in its row are of the same turn, of neighbours by their distances (K, n)."""
    nearer = np.zeros(turn.shape, dtype=np.int64)
    for one in np.unique(turn).tolist():
        own = turn == one
        nearer += own * (np.cumsum(own, axis=1) - 1)
    return nearer


def _off(one: Array, other: Array, around: Array) -> Array:
    """Differences of places, the short way round."""
    off = one - other
    return np.asarray(off - around * np.rint(off / np.where(around > 0.0, around, np.inf)))


def _places(sensor: Sensor, measured: Array) -> Array:
    """Measurements in units of the noise."""
    part = sensor.position_part
    z = measured[:, : part.dim].copy()
    turning = list(part.angular[: part.dim])
    z[:, turning] = np.mod(z[:, turning], 2.0 * math.pi)
    return np.asarray(z / _units(sensor))
