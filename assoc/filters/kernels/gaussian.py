"""Prediction and correction of Gaussians, compiled, for a batch of targets in one call.

The correction is Joseph's form, P+ = (I - K H) P (I - K H)' + K R K', in which a rounding error of the gain
enters only squared; only one half is computed and mirrored, so covariances stay exactly symmetric. H is
given by the columns of the state that it reads (`columns`) and its entries there, (d, c).
"""

from __future__ import annotations

import math

import numpy as np

from assoc._system.compiled import inner_njit, literal_njit, njit
from assoc._types import Array
from assoc.filters.kernels.linear_algebra import factor
from assoc.sensors.kernels.dispatch import linearise, linearise_moving, wrap

LINEAR = 4
"""Measurement model: a matrix on the state, beside the codes of the sensors."""
GIVEN = -1
"""Measurement model of the user's: prediction and Jacobian come with the call."""

PLAIN, MODIFIED, SIMPLIFIED = 0, 1, 2
"""Kinds of correction; the last two are those of the modified EKF."""

GOOD, BAD_MEASUREMENT, BAD_COVARIANCE, BAD_MEAN = 0, 1, 2, 3
"""What a kernel found."""
STATUSES = 4

LOG_TURN = math.log(2.0 * math.pi)


@inner_njit
def multiply(F: Array, P: Array, out: Array) -> None:
    """Write F P into out; zeros of F cost nothing."""
    n = P.shape[0]
    for i in range(n):
        for j in range(n):
            out[i, j] = 0.0
        for k in range(n):
            f = F[i, k]
            if f != 0.0:
                for j in range(n):
                    out[i, j] += f * P[k, j]


@inner_njit
def predict_one(m: Array, P: Array, F: Array, Q: Array, moved: Array, new_mean: Array, out: Array, W: Array) -> None:
    """`predict` for one target; W (n, n) is working space."""
    n = len(m)
    if len(moved) > 0:
        for i in range(n):
            new_mean[i] = moved[i]
    else:
        for i in range(n):
            total = 0.0
            for k in range(n):
                total += F[i, k] * m[k]
            new_mean[i] = total
    multiply(F, P, W)
    for i in range(n):
        for j in range(i + 1):
            out[i, j] = Q[i, j]
    for j in range(n):
        for k in range(n):
            f = F[j, k]
            if f != 0.0:
                for i in range(j, n):
                    out[i, j] += f * W[i, k]
    for i in range(n):
        for j in range(i):
            out[j, i] = out[i, j]


@njit
def predict(mean: Array, P: Array, F: Array, Q: Array, moved: Array, new_mean: Array, new_P: Array) -> None:
    """Predict a batch into new_mean and new_P.

    Results are written into arrays of the caller's: returning them costs 1 microsecond each.

    Parameters
    ----------
    mean, P : (B, n), (B, n, n)
    F, Q : (B or 1, n, n)
        Transition (or Jacobian) and process noise.
    moved : (B, n) or (0, n)
        Predicted means of a nonlinear model; empty: F times the mean.
    """
    n = mean.shape[1]
    none, W = np.empty(0), np.empty((n, n))
    for b in range(len(mean)):
        predict_one(
            mean[b], P[b], F[b if len(F) > 1 else 0], Q[b if len(Q) > 1 else 0], moved[b] if len(moved) > 0 else none,
            new_mean[b], new_P[b], W,
        )  # fmt: skip


@literal_njit
def correct(
    d: int, c: int, mean: Array, P: Array, columns: Array, H: Array, R: Array, v: Array, S: Array,
    new_mean: Array, new_P: Array, X: Array, K: Array, L: Array, W: Array, G: Array, M: Array,
) -> tuple[bool, float, float]:  # fmt: skip
    """Joseph's correction of one Gaussian; returns whether S is positive definite, NIS and ln det S.

    d and c are the numbers of measured quantities and of columns: the compiler unrolls the loops of a caller
    that gives them literally. X, K and G (n, d), L and W (d, d), M (n, n) are working space.
    """
    n = len(mean)
    for i in range(n):
        for a in range(d):
            total = 0.0
            for p in range(c):
                total += P[i, columns[p]] * H[a, p]
            X[i, a] = total
    for a in range(d):
        for e in range(a + 1):
            total = R[a, e]
            for p in range(c):
                total += H[a, p] * X[columns[p], e]
            S[a, e] = total
            S[e, a] = total
    if not factor(S, d, L):
        return False, 0.0, 0.0
    # the inverse of S; what rounding makes of the gain, Joseph's form forgives
    log_det = nis = 0.0
    for a in range(d):
        log_det += 2.0 * math.log(L[a, a])
        L[a, a] = 1.0 / L[a, a]
    for a in range(d):
        for e in range(a + 1, d):
            total = 0.0
            for k in range(a, e):
                total -= L[e, k] * (L[k, a] if k > a else L[a, a])
            L[e, a] = total * L[e, e]
        total = 0.0
        for e in range(a + 1):
            total += L[a, e] * v[e]
        nis += total * total
    for a in range(d):
        for e in range(a + 1):
            total = 0.0
            for k in range(a, d):
                total += L[k, a] * L[k, e]
            W[a, e] = total
            W[e, a] = total
    for i in range(n):
        for a in range(d):
            total = 0.0
            for e in range(d):
                total += X[i, e] * W[e, a]
            K[i, a] = total
    for i in range(n):
        total = mean[i]
        for a in range(d):
            total += K[i, a] * v[a]
        new_mean[i] = total
    # M = (I - K H) P, then M (I - K H)' + K R K'
    # (of M only the lower half and the columns that H reads are needed)
    last = 0
    for p in range(c):
        last = max(last, columns[p] + 1)
    for i in range(n):
        for j in range(max(i + 1, last)):
            total = P[i, j]
            for a in range(d):
                total -= K[i, a] * X[j, a]
            M[i, j] = total
    for i in range(n):
        for a in range(d):
            total = 0.0
            for e in range(d):
                total += K[i, e] * R[e, a]
            for p in range(c):
                total -= M[i, columns[p]] * H[a, p]
            G[i, a] = total
    for i in range(n):
        for j in range(i + 1):
            total = M[i, j]
            for a in range(d):
                total += G[i, a] * K[j, a]
            new_P[i, j] = total
            new_P[j, i] = total
    return True, nis, log_det


@inner_njit
def modify(kind: int, r: float, e: float, v: Array, R: Array, bt: float, bp: float, out: Array) -> None:
    """Debias a radar residual v (range, azimuth, elevation) in place and write its covariance into out.

    Park and Lee's filter with the corrected terms; equations 2.29 and 2.32 if simplified. r and e are the
    predicted range and elevation, bt and bp the prior variances of azimuth and elevation.
    """
    t, p, st, sp = v[1], v[2], R[1, 1], R[2, 2]
    for a in range(3):
        for b in range(3):
            out[a, b] = R[a, b]
    if kind == SIMPLIFIED:
        v[0] -= 0.5 * r * (t * t + p * p - st - sp)
        out[0, 0] += 0.5 * r * r * (st * st + sp * sp)
        return
    cos, sin = math.cos(e), math.sin(e)
    tan = sin / cos
    c2 = cos * cos
    v[0] -= 0.5 * r * (c2 * (t * t - st) + p * p - sp)
    v[1] -= tan * t * p
    v[2] += 0.5 * sin * cos * (t * t - st)
    out[0, 0] += r * r * (0.5 * (st * st * c2 * c2 + sp * sp) + c2 * c2 * st * bt + sp * bp)
    out[1, 1] += tan * tan * (st * sp + st * bp + sp * bt)


@inner_njit
def update_one(
    m: Array, P: Array, z: Array, code: int, place: Array, columns: Array, matrix: Array, R: Array,
    given: Array, given_H: Array, kind: int, new_mean: Array, new_P: Array, v: Array, S: Array,
) -> tuple[int, float, float]:  # fmt: skip
    """`update` for one target: what was found, NIS and log-likelihood."""
    n, d, c = len(m), len(z), len(columns)
    # few allocations: for a single target they count
    tall, small, M, h, H = (
        np.empty((3, n, d)),
        np.empty((2, d, d)),
        np.empty((n, n)),
        np.empty(d),
        np.empty((d, max(3, c))),
    )
    X, K, G, L, W = tall[0], tall[1], tall[2], small[0], small[1]
    for a in range(d):
        if not math.isfinite(z[a]):
            return BAD_MEASUREMENT, 0.0, 0.0
    if code == GIVEN:
        for a in range(d):
            v[a] = given[a]
            for p in range(c):
                H[a, p] = given_H[a, p]
    elif code == LINEAR:
        for a in range(d):
            total = 0.0
            for p in range(c):
                total += matrix[a, p] * m[columns[p]]
                H[a, p] = matrix[a, p]
            v[a] = z[a] - total
    else:
        if c > 3:
            linearise_moving(place, m, columns, h, H)
        else:
            height = m[columns[2]] if c > 2 else 0.0
            linearise(code, d, place, m[columns[0]], m[columns[1]], height, h, H)
        for a in range(d):
            v[a] = z[a] - h[a]
        wrap(code, v)
        if kind != PLAIN:
            bt, bp = 0.0, 0.0
            for p in range(c):
                for q in range(c):
                    cov = P[columns[p], columns[q]]
                    bt += H[1, p] * H[1, q] * cov
                    bp += H[2, p] * H[2, q] * cov
            widened = np.empty((d, d))
            modify(kind, h[0], h[2], v, R, bt, bp, widened)
            R = widened
    for a in range(d):
        if not math.isfinite(v[a]):
            return BAD_MEAN, 0.0, 0.0
    if d == 3 and c == 3:
        good, nis, log_det = correct(3, 3, m, P, columns, H, R, v, S, new_mean, new_P, X, K, L, W, G, M)
    else:
        good, nis, log_det = correct(d, c, m, P, columns, H, R, v, S, new_mean, new_P, X, K, L, W, G, M)
    if not good:
        return BAD_COVARIANCE, 0.0, 0.0
    return GOOD, nis, -0.5 * (nis + log_det + d * LOG_TURN)


@njit
def update(
    mean: Array, P: Array, z: Array, code: int, place: Array, columns: Array, matrix: Array, R: Array,
    given: Array, given_H: Array, kind: int,
    new_mean: Array, new_P: Array, rest: Array,
) -> int:  # fmt: skip
    """Correct a batch with one measurement for each, into the last three arrays.

    Parameters
    ----------
    mean, P : (B, n), (B, n, n)
    z : (B, d)
    code : int
        Measurement model: that of a sensor, LINEAR or GIVEN.
    place : (3,)
        The sensor's.
    columns : (c,)
        Components of the state that the model reads; for sensors those of x, y (and z), with a range rate
        their velocities after them.
    matrix : (d, c)
        Of a linear model.
    R : (B or 1, d, d)
    given, given_H : (B, d), (B, d, n)
        Residuals and Jacobians of the user's model.
    kind : int
        PLAIN, MODIFIED or SIMPLIFIED.

    new_mean, new_P, rest
        Corrected Gaussians; innovations (B, d), their covariances (B, d, d), NIS (B,) and log-likelihoods (B,), one
        after the other.

    Returns
    -------
    GOOD, or what was found plus STATUSES times the number of the target.
    """
    B, d = z.shape
    begin, end = B * d, B * d + B * d * d
    v, S = rest[:begin].reshape((B, d)), rest[begin:end].reshape((B, d, d))
    nis, ll = rest[end : end + B], rest[end + B :]
    for b in range(B):
        own = b if code == GIVEN else 0
        status, nis[b], ll[b] = update_one(
            mean[b], P[b], z[b], code, place, columns, matrix, R[b if len(R) > 1 else 0], given[own], given_H[own],
            kind, new_mean[b], new_P[b], v[b], S[b],
        )  # fmt: skip
        if status != GOOD:
            return status + STATUSES * b
    return GOOD


@njit
def step(
    mean: Array, P: Array, models: Array, z: Array, seen: Array, code: int, c: int, kind: int,
    new_mean: Array, new_P: Array, rest: Array,
) -> int:  # fmt: skip
    """Predict one target with a linear model and correct it, into the last three arrays, as `update` does.

    models (2, 1, n, n) are F and Q. `seen` is a measurement model that reads c components in one piece, as
    `assoc.filters.measurement.Observation` has it: an array less is a tenth of a microsecond less.
    """
    n, d = mean.shape[1], z.shape[1]
    predicted, pair, none = np.empty(n), np.empty((2, n, n)), rest[:0]
    predicted_P = pair[0]
    predict_one(mean[0], P[0], models[0, 0], models[1, 0], none, predicted, predicted_P, pair[1])
    matrix, v = seen[3 + c : len(seen) - d * d], rest[:d]
    end = d + d * d
    status, rest[end], rest[end + 1] = update_one(
        predicted, predicted_P, z[0], code, seen[:3], seen[3 : 3 + c].view(np.int64),
        matrix.reshape((len(matrix) // c, c)), seen[len(seen) - d * d :].reshape((d, d)), none, predicted_P[:0], kind,
        new_mean[0], new_P[0], v, rest[d:end].reshape((d, d)),
    )  # fmt: skip
    return status


@njit
def follow(
    mean: Array, P: Array, F: Array, Q: Array, z: Array, code: int, place: Array, columns: Array, matrix: Array,
    R: Array, kind: int, means: Array, Ps: Array, nis: Array, ll: Array,
) -> int:  # fmt: skip
    """Predict and correct a batch through K steps of a linear motion, into the last four arrays.

    F and Q are (K or 1, n, n), z (K, B, d), means and Ps (K, B, ...), nis and ll (K, B). Returns as `update`
    does, with the target counted through the steps.
    """
    K, B, d = z.shape
    n = mean.shape[1]
    given, given_H = np.empty((1, 0)), np.empty((1, 0, 0))
    predicted, predicted_P = np.empty((B, n)), np.empty((B, n, n))
    rest, nothing = np.empty(B * (d + d * d + 2)), np.empty((0, 0))
    for k in range(K):
        j = k if len(F) > 1 else 0
        if k == 0:
            predict(mean, P, F[j : j + 1], Q[j : j + 1], nothing, predicted, predicted_P)
        else:
            predict(means[k - 1], Ps[k - 1], F[j : j + 1], Q[j : j + 1], nothing, predicted, predicted_P)
        status = update(
            predicted, predicted_P, z[k], code, place, columns, matrix, R, given, given_H, kind,
            means[k], Ps[k], rest,
        )  # fmt: skip
        if status != GOOD:
            return status + STATUSES * B * k
        nis[k], ll[k] = rest[len(rest) - 2 * B : len(rest) - B], rest[len(rest) - B :]
    return GOOD
