"""The compiled model of sensors that measure only azimuth, or azimuth and elevation; see `assoc.sensors.bearing`."""

from __future__ import annotations

import math

from assoc._system.compiled import inner_njit, lean_inner_njit
from assoc._types import Array
from assoc.sensors.kernels.records import TURN, Information, Six, Three
from assoc.sensors.radar import NEAREST


@lean_inner_njit
def measure_bearing(dim: int, dx: float, dy: float, dz: float, h: Array) -> None:
    """Write the azimuth (and elevation) of a position, relative to the sensor, into h."""
    h[0] = math.atan2(dy, dx)
    if dim == 2:
        h[1] = math.atan2(dz, math.hypot(dx, dy))


@lean_inner_njit
def linearise_bearing(dim: int, dx: float, dy: float, dz: float, h: Array, H: Array) -> None:
    """Write the azimuth (and elevation) into h and the derivatives into H, which holds zeros."""
    flat = math.hypot(dx, dy)
    ground = max(flat, NEAREST)
    measure_bearing(dim, dx, dy, dz, h)
    H[0, 0], H[0, 1] = -dy / (ground * ground), dx / (ground * ground)
    if dim == 2:
        square = ground * ground + dz * dz
        H[1, 0], H[1, 1], H[1, 2] = -dx * dz / (ground * square), -dy * dz / (ground * square), ground / square


@inner_njit
def add_bearing(dim: int, W: Six, position: Three, measured: Three, at: Three, sums: Information) -> Information:
    """Add one measurement's share; see `assoc.sensors.kernels.dispatch.add_information`."""
    chi, g0, g1, g2, a0, a1, a2, a3, a4, a5 = sums
    dx, dy = at[0] - position[0], at[1] - position[1]
    flat2 = dx * dx + dy * dy
    turn = math.atan2(dy, dx)
    flat2 = max(flat2, NEAREST * NEAREST)
    v0 = measured[0] - turn
    v0 -= TURN * round(v0 / TURN)
    h0, h1 = -dy / flat2, dx / flat2
    chi += W[0] * v0 * v0
    g0, g1 = g0 + W[0] * v0 * h0, g1 + W[0] * v0 * h1
    a0, a1, a3 = a0 + W[0] * h0 * h0, a1 + W[0] * h0 * h1, a3 + W[0] * h1 * h1
    if dim == 2:
        dz, flat = at[2] - position[2], math.sqrt(flat2)
        square = flat2 + dz * dz
        v1 = measured[1] - math.atan2(dz, flat)
        e0, e1, e2 = -dx * dz / (flat * square), -dy * dz / (flat * square), flat / square
        w0, w1 = W[1] * v1, W[1] * v0 + W[3] * v1
        chi += 2.0 * W[1] * v0 * v1 + W[3] * v1 * v1
        g0, g1, g2 = g0 + h0 * w0 + e0 * w1, g1 + h1 * w0 + e1 * w1, g2 + e2 * w1
        a0 += 2.0 * W[1] * h0 * e0 + W[3] * e0 * e0
        a1 += W[1] * (h0 * e1 + h1 * e0) + W[3] * e0 * e1
        a2 += W[1] * h0 * e2 + W[3] * e0 * e2
        a3 += 2.0 * W[1] * h1 * e1 + W[3] * e1 * e1
        a4 += W[1] * h1 * e2 + W[3] * e1 * e2
        a5 += W[3] * e2 * e2
    return chi, g0, g1, g2, a0, a1, a2, a3, a4, a5
