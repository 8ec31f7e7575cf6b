"""Velocities of targets from the measurements of one sensor: three dwells in a row on a straight line.

A sensor's bias moves all its plots alike, so that differences between them are nearly free of it. Measurements on no
line, or on several, have no velocity: most false alarms are such.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from assoc._types import Array
from assoc.registration.correction import pointed_at
from assoc.sensors import BearingSensor, Sensor
from assoc.sensors.base import ANGLES

FASTEST = 700.0
"""Largest speed of a target, m/s."""
_SIGMAS = 4.0
_NEIGHBOURS = ((-1, 1), (-1, 2), (1, -2), (1, 2), (-1, -2), (2, -2))
_ACCELERATION = 20.0
"""Largest acceleration, m/s^2."""


def target_velocities(sensor: Sensor, times: Sequence[Array], measurements: Sequence[Array]) -> list[Array]:
    """Velocity of the target of each measurement of a sensor, (n, 3) for each epoch, m/s.

    NaN where unknown, as from a platform; the vertical speed is 0 for sensors that leave the height open.
    """
    unknown = [np.full((len(z), 3), np.nan) for z in measurements]
    if isinstance(sensor, BearingSensor) or sensor.platform is not None or len(measurements) < 2:
        return unknown
    located = sensor.position_part
    positions = [pointed_at(located, np.asarray(z)[:, : located.dim]) for z in measurements]
    sigma = _sigma(located, positions)
    found = unknown
    for k in range(len(positions)):
        here = (positions[k], times[k])
        # epochs before and after, nearer ones first: targets are missed at times, and scenes have ends
        for first, second in _NEIGHBOURS:
            unknown_yet = np.isnan(found[k][:, 0])
            if not unknown_yet.any():
                break
            near, far = k + first, k + second
            if not (0 <= min(near, far) and max(near, far) < len(positions)):
                continue
            fresh = np.full((len(positions[k]), 3), np.nan)
            _fill(fresh, here, (positions[near], times[near]), (positions[far], times[far]), sigma)
            found[k][unknown_yet] = fresh[unknown_yet]
    return found


def _sigma(sensor: Sensor, positions: Sequence[Array]) -> float:
    """Standard deviation of a position along its worst axis, at the farthest usual distance, metres."""
    every = np.concatenate(positions)
    if not len(every):
        return 0.0
    deviations = np.sqrt(np.diagonal(sensor.covariance))
    if "range" not in sensor.components:
        return float(deviations.max())
    distance = float(np.percentile(np.linalg.norm(every - sensor.position, axis=1), 90))
    scales = [distance if name in ANGLES else 1.0 for name in sensor.components[: sensor.dim]]
    return float((deviations * scales).max())


def _fill(
    velocity: Array, here: tuple[Array, Array], near: tuple[Array, Array], far: tuple[Array, Array], sigma: float
) -> None:
    """Write velocities of the measurements `here` from those in `near` and `far` on a line with them."""
    if not (len(here[0]) and len(near[0]) and len(far[0])):
        return
    longest = float(max(np.abs(near[1].max() - here[1].min()), np.abs(here[1].max() - near[1].min())))
    pairs = cKDTree(here[0]).sparse_distance_matrix(
        cKDTree(near[0]), FASTEST * longest + _SIGMAS * sigma, output_type="ndarray"
    )
    i, j = pairs["i"], pairs["j"]
    dt = near[1][j] - here[1][i]
    good = (np.abs(dt) > 1e-6) & (pairs["v"] <= FASTEST * np.abs(dt) + _SIGMAS * sigma)
    i, j, dt = i[good], j[good], dt[good]
    if not len(i):
        return
    rate = (near[0][j] - here[0][i]) / dt[:, None]
    # a first guess with the median time of the far epoch, then the time of the measurement found
    there = here[0][i] + rate * (np.median(far[1]) - here[1][i])[:, None]
    tree = cKDTree(far[0])
    for _ in range(2):
        m = np.asarray(tree.query(there)[1])
        ahead = far[1][m] - here[1][i]
        there = here[0][i] + rate * ahead[:, None]
    apart = np.linalg.norm(far[0][m] - there, axis=1)
    share = np.abs(ahead / dt)
    allowed = _SIGMAS * sigma * np.sqrt(1.0 + share**2 + (1.0 + share) ** 2)
    allowed += 0.5 * _ACCELERATION * np.abs(ahead * (ahead - dt))
    good = (apart <= allowed) & (np.abs(ahead - dt) > 1e-6)
    i, j, m, dt, apart = i[good], j[good], m[good], dt[good], apart[good]
    # of several lines through a measurement the straightest, if it is much straighter than the next
    order = np.lexsort((apart, i))
    i, j, m, dt, apart = (x[order] for x in (i, j, m, dt, apart))
    first = np.ones(len(i), dtype=np.bool_)
    first[1:] = i[1:] != i[:-1]
    rivalled = np.zeros(len(i), dtype=np.bool_)
    rivalled[:-1] = first[:-1] & (i[1:] == i[:-1]) & (apart[1:] < 2.0 * apart[:-1] + sigma)
    chosen = first & ~rivalled
    i, j, m = i[chosen], j[chosen], m[chosen]
    span = far[1][m] - near[1][j]
    velocity[i] = (far[0][m] - near[0][j]) / np.where(np.abs(span) > 1e-6, span, np.nan)[:, None]
