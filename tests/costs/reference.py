"""Equations 1-5 read plainly with numpy and scipy, and small scenes to hold the compiled costs against."""

import itertools
import math

import numpy as np
from scipy.optimize import least_squares

from assoc.scene import Scene
from assoc.sensors import BearingSensor, PositionSensor, Radar2D, Radar3D

SIDE = 5e4
REGION = np.array([[-SIDE, SIDE], [-SIDE, SIDE], [0.0, 2e4]])
CIRCLE = [-math.pi, math.pi]

MAKERS = {
    "R": lambda place: Radar3D(position=place, noise=[50, 2e-3, 2e-3], field_of_view=[[0, 2e5], CIRCLE, [-0.5, 1.5]]),
    "r": lambda place: Radar2D(position=place, noise=[50, 2e-3], field_of_view=[[0, 2e5], CIRCLE]),
    "h": lambda place: Radar2D(position=place, noise=[50, 2e-3, 60], field_of_view=[[0, 2e5], CIRCLE, [0, 2e4]]),
    "b": lambda place: BearingSensor(position=place, noise=[5e-3]),
    "P": lambda place: PositionSensor(position=place, noise=[100, 200, 300], field_of_view=REGION),
    "p": lambda place: PositionSensor(position=place, noise=[[1e4, 5e3], [5e3, 2e4]], field_of_view=REGION[:2]),
}


def make_scene(kinds, seed, targets=3, false_alarms=1.0):
    """Sensors of the given kinds and one scan of targets, all at random; also returns the targets."""
    rng = np.random.default_rng(seed)
    sensors = [MAKERS[kind]([*rng.uniform(-SIDE, SIDE, 2), rng.uniform(0, 500)]) for kind in kinds]
    truth = np.column_stack([rng.uniform(-SIDE, SIDE, (targets, 2)), rng.uniform(1e3, 1e4, targets)])
    measurements = []
    for sensor in sensors:
        seen = sensor.measure(truth[rng.random(targets) < sensor.detection_probability])
        noise = rng.standard_normal(seen.shape) @ np.linalg.cholesky(sensor.covariance).T
        low, high = sensor.field_of_view.T
        clutter = low + (high - low) * rng.random((rng.poisson(false_alarms), sensor.dim))
        z = np.vstack([seen + noise, clutter])
        measurements.append(z[rng.permutation(len(z))])
    return Scene(sensors, [0.0], [measurements], region=REGION), truth


def all_tuples(scene, least=2):
    """Every tuple of at least so many measurements in scan 0, (K, S)."""
    ranges = [range(len(z) + 1) for z in scene.measurements[0]]
    chosen = [t for t in itertools.product(*ranges) if sum(i > 0 for i in t) >= least]
    return np.array(chosen, dtype=np.int64).reshape(-1, len(ranges))


def constant(scene, one):
    """Equation 5 without the residuals."""
    total = 0.0
    for sensor, index in zip(scene.sensors, one, strict=True):
        p = sensor.detection_probability
        if index:
            log_det = np.log(np.linalg.det(2 * np.pi * sensor.covariance))
            total += 0.5 * log_det - np.log(p * sensor.volume / sensor.false_alarm_rate)
        else:
            total -= np.log(1 - p)
    return total


def residuals(scene, one, position):
    """Whitened residuals of a tuple at a position: their sum of squares is chi-square."""
    parts = []
    for s, index in enumerate(one):
        if index:
            sensor, z = scene.sensors[s], scene.measurements[0][s][index - 1]
            nu = sensor.residual(z[None], sensor.measure(position[None]))[0]
            parts.append(np.linalg.solve(np.linalg.cholesky(sensor.covariance), nu))
    return np.concatenate(parts)


def best_fit(scene, one, starts):
    """Least chi-square value that scipy finds from the starts, and where."""
    best = None
    for start in starts:
        found = least_squares(
            lambda x: residuals(scene, one, x),
            start,
            x_scale=[1e3] * 3,
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
            max_nfev=200,
        )
        if best is None or found.cost < best.cost:
            best = found
    return 2 * best.cost, best.x


def determined(scene, one, position):
    """Whether the measurements tell more than the region in every direction that they tell of at all."""
    half = np.ptp(scene.region, axis=1) / 2
    information = np.zeros((3, 3))
    for sensor, index in zip(scene.sensors, one, strict=True):
        if index:
            jacobian = sensor.jacobian(position[None])[0]
            information += jacobian.T @ np.linalg.inv(sensor.covariance) @ jacobian
    scaled = information * half[:, None] * half[None, :]
    if not scaled[2].any():
        scaled = scaled[:2, :2]
    return measures_positions(scene, one) or np.linalg.eigvalsh(scaled)[0] > 3.0


def measures_positions(scene, one):
    """Whether a sensor of the tuple measures full positions."""
    return any(scene.sensors[s].dim == 3 for s, index in enumerate(one) if index)


def freedom(scene, one):
    """Degrees of freedom as `build_problem` documents them."""
    components = sum(scene.sensors[s].dim for s, index in enumerate(one) if index)
    return max(1, components - (3 if measures_positions(scene, one) else 2))
