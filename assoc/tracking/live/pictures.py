"""Records of a live tracker: plots, antennas, and the picture after a step."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from assoc._types import Array
from assoc.scene.own_times import FULL_TURN
from assoc.tracking.quality import TrackQuality
from assoc.tracking.records.track import Track

SILENCE = 15.0
"""Seconds, or three turns, without a plot after which a sensor is treated as switched off."""
# the antenna's phase is a mean over about this many turns, with this weight of a plot, and known after so many plots
_TURNS_KEPT, _WEIGHT, _KNOWN = 10.0, 0.05, 5


PlotKey = tuple[int, float, bytes]
"""Sensor, time, values."""


class CheckedPlot(NamedTuple):
    """A plot that passed all checks."""

    sensor: int
    time: float
    z: Array
    identity: Array
    """Mode 3/A code and ICAO address, (2,)."""

    @property
    def key(self) -> PlotKey:
        """Equal for a plot and its repetitions."""
        return self.sensor, self.time, self.z.tobytes()


class Picture(NamedTuple):
    """The situation at the end of a step."""

    time: float
    """Seconds."""
    tracks: list[Track]
    """Confirmed tracks, sorted by id."""
    ended: list[int]
    """Ids of confirmed tracks that ended in this step."""
    plots: Array
    """Positions of the plots that came in since the last step, (n, 3), metres."""
    sensors: Array
    """Sensor of each plot, (n,)."""
    agreements: Mapping[int, TrackQuality] = MappingProxyType({})
    """By track id, if the tracker was made with `quality`."""
    names: Mapping[int, str] = MappingProxyType({})
    """Codes or addresses by track id, of those that have one."""


class SensorState(NamedTuple):
    """What is known of a sensor; plots of one radar with heights and without count as one."""

    name: str
    last: float
    """Time of its newest plot, seconds; -inf before the first."""
    plots: int
    """Plots used since the tracks began."""
    refused: int
    """Plots that could not be used."""
    silent: bool
    """Whether it is treated as switched off."""
    parts: tuple[int, ...] = ()
    """Its sensors in the scene."""


class Antenna(NamedTuple):
    """An antenna, as estimated from its plots so far."""

    last: float = -math.inf
    """Time of the newest plot, seconds."""
    plots: int = 0
    phase: complex = 0j
    """Mean of the directions at which turns begin, weighted by age."""
    silent: bool = False

    def after(self, time: float, azimuth: float, turn: float | None) -> Antenna:
        """The antenna after a plot at `azimuth` (radians); `turn`: seconds for a turn, None if it does not turn."""
        phase = self.phase
        if turn is not None:
            elapsed = max(time - self.last, 0.0) if self.plots else 0.0
            direction = cmath.exp(1j * (azimuth + FULL_TURN * ((time / turn) % 1.0)))
            phase = phase * math.exp(-elapsed / (_TURNS_KEPT * turn)) + _WEIGHT * direction
        return Antenna(max(self.last, time), self.plots + 1, phase)

    def falls_silent(self, end: float, turn: float | None) -> bool:
        """Whether it has become silent by the time `end`, and was not known to be."""
        return self.plots > 0 and not self.silent and end - self.last > max(SILENCE, 3.0 * (turn or 0.0))

    def sector(self, end: float, interval: float, turn: float | None, sent: bool) -> tuple[float, float]:
        """Azimuths swept in the `interval` seconds before `end`; `sent`: whether any plot came from it."""
        if self.silent:
            return 0.0, 0.0
        if turn is None:
            return 0.0, FULL_TURN if sent else 0.0
        if self.plots < _KNOWN:
            return 0.0, 0.0
        low = cmath.phase(self.phase) - FULL_TURN * ((end / turn) % 1.0)
        return low, low + min(FULL_TURN * interval / turn, FULL_TURN)
