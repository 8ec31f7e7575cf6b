"""Platforms: ships, vehicles and aircraft that carry sensors, with their position and heading over time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.sensors.arrays import finite_array

# a step is taken for a jump if it is faster than this (m/s) and so many times as fast as nine in ten steps
FAST, FASTER = 100.0, 10.0


@explains_wrong_types
@dataclass(frozen=True, eq=False, repr=False)
class Platform:
    """Where a carrier of sensors is, and which way it points, over time.

    Between the times given, positions lie on straight lines and headings change evenly, by the shorter way round.

    Parameters
    ----------
    times : array_like (K,)
        Seconds, ascending.
    positions : array_like (K, 3)
        Metres, in the scene's frame.
    headings : array_like (K,), optional
        Azimuth of the carrier's forward direction, radians from +x towards +y, within +-2 pi: sensors measure from it,
        and their positions on the carrier turn with it. Left out, sensors measure in the axes of the scene's frame.

    Raises
    ------
    InvalidInputError
        One line that names the argument and what was expected.
    """

    times: Array
    positions: Array
    headings: Array | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        times = finite_array(self.times, "platform: times")
        if times.ndim != 1 or not len(times) or (np.diff(times) <= 0).any():
            raise InvalidInputError("platform: times must be one or more seconds that ascend")
        put(self, "times", times)
        put(self, "positions", finite_array(self.positions, "platform: positions", (len(times), 3)))
        if self.headings is not None:
            put(self, "headings", checked_headings(finite_array(self.headings, "platform: headings", times.shape)))

    @property
    def warning(self) -> str:
        """One line if a step is much faster than the others, "" else; sensors warn of it."""
        speeds = np.linalg.norm(np.diff(self.positions, axis=0), axis=1) / np.diff(self.times)
        k = int(np.argmax(speeds)) if len(speeds) else 0
        if len(speeds) > 1 and speeds[k] > max(FAST, FASTER * float(np.quantile(np.delete(speeds, k), 0.9))):
            return f"platform jumps at {self.times[k]:g} s, with {speeds[k]:.4g} m/s to its next position"
        return ""

    def poses(self, times: Array) -> tuple[Array, Array]:
        """Positions (n, 3) and headings (n,), 0 where they are not given, at times (n,).

        Raises
        ------
        InvalidInputError
            A time is outside of the platform's times.
        """
        when = np.atleast_1d(np.asarray(times, dtype=np.float64))
        first, last = float(self.times[0]), float(self.times[-1])
        if len(when) and not (first <= when.min() and when.max() <= last):
            wrong = float(when.min() if when.min() < first else when.max())
            raise InvalidInputError(
                f"platform: has no position at {wrong:.10g} s, its times are {first:.10g} to {last:.10g} s"
            )
        positions = np.stack([np.interp(when, self.times, column) for column in self.positions.T], axis=1)
        if self.headings is None:
            return positions, np.zeros(len(when))
        return positions, np.interp(when, self.times, np.unwrap(self.headings))

    def velocities(self, times: Array) -> Array:
        """Velocities (n, 3) at times (n,), m/s: those of the steps that hold them."""
        if len(self.times) == 1:
            return np.zeros((len(times), 3))
        steps = np.diff(self.positions, axis=0) / np.diff(self.times)[:, None]
        return steps[np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(steps) - 1)]

    def places(self, times: Array, mounted: Array) -> Array:
        """Positions (n, 3) at times (n,) of what is mounted forward, left and up (3,) of the carrier's, metres."""
        positions, headings = self.poses(times)
        return positions + turned(np.broadcast_to(mounted, positions.shape), headings)

    def of(self, mounted: Array) -> Platform:
        """The path of what is mounted there (3,), with no heading of its own."""
        return Platform(self.times, self.places(self.times, mounted))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Platform):
            return NotImplemented
        return (
            np.array_equal(self.times, other.times)
            and np.array_equal(self.positions, other.positions)
            and np.array_equal(self.poses(self.times)[1], other.poses(other.times)[1])
            and (self.headings is None) == (other.headings is None)
        )

    def __hash__(self) -> int:
        return hash(self.times.tobytes())

    def __repr__(self) -> str:
        return f"Platform({len(self.times)} positions, {self.times[0]:g} to {self.times[-1]:g} s)"


def checked_headings(headings: Array) -> Array:
    """Return headings (n,) in radians; refuse those that look like degrees."""
    most = float(np.abs(headings).max())
    if not most <= 2 * math.pi * (1 + 1e-9):
        raise InvalidInputError(
            f"platform: headings go up to {most:.4g}: degrees? radians from +x towards +y, within +-2 pi, are expected"
        )
    return headings


def turned(vectors: Array, angles: Array) -> Array:
    """Vectors (n, 2) or (n, 3) turned about the vertical by angles (n,), radians."""
    cos, sin = np.cos(angles), np.sin(angles)
    result = np.array(vectors, dtype=np.float64)
    result[:, 0] = cos * vectors[:, 0] - sin * vectors[:, 1]
    result[:, 1] = sin * vectors[:, 0] + cos * vectors[:, 1]
    return result
