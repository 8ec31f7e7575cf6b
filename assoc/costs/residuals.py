"""How well a position explains measurements, compiled: chi-square, its gradient, and the information."""

from __future__ import annotations

import math

from assoc._system.compiled import njit
from assoc._types import Array
from assoc.costs.arrays import ScanArrays, SensorArrays

_TURN = 2.0 * math.pi
# nearer to a sensor than this (metres) the derivatives of angles are those at this distance
_NEAREST = 1e-9


@njit
def normal(
    sensors: SensorArrays, scan: ScanArrays, members: Array, x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """Chi-square, gradient H' R^-1 nu and information H' R^-1 H of the members at a position."""
    chi = g0 = g1 = g2 = a0 = a1 = a2 = a3 = a4 = a5 = 0.0
    for n in members:
        s = scan.owner[n]
        code = sensors.code[s]
        W = sensors.weight[s]
        if code == 0:
            v0, v1 = scan.z[n, 0] - x, scan.z[n, 1] - y
            v2 = scan.z[n, 2] - z if sensors.dim[s] == 3 else 0.0
            w0 = W[0, 0] * v0 + W[0, 1] * v1 + W[0, 2] * v2
            w1 = W[0, 1] * v0 + W[1, 1] * v1 + W[1, 2] * v2
            w2 = W[0, 2] * v0 + W[1, 2] * v1 + W[2, 2] * v2
            chi += v0 * w0 + v1 * w1 + v2 * w2
            g0, g1, g2 = g0 + w0, g1 + w1, g2 + w2
            a0, a1, a2 = a0 + W[0, 0], a1 + W[0, 1], a2 + W[0, 2]
            a3, a4, a5 = a3 + W[1, 1], a4 + W[1, 2], a5 + W[2, 2]
            continue
        dx, dy, dz = x - sensors.place[s, 0], y - sensors.place[s, 1], z - sensors.place[s, 2]
        flat2 = dx * dx + dy * dy
        turn = math.atan2(dy, dx)
        if code == 3:
            flat2 = max(flat2, _NEAREST * _NEAREST)
            v0 = scan.z[n, 0] - turn
            v0 -= _TURN * round(v0 / _TURN)
            h0, h1 = -dy / flat2, dx / flat2
            chi += W[0, 0] * v0 * v0
            g0, g1 = g0 + W[0, 0] * v0 * h0, g1 + W[0, 0] * v0 * h1
            a0, a1, a3 = a0 + W[0, 0] * h0 * h0, a1 + W[0, 0] * h0 * h1, a3 + W[0, 0] * h1 * h1
            continue
        flat = math.sqrt(flat2)
        slant2 = flat2 + dz * dz
        slant = math.sqrt(slant2)
        v0 = scan.z[n, 0] - slant
        v1 = scan.z[n, 1] - turn
        v1 -= _TURN * round(v1 / _TURN)
        # straight above a radar the azimuth has no derivative; a bounded one serves, steps are only
        # taken if they help
        slant = max(slant, _NEAREST)
        flat = max(flat, 1e-5 * slant, _NEAREST)
        r0, r1, r2 = dx / slant, dy / slant, dz / slant
        t0, t1 = -dy / (flat * flat), dx / (flat * flat)
        if code == 2:
            w0, w1 = W[0, 0] * v0 + W[0, 1] * v1, W[0, 1] * v0 + W[1, 1] * v1
            chi += v0 * w0 + v1 * w1
            g0, g1, g2 = g0 + r0 * w0 + t0 * w1, g1 + r1 * w0 + t1 * w1, g2 + r2 * w0
            p0, p1, p2 = W[0, 0] * r0 + W[0, 1] * t0, W[0, 0] * r1 + W[0, 1] * t1, W[0, 0] * r2
            q0, q1, q2 = W[0, 1] * r0 + W[1, 1] * t0, W[0, 1] * r1 + W[1, 1] * t1, W[0, 1] * r2
            a0, a1, a2 = a0 + r0 * p0 + t0 * q0, a1 + r0 * p1 + t0 * q1, a2 + r0 * p2 + t0 * q2
            a3, a4, a5 = a3 + r1 * p1 + t1 * q1, a4 + r1 * p2 + t1 * q2, a5 + r2 * p2
            continue
        v2 = scan.z[n, 2] - math.atan2(dz, math.sqrt(flat2))
        e0 = -dx * dz / (flat * slant * slant)
        e1 = -dy * dz / (flat * slant * slant)
        e2 = flat / (slant * slant)
        w0 = W[0, 0] * v0 + W[0, 1] * v1 + W[0, 2] * v2
        w1 = W[0, 1] * v0 + W[1, 1] * v1 + W[1, 2] * v2
        w2 = W[0, 2] * v0 + W[1, 2] * v1 + W[2, 2] * v2
        chi += v0 * w0 + v1 * w1 + v2 * w2
        g0, g1 = g0 + r0 * w0 + t0 * w1 + e0 * w2, g1 + r1 * w0 + t1 * w1 + e1 * w2
        g2 += r2 * w0 + e2 * w2
        p0 = W[0, 0] * r0 + W[0, 1] * t0 + W[0, 2] * e0
        p1 = W[0, 0] * r1 + W[0, 1] * t1 + W[0, 2] * e1
        p2 = W[0, 0] * r2 + W[0, 2] * e2
        q0 = W[0, 1] * r0 + W[1, 1] * t0 + W[1, 2] * e0
        q1 = W[0, 1] * r1 + W[1, 1] * t1 + W[1, 2] * e1
        q2 = W[0, 1] * r2 + W[1, 2] * e2
        u0 = W[0, 2] * r0 + W[1, 2] * t0 + W[2, 2] * e0
        u1 = W[0, 2] * r1 + W[1, 2] * t1 + W[2, 2] * e1
        u2 = W[0, 2] * r2 + W[2, 2] * e2
        a0 += r0 * p0 + t0 * q0 + e0 * u0
        a1 += r0 * p1 + t0 * q1 + e0 * u1
        a2 += r0 * p2 + t0 * q2 + e0 * u2
        a3 += r1 * p1 + t1 * q1 + e1 * u1
        a4 += r1 * p2 + t1 * q2 + e1 * u2
        a5 += r2 * p2 + e2 * u2
    return chi, g0, g1, g2, a0, a1, a2, a3, a4, a5
