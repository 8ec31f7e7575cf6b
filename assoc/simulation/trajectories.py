"""Trajectories of targets: straight, or manoeuvring with piecewise constant acceleration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.sensors.arrays import finite_array


@dataclass(frozen=True)
class Manoeuvre:
    """A constant acceleration from ``start`` to ``end`` (s; ``inf``: for ever), in m/s^2."""

    start: float
    end: float
    acceleration: tuple[float, float, float]

    def __post_init__(self) -> None:
        finite_array(self.acceleration, "acceleration", (3,))
        if not self.start < self.end:
            raise InvalidInputError(f"manoeuvre: expected start < end, got {self.start}, {self.end}")


@explains_wrong_types
@dataclass(frozen=True, eq=False)
class Trajectory:
    """Motion of one target.

    Parameters
    ----------
    position : array_like (3,)
        Where it is at time 0, metres.
    velocity : array_like (3,)
        Its velocity at time 0, m/s, as long as no manoeuvre has begun.
    manoeuvres : sequence of Manoeuvre
        At times >= 0. Where two overlap their accelerations add. Without any it is a straight line.
    """

    position: Array
    velocity: Array
    manoeuvres: Sequence[Manoeuvre] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", finite_array(self.position, "position", (3,)))
        object.__setattr__(self, "velocity", finite_array(self.velocity, "velocity", (3,)))
        if any(m.start < 0 for m in self.manoeuvres):
            raise InvalidInputError("manoeuvres: expected start >= 0")

    def positions(self, times: Array) -> Array:
        """Positions (K, 3) in metres at the times (K,) in seconds."""
        t = np.asarray(times, dtype=np.float64)[:, None]
        result = self.position + t * self.velocity
        for m in self.manoeuvres:
            acceleration = np.asarray(m.acceleration)
            burn = np.clip(t - m.start, 0.0, m.end - m.start)
            coast = np.maximum(t - m.end, 0.0)
            result = result + acceleration * (0.5 * burn**2 + burn * coast)
        return result

    def velocities(self, times: Array) -> Array:
        """Velocities (K, 3) in m/s at the times (K,) in seconds."""
        t = np.asarray(times, dtype=np.float64)[:, None]
        result = np.broadcast_to(self.velocity, (t.shape[0], 3)).copy()
        for m in self.manoeuvres:
            result += np.asarray(m.acceleration) * np.clip(t - m.start, 0.0, m.end - m.start)
        return result
