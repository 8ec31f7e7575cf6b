"""Maximum-likelihood positions of tuples (equation 4 of the ant colony paper), compiled.

Levenberg-Marquardt on the residuals of the members, started from their converted measurements or from
the crossing of their bearings. With linear sensors the first step is the closed form. Of two mirror images,
above and below range-azimuth radars, the one on the side of the region's middle is found.

The region's prior enters only where the measurements leave a position open, so that one always exists. A
tuple with a sensor that measures full positions never sees it. For other tuples it acts along those
directions only in which the measurements are less exact than the prior (standard deviation: half the
region's width). The chi-square value is that of the measurements at the position found; the prior's own
term is not part of it. So the cost of a determined tuple is exactly equation 5 at the maximum-likelihood
position, and an undetermined one pays only where its measurements pull away from the region.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from assoc._system.compiled import inner_njit, njit
from assoc._types import Array
from assoc.costs.arrays import HEIGHTS, ScanArrays, SensorArrays
from assoc.costs.residuals import (
    CENTRE,
    CODE,
    DIM,
    FULL,
    INFORMATION,
    MEASURED,
    RISE,
    SITE,
    WEIGHT,
    WIDTH,
    normal,
)
from assoc.costs.starts import bearing_starts, height_start, mean_start, singular_start
from assoc.costs.symmetric import inverse, solve
from assoc.sensors.codes import BEARING, RADAR2D
from assoc.sensors.kernels.records import Six, Three

# a position is undetermined along a direction if its information is less than this times the prior's
_WEAK = 1.0
_MAX_STEPS = 100
# residuals above this make a second start worthwhile (bearings that seem to meet behind a sensor)
_POOR_FIT = 10.0
# chi-square above which a tuple is fitted from elsewhere, too
_DOUBTFUL = 3.0
# how far beyond the region's heights such a fit may end, in half heights: mirror images lie farther
_HEIGHT_SLACK = 1.1

Fit = Callable[[Array, bool], tuple[Array, Array, Array]]
"""`fit` with sensors and scan given, or what sensors of one's own are fitted by: of rows (K, S), whether gating."""


@inner_njit
def _descend(members: Array, middle: Three, at: Three, prior: Six) -> tuple[float, float, float, float, Six]:
    """Levenberg-Marquardt from `at`: chi-square, position and information, all without the prior's share."""
    x, y, z = at
    m0, m1, m2 = middle
    damping = 0.0
    chi, g0, g1, g2, a0, a1, a2, a3, a4, a5 = normal(members, x, y, z)
    q0, q1, q2 = m0 - x, m1 - y, m2 - z
    w0 = prior[0] * q0 + prior[1] * q1 + prior[2] * q2
    w1 = prior[1] * q0 + prior[3] * q1 + prior[4] * q2
    w2 = prior[2] * q0 + prior[4] * q1 + prior[5] * q2
    goal = chi + q0 * w0 + q1 * w1 + q2 * w2
    for _ in range(_MAX_STEPS):
        f = 1.0 + damping
        A = (
            (a0 + prior[0]) * f, a1 + prior[1], a2 + prior[2],
            (a3 + prior[3]) * f, a4 + prior[4], (a5 + prior[5]) * f,
        )  # fmt: skip
        ok, s0, s1, s2 = solve(A, g0 + w0, g1 + w1, g2 + w2)
        if not ok:
            if damping > 1e8:
                break
            damping = max(10.0 * damping, 1e-8)
            continue
        promise = s0 * (g0 + w0) + s1 * (g1 + w1) + s2 * (g2 + w2)
        if promise <= 1e-13 * goal + 1e-20:
            break
        trial = normal(members, x + s0, y + s1, z + s2)
        q0, q1, q2 = m0 - x - s0, m1 - y - s1, m2 - z - s2
        v0 = prior[0] * q0 + prior[1] * q1 + prior[2] * q2
        v1 = prior[1] * q0 + prior[3] * q1 + prior[4] * q2
        v2 = prior[2] * q0 + prior[4] * q1 + prior[5] * q2
        reached = trial[0] + q0 * v0 + q1 * v1 + q2 * v2
        if reached <= goal:
            # a step that keeps what it promised leaves an error far below the promise
            done = promise < 1e-9 and goal - reached > 0.5 * promise
            x, y, z, goal = x + s0, y + s1, z + s2, reached
            chi, g0, g1, g2, a0, a1, a2, a3, a4, a5 = trial
            w0, w1, w2 = v0, v1, v2
            damping = 0.1 * damping if damping > 1e-6 else 0.0
            if done:
                break
        else:
            if promise < 1e-11 * (1.0 + goal) or damping > 1e12:
                break
            damping = max(10.0 * damping, 1e-3)
    return chi, x, y, z, (a0, a1, a2, a3, a4, a5)


@inner_njit
def _determined(half: Three, A: Six, flat: bool) -> bool:
    """Whether the information is above the prior's in every direction (judged by the inverse's trace)."""
    height = A[5] * half[2] * half[2] if not flat else 100.0 * _WEAK
    scaled = (
        A[0] * half[0] * half[0],
        A[1] * half[0] * half[1],
        A[2] * half[0] * half[2],
        A[3] * half[1] * half[1],
        A[4] * half[1] * half[2],
        height,
    )
    ok, c0, _, _, c3, _, c5 = inverse(scaled)
    return ok and c0 + c3 + c5 <= 1.0 / _WEAK


@inner_njit
def _weak_prior(half: Three, A: Six) -> Six:
    """The region's prior along those directions only which the information `A` leaves open."""
    M, V = np.zeros((3, 3)), np.zeros((3, 3))
    M[0, 0], M[1, 1], M[2, 2] = A[0] * half[0] * half[0], A[3] * half[1] * half[1], A[5] * half[2] * half[2]
    M[0, 1] = M[1, 0] = A[1] * half[0] * half[1]
    M[0, 2] = M[2, 0] = A[2] * half[0] * half[2]
    M[1, 2] = M[2, 1] = A[4] * half[1] * half[2]
    V[0, 0] = V[1, 1] = V[2, 2] = 1.0
    # Jacobi's rotations: eigenvalues end on the diagonal of M, eigenvectors in the columns of V
    for _ in range(12):
        for p in range(2):
            for q in range(p + 1, 3):
                if M[p, q] * M[p, q] <= 1e-30 * abs(M[p, p] * M[q, q]):
                    continue
                theta = 0.5 * (M[q, q] - M[p, p]) / M[p, q]
                t = math.copysign(1.0, theta) / (abs(theta) + math.sqrt(theta * theta + 1.0))
                c = 1.0 / math.sqrt(t * t + 1.0)
                for k in range(3):
                    a, b = M[k, p], M[k, q]
                    M[k, p], M[k, q] = c * (a - t * b), c * (t * a + b)
                for k in range(3):
                    a, b = M[p, k], M[q, k]
                    M[p, k], M[q, k] = c * (a - t * b), c * (t * a + b)
                    a, b = V[k, p], V[k, q]
                    V[k, p], V[k, q] = c * (a - t * b), c * (t * a + b)
    P = np.zeros((3, 3))
    for k in range(3):
        if M[k, k] < _WEAK:
            for i in range(3):
                for j in range(3):
                    P[i, j] += V[i, k] * V[j, k] / (half[i] * half[j])
    return P[0, 0], P[0, 1], P[0, 2], P[1, 1], P[1, 2], P[2, 2]


@inner_njit
def _settle(
    members: Array, middle: Three, half: Three, at: Three, flat: bool
) -> tuple[float, float, float, float, Six, Six]:
    """Descend without prior if the members determine the position, else with it where they do not."""
    none = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0 / (half[2] * half[2]) if flat else 0.0)
    every = (1.0 / (half[0] * half[0]), 0.0, 0.0, 1.0 / (half[1] * half[1]), 0.0, 1.0 / (half[2] * half[2]))
    _, _, _, _, a0, a1, a2, a3, a4, a5 = normal(members, at[0], at[1], at[2])
    pure = _determined(half, (a0, a1, a2, a3, a4, a5), flat)
    if pure:
        chi, x, y, z, A = _descend(members, middle, at, none)
        if _determined(half, A, flat):
            return chi, x, y, z, A, none
    chi, x, y, z, A = _descend(members, middle, at, every)
    prior = none if _determined(half, A, flat) else _weak_prior(half, A)
    chi, x, y, z, A = _descend(members, middle, (x, y, z), prior)
    if not _determined(half, A, flat):
        # the final step may have moved where directions open up: keep the covariance finite
        prior = _weak_prior(half, A)
    return chi, x, y, z, A, prior


@inner_njit
def _from(
    members: Array, middle: Three, half: Three, at: Three, full: bool, flat: bool
) -> tuple[float, float, float, float, Six, Six]:
    """Position that a start leads to."""
    if full:
        none = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        chi, x, y, z, A = _descend(members, middle, at, none)
        return chi, x, y, z, A, none
    return _settle(members, middle, half, at, flat)


@inner_njit
def _locate(members: Array, middle: Three, half: Three) -> tuple[float, float, float, float, Six, Six]:
    """Maximum-likelihood position: chi-square there, x, y, z, information, and the prior that was needed.

    Ranges near a radar that measures no elevation bend so much that the fit may end in a local minimum, hundreds of
    chi-square above the best. A fit that is not good starts again where such a radar sees its measurement at its own
    height or at the bottom of the region, whichever explains all measurements better; and beside a zenith or a bearing
    sensor, where azimuths jump.
    """
    # counted, not flagged: a variable that starts as a literal makes numba compile its callees twice
    full_ones = tall_ones = located_ones = slant_ones = 0
    for m in range(len(members)):
        code, tall = members[m, CODE], members[m, FULL] > 0.0
        full_ones += 1 if tall else 0
        tall_ones += 1 if tall or code == RADAR2D else 0
        located_ones += 1 if code != BEARING else 0
        slant_ones += 1 if code == RADAR2D and not tall else 0
    full, flat = full_ones > 0, tall_ones == 0
    at = ahead = (0.0, 0.0, 0.0)
    if located_ones == 0:
        at, ahead = bearing_starts(members, middle, half)
    else:
        at = mean_start(members, full)
    best = _from(members, middle, half, at, full, flat)
    if located_ones == 0 and not best[0] <= _POOR_FIT:
        other = _from(members, middle, half, ahead, full, flat)
        if other[0] < best[0] or not math.isfinite(best[0]):
            best = other
    if len(members) == 1 or located_ones == 0 or best[0] <= _DOUBTFUL:
        return best
    if slant_ones > 0:
        chi, x, y, z = height_start(members, middle, half, slant_ones == len(members))
        if chi < math.inf:
            other = _from(members, middle, half, (x, y, z), full, flat)
            if other[0] < best[0] and abs(other[3] - middle[2]) <= _HEIGHT_SLACK * half[2]:
                best = other
    # a descent from there is worth its time only where the start is already better
    chi, x, y, z = singular_start(members, at)
    if chi < best[0]:
        other = _from(members, middle, half, (x, y, z), full, flat)
        if other[0] < best[0] and (full or abs(other[3] - middle[2]) <= _HEIGHT_SLACK * half[2]):
            best = other
    return best


@njit
def fit(sensors: SensorArrays, scan: ScanArrays, rows: Array, gating: bool) -> tuple[Array, Array, Array]:
    """Fit a position to each tuple: chi-square (K,), positions (K, 3), covariances (K, 3, 3).

    `rows`, int32 (K, S), are the measurement (row of `scan`) of each sensor, or -1. If `gating`, positions and
    covariances come back empty, and chi-square is infinite where the height lies beyond those sought
    (`assoc.costs.arrays.HEIGHTS`) and no sensor measures full positions.
    """
    total = len(rows)
    kept = 0 if gating else total
    chis, positions, covariances = np.zeros(total), np.zeros((kept, 3)), np.zeros((kept, 3, 3))
    middle = (sensors.middle[0], sensors.middle[1], sensors.middle[2])
    half = (sensors.half[0], sensors.half[1], sensors.half[2])
    code, dim, full, position = sensors.code, sensors.dim, sensors.full, sensors.position
    weight, covariance = sensors.weight, sensors.covariance
    measured, centre, information = scan.z, scan.centre, scan.information
    members = np.empty((len(dim), WIDTH))
    for t in range(total):
        count = 0
        full_ones = 0
        for s in range(rows.shape[1]):
            n = rows[t, s]
            if n < 0:
                continue
            members[count, CODE], members[count, DIM], members[count, FULL] = code[s], dim[s], full[s]
            entry = WEIGHT
            for i in range(3):
                members[count, SITE + i] = position[s, i]
                members[count, MEASURED + i] = measured[n, i]
                members[count, CENTRE + i] = centre[n, i]
                for j in range(i, 3):
                    members[count, entry] = weight[s, i, j]
                    entry += 1
            members[count, RISE] = covariance[s, 2, 2]
            for i in range(6):
                members[count, INFORMATION + i] = information[n, i]
            full_ones += 1 if full[s] else 0
            count += 1
        chi, x, y, z, A, prior = _locate(members[:count], middle, half)
        chis[t] = chi
        if gating:
            if full_ones == 0 and abs(z - middle[2]) > HEIGHTS * half[2]:
                chis[t] = math.inf
            continue
        positions[t, 0], positions[t, 1], positions[t, 2] = x, y, z
        B = (
            A[0] + prior[0], A[1] + prior[1], A[2] + prior[2],
            A[3] + prior[3], A[4] + prior[4], A[5] + prior[5],
        )  # fmt: skip
        ok, c0, c1, c2, c3, c4, c5 = inverse(B)
        if not ok:
            # numerically singular: the region's width is the best estimate
            c0, c3, c5 = half[0] ** 2, half[1] ** 2, half[2] ** 2
            c1 = c2 = c4 = 0.0
        elif not solve((c0, c1, c2, c3, c4, c5), 0.0, 0.0, 0.0)[0]:
            # longer than thin by more digits than there are: rounding must not leave it indefinite
            least = 4e-15 * (c0 + c3 + c5)
            c0, c3, c5 = c0 + least, c3 + least, c5 + least
        C = covariances[t]
        C[0, 0], C[1, 1], C[2, 2] = c0, c3, c5
        C[0, 1] = C[1, 0] = c1
        C[0, 2] = C[2, 0] = c2
        C[1, 2] = C[2, 1] = c4
    return chis, positions, covariances
