"""Symmetric 3 x 3 systems, compiled; matrices are passed as (xx, xy, xz, yy, yz, zz)."""

from __future__ import annotations

import math

from assoc._system.compiled import inner_njit, njit
from assoc.sensors.kernels.records import Six


@njit
def solve(A: Six, b0: float, b1: float, b2: float) -> tuple[bool, float, float, float]:
    """Solve a positive definite system, scaled by its diagonal; False where it is not positive definite."""
    if not (A[0] > 0.0 and A[3] > 0.0 and A[5] > 0.0):
        return False, 0.0, 0.0, 0.0
    p, q, r = 1.0 / math.sqrt(A[0]), 1.0 / math.sqrt(A[3]), 1.0 / math.sqrt(A[5])
    c10, c20, c21 = A[1] * p * q, A[2] * p * r, A[4] * q * r
    d1 = 1.0 - c10 * c10
    if not d1 > 1e-15:
        return False, 0.0, 0.0, 0.0
    l11 = math.sqrt(d1)
    l21 = (c21 - c20 * c10) / l11
    d2 = 1.0 - c20 * c20 - l21 * l21
    if not d2 > 1e-15:
        return False, 0.0, 0.0, 0.0
    l22 = math.sqrt(d2)
    y0 = b0 * p
    y1 = (b1 * q - c10 * y0) / l11
    y2 = (b2 * r - c20 * y0 - l21 * y1) / l22
    x2 = y2 / l22
    x1 = (y1 - l21 * x2) / l11
    x0 = y0 - c10 * x1 - c20 * x2
    return True, x0 * p, x1 * q, x2 * r


@njit
def inverse(A: Six) -> tuple[bool, float, float, float, float, float, float]:
    """Inverse of a positive definite matrix."""
    ok, c0, c1, c2 = solve(A, 1.0, 0.0, 0.0)
    ok1, _, c3, c4 = solve(A, 0.0, 1.0, 0.0)
    ok2, _, _, c5 = solve(A, 0.0, 0.0, 1.0)
    return ok and ok1 and ok2, c0, c1, c2, c3, c4, c5


@inner_njit
def inverse_by_cofactors(c: Six) -> tuple[bool, float, float, float, float, float, float]:
    """Inverse of a positive definite matrix by its cofactors, quicker and less exact than `inverse`.

    It weighs the converted measurements where a search starts. Of several local minima the start decides which
    is found, so that one way of rounding is not as good as another there: the two are not interchangeable.
    """
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
