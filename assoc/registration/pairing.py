"""Association of measurements of different sensors under uncertain biases.

Each scan is one assignment problem, as `assoc.associate` makes them, of measurements that are corrected by the biases
known so far and whose noise is widened by their uncertainty.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from assoc._types import Array
from assoc.costs.build import build_problem
from assoc.costs.positions import positions_and_covariances
from assoc.errors import AssocWarning, LimitExceededError
from assoc.registration.correction import biases_of_sensors, corrected_measurements, corrected_sensor
from assoc.registration.normal_equations import Tuples
from assoc.registration.parameters import RegistrationParameters
from assoc.registration.terms import AXES, Term
from assoc.scene.scene import Scene
from assoc.sensors import PositionSensor, Sensor
from assoc.sensors.base import ANGLES
from assoc.solvers.assign import assign

# work of the exact solver on one scan, counted so that the answer does not depend on the machine
_VISITS, _LEAST_NODES = 200_000, 10
_USUAL_SPEED = 250.0


@dataclass(frozen=True)
class Epoch:
    """Measurements that are associated together: those of one scan, or of a turn of the slowest antenna."""

    time: float
    """Of the positions, seconds."""
    measurements: Sequence[Array]
    times: Sequence[Array]
    """Time stamp of each measurement."""
    velocities: Sequence[Array] | None = None
    """Of their targets, (n, 3), NaN where unknown; None: not needed."""


@dataclass(frozen=True)
class Chosen:
    """Tuples that were taken for targets."""

    epoch: Array
    """Number of the `Epoch` of each, (T,)."""
    rows: Array
    """Number of each sensor's measurement there, from 0, or -1, (T, S)."""
    skipped: int = 0
    """Epochs with too many candidate tuples."""

    def __len__(self) -> int:
        return len(self.epoch)


@contextmanager
def _without_warnings() -> Iterator[None]:
    """Suppress warnings about internal scenes, whose noise and measurements are not the user's."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AssocWarning)
        yield


@_without_warnings()
def corrected_scene(
    sensors: Sequence[Sensor], epochs: Sequence[Epoch], terms: Sequence[Term], biases: Array, region: Array
) -> Scene:
    """All epochs as a scene without biases and range rates, each measurement moved to its epoch's time."""
    by_sensor = biases_of_sensors(sensors, terms, biases)
    measurements = []
    for epoch in epochs:
        row = []
        for s, sensor in enumerate(sensors):
            z, moving = epoch.measurements[s], None if epoch.velocities is None else epoch.velocities[s]
            corrected = corrected_measurements(sensor, z, by_sensor[s], moving, epoch.time - epoch.times[s])
            row.append(corrected[:, : sensor.position_part.dim])
        measurements.append(row)
    located = [corrected_sensor(sensor.position_part, by_sensor[s]) for s, sensor in enumerate(sensors)]
    return Scene(located, np.array([epoch.time for epoch in epochs]), measurements, region)


@_without_warnings()
def widened(scene: Scene, terms: Sequence[Term], deviations: Array) -> Scene:
    """The scene with noise that includes the biases' standard deviations (n,)."""
    sensors = []
    for s, (sensor, by_sensor) in enumerate(
        zip(scene.sensors, biases_of_sensors(scene.sensors, terms, deviations), strict=True)
    ):
        away = _USUAL_SPEED * by_sensor.get("time", 0.0)
        if isinstance(sensor, PositionSensor):
            more = [np.hypot(by_sensor.get(axis, 0.0), away) for axis in AXES[: sensor.dim]]
        else:
            # metres as angles, at a usual distance
            aside = float(np.linalg.norm([*(by_sensor.get(axis, 0.0) for axis in AXES[:2]), away]))
            above = float(np.linalg.norm([by_sensor.get("z", 0.0), 0.3 * aside]))
            distance = _usual_distance(scene, s)
            lengths = {
                "range": math.hypot(aside, by_sensor.get("gain", 0.0) * distance),
                "azimuth": aside / distance,
                "elevation": above / distance,
                "height": 0.0,
            }
            more = [np.hypot(by_sensor.get(name, 0.0), lengths[name]) for name in sensor.components[: sensor.dim]]
        most = [1.0 if name in ANGLES else np.inf for name in sensor.components[: sensor.dim]]
        variances = np.minimum(np.array(more), most) ** 2
        sensors.append(replace(sensor, noise=sensor.covariance + np.diag(variances)) if variances.any() else sensor)
    return replace(scene, sensors=sensors)


def _usual_distance(scene: Scene, s: int) -> float:
    sensor = scene.sensors[s].at(float(scene.times[0]))
    if "range" in sensor.components:
        ranges = np.concatenate([scan[s][:, 0] for scan in scene.measurements])
        return max(float(np.median(ranges)) if len(ranges) else 1.0, 1.0)
    away = np.linalg.norm(scene.region[:2].mean(axis=1) - sensor.position[:2])
    return max(float(away), 1.0)


def choose_tuples(scene: Scene, parameters: RegistrationParameters) -> Chosen:
    """Associate every scan of a scene, and keep the tuples that two or more sensors share."""
    epoch, rows, skipped = [np.zeros(0, dtype=np.int64)], [np.zeros((0, len(scene.sensors)), dtype=np.int64)], 0
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        if np.count_nonzero(scan.sizes) < 2:
            continue
        try:
            problem = build_problem(scene, scan, max_tuples=parameters.max_tuples)
        except LimitExceededError:
            skipped += 1
            continue
        nodes = max(_LEAST_NODES, _VISITS // max(problem.num_tuples, 1))
        solution = assign(problem, "exact", seed=parameters.seed, nodes=nodes, patience=0)
        found = solution.tuples[np.count_nonzero(solution.tuples, axis=1) >= 2].astype(np.int64) - 1
        epoch.append(np.full(len(found), k))
        rows.append(found)
    return Chosen(np.concatenate(epoch), np.concatenate(rows), skipped)


def tuple_arrays(scene: Scene, epochs: Sequence[Epoch], chosen: Chosen, clocks: Array) -> Tuples:
    """Measurements, positions and velocities of chosen tuples of a scene that `corrected_scene` has made.

    ``clocks`` (S,) are the biases of the sensors' clocks, seconds.
    """
    total, count = chosen.rows.shape
    z, seen = np.zeros((total, count, 3)), chosen.rows >= 0
    at, velocity = np.zeros((total, 3)), np.full((total, 3), np.nan)
    places = np.zeros((total, count, 3))
    edges = np.searchsorted(chosen.epoch, np.arange(scene.num_scans + 1))
    for k, epoch in enumerate(epochs):
        part = slice(int(edges[k]), int(edges[k + 1]))
        rows = chosen.rows[part]
        if not len(rows):
            continue
        there, scan = scene.at(epoch.time), scene.scan(k).aligned(scene.sensors)
        places[part] = [sensor.position for sensor in there.sensors]
        at[part] = positions_and_covariances(there, scan, rows + 1)[0]
        if epoch.velocities is not None:
            velocity[part] = _mean_velocities(epoch.velocities, rows)
        for s in range(count):
            mine = np.flatnonzero(rows[:, s] >= 0)
            if not len(mine):
                continue
            numbers = rows[mine, s]
            measured = scan.measurements[s][numbers]
            if epoch.velocities is not None:
                # measurements without a velocity are moved to the epoch's time with that of their tuple
                late = np.where(
                    np.isnan(epoch.velocities[s][numbers, 0]), epoch.time - epoch.times[s][numbers] + clocks[s], 0.0
                )
                speed, where = velocity[part.start + mine], at[part.start + mine]
                seen[part.start + mine, s] = (late == 0.0) | ~np.isnan(speed[:, 0])
                measured = corrected_measurements(there.sensors[s], measured, {}, speed, late, where)
            z[part.start + mine, s, : measured.shape[1]] = measured
    flat = _is_flat(scene)
    if flat:
        at[:, 2] = scene.region[2].mean()
    return Tuples(z, seen, at, velocity, places, flat)


def _is_flat(scene: Scene) -> bool:
    """Whether the region is so low, as at sea, that no range tells one height in it from another."""
    if any(sensor.dim == 3 for sensor in scene.sensors):
        return False
    ranges = [math.sqrt(sensor.covariance[0, 0]) for sensor in scene.sensors if sensor.dim == 2]
    return bool(ranges) and bool(np.ptp(scene.region[2]) <= min(ranges))


def _mean_velocities(velocities: Sequence[Array], rows: Array) -> Array:
    """Mean over the members of tuples (T, S) whose velocity is known, (T, 3); NaN where none is."""
    sums, known = np.zeros((len(rows), 3)), np.zeros(len(rows))
    for s, of_sensor in enumerate(velocities):
        mine = np.flatnonzero(rows[:, s] >= 0)
        velocity = of_sensor[rows[mine, s]]
        fit = ~np.isnan(velocity[:, 0])
        sums[mine[fit]] += velocity[fit]
        known[mine[fit]] += 1
    mean: Array = sums / np.where(known > 0, known, np.nan)[:, None]
    return mean
