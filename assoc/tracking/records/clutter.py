"""Where false alarms come from: their density at each measurement, by the plots that lie near it.

The last plots of each sensor are kept. Of those near a measurement, the nearest three of each turn may be of targets:
only the others show clutter, and the density follows from the distance within which there are six of them, in units of
the sensor's noise. A wind farm, a shore or a road returns many plots from the same place in every turn; targets that
fly together are as dense, but go on: a place must surely have returned plots in more than half of the turns before.
And it must have predicted its plots surely better than tracks did (`assoc.tracking.records.prequential`), and than
targets that stand would, each by what came before: where targets circle, each is near its own track, and what stands
comes back to where it was, tracked or not, as often as the sensor detects targets; clutter lies anywhere in its place,
or flickers. In the first turns nobody can be sure, and what may be a place is in doubt unless either has predicted its
plots better.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import gammaincinv, xlog1py, xlogy

from assoc._types import Array
from assoc.scene.scan import Scan
from assoc.sensors import Sensor
from assoc.tracking.records.prequential import NEEDED

_TURNS, _PLOTS = 10.0, 2000
"""Plots are kept for so many turns, and at most so many of a sensor."""
# of so many neighbours, and this many of a turn may be of targets; the density follows from so many others
_LOOKED_AT, _TARGETS, _OTHERS = 64, 3, 6
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
# returns of one point are no denser than noise lets them be
_NEAREST = 1.0
# no two plots of one target are so far apart, in units of the noise
_FAR = 8.0


class ClutterMap(NamedTuple):
    """The last plots of S sensors."""

    places: tuple[Array, ...]
    """In units of the noise, azimuths from 0 to a full turn; (n_s, d_s) each."""
    clocks: tuple[Array, ...]
    """Turns of the sensor when they came; (n_s,) each."""
    clock: Array
    """Turns of each sensor so far, (S,)."""
    votes: tuple[Array, ...]
    """Evidence of each plot that its place predicted it better than tracks, and what stands, did; (n_s, 2) each."""

    @staticmethod
    def empty(sensors: Sequence[Sensor]) -> ClutterMap:
        """No plots."""
        none = [np.zeros((0, sensor.position_part.dim)) for sensor in sensors]
        nothing = tuple(np.zeros(0) for _ in sensors)
        return ClutterMap(tuple(none), nothing, np.zeros(len(sensors)), tuple(np.zeros((0, 2)) for _ in sensors))

    def arrays(self) -> dict[str, Array]:
        """Everything as plain arrays."""
        found = {f"places.{s}": array for s, array in enumerate(self.places)}
        for name, arrays in (("clocks", self.clocks), ("votes", self.votes)):
            found |= {f"{name}.{s}": array for s, array in enumerate(arrays)}
        return found | {"clock": self.clock}

    def restored(self, arrays: Mapping[str, Array]) -> ClutterMap:
        """The map, of as many sensors as this one, from the `arrays` of another."""
        sensors = range(len(self.places))
        names = ("places", "clocks", "votes")
        places, clocks, votes = (tuple(arrays[f"{name}.{s}"] for s in sensors) for name in names)
        return ClutterMap(places, clocks, arrays["clock"], votes)

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
                known = self.places[s], self.clocks[s], self.votes[s]
                found.append(_densities(sensor, at, *known, float(self.clock[s])))
        used, every = zip(*found, strict=True)
        return used, every

    def standing(self, sensor: Sensor, s: int, at: Array) -> Array:
        """Density of plots of targets that stand, at measurements of sensor s, relative to its false alarms, (n,).

        Each plot so far may have been of one, that stands where the plots near by are on average; unless these came
        more seldom than by the sensor's detection probability: turbines and masts flicker.
        """
        turns, part, places = min(round(float(self.clock[s])), _TURNS), sensor.position_part, self.places[s]
        if not len(at) or not len(places) or turns < 1:
            return np.zeros(len(at))
        around, z, most = _around(sensor), _places(sensor, at), min(_LOOKED_AT, len(places))
        tree = cKDTree(places, boxsize=around)
        nearest = [*range(1, most + 1)]
        apart, near = (np.asarray(found) for found in tree.query(z, nearest, distance_upper_bound=_FAR))
        who, which = np.nonzero(np.isfinite(apart))
        some, row = np.unique(near[who, which], return_inverse=True)
        apart, mates = (np.asarray(found) for found in tree.query(places[some], nearest))
        weights = np.exp(-0.25 * apart**2)
        count = weights.sum(axis=1)
        mean = (weights[:, :, None] * _off(places[mates], places[some][:, None], around)).sum(axis=1) / count[:, None]
        off = _off(z[who], (places[some] + mean)[row], around)
        age = np.rint(float(self.clock[s]) - self.clocks[s]).astype(np.int64)
        # two plots of one target are nearer to each other than this, 95 % sure
        own, mate = np.nonzero(apart**2 <= 4.0 * gammaincinv(0.5 * part.dim, _SURE))
        seen = np.zeros((len(some), int(_TURNS) + 2), dtype=np.bool_)
        seen[own, np.clip(age[mates[own, mate]], 0, int(_TURNS) + 1)] = True
        share = _steadiness(seen, sensor.detection_probability)[row] * sensor.detection_probability
        spread = 1.0 + 1.0 / count[row]
        usual = part.false_alarm_rate / part.volume * float(np.prod(_units(sensor))) * turns
        density = share * (2.0 * math.pi * spread) ** (-0.5 * part.dim) * np.exp(-0.5 * (off**2).sum(axis=1) / spread)
        return np.bincount(who, density, len(at)) / usual

    def after(
        self, sensors: Sequence[Sensor], scan: Scan, turns: Array, votes: Sequence[Array] | None = None
    ) -> ClutterMap:
        """The map after a scan in which each sensor made so many turns, (S,).

        `votes` (n_s, 2) are those of its plots. Sensors that did not look have no turns to compare: they keep none.
        """
        kept: list[tuple[Array, ...]] = []
        votes = [np.zeros((len(z), 2)) for z in scan.measurements] if votes is None else votes
        for s, sensor in enumerate(sensors):
            fresh = np.arange(len(votes[s]) if turns[s] > 0.0 else 0)
            when = np.concatenate([self.clocks[s], np.full(len(fresh), self.clock[s])])
            last = slice(max(int(np.searchsorted(when, self.clock[s] - _TURNS)), len(when) - _PLOTS), None)
            places = np.concatenate([self.places[s], _places(sensor, scan.measurements[s][fresh])])
            kept.append((places[last], when[last], np.concatenate([self.votes[s], votes[s][fresh]])[last]))
        places_of_all, clocks, votes_of_all = zip(*kept, strict=True)
        return ClutterMap(places_of_all, clocks, self.clock + turns, votes_of_all)


def _units(sensor: Sensor) -> Array:
    return np.sqrt(np.diagonal(sensor.position_part.covariance))


def _around(sensor: Sensor) -> Any:
    """After how many units each component comes back, 0: never."""
    angular = sensor.position_part.angular
    pairs = zip(_units(sensor), angular, strict=False)
    return [(2.0 * math.pi + 1e-9) / unit if turning else 0.0 for unit, turning in pairs][: sensor.position_part.dim]


def _steadiness(seen: Array, probability: float) -> Array:
    """How likely plots in these turns, bool (n, T), are of a target that is detected with this probability, (n,).

    Relative to one that returns plots half as often or less; at most 1. The first and the last plot do not count.
    """
    between = seen.shape[1] - np.argmax(seen[:, ::-1], axis=1) - np.argmax(seen, axis=1) - 2
    hits = np.maximum(seen.sum(axis=1) - 2.0, 0.0)
    missed = np.maximum(between - hits, 0.0)
    rate = np.minimum(hits / np.maximum(between, 1), 0.5 * probability)
    gain = xlogy(hits, probability) - xlogy(hits, rate) + xlog1py(missed, -probability) - xlog1py(missed, -rate)
    return np.asarray(np.exp(np.minimum(gain, 0.0)))


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


def _densities(
    sensor: Sensor, at: Array, places: Array, clocks: Array, votes: Array, now: float
) -> tuple[Array, Array]:
    """See `ClutterMap.used_and_found`: of these places ``at``."""
    n, part = len(at), sensor.position_part
    result, used = np.zeros(n), np.zeros(n, dtype=np.bool_)
    before = int(min(round(now), _TURNS))
    age, turns = np.rint(now - clocks), max(before, 1)
    if len(places) <= _OTHERS or not n:
        return result, result
    units, d, around = _units(sensor), part.dim, _around(sensor)
    # volume of a ball of radius 1, and false alarms there in these turns
    ball = math.pi ** (d / 2.0) / math.gamma(d / 2.0 + 1.0)
    usual = part.false_alarm_rate / part.volume * float(np.prod(units)) * turns * ball
    least = max(_LEAST, _IN_GATE * turns / (_GATE**d * usual))
    tree, near_by = cKDTree(places, boxsize=around), (_OTHERS / (least * usual)) ** (1.0 / d)
    # few places are dense: only there many neighbours are sought
    farther = np.asarray(tree.query(at, [_OTHERS + 1], distance_upper_bound=near_by)[0])[:, 0]
    dense = np.flatnonzero(farther < near_by)
    if not len(dense):
        return result, result
    distance, near = (np.asarray(array) for array in tree.query(at[dense], min(_LOOKED_AT, len(places))))
    turn = age[near]
    nearer = np.tril(turn[:, :, None] == turn[:, None, :], -1).sum(axis=2)
    others = np.cumsum(nearer >= _TARGETS, axis=1)
    last = np.argmax(others == _OTHERS, axis=1)
    within = np.arange(near.shape[1]) <= last[:, None]
    hits = ((nearer == 0) & within & (turn > 0)).sum(axis=1)
    often = np.flatnonzero((others[:, -1] >= _OTHERS) & (hits >= _NEEDED[before]))
    dense, distance, near, within, last = (array[often] for array in (dense, distance, near, within, last))
    radius = np.maximum(distance[np.arange(len(dense)), last], _NEAREST)
    # the volume of an ellipsoid as they lie: many places are flat
    off = _off(places[near], at[dense, None], around)
    spread = np.einsum("kn,kni,knj->kij", within / (last[:, None] + 1.0), off, off) * (d + 2.0)
    size = np.minimum(np.sqrt(np.linalg.det(spread + _NEAREST**2 * np.eye(d))), radius**d)
    ratio = (last + 1) / (size * usual)
    result[dense] = np.where(ratio > least, np.log(np.maximum(ratio, 1.0)), 0.0)
    if before >= YOUNG:
        # of the first turns tracks know too little, but what stands shows from the second on
        counts = np.stack([clocks[near] >= YOUNG - 1.0, np.ones(near.shape, dtype=np.bool_)], axis=2)
        used[dense] = ((votes[near] * counts).sum(axis=1) > NEEDED).all(axis=1)
    else:
        # of what is about the place, nothing: targets that fly alone are predicted well, and near by
        used[dense] = ((votes[near] * within[:, :, None]).sum(axis=1) >= 0.0).all(axis=1)
    return np.where(used, result, 0.0), result
