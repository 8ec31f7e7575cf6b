"""What goes into a live tracker, and what comes out of it."""

from __future__ import annotations

from typing import NamedTuple

from assoc._types import Array
from assoc.tracking.track import Track

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
