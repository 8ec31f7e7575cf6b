"""Expected measurements, and how well others fit them: for gates and associations."""

from __future__ import annotations

import math

import numpy as np

from assoc._system.compiled import inner_njit, njit
from assoc._types import Array
from assoc.filters.kernels.gaussian import (
    BAD_COVARIANCE,
    GOOD,
    LOG_TURN,
    PLAIN,
    STATUSES,
    H,
    R,
    V,
    blur,
    elevation_of,
    folding_of,
    innovate,
    linearise_at,
    modify,
    squared,
    unpack,
)
from assoc.filters.kernels.linear_algebra import factor
from assoc.sensors.kernels.dispatch import fold, wrap


@inner_njit
def _distance(z: Array, h: Array, L: Array, code: int, folding: float, v: Array) -> float:
    """Squared Mahalanobis distance of a measurement from the expected one, by a Cholesky factor; v (d,) is scratch."""
    for a in range(len(v)):
        v[a] = z[a] - h[a]
    wrap(code, v)
    fold(folding, v)
    total = 0.0
    for a in range(len(v)):
        for e in range(a):
            v[a] -= L[a, e] * v[e]
        v[a] /= L[a, a]
        total += v[a] * v[a]
    return total


@njit
def pairs(h: Array, S: Array, z: Array, code: int, folding: float) -> tuple[int, Array, Array]:
    """Log-likelihood and squared Mahalanobis distance, each (B, M), of each measurement under each target.

    h (B, d) and S (B, d, d) are the expected measurements and their covariances, z (M, d); `folding`: see `folding_of`.
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
            square[b, m] = _distance(z[m], h[b], L, code, folding, v)
            ll[b, m] = -0.5 * (square[b, m] + base)
    return GOOD, ll, square


@njit
def expect(mean: Array, P: Array, models: Array, d: int) -> tuple[Array, Array]:
    """Expected measurements (B, d) of a linearised model, packed (1, ...), and their covariances (B, d, d)."""
    B = len(mean)
    code, kind, position, columns, matrix, noise = unpack(models[0], d)
    c, folding = len(columns), folding_of(code, matrix)
    hs, S, h = np.empty((B, d)), np.empty((B, d, d)), np.empty(d)
    H, HP, v, R = np.empty((d, max(3, c))), np.empty((d, c)), np.zeros(d), noise.copy()
    for b in range(B):
        linearise_at(code, position, columns, matrix, mean[b], h, H)
        if folding > 0.0:
            blur(folding, P[b], columns, noise, H, R)
        for a in range(d):
            hs[b, a] = h[a]
            for q in range(c):
                total = 0.0
                for p in range(c):
                    total += H[a, p] * P[b, columns[p], columns[q]]
                HP[a, q] = total
        for a in range(d):
            for e in range(a + 1):
                total = 0.0
                for q in range(c):
                    total += HP[a, q] * H[e, q]
                S[b, a, e] = S[b, e, a] = total
        if kind != PLAIN:
            v[:] = 0.0
            modify(kind, h[0], elevation_of(h, H), v, noise, S[b, 1, 1], S[b, d - 1, d - 1], R)
        for a in range(d):
            for e in range(d):
                S[b, a, e] += R[a, e]
    return hs, S


@njit
def fits(mean: Array, P: Array, rows: Array, z: Array, models: Array, found: Array) -> int:
    """Log-likelihoods and NIS of measurements z (K, d) of the targets in these rows, as `gaussian.update` has them.

    They are written into found (2, K). Rows of one target should be side by side: it is looked at once. The model,
    packed (1, ...), is linearised and PLAIN. Returns GOOD, or BAD_COVARIANCE plus STATUSES times the target's number.
    """
    K, d = z.shape
    code, _, position, columns, matrix, noise = unpack(models[0], d)
    c, wide, folding = len(columns), max(mean.shape[1], d), folding_of(code, matrix)
    linear, work, S = np.empty((3, d, max(3, c, d))), np.empty((6, wide, wide)), np.empty((d, d))
    h, v = np.empty(d), np.empty(d)
    for a in range(d):
        for e in range(d):
            linear[R, a, e] = noise[a, e]
    last, log_det = -1, 0.0
    for k in range(K):
        b = rows[k]
        if b != last:
            last = b
            linearise_at(code, position, columns, matrix, mean[b], h, linear[H])
            if folding > 0.0:
                blur(folding, P[b], columns, noise, linear[H], linear[R])
            if d == 3 and c == 3:
                good, log_det = innovate(3, 3, P[b], columns, linear, work, S)
            else:
                good, log_det = innovate(d, c, P[b], columns, linear, work, S)
            if not good:
                return BAD_COVARIANCE + STATUSES * b
        for a in range(d):
            v[a] = z[k, a] - h[a]
        wrap(code, v)
        fold(folding, v)
        for a in range(d):
            linear[V, 0, a] = v[a]
        nis = squared(3, linear, work) if d == 3 else squared(d, linear, work)
        found[0, k] = -0.5 * (nis + log_det + d * LOG_TURN)
        found[1, k] = nis
    return GOOD


@njit
def distances(h: Array, S: Array, rows: Array, z: Array, code: int, folding: float) -> tuple[int, Array]:
    """Squared Mahalanobis distances (K,) of z (K, d) from what is expected of targets: h (B, d), S (B, d, d).

    Rows of one target should be side by side. The first number is a status as of `fits`.
    """
    K, d = z.shape
    square, L, v = np.empty(K), np.zeros((d, d)), np.empty(d)
    last = -1
    for k in range(K):
        b = rows[k]
        if b != last:
            last = b
            if not factor(S[b], d, L):
                return BAD_COVARIANCE + STATUSES * b, square
        square[k] = _distance(z[k], h[b], L, code, folding, v)
    return GOOD, square


@njit
def matched(weights: Array, h: Array, S: Array, periods: Array) -> tuple[Array, Array]:
    """Means (B, d) and covariances (B, d, d) of mixtures of measurements, h (B, m, d), S (B, m, d, d), weights (B, m).

    Where a component has a period, as angles have: means are taken of the differences from the first.
    """
    B, m, d = h.shape
    mean, covariance, away = np.empty((B, d)), np.zeros((B, d, d)), np.empty((m, d))
    for b in range(B):
        for a in range(d):
            middle = 0.0
            for j in range(m):
                off = h[b, j, a] - h[b, 0, a]
                if periods[a] > 0.0:
                    off -= periods[a] * round(off / periods[a])
                away[j, a] = off
                middle += weights[b, j] * off
            mean[b, a] = h[b, 0, a] + middle
            for j in range(m):
                away[j, a] -= middle
        for j in range(m):
            for a in range(d):
                for e in range(d):
                    covariance[b, a, e] += weights[b, j] * (S[b, j, a, e] + away[j, a] * away[j, e])
    return mean, covariance
