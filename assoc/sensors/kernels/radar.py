"""The compiled models of radars; see `assoc.sensors.radar`."""

from __future__ import annotations

import math

from assoc._system.compiled import inner_njit, lean_inner_njit
from assoc._types import Array
from assoc.sensors.kernels.records import TURN, Converted, Information, Six, Three
from assoc.sensors.radar import NEAREST

START_REACH = 10.0
"""Squared Mahalanobis distance that a converted measurement covers where a search for a position starts."""


@lean_inner_njit
def measure_range_azimuth(dx: float, dy: float, dz: float, h: Array) -> float:
    """Write range and azimuth of a position, relative to the radar, into h; return the ground range."""
    flat = math.hypot(dx, dy)
    h[0], h[1] = math.hypot(flat, dz), math.atan2(dy, dx)
    return flat


@lean_inner_njit
def linearise_range_azimuth(dx: float, dy: float, dz: float, h: Array, H: Array) -> Three:
    """Write range, azimuth and their derivatives; return the ground range, and it and the slant range above zero."""
    flat = measure_range_azimuth(dx, dy, dz, h)
    ground = max(flat, NEAREST)
    slant = math.hypot(ground, dz)
    H[0, 0], H[0, 1], H[0, 2] = dx / slant, dy / slant, dz / slant
    H[1, 0], H[1, 1] = -dy / (ground * ground), dx / (ground * ground)
    return flat, ground, slant


@lean_inner_njit
def linearise_radar3d(dx: float, dy: float, dz: float, h: Array, H: Array) -> None:
    """Write range, azimuth and elevation into h and their derivatives into H, which holds zeros."""
    flat, ground, slant = linearise_range_azimuth(dx, dy, dz, h, H)
    h[2] = math.atan2(dz, flat)
    H[2, 0] = -dx * dz / (ground * slant * slant)
    H[2, 1] = -dy * dz / (ground * slant * slant)
    H[2, 2] = ground / (slant * slant)


@lean_inner_njit
def linearise_range_rate(dx: float, dy: float, dz: float, velocity: Three, H: Array, columns: int) -> float:
    """Write the range rate's derivatives by position and, from `columns` on, by velocity into H[3]; return it."""
    slant = math.hypot(max(math.hypot(dx, dy), NEAREST), dz)
    u = (dx / slant, dy / slant, dz / slant)
    rate = u[0] * velocity[0] + u[1] * velocity[1] + u[2] * velocity[2]
    for i in range(columns):
        H[3, i] = (velocity[i] - rate * u[i]) / slant
        H[3, columns + i] = u[i]
    return rate


@inner_njit
def _range_azimuth(position: Three, measured: Three, at: Three) -> tuple[Three, Three, float, float, Three, Three]:
    """Residuals of range and azimuth for `add_radar3d` and `add_radar2d`, and what they need of their derivatives.

    Returns the offset from the radar; (residual of range, of azimuth, ground range); ground range and slant range above
    zero; the derivatives of range and of azimuth.
    """
    dx, dy, dz = at[0] - position[0], at[1] - position[1], at[2] - position[2]
    flat2 = dx * dx + dy * dy
    turn = math.atan2(dy, dx)
    flat = math.sqrt(flat2)
    slant = math.sqrt(flat2 + dz * dz)
    v1 = measured[1] - turn
    v1 -= TURN * round(v1 / TURN)
    residual = (measured[0] - slant, v1, flat)
    # straight above a radar the azimuth has no derivative; a bounded one serves, steps are only
    # taken if they help
    slant = max(slant, NEAREST)
    flat = max(flat, 1e-5 * slant, NEAREST)
    by_range, by_azimuth = (dx / slant, dy / slant, dz / slant), (-dy / (flat * flat), dx / (flat * flat), 0.0)
    return (dx, dy, dz), residual, flat, slant, by_range, by_azimuth


@inner_njit
def add_radar3d(W: Six, position: Three, measured: Three, at: Three, sums: Information) -> Information:
    """Add one measurement's share; see `assoc.sensors.kernels.dispatch.add_information`."""
    chi, g0, g1, g2, a0, a1, a2, a3, a4, a5 = sums
    (dx, dy, dz), (v0, v1, ground), flat, slant, (r0, r1, r2), (t0, t1, _) = _range_azimuth(position, measured, at)
    v2 = measured[2] - math.atan2(dz, ground)
    e0 = -dx * dz / (flat * slant * slant)
    e1 = -dy * dz / (flat * slant * slant)
    e2 = flat / (slant * slant)
    w0 = W[0] * v0 + W[1] * v1 + W[2] * v2
    w1 = W[1] * v0 + W[3] * v1 + W[4] * v2
    w2 = W[2] * v0 + W[4] * v1 + W[5] * v2
    chi += v0 * w0 + v1 * w1 + v2 * w2
    g0, g1 = g0 + r0 * w0 + t0 * w1 + e0 * w2, g1 + r1 * w0 + t1 * w1 + e1 * w2
    g2 += r2 * w0 + e2 * w2
    p0 = W[0] * r0 + W[1] * t0 + W[2] * e0
    p1 = W[0] * r1 + W[1] * t1 + W[2] * e1
    p2 = W[0] * r2 + W[2] * e2
    q0 = W[1] * r0 + W[3] * t0 + W[4] * e0
    q1 = W[1] * r1 + W[3] * t1 + W[4] * e1
    q2 = W[1] * r2 + W[4] * e2
    u0 = W[2] * r0 + W[4] * t0 + W[5] * e0
    u1 = W[2] * r1 + W[4] * t1 + W[5] * e1
    u2 = W[2] * r2 + W[5] * e2
    a0 += r0 * p0 + t0 * q0 + e0 * u0
    a1 += r0 * p1 + t0 * q1 + e0 * u1
    a2 += r0 * p2 + t0 * q2 + e0 * u2
    a3 += r1 * p1 + t1 * q1 + e1 * u1
    a4 += r1 * p2 + t1 * q2 + e1 * u2
    a5 += r2 * p2 + e2 * u2
    return chi, g0, g1, g2, a0, a1, a2, a3, a4, a5


@inner_njit
def add_radar2d(W: Six, position: Three, measured: Three, at: Three, sums: Information) -> Information:
    """Add one measurement's share; see `assoc.sensors.kernels.dispatch.add_information`."""
    chi, g0, g1, g2, a0, a1, a2, a3, a4, a5 = sums
    _, (v0, v1, _), _, _, (r0, r1, r2), (t0, t1, _) = _range_azimuth(position, measured, at)
    # weights of a height that is not measured are 0
    v2 = measured[2] - at[2]
    w0, w1 = W[0] * v0 + W[1] * v1 + W[2] * v2, W[1] * v0 + W[3] * v1 + W[4] * v2
    w2 = W[2] * v0 + W[4] * v1 + W[5] * v2
    chi += v0 * w0 + v1 * w1 + v2 * w2
    g0, g1, g2 = g0 + r0 * w0 + t0 * w1, g1 + r1 * w0 + t1 * w1, g2 + r2 * w0 + w2
    p0, p1, p2 = W[0] * r0 + W[1] * t0, W[0] * r1 + W[1] * t1, W[0] * r2 + W[2]
    q0, q1, q2 = W[1] * r0 + W[3] * t0, W[1] * r1 + W[3] * t1, W[1] * r2 + W[4]
    a0, a1, a2 = a0 + r0 * p0 + t0 * q0, a1 + r0 * p1 + t0 * q1, a2 + r0 * p2 + t0 * q2
    a3, a4, a5 = a3 + r1 * p1 + t1 * q1, a4 + r1 * p2 + t1 * q2, a5 + r2 * p2 + W[2] * r2 + W[5]
    return chi, g0, g1, g2, a0, a1, a2, a3, a4, a5


@inner_njit
def convert_with_height(measured: Three, position: Three, R: Six, reach: float, least: float) -> Converted:
    """Range, azimuth and height: as without a height, but only heights near the measured one are sought."""
    slack = math.sqrt(reach * R[5])
    heights = (measured[2] - slack, measured[2], measured[2] + slack)
    at, (xx, xy, _, yy, _, _) = convert_radar2d(measured, position, R, heights, reach, least)
    return at, (xx, xy, 0.0, yy, 0.0, 2.0 * reach * R[5] / least)


@inner_njit
def convert_radar3d(measured: Three, position: Three, R: Six, reach: float, least: float) -> Converted:
    """Range, azimuth, elevation; see `assoc.sensors.kernels.dispatch.convert_one`."""
    slant = max(measured[0], 0.0)
    ca, sa, ce, se = math.cos(measured[1]), math.sin(measured[1]), math.cos(measured[2]), math.sin(measured[2])
    # the target may be a sigma farther than measured; and near the zenith the azimuth opens up
    arm = max(slant, math.sqrt(R[0]))
    tilt = arm * max(abs(ce), math.sqrt(R[5]))
    x, y, z = (ca * ce, -tilt * sa, -arm * ca * se), (sa * ce, tilt * ca, -arm * sa * se), (se, 0.0, arm * ce)
    bend = 0.5 * reach * arm * (R[3] * ce * ce + R[5])
    wide = 4.0 * arm * arm if reach * max(R[3], R[5]) > 1.0 else 0.0
    f = 2.0 * bend * bend / least
    c = (
        _rotated(x, x, R, f * x[0] * x[0] + wide),
        _rotated(x, y, R, f * x[0] * y[0]),
        _rotated(x, z, R, f * x[0] * z[0]),
        _rotated(y, y, R, f * y[0] * y[0] + wide),
        _rotated(y, z, R, f * y[0] * z[0]),
        _rotated(z, z, R, f * z[0] * z[0] + wide),
    )
    return (position[0] + slant * x[0], position[1] + slant * y[0], position[2] + slant * z[0]), c


@inner_njit
def _rotated(a: Three, b: Three, R: Six, more: float) -> float:
    """`more` and a' R b."""
    more += a[0] * (R[0] * b[0] + R[1] * b[1] + R[2] * b[2])
    more += a[1] * (R[1] * b[0] + R[3] * b[1] + R[4] * b[2])
    return more + a[2] * (R[2] * b[0] + R[4] * b[1] + R[5] * b[2])


@inner_njit
def convert_radar2d(measured: Three, position: Three, R: Six, heights: Three, reach: float, least: float) -> Converted:
    """Range and azimuth: the ground ranges that the heights (lowest, middle, highest) allow make it long."""
    low, high = heights[0] - position[2], heights[2] - position[2]
    lowest = 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
    most = max(abs(low), abs(high))
    slack = math.sqrt(START_REACH * R[0])
    farthest = math.sqrt(max((measured[0] + slack) ** 2 - lowest * lowest, 0.0))
    nearest = math.sqrt(max(max(measured[0] - slack, 0.0) ** 2 - most * most, 0.0))
    ground = 0.5 * (farthest + nearest)
    slack = math.sqrt(reach * R[0])
    farthest = math.sqrt(max((measured[0] + slack) ** 2 - lowest * lowest, 0.0))
    nearest = math.sqrt(max(max(measured[0] - slack, 0.0) ** 2 - most * most, 0.0))
    bend = 0.5 * reach * R[3] * farthest
    wide = 4.0 * farthest**2 if reach * R[3] > 1.0 else 0.0
    # a box, not an ellipse: twice, for the target may be at the end of the range and of the azimuth at once
    along = 2.0 * (max(farthest - ground, ground - nearest, slack) + bend) ** 2 / least + wide
    across = 2.0 * max(farthest * farthest, R[0]) * R[3] * reach / least + wide
    ca, sa = math.cos(measured[1]), math.sin(measured[1])
    xx, xy, yy = ca * ca * along + sa * sa * across, ca * sa * (along - across), sa * sa * along + ca * ca * across
    return (position[0] + ground * ca, position[1] + ground * sa, heights[1]), (xx, xy, 0.0, yy, 0.0, 1.0)
