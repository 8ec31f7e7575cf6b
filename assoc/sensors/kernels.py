"""Compiled twins of the measurement models: one position at a time, for the kernels of the filters.

They follow `measure`, `jacobian` and `residual` of the sensors line by line; a test holds them together for
every kind in the registry. They are kept apart so that sensors can be used without numba.
"""

from __future__ import annotations

import math

from assoc._system.compiled import njit
from assoc._types import Array
from assoc.sensors.base import Sensor
from assoc.sensors.bearing import BearingSensor
from assoc.sensors.position import PositionSensor
from assoc.sensors.radar import NEAREST, Radar2D, Radar3D

CODES: dict[type[Sensor], int] = {PositionSensor: 0, Radar3D: 1, Radar2D: 2, BearingSensor: 3}
"""Class of a sensor -> the number by which kernels know it."""

TURN = 2.0 * math.pi


@njit
def linearise(code: int, dim: int, place: Array, x: float, y: float, z: float, h: Array, H: Array) -> None:
    """Write the noise-free measurement of a position into h (d,) and its derivatives into H (d, 3)."""
    H[:dim, :3] = 0.0
    if code == 0:
        h[0], h[1] = x, y
        H[0, 0] = H[1, 1] = 1.0
        if dim == 3:
            h[2] = z
            H[2, 2] = 1.0
        return
    dx, dy, dz = x - place[0], y - place[1], z - place[2]
    flat = math.hypot(dx, dy)
    turn = math.atan2(dy, dx)
    ground = max(flat, NEAREST)
    if code == 3:
        h[0] = turn
        H[0, 0], H[0, 1] = -dy / (ground * ground), dx / (ground * ground)
        return
    h[0], h[1] = math.hypot(flat, dz), turn
    slant = math.hypot(ground, dz)
    H[0, 0], H[0, 1], H[0, 2] = dx / slant, dy / slant, dz / slant
    H[1, 0], H[1, 1] = -dy / (ground * ground), dx / (ground * ground)
    if code == 1:
        h[2] = math.atan2(dz, flat)
        H[2, 0] = -dx * dz / (ground * slant * slant)
        H[2, 1] = -dy * dz / (ground * slant * slant)
        H[2, 2] = ground / (slant * slant)


@njit
def measure(code: int, dim: int, place: Array, x: float, y: float, z: float, h: Array) -> None:
    """Write the noise-free measurement of a position into h (d,)."""
    if code == 0:
        h[0], h[1] = x, y
        if dim == 3:
            h[2] = z
        return
    dx, dy, dz = x - place[0], y - place[1], z - place[2]
    if code == 3:
        h[0] = math.atan2(dy, dx)
        return
    flat = math.hypot(dx, dy)
    h[0], h[1] = math.hypot(flat, dz), math.atan2(dy, dx)
    if code == 1:
        h[2] = math.atan2(dz, flat)


@njit
def wrap(code: int, v: Array) -> None:
    """Bring the azimuth of a residual (d,) into (-pi, pi]."""
    if code == 3:
        v[0] -= TURN * math.ceil(v[0] / TURN - 0.5)
    elif code == 1 or code == 2:
        v[1] -= TURN * math.ceil(v[1] / TURN - 0.5)
