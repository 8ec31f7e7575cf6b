"""Expected measurements, and how well others fit them: for gates and associations."""

from __future__ import annotations

import math

import numpy as np

from assoc._system.compiled import njit
from assoc._types import Array
from assoc.filters.kernels.gaussian import (
    BAD_COVARIANCE,
    GOOD,
    LOG_TURN,
    PLAIN,
    STATUSES,
    elevation_of,
    linearise_at,
    modify,
    unpack,
)
from assoc.filters.kernels.linear_algebra import factor
from assoc.sensors.kernels.dispatch import wrap


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
def expect(mean: Array, P: Array, models: Array, d: int) -> tuple[Array, Array]:
    """Expected measurements (B, d) of a linearised model, packed (1, ...), and their covariances (B, d, d)."""
    B = len(mean)
    code, kind, position, columns, matrix, noise = unpack(models[0], d)
    c = len(columns)
    hs, S, h = np.empty((B, d)), np.empty((B, d, d)), np.empty(d)
    H, v, R = np.empty((d, max(3, c))), np.zeros(d), noise.copy()
    for b in range(B):
        linearise_at(code, position, columns, matrix, mean[b], h, H)
        for a in range(d):
            hs[b, a] = h[a]
            for e in range(d):
                total = 0.0
                for p in range(c):
                    for q in range(c):
                        total += H[a, p] * P[b, columns[p], columns[q]] * H[e, q]
                S[b, a, e] = total
        if kind != PLAIN:
            v[:] = 0.0
            modify(kind, h[0], elevation_of(h, H), v, noise, S[b, 1, 1], S[b, d - 1, d - 1], R)
        for a in range(d):
            for e in range(d):
                S[b, a, e] += R[a, e]
    return hs, S
