"""Which measurements of different sensors are one target, with biases that are known only so well.

Each scan is one assignment problem, as `assoc.associate` makes them, of measurements that are corrected by the biases
known so far and whose noise is widened by how badly these are known. Gates are as wide as needed and no wider.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from assoc._types import Array
from assoc.costs.build import build_problem
from assoc.costs.positions import positions_and_covariances
from assoc.errors import AssocWarning, LimitExceededError
from assoc.registration.correction import corrected_measurements, corrected_sensor, own_biases
from assoc.registration.normal_equations import Places, Tuples
from assoc.registration.parameters import RegistrationParameters
from assoc.registration.terms import AXES, Term
from assoc.scene.scene import Scene
from assoc.sensors import PositionSensor, Sensor
from assoc.sensors.base import ANGLES
from assoc.sensors.codes import CODES
from assoc.solvers.assign import assign

# what the exact solver may do on one scan, counted so that the answer does not depend on the machine
_VISITS, _LEAST_NODES = 200_000, 10
_USUAL_SPEED = 250.0


@dataclass(frozen=True)
class Looks:
    """Measurements that belong together: those of one scan.

    Attributes
    ----------
    time : float
        To which positions belong, seconds.
    measurements : sequence over sensors of arrays (n, d)
    times : sequence over sensors of arrays (n,)
        Each measurement's own time, as stamped.
    velocities : sequence over sensors of arrays (n, 3), or None
        Of their targets, NaN where not known; None: not needed.
    """

    time: float
    measurements: Sequence[Array]
    times: Sequence[Array]
    velocities: Sequence[Array] | None = None


@dataclass(frozen=True)
class Chosen:
    """Tuples that were taken for targets.

    Attributes
    ----------
    look : int array (T,)
        To which `Looks` they belong.
    rows : int array (T, S)
        Number of each sensor's measurement there, from 0, or -1.
    skipped : int
        Looks that had too many candidate tuples.
    """

    look: Array
    rows: Array
    skipped: int = 0

    def __len__(self) -> int:
        return len(self.look)


def places_of(sensors: Sequence[Sensor]) -> Places:
    """Sensors in the form that kernels take, without range rates."""
    located = [sensor.position_part for sensor in sensors]
    weight = np.zeros((len(sensors), 3, 3))
    for s, sensor in enumerate(located):
        weight[s, : sensor.dim, : sensor.dim] = np.linalg.inv(sensor.covariance)
    return Places(
        code=np.array([CODES[type(sensor)] for sensor in located], dtype=np.int64),
        dim=np.array([sensor.dim for sensor in located], dtype=np.int64),
        place=np.array([sensor.position for sensor in located]),
        weight=weight,
    )


@contextmanager
def _unasked() -> Iterator[None]:
    """No doubts about scenes that the user never sees: their noise and measurements are not those that were given."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AssocWarning)
        yield


@_unasked()
def corrected_scene(
    sensors: Sequence[Sensor], looks: Sequence[Looks], terms: Sequence[Term], biases: Array, region: Array
) -> Scene:
    """All looks as a scene without the biases, each measurement at its look's time, without range rates."""
    own = [own_biases(terms, biases, s) for s in range(len(sensors))]
    measurements = []
    for one in looks:
        row = []
        for s, sensor in enumerate(sensors):
            z, moving = one.measurements[s], None if one.velocities is None else one.velocities[s]
            corrected = corrected_measurements(sensor, z, own[s], moving, one.time - one.times[s])
            row.append(corrected[:, : sensor.position_part.dim])
        measurements.append(row)
    located = [corrected_sensor(sensor.position_part, own[s]) for s, sensor in enumerate(sensors)]
    return Scene(located, np.array([one.time for one in looks]), measurements, region)


@_unasked()
def widened(scene: Scene, terms: Sequence[Term], deviations: Array) -> Scene:
    """The scene with noise that contains what is not known of the biases, (n,) standard deviations."""
    sensors = []
    for s, sensor in enumerate(scene.sensors):
        own = own_biases(terms, deviations, s)
        away = _USUAL_SPEED * own.get("time", 0.0)
        if isinstance(sensor, PositionSensor):
            more = [np.hypot(own.get(axis, 0.0), away) for axis in AXES[: sensor.dim]]
        else:
            # what moves a target by so many metres turns its bearing by so much, at a usual distance
            aside = float(np.linalg.norm([*(own.get(axis, 0.0) for axis in AXES[:2]), away]))
            above = float(np.linalg.norm([own.get("z", 0.0), 0.3 * aside]))
            distance = _usual_distance(scene, s)
            lengths = {"range": aside, "azimuth": aside / distance, "elevation": above / distance}
            more = [np.hypot(own.get(name, 0.0), lengths[name]) for name in sensor.components[: sensor.dim]]
        variances = (
            np.minimum(np.array(more), [1.0 if name in ANGLES else np.inf for name in sensor.components[: sensor.dim]])
            ** 2
        )
        sensors.append(replace(sensor, noise=sensor.covariance + np.diag(variances)) if variances.any() else sensor)
    return replace(scene, sensors=sensors)


def _usual_distance(scene: Scene, s: int) -> float:
    sensor = scene.sensors[s]
    if "range" in sensor.components:
        ranges = np.concatenate([scan[s][:, 0] for scan in scene.measurements])
        return max(float(np.median(ranges)) if len(ranges) else 1.0, 1.0)
    away = np.linalg.norm(scene.region[:2].mean(axis=1) - sensor.position[:2])
    return max(float(away), 1.0)


def choose_tuples(scene: Scene, parameters: RegistrationParameters) -> Chosen:
    """Associate every scan of a scene, and keep the tuples that two or more sensors share."""
    look, rows, skipped = [np.zeros(0, dtype=np.int64)], [np.zeros((0, len(scene.sensors)), dtype=np.int64)], 0
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
        look.append(np.full(len(found), k))
        rows.append(found)
    return Chosen(np.concatenate(look), np.concatenate(rows), skipped)


def tuple_arrays(scene: Scene, looks: Sequence[Looks], chosen: Chosen, clocks: Array) -> Tuples:
    """Measurements, positions and velocities of chosen tuples of a corrected scene.

    Parameters
    ----------
    scene : Scene
        As `corrected_scene` makes it.
    looks : sequence of Looks
    chosen : Chosen
    clocks : array (S,)
        Biases of the sensors' clocks, seconds.
    """
    total, count = chosen.rows.shape
    z, seen = np.zeros((total, count, 3)), chosen.rows >= 0
    at, velocity = np.zeros((total, 3)), np.full((total, 3), np.nan)
    edges = np.searchsorted(chosen.look, np.arange(scene.num_scans + 1))
    for k, look in enumerate(looks):
        part = slice(int(edges[k]), int(edges[k + 1]))
        rows = chosen.rows[part]
        if not len(rows):
            continue
        at[part] = positions_and_covariances(scene, k, rows + 1)[0]
        if look.velocities is not None:
            velocity[part] = _mean_velocities(look.velocities, rows)
        for s in range(count):
            mine = np.flatnonzero(rows[:, s] >= 0)
            if not len(mine):
                continue
            numbers = rows[mine, s]
            measured = scene.measurements[k][s][numbers]
            if look.velocities is not None:
                # what the sensor itself could not move to the look's time is moved as its tuple moves
                late = np.where(
                    np.isnan(look.velocities[s][numbers, 0]), look.time - look.times[s][numbers] + clocks[s], 0.0
                )
                speed, where = velocity[part.start + mine], at[part.start + mine]
                seen[part.start + mine, s] = (late == 0.0) | ~np.isnan(speed[:, 0])
                measured = corrected_measurements(scene.sensors[s], measured, {}, speed, late, where)
            z[part.start + mine, s, : measured.shape[1]] = measured
    return Tuples(z, seen, at, velocity)


def _mean_velocities(velocities: Sequence[Array], rows: Array) -> Array:
    """Mean over the members of tuples (T, S) whose velocity is known, (T, 3); NaN where none is."""
    sums, known = np.zeros((len(rows), 3)), np.zeros(len(rows))
    for s, own in enumerate(velocities):
        mine = np.flatnonzero(rows[:, s] >= 0)
        one = own[rows[mine, s]]
        fit = ~np.isnan(one[:, 0])
        sums[mine[fit]] += one[fit]
        known[mine[fit]] += 1
    mean: Array = sums / np.where(known > 0, known, np.nan)[:, None]
    return mean
