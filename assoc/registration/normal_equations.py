"""Normal equations of biases, from which the targets' positions are eliminated, compiled.

A measurement is z = h(p) + B b + noise, with p the target's position and b the biases; B is 1 for a component's own
bias, the range for that of its gain, H for that of the sensor's position, and -H v for that of its clock, with
H = dh/dp and v the target's velocity.
Each tuple has an unknown position. Eliminating it from the least squares (Schur complement) leaves the weight
W = R^-1 - R^-1 H (H' R^-1 H)^-1 H' R^-1 on the residuals of the tuple; the information of all targets on the biases is
the sum of B' W B and B' W nu. Biases that another position explains as well get no information.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from assoc._system.compiled import inner_njit, njit
from assoc._types import Array
from assoc.costs.arrays import SensorArrays
from assoc.costs.symmetric import inverse
from assoc.registration.terms import GAIN, MEASURED, SITE, TermArrays
from assoc.sensors.codes import BEARING, POSITION
from assoc.sensors.kernels.dispatch import linearise, wrap


class Tuples(NamedTuple):
    """T tuples of measurements, each taken for one target."""

    z: Array
    """Measurements, corrected by the biases known so far, (T, S, 3)."""
    seen: Array
    """Which sensors measured it, bool (T, S)."""
    at: Array
    """Position of the target, near enough to linearise, (T, 3), metres."""
    velocity: Array
    """Its velocity, (T, 3), m/s; NaN where unknown: the tuple then has no information on clocks."""
    places: Array
    """Where the sensors stood, (T, S, 3), metres."""
    flat: bool
    """Whether all targets are at one height, which is then no unknown: it would explain each range that is too long."""


class NormalEquations(NamedTuple):
    """Normal equations of n biases from T tuples."""

    information: Array
    """Sum of w B' W B, (n, n)."""
    gradient: Array
    """Sum of w B' W nu, (n,)."""
    scatter: Array
    """Sum of the outer products of the tuples' gradients, (n, n), for a covariance that holds for any noise."""
    slope: Array
    """What the gradient falls by for each unit of a bias, (n, n): the information, less what a lighter weight takes
    where a tuple comes to fit worse."""
    chi: Array
    """Chi-square value of each tuple at the position that fits it best, (T,)."""
    freedom: Array
    """Its degrees of freedom, int64 (T,)."""
    left: Array
    """Residuals there, (T, S, 3), NaN where nothing was measured."""


@inner_njit
def _bias_column(kind: int, index: int, H: Array, v: Array, z: Array, d: int, column: Array) -> None:
    """Write the derivative of a measurement by a bias into `column` (3,)."""
    column[:] = 0.0
    if kind == GAIN:
        column[0] = z[0]
        return
    for i in range(d):
        if kind == MEASURED:
            column[i] = 1.0 if i == index else 0.0
        elif kind == SITE:
            column[i] = H[i, index]
        elif not math.isnan(v[0]):
            column[i] = -(H[i, 0] * v[0] + H[i, 1] * v[1] + H[i, 2] * v[2])


@inner_njit
def _linearise_tuple(
    sensors: SensorArrays, tuples: Tuples, t: int, H: Array, nu: Array, a: Array, u: Array
) -> tuple[float, int]:
    """Linearise the measurements of tuple t: H (S, 3, 3), residuals nu (S, 3), a = H' W H, u = H' W nu.

    Returns nu' W nu and the degrees of freedom.
    """
    z, seen, at = tuples.z[t], tuples.seen[t], tuples.at[t]
    a[:], u[:] = 0.0, 0.0
    h = np.empty(3)
    squares, measured, tall = 0.0, 0, 0
    for s in range(len(seen)):
        if not seen[s]:
            continue
        code, d, W = sensors.code[s], sensors.dim[s], sensors.weight[s]
        linearise(code, d, tuples.places[t, s], at[0], at[1], at[2], h, H[s])
        if tuples.flat:
            H[s, :, 2] = 0.0
        for i in range(d):
            nu[s, i] = z[s, i] - h[i]
        wrap(code, nu[s])
        measured += d
        tall += 0 if tuples.flat or (code == BEARING and d == 1) or (code == POSITION and d == 2) else 1
        for i in range(d):
            for j in range(d):
                squares += nu[s, i] * W[i, j] * nu[s, j]
                for k in range(3):
                    u[k] += H[s, i, k] * W[i, j] * nu[s, j]
                    for m in range(3):
                        a[k, m] += H[s, i, k] * W[i, j] * H[s, j, m]
    return squares, max(measured - 3 if tall else measured - 2, 0)


@inner_njit
def _weigh_bias(W: Array, H: Array, d: int, column: Array, left: Array, WB: Array, Y: Array) -> float:
    """Write W B and B' W H of one bias with derivatives `column`; return its gradient B' W left."""
    pull = 0.0
    for i in range(3):
        WB[i], Y[i] = 0.0, 0.0
    for i in range(d):
        for k in range(d):
            WB[i] += W[i, k] * column[k]
    for i in range(d):
        pull += WB[i] * left[i]
        for k in range(3):
            Y[k] += WB[i] * H[i, k]
    return pull


@njit
def normal_equations(
    sensors: SensorArrays, tuples: Tuples, terms: TermArrays, limits: Array
) -> tuple[Array, Array, Array, Array, Array, Array, Array]:
    """Sum up the information of tuples on the n biases in ``terms``: the fields of `NormalEquations`.

    ``limits`` (3 S + 1,) are, by degrees of freedom, chi-square values up to which a tuple counts fully; above, its
    weight is limit / chi-square, so that outliers count no more than a tuple at the limit.
    """
    total, count, n = len(tuples.z), len(sensors.dim), len(terms.sensor)
    information, scatter, slope, gradient = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    chi, freedom = np.zeros(total), np.zeros(total, np.int64)
    left = np.full((total, count, 3), np.nan)
    columns, H, nu = np.zeros((n, 3)), np.zeros((count, 3, 3)), np.zeros((count, 3))
    WB, Y, pull = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n)
    a, u = np.zeros((3, 3)), np.zeros(3)
    for t in range(total):
        seen = tuples.seen[t]
        squares, freedom[t] = _linearise_tuple(sensors, tuples, t, H, nu, a, u)
        # directions that no measurement determines must not make the matrix singular, nor add information
        least = 1e-12 * (a[0, 0] + a[1, 1] + a[2, 2])
        A = (a[0, 0] + least, a[0, 1], a[0, 2], a[1, 1] + least, a[1, 2], a[2, 2] + least)
        ok, c0, c1, c2, c3, c4, c5 = inverse(A)
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
        # the derivative of limit / chi by a bias
        lighter = 0.0 if chi[t] <= limit else 2.0 * share / chi[t]
        for s in range(count):
            if seen[s]:
                for i in range(sensors.dim[s]):
                    moved = H[s, i, 0] * step[0] + H[s, i, 1] * step[1] + H[s, i, 2] * step[2]
                    left[t, s, i] = nu[s, i] - moved
        for j in range(n):
            s = terms.sensor[j]
            if seen[s]:
                d = sensors.dim[s]
                _bias_column(terms.kind[j], terms.entry[j], H[s], tuples.velocity[t], tuples.z[t, s], d, columns[j])
                pull[j] = _weigh_bias(sensors.weight[s], H[s], d, columns[j], left[t, s], WB[j], Y[j])
        for j in range(n):
            s = terms.sensor[j]
            if not seen[s]:
                continue
            gradient[j] += share * pull[j]
            p0 = c0 * Y[j, 0] + c1 * Y[j, 1] + c2 * Y[j, 2]
            p1 = c1 * Y[j, 0] + c3 * Y[j, 1] + c4 * Y[j, 2]
            p2 = c2 * Y[j, 0] + c4 * Y[j, 1] + c5 * Y[j, 2]
            for k in range(n):
                if not seen[terms.sensor[k]]:
                    continue
                value = -(p0 * Y[k, 0] + p1 * Y[k, 1] + p2 * Y[k, 2])
                if terms.sensor[k] == s:
                    for i in range(sensors.dim[s]):
                        value += WB[j, i] * columns[k, i]
                information[j, k] += share * value
                slope[j, k] += share * value - lighter * pull[j] * pull[k]
                scatter[j, k] += share * share * pull[j] * pull[k]
    return information, gradient, scatter, slope, chi, freedom, left
