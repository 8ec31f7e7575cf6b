"""Where false alarms come from: their density at each measurement, by the plots that lie near it.

The last plots of each sensor are kept, whoever took them. Of those near a measurement, the nearest three of each turn
may be of targets: only the others show clutter, and the density follows from the distance within which there are six
of them, in units of the sensor's noise. So neither are targets that stand or circle each other's clutter, nor are
trails of those that move; a wind farm, a shore or a road returns many plots from the same place in every turn.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from assoc._types import Array
from assoc.scene.scan import Scan
from assoc.sensors import Sensor

_TURNS, _PLOTS = 10.0, 2000
"""Plots are kept for so many turns, and at most so many of a sensor."""
# of so many neighbours, and this many of a turn may be of targets; the density follows from so many others
_LOOKED_AT, _TARGETS, _OTHERS = 64, 3, 6
# it is clutter of a place at so many times the density of false alarms, and so many plots a turn within this distance:
# traffic is less dense
_LEAST, _IN_GATE, _GATE = 30.0, 0.002, 4.0
# returns of one point are no denser than noise lets them be
_NEAREST = 1.0


class ClutterMap(NamedTuple):
    """The last plots of S sensors."""

    places: tuple[Array, ...]
    """In units of the noise, azimuths from 0 to a full turn; (n_s, d_s) each."""
    clocks: tuple[Array, ...]
    """Turns of the sensor when they came; (n_s,) each."""
    clock: Array
    """Turns of each sensor so far, (S,)."""

    @staticmethod
    def empty(sensors: Sequence[Sensor]) -> ClutterMap:
        """No plots."""
        none = [np.zeros((0, sensor.position_part.dim)) for sensor in sensors]
        return ClutterMap(tuple(none), tuple(np.zeros(0) for _ in sensors), np.zeros(len(sensors)))

    def arrays(self) -> dict[str, Array]:
        """Everything as plain arrays."""
        found = {f"places.{s}": array for s, array in enumerate(self.places)}
        return found | {f"clocks.{s}": array for s, array in enumerate(self.clocks)} | {"clock": self.clock}

    def restored(self, arrays: Mapping[str, Array]) -> ClutterMap:
        """The map, of as many sensors as this one, from the `arrays` of another."""
        sensors = range(len(self.places))
        places, clocks = (tuple(arrays[f"{name}.{s}"] for s in sensors) for name in ("places", "clocks"))
        return ClutterMap(places, clocks, arrays["clock"])

    def densities(self, sensors: Sequence[Sensor], scan: Scan) -> tuple[Array, ...]:
        """Logarithms of the densities at a scan's measurements relative to that of the sensors' false alarms, >= 0."""
        found = []
        for s, sensor in enumerate(sensors):
            here = _places(sensor, scan.measurements[s])
            found.append(_densities(sensor, here, self.places[s], self.clocks[s], float(self.clock[s])))
        return tuple(found)

    def after(self, sensors: Sequence[Sensor], scan: Scan, turns: Array) -> ClutterMap:
        """The map after a scan in which each sensor made so many turns, (S,)."""
        places, clocks = [], []
        for s, sensor in enumerate(sensors):
            when = np.concatenate([self.clocks[s], np.full(len(scan.measurements[s]), self.clock[s])])
            kept = slice(max(int(np.searchsorted(when, self.clock[s] - _TURNS)), len(when) - _PLOTS), None)
            places.append(np.concatenate([self.places[s], _places(sensor, scan.measurements[s])])[kept])
            clocks.append(when[kept])
        return ClutterMap(tuple(places), tuple(clocks), self.clock + turns)


def _units(sensor: Sensor) -> Array:
    return np.sqrt(np.diagonal(sensor.position_part.covariance))


def _places(sensor: Sensor, measured: Array) -> Array:
    """Measurements in units of the noise."""
    part = sensor.position_part
    z = measured[:, : part.dim].copy()
    turning = list(part.angular[: part.dim])
    z[:, turning] = np.mod(z[:, turning], 2.0 * math.pi)
    return np.asarray(z / _units(sensor))


def _densities(sensor: Sensor, here: Array, places: Array, clocks: Array, now: float) -> Array:
    n, part = len(here), sensor.position_part
    result = np.zeros(n)
    every = np.concatenate([places, here])
    if len(every) <= _OTHERS or not n:
        return result
    units, d = _units(sensor), part.dim
    around: Any = [
        (2.0 * math.pi + 1e-9) / unit if turns else 0.0 for unit, turns in zip(units, part.angular, strict=False)
    ]
    # volume of a ball of radius 1, and false alarms there since the first plot
    ball = math.pi ** (d / 2.0) / math.gamma(d / 2.0 + 1.0)
    span = max(now - float(clocks[0]) if len(clocks) else 0.0, 0.0) + 1.0
    usual = part.false_alarm_rate / part.volume * float(np.prod(units)) * span * ball
    least = max(_LEAST, _IN_GATE * span / (_GATE**d * usual))
    tree, near_by = cKDTree(every, boxsize=around), (_OTHERS / (least * usual)) ** (1.0 / d)
    # few places are dense: only there many neighbours are sought
    farther = np.asarray(tree.query(here, [_OTHERS + 1], distance_upper_bound=near_by)[0])[:, 0]
    dense = np.flatnonzero(farther < near_by)
    if not len(dense):
        return result
    distance, near = (np.asarray(array) for array in tree.query(here[dense], min(_LOOKED_AT, len(every))))
    turn = np.floor(np.append(clocks, np.full(n, now)))[near]
    nearer = np.tril(turn[:, :, None] == turn[:, None, :], -1).sum(axis=2)
    others = np.cumsum(nearer >= _TARGETS, axis=1)
    last = np.argmax(others == _OTHERS, axis=1)
    radius = np.maximum(distance[np.arange(len(dense)), last], _NEAREST)
    ratio = (last + 1) / (radius**d * usual)
    result[dense] = np.where((others[:, -1] >= _OTHERS) & (ratio > least), np.log(np.maximum(ratio, 1.0)), 0.0)
    return result
