"""What tuples say of biases: normal equations from which the targets' positions are eliminated, compiled.

A measurement is z = h(p) + B b + noise, with p the target's position and b the biases; B is one for a component's own
bias, H for that of the sensor's place, and -H v for that of its clock, with H = dh/dp and v the target's velocity. Each
tuple has a position of its own, of which nothing else is known. Eliminated from the least squares (Schur complement) it
leaves the weight W = R^-1 - R^-1 H (H' R^-1 H)^-1 H' R^-1 on the residuals of the tuple: what all targets say
together of the biases is the sum of B' W B and B' W nu. A bias that another position explains as well gets nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from assoc._system.compiled import njit
from assoc._types import Array
from assoc.costs.symmetric import inverse
from assoc.registration.terms import MEASURED, PLACE, TermArrays
from assoc.sensors.codes import BEARING, POSITION
from assoc.sensors.kernels.dispatch import linearise, wrap


class Places(NamedTuple):
    """The S sensors as kernels take them."""

    code: Array
    """Kind of each, int64 (S,); see `assoc.sensors.codes`."""
    dim: Array
    """Components of a measurement, int64 (S,)."""
    place: Array
    """(S, 3), metres."""
    weight: Array
    """Inverse measurement covariances padded with zeros, (S, 3, 3)."""


class Tuples(NamedTuple):
    """T tuples of measurements that are taken for one target each."""

    z: Array
    """Measurements, corrected by the biases known so far, (T, S, 3)."""
    seen: Array
    """Which sensors measured it, bool (T, S)."""
    at: Array
    """Where the target is, near enough to linearise, (T, 3), metres."""
    velocity: Array
    """Its velocity, (T, 3), m/s; NaN where it is not known: the tuple then says nothing of clocks."""


class NormalEquations(NamedTuple):
    """What T tuples say of n biases."""

    information: Array
    """Sum of w B' W B, (n, n)."""
    gradient: Array
    """Sum of w B' W nu, (n,)."""
    scatter: Array
    """Sum of the outer products of the tuples' gradients, (n, n): for a covariance that holds whatever the noise."""
    chi: Array
    """Chi-square value of each tuple at the position that fits it best, (T,)."""
    freedom: Array
    """Its degrees of freedom, int64 (T,)."""
    left: Array
    """Residuals there, (T, S, 3), NaN where nothing was measured."""


@njit
def _bias_column(kind: int, index: int, H: Array, v: Array, d: int, column: Array) -> None:
    """Write the derivative of a measurement by a bias into `column` (3,)."""
    column[:] = 0.0
    for i in range(d):
        if kind == MEASURED:
            column[i] = 1.0 if i == index else 0.0
        elif kind == PLACE:
            column[i] = H[i, index]
        elif not math.isnan(v[0]):
            column[i] = -(H[i, 0] * v[0] + H[i, 1] * v[1] + H[i, 2] * v[2])


@njit
def normal_equations(places: Places, tuples: Tuples, terms: TermArrays, limits: Array) -> NormalEquations:
    """Sum up what tuples say of biases.

    Parameters
    ----------
    places : Places
    tuples : Tuples
    terms : TermArrays
        The n biases.
    limits : array (3 S + 1,)
        By degrees of freedom: chi-square values up to which a tuple counts fully; beyond, it counts limit / chi-square
        of it, so that what is too wrong to be noise has no more say than what is at the limit.

    Returns
    -------
    NormalEquations
    """
    total, count, n = len(tuples.z), len(places.dim), len(terms.sensor)
    information, scatter, gradient = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    chi, freedom = np.zeros(total), np.zeros(total, np.int64)
    left = np.full((total, count, 3), np.nan)
    h, columns = np.zeros(3), np.zeros((n, 3))
    H, nu = np.zeros((count, 3, 3)), np.zeros((count, 3))
    WB, Y, own = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n)
    a, u = np.zeros((3, 3)), np.zeros(3)
    for t in range(total):
        a[:], u[:] = 0.0, 0.0
        squares, measured, tall = 0.0, 0, 0
        x, y, z = tuples.at[t, 0], tuples.at[t, 1], tuples.at[t, 2]
        for s in range(count):
            if not tuples.seen[t, s]:
                continue
            code, d = places.code[s], places.dim[s]
            linearise(code, d, places.place[s], x, y, z, h, H[s])
            for i in range(d):
                nu[s, i] = tuples.z[t, s, i] - h[i]
            wrap(code, nu[s])
            measured += d
            tall += 0 if code == BEARING or (code == POSITION and d == 2) else 1
            W = places.weight[s]
            for i in range(d):
                for j in range(d):
                    squares += nu[s, i] * W[i, j] * nu[s, j]
                    for k in range(3):
                        u[k] += H[s, i, k] * W[i, j] * nu[s, j]
                        for m in range(3):
                            a[k, m] += H[s, i, k] * W[i, j] * H[s, j, m]
        # what no measurement tells of the position must not make the matrix singular, nor tell of biases
        least = 1e-12 * (a[0, 0] + a[1, 1] + a[2, 2])
        A = (a[0, 0] + least, a[0, 1], a[0, 2], a[1, 1] + least, a[1, 2], a[2, 2] + least)
        ok, c0, c1, c2, c3, c4, c5 = inverse(A)
        freedom[t] = max(measured - 3 if tall else measured - 2, 0)
        if not ok or freedom[t] == 0:
            continue
        step = (
            c0 * u[0] + c1 * u[1] + c2 * u[2],
            c1 * u[0] + c3 * u[1] + c4 * u[2],
            c2 * u[0] + c4 * u[1] + c5 * u[2],
        )
        chi[t] = max(squares - u[0] * step[0] - u[1] * step[1] - u[2] * step[2], 0.0)
        limit = limits[freedom[t]]
        share = 1.0 if chi[t] <= limit else limit / chi[t]
        for s in range(count):
            if tuples.seen[t, s]:
                for i in range(places.dim[s]):
                    moved = H[s, i, 0] * step[0] + H[s, i, 1] * step[1] + H[s, i, 2] * step[2]
                    left[t, s, i] = nu[s, i] - moved
        for j in range(n):
            s = terms.sensor[j]
            own[j] = 0.0
            if not tuples.seen[t, s]:
                continue
            d = places.dim[s]
            _bias_column(terms.kind[j], terms.entry[j], H[s], tuples.velocity[t], d, columns[j])
            for i in range(3):
                WB[j, i], Y[j, i] = 0.0, 0.0
            for i in range(d):
                for k in range(d):
                    WB[j, i] += places.weight[s, i, k] * columns[j, k]
            for i in range(d):
                own[j] += WB[j, i] * left[t, s, i]
                for k in range(3):
                    Y[j, k] += WB[j, i] * H[s, i, k]
        for j in range(n):
            s = terms.sensor[j]
            if not tuples.seen[t, s]:
                continue
            gradient[j] += share * own[j]
            p0 = c0 * Y[j, 0] + c1 * Y[j, 1] + c2 * Y[j, 2]
            p1 = c1 * Y[j, 0] + c3 * Y[j, 1] + c4 * Y[j, 2]
            p2 = c2 * Y[j, 0] + c4 * Y[j, 1] + c5 * Y[j, 2]
            for k in range(n):
                if not tuples.seen[t, terms.sensor[k]]:
                    continue
                value = -(p0 * Y[k, 0] + p1 * Y[k, 1] + p2 * Y[k, 2])
                if terms.sensor[k] == s:
                    for i in range(places.dim[s]):
                        value += WB[j, i] * columns[k, i]
                information[j, k] += share * value
                scatter[j, k] += share * share * own[j] * own[k]
    return NormalEquations(information, gradient, scatter, chi, freedom, left)
