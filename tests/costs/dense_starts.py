"""Positions of tuples against a dense search of starts by scipy, for all mixes of sensors, near ones, too.

Each case is one target seen by two to four sensors, half of them with sensors 30 m to 5 km away from it.
"""

import math
from collections.abc import Iterator

import numpy as np

from assoc.costs import tuple_costs
from assoc.scene import Scene
from assoc.sensors import BearingSensor, PositionSensor, Radar2D, Radar3D
from tests.costs.reference import CIRCLE, best_fit, constant, determined

WIDTH, HEIGHT = 20e3, 10e3
REGION = [[-WIDTH, WIDTH], [-WIDTH, WIDTH], [0.0, HEIGHT]]
# values above this are beyond any gate, best or not
_PLAUSIBLE = 40.0
# room below the ground for noise: mirror images of low targets lie there
_BELOW = 50.0


def draw(seed: int, number: int) -> tuple[str, Scene, np.ndarray]:
    """Draw sensors, one target and its measurements."""
    rng = np.random.default_rng([seed, number])
    kinds = "".join(rng.choice(list("RrbPp"), int(rng.integers(2, 5))))
    height = rng.choice([50, 100, 300, 1000, 3000, 8000]) * rng.uniform(0.5, 1.2)
    truth = np.array([rng.uniform(-WIDTH, WIDTH), rng.uniform(-WIDTH, WIDTH), height])
    near = rng.random() < 0.5
    sensors, measured = [], []
    for kind in kinds:
        place = np.array([*rng.uniform(-WIDTH, WIDTH, 2), rng.choice([0.0, 0.0, 30.0, 500.0])])
        if near and rng.random() < 0.6:
            turn = rng.uniform(-math.pi, math.pi)
            place[:2] = truth[:2] + 10 ** rng.uniform(1.5, 3.7) * np.array([math.cos(turn), math.sin(turn)])
        sensor = _sensor(kind, place, 10 ** rng.uniform(-0.5, 0.7))
        z = sensor.measure(truth[None]) + rng.normal(size=(1, sensor.dim)) * np.sqrt(np.diag(sensor.covariance))
        if kind in "Rr":
            z[:, 0] = np.maximum(z[:, 0], 1e-3)
        if kind == "R":
            z[:, 2] = np.clip(z[:, 2], -math.pi / 2, math.pi / 2)
        sensors.append(sensor)
        measured.append(z)
    return kinds, Scene(sensors, [0.0], [measured], region=REGION), truth


def _sensor(kind: str, place: np.ndarray, spread: float) -> BearingSensor | PositionSensor | Radar2D | Radar3D:
    common = {"position": place, "detection_probability": 0.9, "false_alarm_rate": 5.0}
    if kind == "R":
        view = [[0.0, 1e5], CIRCLE, [-math.pi / 2, math.pi / 2]]
        return Radar3D(noise=[50 * spread, 5e-3 * spread, 9e-3 * spread], field_of_view=view, **common)
    if kind == "r":
        return Radar2D(noise=[50 * spread, 5e-3 * spread], field_of_view=[[0.0, 1e5], CIRCLE], **common)
    if kind == "b":
        return BearingSensor(noise=[5e-3 * spread], **common)
    dims = 3 if kind == "P" else 2
    return PositionSensor(noise=[50 * spread] * dims, field_of_view=[[-1e5, 1e5]] * dims, **common)


def _starts(rng: np.random.Generator, scene: Scene, truth: np.ndarray) -> Iterator[np.ndarray]:
    """The truth, places around it, and what each sensor points at, at several heights."""
    yield truth
    for _ in range(3):
        yield np.array([*(truth[:2] + 1e3 * rng.normal(size=2)), rng.uniform(0.0, HEIGHT)])
    for sensor, z in zip(scene.sensors, scene.measurements[0], strict=True):
        for height in (0.0, truth[2], 3000.0):
            if isinstance(sensor, PositionSensor):
                yield np.array([z[0, 0], z[0, 1], height])
            elif not isinstance(sensor, BearingSensor):
                up = float(np.clip(height - sensor.position[2], -z[0, 0], z[0, 0]))
                ground = math.sqrt(z[0, 0] ** 2 - up * up)
                offset = [ground * math.cos(z[0, 1]), ground * math.sin(z[0, 1]), up]
                yield np.asarray(sensor.position) + offset


def excess(seed: int, number: int) -> tuple[str, float] | None:
    """By how much the position found is worse than the best of all starts; None where they say nothing."""
    kinds, scene, truth = draw(seed, number)
    one = np.ones((1, len(kinds)), dtype=np.int64)
    ours = 2.0 * float(tuple_costs(scene, 0, one)[0] - constant(scene, one[0]))
    chi, where = best_fit(scene, one[0], list(_starts(np.random.default_rng([seed, number, 1]), scene, truth)))
    if chi > _PLAUSIBLE or not determined(scene, one[0], where) or not -_BELOW < where[2] < 1.5 * HEIGHT:
        return None
    return kinds, ours - chi
