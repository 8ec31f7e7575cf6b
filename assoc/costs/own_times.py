"""Scans whose measurements have their own times: tuples, costs and positions through predicted motion.

A target flies straight with little noise and a velocity of known prior. The cost is that of equation 5 with the
velocity integrated out; for simultaneous measurements of linear sensors it equals theirs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.costs.positions import checked_tuples, positions_of_scan
from assoc.costs.range_rates import checked_speed
from assoc.costs.tracks.own_times import Places, TimedScan, grow_timed_tuples, score_costs
from assoc.costs.tracks.scores import score_terms
from assoc.errors import InvalidInputError
from assoc.filters.kalman import ExtendedKalmanFilter
from assoc.filters.motion.models import ConstantVelocity
from assoc.filters.state import gaussian
from assoc.problem import AssignmentProblem
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.sensors import BearingSensor

UNREST = 5.0
"""Root of the spectral density of a target's acceleration, m/s^1.5, between the measurements of a scan."""


def timed_problem(
    scene: Scene, scan: Scan, gate_probability: float, max_tuples: int, speed: float | Sequence[float]
) -> AssignmentProblem:
    """Candidate tuples of a scan with own times; see `assoc.build_problem`.

    A tuple has at least one measurement that determines a position: bearings alone are not compared over time.
    """
    timed = _timed_scan(scene, scan, gate_probability, speed)
    terms = score_terms(scene.sensors)
    found = grow_timed_tuples(timed, terms, timed.misses(terms), max_tuples)
    rows = found.rows[np.count_nonzero(found.rows, axis=1) > 1]
    costs = found.costs[np.count_nonzero(found.rows, axis=1) > 1] - _fusion(timed, rows)
    good = costs < 0
    return AssignmentProblem(rows[good], costs[good], scan.sizes)


def timed_costs(scene: Scene, scan: Scan, tuples: Array, speed: float | Sequence[float]) -> Array:
    """Cost of given tuples of a scan with own times; see `assoc.costs.tuple_costs`."""
    timed = _timed_scan(scene, scan, 1.0, speed)
    rows = _checked(timed, tuples)
    followed = timed.follow(np.full(len(rows), -1), rows)
    terms = score_terms(scene.sensors)
    misses = timed.misses(terms)[timed.anchors(rows, followed.lead)]
    costs = score_costs(timed, followed, rows, terms, misses) - _fusion(timed, rows)
    return np.where(np.count_nonzero(rows, axis=1) == 1, 0.0, costs)


def timed_positions(scene: Scene, scan: Scan, tuples: Array, speed: float | Sequence[float]) -> tuple[Array, Array]:
    """Positions and covariances at the scan's time; see `assoc.costs.positions_and_covariances`."""
    timed = _timed_scan(scene, scan, 1.0, speed)
    rows = _checked(timed, tuples)
    followed = timed.follow(np.full(len(rows), -1), rows)
    states = timed.at_end(followed, np.full(len(rows), -1))
    return states.mean[:, :3].copy(), states.covariance[:, :3, :3].copy()


def _timed_scan(scene: Scene, scan: Scan, gate_probability: float, speed: float | Sequence[float]) -> TimedScan:
    """A scan without tracks, in the form in which tuples are grown and followed."""
    prior = np.diag(checked_speed(speed) ** 2)
    filter = ExtendedKalmanFilter(ConstantVelocity(UNREST, kind="continuous"))

    def start(positions: Array, covariances: Array, lag: Array) -> Any:
        return gaussian(*beginning(positions, covariances, prior, lag))

    none = start(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0))
    return TimedScan(
        filter, none, scan.time, replace(scan, clutter=None), scene.sensors, _places(scene, scan), start,
        gate_probability,
    )  # fmt: skip


def beginning(positions: Array, covariances: Array, prior: Array, lag: Array) -> tuple[Array, Array]:
    """Means (n, 6) and covariances of positions and velocities `lag` (n,) seconds before targets were measured there.

    The velocity's mean is 0, its covariance `prior` (3, 3).
    """
    mean = np.concatenate([positions, np.zeros_like(positions)], axis=1)
    covariance = np.empty((len(mean), 6, 6))
    covariance[:, :3, :3] = covariances + lag[:, None, None] ** 2 * prior
    covariance[:, :3, 3:] = covariance[:, 3:, :3] = -lag[:, None, None] * prior
    covariance[:, 3:, 3:] = prior
    return mean, covariance


def _places(scene: Scene, scan: Scan) -> Places:
    """Positions of single measurements; all but bearings may start a target.

    A birth is equation 5 of a single measurement times the volume of its position: with that of the position of the
    whole tuple (`_fusion`) the chain of predictive densities becomes the likelihood at the best position.
    """
    positions, covariances, able, births = [], [], [], []
    for s, (sensor, z) in enumerate(zip(scene.sensors, scan.measurements, strict=True)):
        where, spread = positions_of_scan(scene, scan, s)
        located = sensor.position_part
        density = located.false_alarm_rate / located.volume
        peak = -0.5 * float(np.linalg.slogdet(2.0 * math.pi * located.covariance)[1])
        positions.append(where)
        covariances.append(spread)
        able.append(np.full(len(z), not isinstance(sensor, BearingSensor)))
        births.append(math.log(sensor.detection_probability / density) + peak + 0.5 * np.linalg.slogdet(spread)[1])
    return Places(positions, covariances, able, births)


def _fusion(timed: TimedScan, rows: Array) -> Array:
    """Half the logarithm of the determinant of the information on the position that the measurements hold, (M,)."""
    total = np.zeros((len(rows), 3, 3))
    for s, covariances in enumerate(timed.places.covariances):
        seen = np.flatnonzero(rows[:, s])
        total[seen] += np.linalg.inv(covariances)[rows[seen, s] - 1]
    return np.asarray(0.5 * np.linalg.slogdet(total)[1])


def _checked(timed: TimedScan, tuples: Array) -> Array:
    """Tuples with a measurement that determines a position, as int32 (K, S)."""
    rows = checked_tuples(tuples, np.array([len(z) for z in timed.measurements]))
    able = np.stack([np.append(fit, False)[rows[:, s] - 1] for s, fit in enumerate(timed.places.fit)], axis=1)
    if len(rows) and not able.any(axis=1).all():
        raise InvalidInputError(
            f"tuples: row {int(np.argmin(able.any(axis=1)))} has bearings alone, which are not compared over time"
        )
    return rows
