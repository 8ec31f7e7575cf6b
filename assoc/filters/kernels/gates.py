"""What gates and associations ask of a filter: expected measurements, and how well others fit them."""

from __future__ import annotations

import math

import numpy as np

from assoc._system.compiled import njit
from assoc._types import Array
from assoc.filters.kernels.gaussian import BAD_COVARIANCE, GOOD, LINEAR, LOG_TURN, PLAIN, STATUSES, modify
from assoc.filters.kernels.linear_algebra import factor
from assoc.sensors.kernels.dispatch import linearise, linearise_moving, wrap


@njit
def pairs(h: Array, S: Array, z: Array, code: int) -> tuple[int, Array, Array]:
    """Log-likelihood and squared Mahalanobis distance, each (B, M), of each measurement under each target.

    h (B, d) and S (B, d, d) are the expected measurements and their covariances, z (M, d).
    """
    B, d = h.shape
    ll, square = np.empty((B, len(z))), np.empty((B, len(z)))
    L, v = np.zeros((d, d)), np.empty(d)
    for b in range(B):
        if not factor(S[b], d, L):
            return BAD_COVARIANCE + STATUSES * b, ll, square
        base = d * LOG_TURN
        for a in range(d):
            base += 2.0 * math.log(L[a, a])
        for m in range(len(z)):
            for a in range(d):
                v[a] = z[m, a] - h[b, a]
            wrap(code, v)
            total = 0.0
            for a in range(d):
                for e in range(a):
                    v[a] -= L[a, e] * v[e]
                v[a] /= L[a, a]
                total += v[a] * v[a]
            square[b, m] = total
            ll[b, m] = -0.5 * (total + base)
    return GOOD, ll, square


@njit
def expect(
    mean: Array, P: Array, code: int, place: Array, columns: Array, matrix: Array, R: Array, kind: int
) -> tuple[Array, Array]:
    """Expected measurements (B, d) of linearised models and their covariances (B, d, d)."""
    B, d, c = len(mean), R.shape[1], len(columns)
    hs, S = np.empty((B, d)), np.empty((B, d, d))
    h, H, v, R1 = np.empty(d), np.empty((d, max(3, c))), np.zeros(d), np.empty((d, d))
    for b in range(B):
        m = mean[b]
        if code == LINEAR:
            for a in range(d):
                total = 0.0
                for p in range(c):
                    total += matrix[a, p] * m[columns[p]]
                    H[a, p] = matrix[a, p]
                h[a] = total
        elif c > 3:
            linearise_moving(place, m, columns, h, H)
        else:
            height = m[columns[2]] if c > 2 else 0.0
            linearise(code, d, place, m[columns[0]], m[columns[1]], height, h, H)
        for a in range(d):
            hs[b, a] = h[a]
            for e in range(d):
                total = 0.0
                for p in range(c):
                    for q in range(c):
                        total += H[a, p] * P[b, columns[p], columns[q]] * H[e, q]
                S[b, a, e] = total
        Rb = R[b if len(R) > 1 else 0]
        if kind != PLAIN:
            v[:] = 0.0
            modify(kind, h[0], h[2], v, Rb, S[b, 1, 1], S[b, 2, 2], R1)
            Rb = R1
        for a in range(d):
            for e in range(d):
                S[b, a, e] += Rb[a, e]
    return hs, S
