"""The compiled model of sensors that measure only azimuth; see `assoc.sensors.bearing`."""

from __future__ import annotations

import math

from assoc._system.compiled import inner_njit
from assoc._types import Array
from assoc.sensors.kernels.records import TURN, Information, Six, Three
from assoc.sensors.radar import NEAREST


@inner_njit
def measure_bearing(dx: float, dy: float, h: Array) -> None:
    """Write the azimuth of a position, relative to the sensor, into h."""
    h[0] = math.atan2(dy, dx)


@inner_njit
def linearise_bearing(dx: float, dy: float, h: Array, H: Array) -> None:
    """Write the azimuth into h and its derivatives into H, which holds zeros."""
    flat = math.hypot(dx, dy)
    ground = max(flat, NEAREST)
    h[0] = math.atan2(dy, dx)
    H[0, 0], H[0, 1] = -dy / (ground * ground), dx / (ground * ground)


@inner_njit
def add_bearing(W: Six, position: Three, measured: Three, at: Three, sums: Information) -> Information:
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
    return chi, g0, g1, g2, a0, a1, a2, a3, a4, a5
