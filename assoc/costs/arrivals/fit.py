"""Positions and costs of tuples of arrival times, the time of emission at its best or integrated out.

A tuple has one position x and one time of emission e. Receiver s hears it at e + |x - p_s| / v_s + noise. With weights
w_s = 1 / sigma_s^2 and the lag tau_s = t_s - |x - p_s| / v_s the best e is the weighted mean of the lags, and

    chi-square(x) = sum w_s (tau_s - mean tau)^2,

which is what the position is fitted to: derivatives less their weighted mean, by Levenberg and Marquardt. Equation 5
takes the likelihood at the best position and time. With a density of targets both are integrated out: the time under a
uniform prior as long as the receivers listen, W seconds, which costs -ln(sqrt(2 pi / sum w) / W), and the position as
of other sensors (`assoc.costs.prices`).

The region is the prior for what arrival times leave open, as depths below a flat array, and in no part of a cost. If
it has no height, positions are in its plane.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from assoc._system.compiled import inner_njit, njit
from assoc._types import Array
from assoc.costs.arrays import SensorArrays
from assoc.costs.prices import PositionPrior, log_expected
from assoc.costs.symmetric import inverse, solve
from assoc.errors import InvalidInputError
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.sensors import ArrivalTimeSensor
from assoc.sensors.kernels.records import Three

# places of the region at which a fit may start, and how many of them are tried
_GRID = (15, 15, 5)
_STARTS = 3
_STEPS = 50
_NEAREST = 1e-9


class Receivers(NamedTuple):
    """S receivers in the form that the kernels take."""

    site: Array
    """(S, 3), metres."""
    speed: Array
    """Of the wave, (S,), m/s."""
    weight: Array
    """1 / variance, (S,), 1/s^2."""
    middle: Array
    """Middle of the region, (3,), metres."""
    half: Array
    """Half widths of the region, (3,), metres; the last is 0 where positions are in its plane."""


def any_arrivals(scene: Scene) -> bool:
    """Whether a scene's sensors measure arrival times; refused if only some do, or measurements have own times."""
    known = [isinstance(sensor, ArrivalTimeSensor) for sensor in scene.sensors]
    if any(known) and not all(known):
        other = scene.sensors[known.index(False)].label(known.index(False))
        raise InvalidInputError(f"{other}: is in one scene with receivers of arrival times, which must be alone in it")
    if any(known) and (scene.measurement_times is not None or scene.sectors is not None):
        raise InvalidInputError("scene: arrival times are measurements; leave out measurement_times and sectors")
    return any(known)


def receivers_of(scene: Scene, arrays: SensorArrays) -> Receivers:
    """The receivers of a scene, for kernels."""
    flat = bool(scene.region[2, 0] == scene.region[2, 1])
    half = np.array([*arrays.half[:2], 0.0 if flat else arrays.half[2]])
    speed = np.array([sensor.wave_speed for sensor in scene.sensors])  # type: ignore[attr-defined]
    return Receivers(arrays.position, speed, np.ascontiguousarray(arrays.weight[:, 0, 0]), arrays.middle, half)


def needed(receivers: Receivers) -> int:
    """How many arrival times determine a position and the time of emission: four, or three in the plane."""
    return 4 if receivers.half[2] > 0.0 else 3


def times_of(scan: Scan, tuples: Array) -> Array:
    """Arrival times (K, S) of tuples of 1-based measurements, NaN where there is none."""
    return np.stack([np.append(np.nan, z[:, 0])[tuples[:, s]] for s, z in enumerate(scan.measurements)], axis=1)


@inner_njit
def _normal(
    r: Receivers, times: Array, x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float, float, float, float, float, float]:
    """Chi-square, best time of emission, gradient (3) and information (6) at a position."""
    site, speed, weight = r.site, r.speed, r.weight
    # first the time: sums of squares of large times would lose the digits that count
    total = mean = m0 = m1 = m2 = 0.0
    for s in range(len(times)):
        if math.isnan(times[s]):
            continue
        dx, dy, dz = x - site[s, 0], y - site[s, 1], z - site[s, 2]
        away = max(math.sqrt(dx * dx + dy * dy + dz * dz), _NEAREST)
        share = weight[s]
        total += share
        share /= total
        slow = 1.0 / (away * speed[s])
        mean += share * (times[s] - away / speed[s] - mean)
        m0, m1, m2 = m0 + share * (dx * slow - m0), m1 + share * (dy * slow - m1), m2 + share * (dz * slow - m2)
    chi = g0 = g1 = g2 = a0 = a1 = a2 = a3 = a4 = a5 = 0.0
    for s in range(len(times)):
        if math.isnan(times[s]):
            continue
        dx, dy, dz = x - site[s, 0], y - site[s, 1], z - site[s, 2]
        away = max(math.sqrt(dx * dx + dy * dy + dz * dz), _NEAREST)
        w, slow = weight[s], 1.0 / (away * speed[s])
        off = times[s] - away / speed[s] - mean
        h0, h1, h2 = dx * slow - m0, dy * slow - m1, dz * slow - m2
        chi += w * off * off
        g0, g1, g2 = g0 + w * off * h0, g1 + w * off * h1, g2 + w * off * h2
        a0, a1, a2 = a0 + w * h0 * h0, a1 + w * h0 * h1, a2 + w * h0 * h2
        a3, a4, a5 = a3 + w * h1 * h1, a4 + w * h1 * h2, a5 + w * h2 * h2
    return chi, mean, g0, g1, g2, a0, a1, a2, a3, a4, a5


@inner_njit
def descend(r: Receivers, times: Array, at: Three) -> tuple[float, float, float, float, float, float, Array]:
    """The fit from a start: chi-square, the same with the prior, time of emission, position, covariance (3, 3)."""
    x, y, z = at
    m0, m1, m2 = r.middle[0], r.middle[1], r.middle[2]
    flat = not r.half[2] > 0.0
    p0, p1 = 1.0 / r.half[0] ** 2, 1.0 / r.half[1] ** 2
    # what is in the plane has the plane's width as its height, as of other sensors that leave it open
    p2 = 1.0 / r.half[0] ** 2 if flat else 1.0 / r.half[2] ** 2
    if flat:
        z = m2
    chi, mean, g0, g1, g2, a0, a1, a2, a3, a4, a5 = _normal(r, times, x, y, z)
    goal = chi + p0 * (m0 - x) ** 2 + p1 * (m1 - y) ** 2 + p2 * (m2 - z) ** 2
    damping = 1e-3
    for _ in range(_STEPS):
        if flat:
            g2 = a2 = a4 = a5 = 0.0
        f = 1.0 + damping
        b0, b1, b2 = g0 + p0 * (m0 - x), g1 + p1 * (m1 - y), g2 + p2 * (m2 - z)
        ok, s0, s1, s2 = solve(((a0 + p0) * f, a1, a2, (a3 + p1) * f, a4, (a5 + p2) * f), b0, b1, b2)
        if not ok or damping > 1e12:
            break
        if s0 * b0 + s1 * b1 + s2 * b2 <= 1e-12 * (1.0 + goal):
            break
        trial = _normal(r, times, x + s0, y + s1, z + s2)
        reached = trial[0] + p0 * (m0 - x - s0) ** 2 + p1 * (m1 - y - s1) ** 2 + p2 * (m2 - z - s2) ** 2
        if reached <= goal:
            x, y, z, goal = x + s0, y + s1, z + s2, reached
            chi, mean, g0, g1, g2, a0, a1, a2, a3, a4, a5 = trial
            damping *= 0.1
        else:
            damping *= 10.0
    if flat:
        a2 = a4 = a5 = 0.0
    C = np.empty((3, 3))
    ok, C[0, 0], C[0, 1], C[0, 2], C[1, 1], C[1, 2], C[2, 2] = inverse((a0 + p0, a1, a2, a3 + p1, a4, a5 + p2))
    if not ok:
        C[:] = 0.0
        C[0, 0], C[1, 1], C[2, 2] = 1.0 / p0, 1.0 / p1, 1.0 / p2
    C[1, 0], C[2, 0], C[2, 1] = C[0, 1], C[0, 2], C[1, 2]
    return chi, goal, mean, x, y, z, C


@njit
def fit(r: Receivers, times: Array, places: Array, own: bool) -> tuple[Array, Array, Array, Array]:
    """Fit tuples of arrival times (K, S), NaN where one missed, from the best of `places` (G, 3) or each its `own`.

    Chi-square (K,), times of emission (K,), positions (K, 3) and covariances (K, 3, 3).
    """
    total = len(times)
    chis, emitted = np.zeros(total), np.zeros(total)
    positions, covariances = np.zeros((total, 3)), np.zeros((total, 3, 3))
    starts, least = np.zeros((_STARTS, 3)), np.zeros(_STARTS)
    for k in range(total):
        count = 1 if own else _STARTS
        if own:
            starts[0] = places[k]
        else:
            least[:] = math.inf
            starts[:] = r.middle
            for g in range(len(places)):
                chi = _normal(r, times[k], places[g, 0], places[g, 1], places[g, 2])[0]
                i = _STARTS
                while i > 0 and chi < least[i - 1]:
                    i -= 1
                if i < _STARTS:
                    for j in range(_STARTS - 1, i, -1):
                        least[j], starts[j] = least[j - 1], starts[j - 1]
                    least[i], starts[i] = chi, places[g]
        best = math.inf
        for i in range(count):
            chi, goal, mean, x, y, z, C = descend(r, times[k], (starts[i, 0], starts[i, 1], starts[i, 2]))
            if goal < best:
                best, chis[k], emitted[k] = goal, chi, mean
                positions[k, 0], positions[k, 1], positions[k, 2] = x, y, z
                covariances[k] = C
    return chis, emitted, positions, covariances


def fit_arrivals(r: Receivers, times: Array) -> tuple[Array, Array, Array, Array]:
    """`fit` of tuples, from places all over the region."""
    counts = _GRID if r.half[2] > 0.0 else (*_GRID[:2], 1)
    axes = [m + h * (2.0 * np.arange(n) + 1.0 - n) / n for m, h, n in zip(r.middle, r.half, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return fit(r, times, grid, False)


def arrival_costs(
    scene: Scene, arrays: SensorArrays, times: Array, prior: PositionPrior | None, fitted: tuple[Array, ...]
) -> Array:
    """Costs (K,) of tuples of arrival times (K, S), from what `fit` says of them.

    infinite for too few to determine a position, 0 for a single one, a false alarm.
    """
    chi, _, positions, covariances = fitted
    r, heard = receivers_of(scene, arrays), ~np.isnan(times)
    costs = 0.5 * chi - heard @ arrays.gain + arrays.base
    if prior is not None:
        listened = max(float(np.ptp(sensor.field_of_view)) for sensor in scene.sensors)
        costs += np.log(listened * np.sqrt(heard @ r.weight / (2.0 * math.pi)))
        costs += prior.log_targets - log_expected(prior, positions, covariances)
    count = heard.sum(axis=1)
    return np.where(count == 1, 0.0, np.where(count < needed(r), np.inf, costs))
