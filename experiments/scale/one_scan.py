"""One scan of a crowd, from its measurements to a certified answer: positions, 2-D radars, and bearings among them."""

import math
import time
from typing import Any

import numpy as np

import assoc
from assoc.scene import Scene
from assoc.sensors import BearingSensor, PositionSensor, Radar2D, Sensor
from assoc.simulation import simulate
from experiments.common.instances.scenes import single_scan
from experiments.common.measuring import timed
from experiments.scale.alone import Measured, seconds

SOLVERS: dict[str, dict[str, Any]] = {"exact": {}, "lagrangian": {"gap": 1e-3}, "greedy": {}}
AREA = {"positions": 5.0, "2-D radars": 10.0, "2-D radars and a bearing": 10.0}
"""Kind -> side of a square in which 100 targets are, km. It grows with the targets, their density stays."""


def crowd(kind: str, targets: int, seed: int) -> Scene:
    """Three sensors with a noise of 100 m (of angles: across, in the middle), P_d 0.9, 10 % false alarms.

    Targets are uniform in a square, 2 km high; radars and bearings stand around it, half a diagonal from its middle.
    """
    rng = np.random.default_rng(seed)
    side = AREA[kind] * 1e3 * math.sqrt(targets / 100)
    region = np.array([[0.0, side], [0.0, side], [0.0, 2_000.0]])
    away = side * math.sqrt(2.0)
    common: dict[str, Any] = {"detection_probability": 0.9, "false_alarm_rate": 0.1 * targets}
    sensors: list[Sensor] = []
    for s, angle in enumerate(2.0 * math.pi * np.arange(3) / 3.0):
        place = region.mean(axis=1) + away / 2.0 * np.array([math.cos(angle), math.sin(angle), 0.0])
        view = np.array([[0.0, 2.0 * away], [-math.pi, math.pi]])
        if kind == "positions":
            box = region + 500.0 * np.array([-1.0, 1.0])
            sensors.append(PositionSensor(position=place, noise=np.full(3, 100.0), field_of_view=box, **common))
        elif kind.endswith("bearing") and s == 2:
            sensors.append(BearingSensor(position=place, noise=np.array([200.0 / away]), **common))
        else:
            sensors.append(Radar2D(position=place, noise=np.array([100.0, 200.0 / away]), field_of_view=view, **common))
    positions = region[:, 0] + (region[:, 1] - region[:, 0]) * rng.random((targets, 3))
    return single_scan(sensors, positions, region, rng, f"{kind}, {targets}")


def measure(kind: str, targets: int, solvers: tuple[str, ...]) -> Measured:
    """Processor time of each part, the tuples, and the relative gap of `exact`."""
    found: Measured = {}
    small = assoc.build_problem(crowd(kind, 300, 0), 0)
    for name in solvers:
        assoc.assign(small, name, **SOLVERS[name])
    assoc.build_problem(crowd(kind, 1_000, 0), 0)
    scene = crowd(kind, targets, 1)
    found["measurements"] = float(sum(map(len, scene.measurements[0])))
    with seconds(found, "build"):
        problem = assoc.build_problem(scene, 0)
    found["tuples"] = float(problem.num_tuples)
    for name in solvers:
        with seconds(found, name):
            answer = assoc.assign(problem, name, advise=False, **SOLVERS[name])
        found[f"{name}, gap"] = answer.gap / max(1.0, abs(answer.cost))
    return found


def solved(jobs: int, count: int) -> Measured:
    """Seconds by the wall and scans a second of 300 targets each, solved by so many processes."""
    scene = simulate("crowd", 1, targets=300, scans=count, constant_density=True)
    assoc.associate(simulate("crowd", 0, targets=300, scans=2, constant_density=True), jobs=jobs)
    return {"wall": timed(lambda: assoc.associate(scene, jobs=jobs), time.perf_counter)[1]}
