"""What goes into a live tracker, what it knows of the sensors by it, and what comes out."""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

from assoc._types import Array
from assoc.scene.own_times import FULL_TURN
from assoc.tracking.track import Track

SILENCE = 15.0
"""Seconds, or three turns, without a plot after which a sensor is treated as switched off."""
# the antenna's phase is a mean over about this many turns, with this weight for a plot, and known after so many
_TURNS_KEPT, _WEIGHT, _KNOWN = 10.0, 0.05, 5


PlotKey = tuple[int, float, bytes]
"""Sensor, time, values."""


class SoundPlot(NamedTuple):
    """A plot that is sound."""

    sensor: int
    time: float
    z: Array
    identity: Array
    """Mode 3/A code and ICAO address, (2,)."""

    @property
    def key(self) -> PlotKey:
        """What a repeated plot has in common with the first."""
        return self.sensor, self.time, self.z.tobytes()


class Picture(NamedTuple):
    """What is known at the end of a step."""

    time: float
    """Seconds."""
    tracks: list[Track]
    """Confirmed ones, by their ids."""
    ended: list[int]
    """Confirmed tracks that are no more."""
    plots: Array
    """Positions of the plots that came in since the last step, (n, 3), metres."""
    sensors: Array
    """Sensor of each of these, (n,)."""


class Antenna(NamedTuple):
    """A sensor by its plots so far."""

    last: float = -math.inf
    """Time of the newest plot, seconds."""
    plots: int = 0
    phase: complex = 0j
    """Mean of the directions at which turns begin, weighted by age."""
    silent: bool = False

    def after(self, time: float, azimuth: float, turn: float | None) -> Antenna:
        """The antenna after a plot; `azimuth` (radians) counts where it turns, in `turn` seconds."""
        phase = self.phase
        if turn is not None:
            elapsed = max(time - self.last, 0.0) if self.plots else 0.0
            direction = cmath.exp(1j * (azimuth + FULL_TURN * ((time / turn) % 1.0)))
            phase = phase * math.exp(-elapsed / (_TURNS_KEPT * turn)) + _WEIGHT * direction
        return Antenna(max(self.last, time), self.plots + 1, phase)

    def falls_silent(self, end: float, turn: float | None) -> bool:
        """Whether it sends nothing any more at this time, and it was not known."""
        return self.plots > 0 and not self.silent and end - self.last > max(SILENCE, 3.0 * (turn or 0.0))

    def sector(self, end: float, interval: float, turn: float | None, sent: bool) -> tuple[float, float]:
        """Where it looked in an interval (both seconds), in which it has sent plots or not."""
        if self.silent:
            return 0.0, 0.0
        if turn is None:
            return 0.0, FULL_TURN if sent else 0.0
        if self.plots < _KNOWN:
            return 0.0, 0.0
        low = cmath.phase(self.phase) - FULL_TURN * ((end / turn) % 1.0)
        return low, low + min(FULL_TURN * interval / turn, FULL_TURN)
