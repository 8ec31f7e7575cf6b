"""Prediction and correction of Gaussians, compiled, for a batch of targets in one call.

The correction is Joseph's form, P+ = (I - K H) P (I - K H)' + K R K', in which a rounding error of the gain
enters only squared; only one half is computed and mirrored, so covariances stay exactly symmetric. H is
given by the columns of the state that it reads (`columns`) and its entries there, (d, c).
"""

from __future__ import annotations

import math

import numpy as np

from assoc._system.compiled import inner_njit, lean_inner_njit, literal_njit, njit
from assoc._types import Array
from assoc.filters.kernels.linear_algebra import factor
from assoc.sensors.codes import RADAR3D
from assoc.sensors.kernels.dispatch import fold, linearise, linearise_moving, wrap

LINEAR = 4
"""Measurement model: a matrix on the state, beside the codes of the sensors."""
GIVEN = -1
"""A user's measurement model: residuals and Jacobians come with the call."""

PLAIN, MODIFIED, SIMPLIFIED = 0, 1, 2
"""Kinds of correction; the last two are those of the modified EKF."""

GOOD, BAD_MEASUREMENT, BAD_COVARIANCE, BAD_MEAN = 0, 1, 2, 3
"""Statuses that kernels return."""
STATUSES = 4

LOG_TURN = math.log(2.0 * math.pi)


H, R, V = 0, 1, 2
"""Planes of a linearised measurement, (3, d, max(3, c, d)): Jacobian, noise covariance, residual (its first row)."""
X, K, G, M, L, W = range(6)
"""Planes of the working space of a correction, (6, max(n, d), max(n, d)); `correct` leaves the gain in K."""


@inner_njit
def unpack(packed: Array, d: int) -> tuple[int, int, Array, Array, Array, Array]:
    """Take a measurement model of d quantities apart, which `assoc.filters.measurement.pack` has put in one piece.

    numba takes 0.1 microsecond for each array that Python passes, and 0.8 for a record. Returns the code (that of a
    sensor, LINEAR or GIVEN) and kind (PLAIN, MODIFIED or SIMPLIFIED); the sensor's position (3,); the columns (c,) of
    the state that are read: for sensors x, y (and z), with a range rate their velocities after them; the matrix (d, c)
    of a linear model (GIVEN: Jacobian (d, n), or measurements of points (m, d); where range rates fold a row that
    begins with their interval); and the noise covariance (d, d).
    """
    c, end = int(packed[2]), len(packed) - d * d
    matrix = packed[6 + c : end]
    return (
        int(packed[0]), int(packed[1]), packed[3:6], packed[6 : 6 + c].view(np.int64),
        matrix.reshape((len(matrix) // max(c, 1), c)), packed[end:].reshape((d, d)),
    )  # fmt: skip


@inner_njit
def parts_of(rest: Array, B: int, d: int) -> tuple[Array, Array, Array, Array]:
    """Views of innovations (B, d), their covariances (B, d, d), NIS (B,) and log-likelihoods (B,), in one piece."""
    v, S = B * d, B * d + B * d * d
    return rest[:v].reshape((B, d)), rest[v:S].reshape((B, d, d)), rest[S : S + B], rest[S + B :]


@lean_inner_njit
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


@lean_inner_njit
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
    """Predict a batch, (B, n), (B, n, n), into new_mean and new_P.

    Results are written into arrays of the caller's: returning them costs 1 microsecond each. F and Q, (B or 1, n, n),
    are transition (or Jacobian) and process noise; `moved` (B, n) are the means of a nonlinear model; empty: F times
    the mean.
    """
    n = mean.shape[1]
    none, W = np.empty(0), np.empty((n, n))
    for b in range(len(mean)):
        predict_one(
            mean[b], P[b], F[b if len(F) > 1 else 0], Q[b if len(Q) > 1 else 0], moved[b] if len(moved) > 0 else none,
            new_mean[b], new_P[b], W,
        )  # fmt: skip


@literal_njit
def innovate(d: int, c: int, P: Array, columns: Array, linear: Array, work: Array, S: Array) -> tuple[bool, float]:
    """Covariance of a residual, S; the inverse of its factor goes to L; whether it is positive definite, and ln det S.

    Of the working space it also writes X, P H'.
    """
    n = len(P)
    for i in range(n):
        for a in range(d):
            total = 0.0
            for p in range(c):
                total += P[i, columns[p]] * linear[H, a, p]
            work[X, i, a] = total
    for a in range(d):
        for e in range(a + 1):
            total = linear[R, a, e]
            for p in range(c):
                total += linear[H, a, p] * work[X, columns[p], e]
            S[a, e] = total
            S[e, a] = total
    if not factor(S, d, work[L]):
        return False, 0.0
    log_det = 0.0
    for a in range(d):
        log_det += 2.0 * math.log(work[L, a, a])
        work[L, a, a] = 1.0 / work[L, a, a]
    for a in range(d):
        for e in range(a + 1, d):
            total = 0.0
            for k in range(a, e):
                total -= work[L, e, k] * work[L, k, a]
            work[L, e, a] = total * work[L, e, e]
    return True, log_det


@literal_njit
def squared(d: int, linear: Array, work: Array) -> float:
    """NIS of the residual, after `innovate`."""
    nis = 0.0
    for a in range(d):
        total = 0.0
        for e in range(a + 1):
            total += work[L, a, e] * linear[V, 0, e]
        nis += total * total
    return nis


@literal_njit
def correct(
    d: int, c: int, P: Array, columns: Array, linear: Array, work: Array, S: Array, new_P: Array
) -> tuple[bool, float, float]:
    """Joseph's correction of one covariance; returns whether S is positive definite, NIS and ln det S.

    d and c are the numbers of measured quantities and of columns: the compiler unrolls the loops of a caller
    that gives them literally. S receives the residual's covariance.
    """
    n = len(P)
    good, log_det = innovate(d, c, P, columns, linear, work, S)
    if not good:
        return False, 0.0, 0.0
    # the inverse of S; Joseph's form forgives rounding errors of the gain
    nis = squared(d, linear, work)
    for a in range(d):
        for e in range(a + 1):
            total = 0.0
            for k in range(a, d):
                total += work[L, k, a] * work[L, k, e]
            work[W, a, e] = total
            work[W, e, a] = total
    for i in range(n):
        for a in range(d):
            total = 0.0
            for e in range(d):
                total += work[X, i, e] * work[W, e, a]
            work[K, i, a] = total
    # M = (I - K H) P, then M (I - K H)' + K R K'
    # (of M only the lower half and the columns that H reads are needed)
    last = 0
    for p in range(c):
        last = max(last, columns[p] + 1)
    for i in range(n):
        for j in range(max(i + 1, last)):
            total = P[i, j]
            for a in range(d):
                total -= work[K, i, a] * work[X, j, a]
            work[M, i, j] = total
    for i in range(n):
        for a in range(d):
            total = 0.0
            for e in range(d):
                total += work[K, i, e] * linear[R, e, a]
            for p in range(c):
                total -= work[M, i, columns[p]] * linear[H, a, p]
            work[G, i, a] = total
    for i in range(n):
        for j in range(i + 1):
            total = work[M, i, j]
            for a in range(d):
                total += work[G, i, a] * work[K, j, a]
            new_P[i, j] = total
            new_P[j, i] = total
    return True, nis, log_det


@lean_inner_njit
def correct_mean(mean: Array, work: Array, v: Array, new_mean: Array) -> None:
    """Add the gain that `correct` has left times the residual."""
    for i in range(len(mean)):
        total = mean[i]
        for a in range(len(v)):
            total += work[K, i, a] * v[a]
        new_mean[i] = total


@lean_inner_njit
def elevation_of(h: Array, H: Array) -> float:
    """Elevation of an expected radar measurement h; its size where only range and azimuth are measured."""
    if len(h) == 3:
        return float(h[2])
    # the azimuth's derivatives H[1] are as long as 1 / ground range
    return math.acos(min(1.0, 1.0 / (h[0] * math.hypot(H[1, 0], H[1, 1]))))


@lean_inner_njit
def modify(kind: int, r: float, e: float, v: Array, R: Array, bt: float, bp: float, out: Array) -> None:
    """Debias a radar residual v (range, azimuth and, of three, elevation) in place, write its covariance into out.

    Park and Lee's filter with the corrected terms; equations 2.29 and 2.32 if simplified. r and e are the
    predicted range and elevation, bt and bp the prior variances of azimuth and elevation.
    """
    d = len(v)
    t, st = v[1], R[1, 1]
    p, sp = (v[2], R[2, 2]) if d == 3 else (0.0, 0.0)
    for a in range(d):
        for b in range(d):
            out[a, b] = R[a, b]
    if kind == SIMPLIFIED:
        v[0] -= 0.5 * r * (t * t + p * p - st - sp)
        out[0, 0] += 0.5 * r * r * (st * st + sp * sp)
        return
    cos, sin = math.cos(e), math.sin(e)
    tan = sin / cos
    c2 = cos * cos
    v[0] -= 0.5 * r * (c2 * (t * t - st) + p * p - sp)
    out[0, 0] += r * r * (0.5 * (st * st * c2 * c2 + sp * sp) + c2 * c2 * st * bt + sp * bp)
    if d == 3:
        v[1] -= tan * t * p
        v[2] += 0.5 * sin * cos * (t * t - st)
        out[1, 1] += tan * tan * (st * sp + st * bp + sp * bt)


@lean_inner_njit
def linearise_at(code: int, position: Array, columns: Array, matrix: Array, m: Array, h: Array, J: Array) -> None:
    """Write the measurement expected of a mean into h (d,) and its derivatives by the columns into J (d, c)."""
    if code == LINEAR:
        for a in range(len(h)):
            total = 0.0
            for p in range(len(columns)):
                total += matrix[a, p] * m[columns[p]]
                J[a, p] = matrix[a, p]
            h[a] = total
    elif len(columns) > 3:
        linearise_moving(position, m, columns, h, J)
    else:
        height = m[columns[2]] if len(columns) > 2 else 0.0
        linearise(code, len(h), position, m[columns[0]], m[columns[1]], height, h, J)


@lean_inner_njit
def folding_of(code: int, matrix: Array) -> float:
    """Interval at which range rates fold, of a model as `unpack` gives it; 0: they do not."""
    return float(matrix[0, 0]) if code == RADAR3D and len(matrix) > 0 else 0.0


@lean_inner_njit
def blur(folding: float, P: Array, columns: Array, noise: Array, H: Array, R: Array) -> None:
    """Make a folded range rate say nothing where it is expected less exactly than to a third of the interval.

    It is then a number of its own with the variance of one that is uniform on the interval. H (4, c) is the Jacobian
    for a covariance P; R (4, 4), the noise, is written in either case.
    """
    variance = noise[3, 3]
    for p in range(len(columns)):
        for q in range(len(columns)):
            variance += H[3, p] * P[columns[p], columns[q]] * H[3, q]
    known = 9.0 * variance <= folding * folding
    for a in range(4):
        R[3, a] = noise[3, a] if known else 0.0
        R[a, 3] = R[3, a]
    if not known:
        R[3, 3] = folding * folding / 12.0
        for p in range(len(columns)):
            H[3, p] = 0.0


@njit
def update(mean: Array, P: Array, z: Array, models: Array, new_mean: Array, new_P: Array, rest: Array) -> int:
    """Correct a batch with one measurement for each, into the last three arrays.

    z (B, d) are measurements, residuals where the model is GIVEN; models (B or 1, ...) are packed, see `unpack`; rest
    gets innovations, their covariances, NIS and log-likelihoods, see `parts_of`. Returns GOOD, or the status plus
    STATUSES times the number of the target.
    """
    B, d = z.shape
    wide = max(mean.shape[1], d)
    v, S, nis, ll = parts_of(rest, B, d)
    # few allocations: for a single target they count
    work, h = np.empty((6, wide, wide)), np.empty(d)
    for b in range(B):
        if b == 0 or len(models) > 1:
            code, kind, position, columns, matrix, noise = unpack(models[b], d)
            c, folding = len(columns), folding_of(code, matrix)
            linear = np.empty((3, d, max(3, c, d)))
            # number by number: assigning slices takes longer
            for a in range(d):
                for e in range(d):
                    linear[R, a, e] = noise[a, e]
        for a in range(d):
            if not math.isfinite(z[b, a]):
                return BAD_MEASUREMENT + STATUSES * b
        if code == GIVEN:
            # slices again number by number: assigning one would compile an error message about its shape
            for a in range(d):
                v[b, a] = z[b, a]
                for p in range(c):
                    linear[H, a, p] = matrix[a, p]
        else:
            linearise_at(code, position, columns, matrix, mean[b], h, linear[H])
            for a in range(d):
                v[b, a] = z[b, a] - h[a]
            wrap(code, v[b])
            if folding > 0.0:
                fold(folding, v[b])
                blur(folding, P[b], columns, noise, linear[H], linear[R])
            if kind != PLAIN:
                bt, bp = 0.0, 0.0
                for p in range(c):
                    for q in range(c):
                        cov = P[b, columns[p], columns[q]]
                        bt += linear[H, 1, p] * linear[H, 1, q] * cov
                        if d == 3:
                            bp += linear[H, 2, p] * linear[H, 2, q] * cov
                modify(kind, h[0], elevation_of(h, linear[H]), v[b], noise, bt, bp, linear[R])
        for a in range(d):
            if not math.isfinite(v[b, a]):
                return BAD_MEAN + STATUSES * b
            linear[V, 0, a] = v[b, a]
        if d == 3 and c == 3:
            good, nis[b], log_det = correct(3, 3, P[b], columns, linear, work, S[b], new_P[b])
        else:
            good, nis[b], log_det = correct(d, c, P[b], columns, linear, work, S[b], new_P[b])
        if not good:
            return BAD_COVARIANCE + STATUSES * b
        correct_mean(mean[b], work, v[b], new_mean[b])
        ll[b] = -0.5 * (nis[b] + log_det + d * LOG_TURN)
    return GOOD


@njit
def step(
    mean: Array, P: Array, motion: Array, z: Array, models: Array, new_mean: Array, new_P: Array, rest: Array
) -> int:
    """Predict one target with a linear model and correct it, into the last three arrays, as `update` does.

    motion (2, 1, n, n) is F and Q.
    """
    n = mean.shape[1]
    predicted, pair = np.empty((1, n)), np.empty((2, n, n))
    predict_one(mean[0], P[0], motion[0, 0], motion[1, 0], rest[:0], predicted[0], pair[0], pair[1])
    return update(predicted, pair[:1], z, models, new_mean, new_P, rest)


@njit
def follow(
    mean: Array, P: Array, motion: Array, z: Array, models: Array, means: Array, Ps: Array, scores: Array
) -> int:
    """Predict and correct a batch through K steps of a linear motion, into the last three arrays.

    motion (2, K or 1, n, n) is F and Q, z (K, B, d), means and Ps (K, B, ...), scores (2, K, B) NIS and
    log-likelihood. Returns as `update` does, with the target counted through the steps.
    """
    K, B, d = z.shape
    predicted, predicted_P = np.empty(mean.shape), np.empty(P.shape)
    rest, nothing = np.empty(B * (d + d * d + 2)), np.empty((0, 0))
    _, _, nis, ll = parts_of(rest, B, d)
    for k in range(K):
        j = k if motion.shape[1] > 1 else 0
        F, Q = motion[0, j : j + 1], motion[1, j : j + 1]
        if k == 0:
            predict(mean, P, F, Q, nothing, predicted, predicted_P)
        else:
            predict(means[k - 1], Ps[k - 1], F, Q, nothing, predicted, predicted_P)
        status = update(predicted, predicted_P, z[k], models, means[k], Ps[k], rest)
        if status != GOOD:
            return status + STATUSES * B * k
        for b in range(B):
            scores[0, k, b], scores[1, k, b] = nis[b], ll[b]
    return GOOD
