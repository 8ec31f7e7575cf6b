"""Kernels of the filters that carry points: sigma points and ensembles."""

from __future__ import annotations

import math

import numpy as np

from assoc._system.compiled import inner_njit, njit
from assoc._types import Array
from assoc.filters.kernels.gaussian import (
    BAD_COVARIANCE,
    BAD_MEAN,
    BAD_MEASUREMENT,
    GIVEN,
    GOOD,
    LINEAR,
    LOG_TURN,
    STATUSES,
)
from assoc.filters.kernels.gaussian import correct as correct_one
from assoc.filters.kernels.linear_algebra import factor, solve_in_place
from assoc.sensors.kernels.dispatch import measure, measure_moving, wrap


@inner_njit
def observe_point(x: Array, code: int, d: int, place: Array, columns: Array, matrix: Array, h: Array) -> None:
    """Write the noise-free measurement of one state into h."""
    if code == LINEAR:
        for a in range(d):
            total = 0.0
            for p in range(len(columns)):
                total += matrix[a, p] * x[columns[p]]
            h[a] = total
    elif len(columns) > 3:
        measure_moving(place, x, columns, h)
    else:
        height = x[columns[2]] if len(columns) > 2 else 0.0
        measure(code, d, place, x[columns[0]], x[columns[1]], height, h)


@inner_njit
def observe_from_first(
    s: int, x: Array, code: int, d: int, place: Array, columns: Array, matrix: Array, first: Array, h: Array
) -> None:
    """Write the measurement of point number s into h[s] as the difference from the first, so that angles do not jump.

    That of the first point is kept in `first`.
    """
    observe_point(x, code, d, place, columns, matrix, h[s])
    if s == 0:
        for a in range(d):
            first[a] = h[0, a]
    for a in range(d):
        h[s, a] -= first[a]
    wrap(code, h[s])


@njit
def sigma_points(mean: Array, P: Array, scale: float, points: Array) -> int:
    """Write the 2 n + 1 points of each Gaussian, mean and mean +- scale times a column of the factor."""
    B, n = mean.shape
    L = np.zeros((n, n))
    for b in range(B):
        if not factor(P[b], n, L):
            return BAD_COVARIANCE + STATUSES * b
        for i in range(n):
            points[b, 0, i] = mean[b, i]
            for k in range(n):
                step = scale * L[i, k] if k <= i else 0.0
                points[b, 1 + k, i] = mean[b, i] + step
                points[b, 1 + n + k, i] = mean[b, i] - step
    return GOOD


@njit
def moments(points: Array, before: Array, wm: Array, wc: Array, Q: Array, mean: Array, P: Array) -> Array:
    """Mean and covariance (plus Q) of weighted points (B, m, n); returns the cross covariance with `before`.

    `before` (B, m, n) are the points that they were moved from.
    """
    B, m, n = points.shape
    cross = np.zeros((B, n, n))
    for b in range(B):
        Qb = Q[b if len(Q) > 1 else 0]
        for i in range(n):
            total = 0.0
            for s in range(m):
                total += wm[s] * points[b, s, i]
            mean[b, i] = total
        for i in range(n):
            for j in range(i + 1):
                P[b, i, j] = Qb[i, j]
        for s in range(m):
            for i in range(n):
                u = wc[s] * (points[b, s, i] - mean[b, i])
                for j in range(i + 1):
                    P[b, i, j] += u * (points[b, s, j] - mean[b, j])
                for j in range(n):
                    cross[b, j, i] += u * (before[b, s, j] - before[b, 0, j])
        for i in range(n):
            for j in range(i):
                P[b, j, i] = P[b, i, j]
    return cross


@njit
def unscented(
    mean: Array, P: Array, z: Array, code: int, place: Array, columns: Array, matrix: Array, R: Array,
    given: Array, given_residual: Array, scale: float, wm: Array, wc: Array, correcting: bool,
    new_mean: Array, new_P: Array, v: Array, S: Array, nis: Array, ll: Array,
) -> int:  # fmt: skip
    """Unscented correction of a batch, into the last six arrays.

    The sigma points give a regression z = H x + noise of covariance R + extra; corrected with these, Joseph's form
    keeps the covariance positive definite, and it is the unscented correction exactly. For a user's model
    (GIVEN) the measurements of the points (B, 2n+1, d) relative to the first and the residual of the first
    (B, d) come with the call. Without `correcting`, v receives the expected measurement, S its covariance.
    """
    B, n = mean.shape
    d, m = R.shape[1], 2 * n + 1
    L, h, x = np.zeros((n, n)), np.zeros((m, d)), np.empty(n)
    H, C, extra, mu = np.empty((d, n)), np.empty((d, n)), np.empty((d, d)), np.empty(d)
    X, K, LS, W = np.empty((n, d)), np.empty((n, d)), np.empty((d, d)), np.empty((d, d))
    G, M, first = np.empty((n, d)), np.empty((n, n)), np.zeros(d)
    every = np.arange(n)
    for b in range(B):
        Rb = R[b if len(R) > 1 else 0]
        if correcting:
            for a in range(d):
                if not math.isfinite(z[b, a]):
                    return BAD_MEASUREMENT + STATUSES * b
        if not factor(P[b], n, L):
            return BAD_COVARIANCE + STATUSES * b
        for s in range(m):
            if code == GIVEN:
                for a in range(d):
                    h[s, a] = given[b, s, a]
                continue
            for i in range(n):
                x[i] = mean[b, i]
            if s > 0:
                k = (s - 1) % n
                sign = scale if s <= n else -scale
                for i in range(k, n):
                    x[i] += sign * L[i, k]
            observe_from_first(s, x, code, d, place, columns, matrix, first, h)
        for a in range(d):
            total = 0.0
            for s in range(m):
                total += wm[s] * h[s, a]
            mu[a] = total
        for a in range(d):
            for i in range(n):
                C[a, i] = 0.0
            for e in range(a + 1):
                total = 0.0
                for s in range(m):
                    total += wc[s] * (h[s, a] - mu[a]) * (h[s, e] - mu[e])
                extra[a, e] = total
                extra[e, a] = total
            for k in range(n):
                u = scale * (wc[1 + k] * (h[1 + k, a] - mu[a]) - wc[1 + n + k] * (h[1 + n + k, a] - mu[a]))
                for i in range(k, n):
                    C[a, i] += u * L[i, k]
            for i in range(n):
                H[a, i] = C[a, i]
            solve_in_place(L, n, H[a])
        if not correcting:
            for a in range(d):
                v[b, a] = first[a] + mu[a]
                for e in range(d):
                    S[b, a, e] = extra[a, e] + Rb[a, e]
            continue
        for a in range(d):
            for e in range(a + 1):
                total = extra[a, e] + Rb[a, e]
                for i in range(n):
                    total -= H[a, i] * C[e, i]
                extra[a, e] = total
                extra[e, a] = total
        if code == GIVEN:
            for a in range(d):
                v[b, a] = given_residual[b, a] - mu[a]
        else:
            for a in range(d):
                v[b, a] = z[b, a] - first[a]
            wrap(code, v[b])
            for a in range(d):
                v[b, a] -= mu[a]
            wrap(code, v[b])
        for a in range(d):
            if not math.isfinite(v[b, a]):
                return BAD_MEAN + STATUSES * b
        good, one, log_det = correct_one(
            d, n, mean[b], P[b], every, H, extra, v[b], S[b], new_mean[b], new_P[b], X, K, LS, W, G, M
        )
        if not good:
            return BAD_COVARIANCE + STATUSES * b
        nis[b] = one
        ll[b] = -0.5 * (one + log_det + d * LOG_TURN)
    return GOOD


@njit
def move_ensemble(members: Array, F: Array, shocks: Array, moved: Array, factors: Array, out: Array) -> None:
    """Move members (B, N, n) by F (linear models) or take `moved`, and add factors (B or 1, n, n) @ shocks."""
    B, N, n = members.shape
    for b in range(B):
        Lb = factors[b if len(factors) > 1 else 0]
        for s in range(N):
            for i in range(n):
                total = 0.0
                if len(moved) > 0:
                    total = moved[b, s, i]
                else:
                    for k in range(n):
                        f = F[0, i, k]
                        if f != 0.0:
                            total += f * members[b, s, k]
                for k in range(i + 1):
                    f = Lb[i, k]
                    if f != 0.0:
                        total += f * shocks[b, s, k]
                out[b, s, i] = total


@njit
def ensemble_update(
    members: Array, z: Array, code: int, place: Array, columns: Array, matrix: Array, R: Array,
    given: Array, given_residual: Array, shocks: Array, correcting: bool,
    out: Array, v: Array, S: Array, nis: Array, ll: Array,
) -> int:  # fmt: skip
    """Correction of ensembles with perturbed measurements, into the last five arrays.

    members (B, N, n), shocks (B, N, d) standard normal. Equations 12 and 13 of the UAV paper, for any
    measurement model: the gain is that of sample covariances. For a user's model the measurements of the
    members relative to the first, (B, N, d), and the residual of the first, (B, d), come with the call. Without
    `correcting`, v receives the expected measurement and S its covariance.
    """
    B, N, n = members.shape
    d = R.shape[1]
    h, mu, mean = np.empty((N, d)), np.empty(d), np.empty(n)
    C, L, LR, w = np.empty((n, d)), np.zeros((d, d)), np.zeros((d, d)), np.empty(d)
    first = np.zeros(d)
    for b in range(B):
        Rb = R[b if len(R) > 1 else 0]
        if correcting:
            for a in range(d):
                if not math.isfinite(z[b, a]):
                    return BAD_MEASUREMENT + STATUSES * b
        if not factor(Rb, d, LR):
            return BAD_COVARIANCE + STATUSES * b
        mu[:] = 0.0
        mean[:] = 0.0
        for s in range(N):
            if code == GIVEN:
                for a in range(d):
                    h[s, a] = given[b, s, a]
            else:
                observe_from_first(s, members[b, s], code, d, place, columns, matrix, first, h)
            for a in range(d):
                mu[a] += h[s, a] / N
            for i in range(n):
                mean[i] += members[b, s, i] / N
        for a in range(d):
            for e in range(d):
                S[b, a, e] = 0.0
            for i in range(n):
                C[i, a] = 0.0
        for s in range(N):
            for a in range(d):
                u = (h[s, a] - mu[a]) / (N - 1)
                for e in range(a + 1):
                    S[b, a, e] += u * (h[s, e] - mu[e])
                for i in range(n):
                    C[i, a] += u * (members[b, s, i] - mean[i])
        for a in range(d):
            for e in range(a + 1):
                S[b, a, e] += Rb[a, e]
                S[b, e, a] = S[b, a, e]
        if not correcting:
            for a in range(d):
                v[b, a] = first[a] + mu[a]
            continue
        if not factor(S[b], d, L):
            return BAD_COVARIANCE + STATUSES * b
        # the residual of the mean
        for a in range(d):
            v[b, a] = given_residual[b, a] if code == GIVEN else z[b, a] - first[a]
        wrap(code, v[b])
        for a in range(d):
            v[b, a] -= mu[a]
        wrap(code, v[b])
        square = log_det = 0.0
        for a in range(d):
            total = v[b, a]
            if not math.isfinite(total):
                return BAD_MEAN + STATUSES * b
            for e in range(a):
                total -= L[a, e] * w[e]
            w[a] = total / L[a, a]
            square += w[a] * w[a]
            log_det += 2.0 * math.log(L[a, a])
        nis[b] = square
        ll[b] = -0.5 * (square + log_det + d * LOG_TURN)
        # C becomes the gain
        for i in range(n):
            solve_in_place(L, d, C[i])
        for s in range(N):
            for a in range(d):
                total = v[b, a] + mu[a] - h[s, a]
                for e in range(a + 1):
                    total += LR[a, e] * shocks[b, s, e]
                w[a] = total
            for i in range(n):
                total = members[b, s, i]
                for a in range(d):
                    total += C[i, a] * w[a]
                out[b, s, i] = total
    return GOOD
