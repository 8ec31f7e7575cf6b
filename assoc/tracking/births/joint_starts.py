"""New tracks of sensors that cannot start one alone: where bearings of several sensors cross.

A tracker that takes one sensor after the other looks at single measurements, and a bearing alone tells no position.
What its tracks leave over of such sensors is taken together: tuples of two measurements or more that may be one target.
Most tuples are ghosts, crossings of bearings of different targets or of false alarms. They die as false tracks do: the
measurements of later scans do not follow them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.build import build_problem
from assoc.costs.positions import positions_and_covariances
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.sensors import Sensor


def angles_alone(sensors: Sequence[Sensor]) -> bool:
    """Whether no sensor tells a distance, so that none starts a track alone."""
    return all(all(sensor.angular[: sensor.dim]) for sensor in sensors)


class Crossings(NamedTuple):
    """Tuples of measurements that may be one target each."""

    rows: Array
    """1-based measurement of each sensor, 0: none; int32 (K, S)."""
    costs: Array
    """Against false alarms, (K,); see `assoc.build_problem`."""
    positions: Array
    """Metres, (K, 3)."""
    covariances: Array
    """(K, 3, 3)."""


def crossings(place: Scene, scan: Scan, free: Sequence[Array], **options: Any) -> Crossings | None:
    """Tuples of two free measurements or more.

    Parameters
    ----------
    place : Scene
        Sensors and region.
    scan : Scan
    free : sequence over sensors of bool arrays (n_s,)
        Measurements that may be used.
    **options
        Of `assoc.build_problem`.

    Returns
    -------
    Crossings or None
        None where fewer than two sensors have any.
    """
    numbers = [np.flatnonzero(one) for one in free]
    if sum(len(one) > 0 for one in numbers) < 2:
        return None
    left = tuple(z[own] for z, own in zip(scan.measurements, numbers, strict=True))
    problem = build_problem(place, Scan(scan.index, scan.time, left), **options)
    several = np.count_nonzero(problem.tuples, axis=1) > 1
    if not several.any():
        return None
    tuples = problem.tuples[several]
    positions, covariances = positions_and_covariances(place, Scan(scan.index, scan.time, left), tuples)
    given = [np.concatenate([[0], own + 1]) for own in numbers]
    rows = np.stack([one[tuples[:, s]] for s, one in enumerate(given)], axis=1).astype(np.int32)
    return Crossings(rows, problem.costs[several], positions, covariances)
