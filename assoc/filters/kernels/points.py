"""Kernels of the filters that carry points: sigma points and ensembles."""

from __future__ import annotations

import math

import numpy as np

from assoc._system.compiled import inner_njit, lean_inner_njit, njit
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
    H,
    R,
    V,
    correct,
    correct_mean,
    folding_of,
    parts_of,
    unpack,
)
from assoc.filters.kernels.linear_algebra import factor, solve_in_place
from assoc.sensors.kernels.dispatch import fold, measure, measure_moving, wrap


@inner_njit
def observe_points(
    code: int, position: Array, columns: Array, matrix: Array, points: Array, first: Array, h: Array
) -> None:
    """Write measurements of points (m, n) into h (m, d) as differences from the first, so that angles do not jump.

    That of the first point is kept in `first`. Of the user's own model (GIVEN) they are the matrix.
    """
    if code == GIVEN:
        # number by number: assigning the whole would compile an error message about its shape
        for s in range(len(points)):
            for a in range(len(first)):
                h[s, a] = matrix[s, a]
        return
    d = len(first)
    for s in range(len(points)):
        x = points[s]
        if code == LINEAR:
            for a in range(d):
                total = 0.0
                for p in range(len(columns)):
                    total += matrix[a, p] * x[columns[p]]
                h[s, a] = total
        elif len(columns) > 3:
            measure_moving(position, x, columns, h[s])
        else:
            height = x[columns[2]] if len(columns) > 2 else 0.0
            measure(code, d, position, x[columns[0]], x[columns[1]], height, h[s])
        for a in range(d):
            if s == 0:
                first[a] = h[0, a]
            h[s, a] -= first[a]
        wrap(code, h[s])


@inner_njit
def residual_of_mean(code: int, folding: float, z: Array, first: Array, mu: Array, v: Array) -> bool:
    """Write the residual of the mean measurement, first + mu, into v (d,); False if it is not finite."""
    for a in range(len(z)):
        v[a] = z[a] if code == GIVEN else z[a] - first[a]
    wrap(code, v)
    for a in range(len(z)):
        v[a] -= mu[a]
    wrap(code, v)
    fold(folding, v)
    return all_finite(v)


@inner_njit
def all_finite(z: Array) -> bool:
    """Whether all numbers are finite, (d,)."""
    for a in range(len(z)):
        if not math.isfinite(z[a]):
            return False
    return True


@njit
def sigma_points(mean: Array, P: Array, scale: float, points: Array) -> int:
    """Write the 2 n + 1 points of each Gaussian, mean and mean +- scale times a column of the factor."""
    B, n = mean.shape
    L = np.zeros((n, n))
    for b in range(B):
        if not factor(P[b], n, L):
            return BAD_COVARIANCE + STATUSES * b
        _draw(mean[b], scale, L, points[b])
    return GOOD


@lean_inner_njit
def _draw(mean: Array, scale: float, factor: Array, points: Array) -> None:
    """Write the 2 n + 1 sigma points of one Gaussian; the factor of its covariance is lower triangular."""
    n = len(mean)
    for i in range(n):
        points[0, i] = mean[i]
        for k in range(n):
            step = scale * factor[i, k] if k <= i else 0.0
            points[1 + k, i] = mean[i] + step
            points[1 + n + k, i] = mean[i] - step


@lean_inner_njit
def _regress(h: Array, weights: Array, F: Array, mu: Array, C: Array, extra: Array) -> None:
    """Weighted mean (d,) of measured sigma points (2 n + 1, d), their cross covariance (d, n), covariance (d, d).

    `F` is the factor of the state's covariance.
    """
    m, d = h.shape
    n = len(F)
    scale = weights[0, 1]
    for a in range(d):
        total = 0.0
        for s in range(m):
            total += weights[1, s] * h[s, a]
        mu[a] = total
    for a in range(d):
        for i in range(n):
            C[a, i] = 0.0
        for e in range(a + 1):
            total = 0.0
            for s in range(m):
                total += weights[2, s] * (h[s, a] - mu[a]) * (h[s, e] - mu[e])
            extra[a, e] = total
            extra[e, a] = total
        for k in range(n):
            above, below = h[1 + k, a] - mu[a], h[1 + n + k, a] - mu[a]
            u = scale * (weights[2, 1 + k] * above - weights[2, 1 + n + k] * below)
            for i in range(k, n):
                C[a, i] += u * F[i, k]


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
    mean: Array, P: Array, z: Array, models: Array, weights: Array, new_mean: Array, new_P: Array, rest: Array
) -> int:
    """Unscented correction of a batch, into the last three arrays, as `assoc.filters.kernels.gaussian.update` does.

    The sigma points give a regression z = H x + noise of covariance R + extra; corrected with these, Joseph's form
    keeps the covariance positive definite, and it is the unscented correction exactly.

    z (B, d): measurements; of a user's model (GIVEN) the residuals of the first point. Without rows the expected
    measurements and their covariances are written in place of the innovations. models (B or 1, ...): packed; a user's
    has the measurements of the points (2n+1, d) relative to the first. weights (3, 2n+1): steps of the points in
    columns of the factor, weights of means, weights of covariances.
    """
    B, n = mean.shape
    d, m = z.shape[1], 2 * n + 1
    v, S, nis, ll = parts_of(rest, B, d)
    wide = max(n, d)
    F, h, x = np.zeros((n, n)), np.zeros((m, d)), np.empty((m, n))
    C, mu, first = np.empty((d, n)), np.empty(d), np.zeros(d)
    every, work, linear = np.arange(n), np.empty((6, wide, wide)), np.empty((3, d, wide))
    slopes, extra = linear[H], linear[R]
    for b in range(B):
        if b == 0 or len(models) > 1:
            code, _, position, columns, matrix, noise = unpack(models[b], d)
            folding = folding_of(code, matrix)
        if len(z) and not all_finite(z[b]):
            return BAD_MEASUREMENT + STATUSES * b
        if not factor(P[b], n, F):
            return BAD_COVARIANCE + STATUSES * b
        _draw(mean[b], weights[0, 1], F, x)
        observe_points(code, position, columns, matrix, x, first, h)
        _regress(h, weights, F, mu, C, extra)
        for a in range(d):
            for i in range(n):
                slopes[a, i] = C[a, i]
            solve_in_place(F, n, slopes[a])
        if folding > 0.0 and 9.0 * (extra[3, 3] + noise[3, 3]) > folding * folding:
            # says nothing, as in `assoc.filters.kernels.gaussian.blur`
            for i in range(n):
                slopes[3, i], C[3, i] = 0.0, 0.0
            for a in range(3):
                extra[3, a] = extra[a, 3] = -noise[3, a]
            extra[3, 3] = folding * folding / 12.0 - noise[3, 3]
        if not len(z):
            for a in range(d):
                v[b, a] = first[a] + mu[a]
                for e in range(d):
                    S[b, a, e] = extra[a, e] + noise[a, e]
            continue
        for a in range(d):
            for e in range(a + 1):
                total = extra[a, e] + noise[a, e]
                for i in range(n):
                    total -= slopes[a, i] * C[e, i]
                extra[a, e] = total
                extra[e, a] = total
        if not residual_of_mean(code, folding, z[b], first, mu, v[b]):
            return BAD_MEAN + STATUSES * b
        for a in range(d):
            linear[V, 0, a] = v[b, a]
        good, nis[b], log_det = correct(d, n, P[b], every, linear, work, S[b], new_P[b])
        if not good:
            return BAD_COVARIANCE + STATUSES * b
        correct_mean(mean[b], work, v[b], new_mean[b])
        ll[b] = -0.5 * (nis[b] + log_det + d * LOG_TURN)
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


@lean_inner_njit
def _sample_moments(members: Array, h: Array, noise: Array, mu: Array, mean: Array, C: Array, S: Array) -> None:
    """Sample means (d,) and (n,) of measured members (N, d) and of members (N, n), covariances (n, d) and (d, d).

    The last is that of measurements, with their noise.
    """
    N, n = members.shape
    d = h.shape[1]
    for a in range(d):
        mu[a] = 0.0
        for e in range(d):
            S[a, e] = 0.0
        for i in range(n):
            C[i, a] = 0.0
    for i in range(n):
        mean[i] = 0.0
    for s in range(N):
        for a in range(d):
            mu[a] += h[s, a] / N
        for i in range(n):
            mean[i] += members[s, i] / N
    for s in range(N):
        for a in range(d):
            u = (h[s, a] - mu[a]) / (N - 1)
            for e in range(a + 1):
                S[a, e] += u * (h[s, e] - mu[e])
            for i in range(n):
                C[i, a] += u * (members[s, i] - mean[i])
    for a in range(d):
        for e in range(a + 1):
            S[a, e] += noise[a, e]
            S[e, a] = S[a, e]


@njit
def ensemble_update(members: Array, z: Array, models: Array, shocks: Array, out: Array, rest: Array) -> int:
    """Correction of ensembles with perturbed measurements, into the last two arrays; `rest` as in `unscented`.

    Equations 12 and 13 of the UAV paper, for any measurement model: the gain is that of sample covariances. members (B,
    N, n); z and models as in `unscented`, with N members for points; shocks (B, N, d): standard normal.
    """
    B, N, n = members.shape
    d = z.shape[1]
    v, S, nis, ll = parts_of(rest, B, d)
    h, mu, mean = np.empty((N, d)), np.empty(d), np.empty(n)
    C, L, LR, w = np.empty((n, d)), np.zeros((d, d)), np.zeros((d, d)), np.empty(d)
    first = np.zeros(d)
    for b in range(B):
        if b == 0 or len(models) > 1:
            code, _, position, columns, matrix, noise = unpack(models[b], d)
            folding = folding_of(code, matrix)
        if len(z) and not all_finite(z[b]):
            return BAD_MEASUREMENT + STATUSES * b
        if not factor(noise, d, LR):
            return BAD_COVARIANCE + STATUSES * b
        observe_points(code, position, columns, matrix, members[b], first, h)
        _sample_moments(members[b], h, noise, mu, mean, C, S[b])
        if folding > 0.0 and 9.0 * S[b, 3, 3] > folding * folding:
            # says nothing, as in `assoc.filters.kernels.gaussian.blur`
            for a in range(3):
                S[b, 3, a] = S[b, a, 3] = 0.0
            S[b, 3, 3] = folding * folding / 12.0
            for i in range(n):
                C[i, 3] = 0.0
        if not len(z):
            for a in range(d):
                v[b, a] = first[a] + mu[a]
            continue
        if not factor(S[b], d, L):
            return BAD_COVARIANCE + STATUSES * b
        if not residual_of_mean(code, folding, z[b], first, mu, v[b]):
            return BAD_MEAN + STATUSES * b
        square = log_det = 0.0
        for a in range(d):
            total = v[b, a]
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
