"""Single measurements converted to positions with a covariance: where to look, and where to start from."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from assoc._compiled import njit

Array = np.ndarray[Any, np.dtype[Any]]


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
) -> tuple[Array, Array, Array]:
    """Convert measurements (N, 3) to positions.

    The covariance is the linearised one, widened where the measurement bends so much that the ellipsoid of
    chi-square value `reach` would not hold the target: by the sagitta of the arc for radars, and for a radar
    that leaves the height open by the ground ranges that heights within twice the region's allow.

    Returns
    -------
    centre (N, 3), spread (N, 6), information (N, 6)
        Position, covariance and its inverse as (xx, xy, xz, yy, yz, zz); zeros for bearings, and of x and y
        alone for measurements that leave the height open.
    """
    count = len(z)
    centre, spread, information = np.zeros((count, 3)), np.zeros((count, 6)), np.zeros((count, 6))
    axes = np.zeros((3, 3))
    for n in range(count):
        s = owner[n]
        c = spread[n]
        R = covariance[s]
        if code[s] == 0:
            centre[n, 0], centre[n, 1] = z[n, 0], z[n, 1]
            centre[n, 2] = z[n, 2] if dim[s] == 3 else middle[2]
            c[0], c[1], c[2], c[3], c[4], c[5] = R[0, 0], R[0, 1], R[0, 2], R[1, 1], R[1, 2], R[2, 2]
        elif code[s] == 1:
            slant = max(z[n, 0], 0.0)
            ca, sa, ce, se = math.cos(z[n, 1]), math.sin(z[n, 1]), math.cos(z[n, 2]), math.sin(z[n, 2])
            axes[0, 0], axes[0, 1], axes[0, 2] = ca * ce, sa * ce, se
            axes[1, 0], axes[1, 1], axes[1, 2] = -sa, ca, 0.0
            axes[2, 0], axes[2, 1], axes[2, 2] = -ca * se, -sa * se, ce
            for k in range(3):
                centre[n, k] = place[s, k] + slant * axes[0, k]
            # the target may be a sigma farther than measured; and near the zenith the azimuth opens up
            arm = max(slant, math.sqrt(R[0, 0]))
            tilt = max(abs(ce), math.sqrt(R[2, 2]))
            bend = 0.5 * reach * arm * (R[1, 1] * ce * ce + R[2, 2])
            wide = 4.0 * arm * arm if reach * max(R[1, 1], R[2, 2]) > 1.0 else 0.0
            scale0, scale1, scale2 = 1.0, arm * tilt, arm
            place_in = 0
            for i in range(3):
                for j in range(i, 3):
                    total = wide if i == j else 0.0
                    for k in range(3):
                        fk = scale0 if k == 0 else (scale1 if k == 1 else scale2)
                        for m in range(3):
                            fm = scale0 if m == 0 else (scale1 if m == 1 else scale2)
                            total += axes[k, i] * fk * R[k, m] * fm * axes[m, j]
                    total += bend * bend * axes[0, i] * axes[0, j]
                    c[place_in] = total
                    place_in += 1
        elif code[s] == 2:
            slack = math.sqrt(reach * R[0, 0])
            low = middle[2] - 2.0 * half[2] - place[s, 2]
            high = middle[2] + 2.0 * half[2] - place[s, 2]
            least = 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
            most = max(abs(low), abs(high))
            farthest = math.sqrt(max((z[n, 0] + slack) ** 2 - least * least, 0.0))
            nearest = math.sqrt(max(max(z[n, 0] - slack, 0.0) ** 2 - most * most, 0.0))
            ground = 0.5 * (farthest + nearest)
            along = max(farthest - ground, slack) ** 2 / reach
            bend = 0.5 * reach * R[1, 1] * farthest
            along += bend * bend + (4.0 * farthest**2 if reach * R[1, 1] > 1.0 else 0.0)
            across = max(farthest * farthest, R[0, 0]) * R[1, 1]
            across += 4.0 * farthest**2 if reach * R[1, 1] > 1.0 else 0.0
            ca, sa = math.cos(z[n, 1]), math.sin(z[n, 1])
            centre[n, 0], centre[n, 1] = place[s, 0] + ground * ca, place[s, 1] + ground * sa
            centre[n, 2] = middle[2]
            c[0] = ca * ca * along + sa * sa * across
            c[1] = ca * sa * (along - across)
            c[3] = sa * sa * along + ca * ca * across
        if code[s] != 3:
            if dim[s] == 2:
                c[2], c[4], c[5] = 0.0, 0.0, 1.0
            ok, i0, i1, i2, i3, i4, i5 = _invert(c)
            if not ok:
                # too flat to invert: a ball of the same size will do for a start
                i0 = i3 = i5 = 1.0 / (c[0] + c[3] + (c[5] if dim[s] == 3 else 0.0))
                i1 = i2 = i4 = 0.0
            information[n, 0], information[n, 1], information[n, 2] = i0, i1, i2
            information[n, 3], information[n, 4], information[n, 5] = i3, i4, i5
    return centre, spread, information
