"""A turning antenna: when it points at an aircraft, and what the radar measures then."""

from __future__ import annotations

import math

import numpy as np

from assoc._types import Array


def dwells(times: Array, positions: Array, rotation: float) -> Array:
    """Times (L,), seconds, at which an antenna at the origin points at a moving aircraft.

    The antenna points north at time 0 and turns clockwise, in `rotation` seconds. Positions (K, 3), metres, are those
    at the times (K,), seconds, ascending, in steps much shorter than a rotation.
    """
    bearing = np.unwrap(np.arctan2(positions[:, 0], positions[:, 1]))
    # turns that the antenna is ahead of the aircraft: a dwell is where this is a whole number
    ahead = times / rotation - bearing / (2 * math.pi)
    # right above the radar an aircraft can be quicker than the antenna, for an instant
    ahead = np.maximum.accumulate(ahead)
    passes = np.arange(math.ceil(ahead[0]), math.floor(ahead[-1]) + 1)
    return np.interp(passes, ahead, times)


def slant_range_and_bearing(positions: Array) -> tuple[Array, Array]:
    """Slant range (n,), metres, and compass bearing (n,), radians in [0, 2 pi), of positions (n, 3)."""
    return np.linalg.norm(positions, axis=1), np.mod(np.arctan2(positions[:, 0], positions[:, 1]), 2 * math.pi)


def in_steps(values: Array, step: float) -> Array:
    """Round values to multiples of a step; 0 leaves them as they are."""
    return values if step == 0 else np.round(values / step) * step


def bearings_in_steps(bearings: Array, step: float) -> Array:
    """Round bearings (rad, in [0, 2 pi)) to multiples of a step; a full turn or more is north, 0."""
    rounded = in_steps(bearings, step)
    return np.where(rounded >= 2 * math.pi, 0.0, rounded)
