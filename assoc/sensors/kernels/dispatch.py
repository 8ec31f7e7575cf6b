"""Compiled measurement models of all kinds of sensors: one position, one state or one measurement at a time.

They follow `measure`, `jacobian` and `residual` of the sensors line by line; a test holds them together for
every kind in the registry. A new kind is a file beside this one and a branch in each of these functions.
"""

from __future__ import annotations

import math

from assoc._system.compiled import inner_njit, lean_inner_njit, njit
from assoc._types import Array
from assoc.sensors.codes import BEARING, POSITION, RADAR2D, RADAR3D
from assoc.sensors.kernels.bearing import add_bearing, linearise_bearing, measure_bearing
from assoc.sensors.kernels.position import add_position, convert_position, linearise_position, measure_position
from assoc.sensors.kernels.radar import (
    add_radar2d,
    add_radar3d,
    convert_radar2d,
    convert_radar3d,
    convert_with_height,
    linearise_radar3d,
    linearise_range_azimuth,
    linearise_range_rate,
    measure_range_azimuth,
)
from assoc.sensors.kernels.records import TURN, Converted, Information, Six, Three
from assoc.sensors.radar import NEAREST


@lean_inner_njit
def linearise(code: int, dim: int, position: Array, x: float, y: float, z: float, h: Array, H: Array) -> None:
    """Write the noise-free measurement of a position into h (d,) and its derivatives into H (d, 3)."""
    H[:dim, :3] = 0.0
    if code == POSITION:
        linearise_position(dim, x, y, z, h, H)
        return
    dx, dy, dz = x - position[0], y - position[1], z - position[2]
    if code == BEARING:
        linearise_bearing(dim, dx, dy, dz, h, H)
    elif code == RADAR3D:
        linearise_radar3d(dx, dy, dz, h, H)
    else:
        linearise_range_azimuth(dx, dy, dz, h, H)
        if dim == 3:
            h[2], H[2, 2] = z, 1.0


@njit
def measure(code: int, dim: int, position: Array, x: float, y: float, z: float, h: Array) -> None:
    """Write the noise-free measurement of a position into h (d,)."""
    if code == POSITION:
        measure_position(dim, x, y, z, h)
        return
    dx, dy, dz = x - position[0], y - position[1], z - position[2]
    if code == BEARING:
        measure_bearing(dim, dx, dy, dz, h)
        return
    flat = measure_range_azimuth(dx, dy, dz, h)
    if code == RADAR3D:
        h[2] = math.atan2(dz, flat)
    elif dim == 3:
        h[2] = z


@lean_inner_njit
def measure_moving(position: Array, state: Array, columns: Array, h: Array) -> None:
    """Write range, azimuth, elevation and range rate of a state into h (4,).

    `columns` says where x, y (and z) stand in the state, and after them their velocities.
    """
    axes = len(columns) // 2
    dx, dy = state[columns[0]] - position[0], state[columns[1]] - position[1]
    dz = (state[columns[2]] if axes == 3 else 0.0) - position[2]
    flat = measure_range_azimuth(dx, dy, dz, h)
    h[2] = math.atan2(dz, flat)
    along = dx * state[columns[axes]] + dy * state[columns[axes + 1]]
    if axes == 3:
        along += dz * state[columns[5]]
    h[3] = along / max(h[0], NEAREST)


@lean_inner_njit
def linearise_moving(position: Array, state: Array, columns: Array, h: Array, H: Array) -> None:
    """Write range, azimuth, elevation and range rate into h (4,), and their derivatives by the columns into H (4, c).

    `columns` is as for `measure_moving`.
    """
    axes = len(columns) // 2
    dx, dy = state[columns[0]] - position[0], state[columns[1]] - position[1]
    dz = (state[columns[2]] if axes == 3 else 0.0) - position[2]
    H[:] = 0.0
    linearise_radar3d(dx, dy, dz, h, H)
    if axes == 2:
        # the third column is a velocity's
        H[:3, 2] = 0.0
    vz = state[columns[5]] if axes == 3 else 0.0
    h[3] = linearise_range_rate(dx, dy, dz, (state[columns[axes]], state[columns[axes + 1]], vz), H, axes)


@lean_inner_njit
def wrap(code: int, v: Array) -> None:
    """Bring the azimuth of a residual (d,) into (-pi, pi]."""
    if code == BEARING:
        v[0] -= TURN * math.ceil(v[0] / TURN - 0.5)
    elif code == RADAR3D or code == RADAR2D:
        v[1] -= TURN * math.ceil(v[1] / TURN - 0.5)


@lean_inner_njit
def fold(folding: float, v: Array) -> None:
    """Bring the range rate of a residual (4,) within half an interval; 0: it does not fold."""
    if folding > 0.0:
        v[3] -= folding * math.floor(v[3] / folding + 0.5)


@inner_njit
def add_information(
    code: int, dim: int, W: Six, position: Three, measured: Three, at: Three, sums: Information
) -> Information:
    """Add one measurement's chi-square, gradient and information, at a position, to the sums of those before it.

    W is the inverse of its covariance, padded with zeros, `position` the sensor's.
    """
    if code == POSITION:
        return add_position(dim, W, measured, at, sums)
    if code == BEARING:
        return add_bearing(dim, W, position, measured, at, sums)
    if code == RADAR2D:
        return add_radar2d(W, position, measured, at, sums)
    return add_radar3d(W, position, measured, at, sums)


@inner_njit
def convert_one(
    code: int, dim: int, measured: Three, position: Three, R: Six, heights: Three, reach: float, least: float
) -> Converted:
    """Position that a measurement points at, and its covariance R, widened.

    The covariance's ellipsoid of chi-square value `least` holds all positions within `reach`. `heights` are the lowest,
    middle and highest that are sought where the measurement leaves the height open; xz, yz and zz are 0, 0 and 1 then.
    """
    if code == POSITION:
        return convert_position(dim, measured, R, heights[1])
    if code == RADAR3D:
        return convert_radar3d(measured, position, R, reach, least)
    if dim == 3:
        return convert_with_height(measured, position, R, reach, least)
    return convert_radar2d(measured, position, R, heights, reach, least)
