"""Single measurements converted to positions with a covariance: where to look, and where to start from."""

from __future__ import annotations

import math

import numpy as np

from assoc._system.compiled import njit
from assoc._types import Array

HEIGHTS = 3.0
"""Where no sensor measures full positions, heights are sought this many half heights around the middle."""

_START_REACH = 10.0


@njit
def _invert(c: Array) -> tuple[bool, float, float, float, float, float, float]:
    """Inverse of a symmetric matrix (xx, xy, xz, yy, yz, zz), scaled first so that units do not matter."""
    if not (c[0] > 0.0 and c[3] > 0.0 and c[5] > 0.0):
        return False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    p, q, r = 1.0 / math.sqrt(c[0]), 1.0 / math.sqrt(c[3]), 1.0 / math.sqrt(c[5])
    a, b, d = c[1] * p * q, c[2] * p * r, c[4] * q * r
    m00, m11, m22 = 1.0 - d * d, 1.0 - b * b, 1.0 - a * a
    m01, m02, m12 = b * d - a, a * d - b, a * b - d
    det = m00 + a * m01 + b * m02
    if not det > 1e-14:
        return False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    f = 1.0 / det
    return (
        True,
        m00 * f * p * p,
        m01 * f * p * q,
        m02 * f * p * r,
        m11 * f * q * q,
        m12 * f * q * r,
        m22 * f * r * r,
    )


@njit
def _radar3d(z: Array, place: Array, R: Array, reach: float, least: float, centre: Array, c: Array) -> None:
    """Range, azimuth, elevation."""
    slant = max(z[0], 0.0)
    ca, sa, ce, se = math.cos(z[1]), math.sin(z[1]), math.cos(z[2]), math.sin(z[2])
    # the target may be a sigma farther than measured; and near the zenith the azimuth opens up
    arm = max(slant, math.sqrt(R[0, 0]))
    tilt = arm * max(abs(ce), math.sqrt(R[2, 2]))
    axes = (
        (ca * ce, -tilt * sa, -arm * ca * se),
        (sa * ce, tilt * ca, -arm * sa * se),
        (se, 0.0, arm * ce),
    )
    bend = 0.5 * reach * arm * (R[1, 1] * ce * ce + R[2, 2])
    wide = 4.0 * arm * arm if reach * max(R[1, 1], R[2, 2]) > 1.0 else 0.0
    entry = 0
    for i in range(3):
        a = axes[i]
        centre[i] = place[i] + slant * a[0]
        for j in range(i, 3):
            b = axes[j]
            total = 2.0 * bend * bend / least * a[0] * b[0] + (wide if i == j else 0.0)
            for k in range(3):
                total += a[k] * (R[k, 0] * b[0] + R[k, 1] * b[1] + R[k, 2] * b[2])
            c[entry] = total
            entry += 1


@njit
def _radar2d(
    z: Array,
    place: Array,
    R: Array,
    middle: float,
    half: float,
    reach: float,
    least: float,
    centre: Array,
    c: Array,
) -> None:
    """Range and azimuth: the ground ranges that the heights allow make it long."""
    low, high = middle - HEIGHTS * half - place[2], middle + HEIGHTS * half - place[2]
    lowest = 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
    most = max(abs(low), abs(high))
    slack = math.sqrt(_START_REACH * R[0, 0])
    farthest = math.sqrt(max((z[0] + slack) ** 2 - lowest * lowest, 0.0))
    nearest = math.sqrt(max(max(z[0] - slack, 0.0) ** 2 - most * most, 0.0))
    ground = 0.5 * (farthest + nearest)
    slack = math.sqrt(reach * R[0, 0])
    farthest = math.sqrt(max((z[0] + slack) ** 2 - lowest * lowest, 0.0))
    nearest = math.sqrt(max(max(z[0] - slack, 0.0) ** 2 - most * most, 0.0))
    bend = 0.5 * reach * R[1, 1] * farthest
    wide = 4.0 * farthest**2 if reach * R[1, 1] > 1.0 else 0.0
    # a box, not an ellipse: twice, for the target may be at the end of the range and of the azimuth at once
    along = 2.0 * (max(farthest - ground, ground - nearest, slack) + bend) ** 2 / least + wide
    across = 2.0 * max(farthest * farthest, R[0, 0]) * R[1, 1] * reach / least + wide
    ca, sa = math.cos(z[1]), math.sin(z[1])
    centre[0], centre[1], centre[2] = place[0] + ground * ca, place[1] + ground * sa, middle
    c[0], c[1], c[3] = (
        ca * ca * along + sa * sa * across,
        ca * sa * (along - across),
        sa * sa * along + ca * ca * across,
    )


@njit
def convert(
    code: Array,
    dim: Array,
    place: Array,
    covariance: Array,
    middle: Array,
    half: Array,
    z: Array,
    owner: Array,
    reach: float,
    least: float,
) -> tuple[Array, Array, Array]:
    """Convert measurements (N, 3) to positions.

    The covariance is the linearised one, widened where the measurement bends so much that its ellipsoid of
    chi-square value `least` would not hold all positions within `reach`, the largest gate: by the sagitta of
    the arc for radars, and by the ground ranges of all heights sought where the height is open.

    Returns
    -------
    centre (N, 3), spread (N, 6), information (N, 6)
        Position, covariance as (xx, xy, xz, yy, yz, zz) for the gate, and the inverse covariance for a start,
        which does not depend on the gate. Zeros for bearings, and of x and y alone for measurements that
        leave the height open.
    """
    count = len(z)
    centre, spread, information = np.zeros((count, 3)), np.zeros((count, 6)), np.zeros((count, 6))
    for n in range(count):
        s = owner[n]
        if code[s] == 3:
            continue
        R = covariance[s]
        # first as wide as the gate asks, then as for any start
        for turn in range(2):
            c = spread[n] if turn == 0 else information[n]
            size = reach if turn == 0 else _START_REACH
            base = least if turn == 0 else _START_REACH
            if code[s] == 0:
                centre[n, 0], centre[n, 1] = z[n, 0], z[n, 1]
                centre[n, 2] = z[n, 2] if dim[s] == 3 else middle[2]
                c[0], c[1], c[2], c[3], c[4], c[5] = R[0, 0], R[0, 1], R[0, 2], R[1, 1], R[1, 2], R[2, 2]
            elif code[s] == 1:
                _radar3d(z[n], place[s], R, size, base, centre[n], c)
            else:
                _radar2d(z[n], place[s], R, middle[2], half[2], size, base, centre[n], c)
            if dim[s] == 2:
                c[2], c[4], c[5] = 0.0, 0.0, 1.0
        c = information[n]
        ok, i0, i1, i2, i3, i4, i5 = _invert(c)
        if not ok:
            # too flat to invert: a ball of the same size will do for a start
            i0 = i3 = i5 = 1.0 / (c[0] + c[3] + (c[5] if dim[s] == 3 else 0.0))
            i1 = i2 = i4 = 0.0
        c[0], c[1], c[2], c[3], c[4], c[5] = i0, i1, i2, i3, i4, i5
    return centre, spread, information
