"""What one size takes, measured in a process of its own: a scan of a crowd, and a tracker's scans.

Peak memory and processor time are then those of that size.
"""

import math
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

import assoc
from assoc.scene import Scene
from assoc.sensors import BearingSensor, PositionSensor, Radar2D, Sensor
from assoc.simulation import simulate
from assoc.tracking import TRACKERS
from experiments.common.instances.scenes import single_scan
from experiments.common.measuring import processor_time

Measured = dict[str, float]


def alone(measure: Callable[..., Measured], *arguments: Any) -> Measured:
    """Call a function of a module in a new process; what it returns, with ``peak`` in MB."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(_measured, measure, arguments).result()


def _measured(measure: Callable[..., Measured], arguments: tuple[Any, ...]) -> Measured:
    return {**measure(*arguments), "peak": peak_mb()}


def peak_mb() -> float:
    """Return the most memory that this process has had."""
    status = Path("/proc/self/status")
    if status.exists():
        # Linux lets a child inherit the maximum that getrusage tells from the process that started it
        peak = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return float(peak.split()[1]) / 1e3
    import resource

    # bytes on macOS, kilobytes elsewhere
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)


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


def scan(kind: str, targets: int, solvers: tuple[str, ...]) -> Measured:
    """Processor time of each part, the tuples, and the relative gap of `exact`."""
    found: Measured = {}
    small = assoc.build_problem(crowd(kind, 300, 0), 0)
    for name in solvers:
        assoc.assign(small, name, **SOLVERS[name])
    assoc.build_problem(crowd(kind, 1_000, 0), 0)
    scene = crowd(kind, targets, 1)
    found["measurements"] = float(sum(map(len, scene.measurements[0])))
    problem, found["build"] = processor_time(assoc.build_problem, scene, 0)
    found["tuples"] = float(problem.num_tuples)
    for name in solvers:
        answer, found[name] = processor_time(partial(assoc.assign, problem, name, advise=False, **SOLVERS[name]))
        found[f"{name}, gap"] = answer.gap / max(1.0, abs(answer.cost))
    return found


SETTLED = 5
"""Scans before those whose median is taken."""
NEAR = 400.0
"""Metres from a target to a track that is its."""


def tracker(kind: str, targets: int, scans: int) -> Measured:
    """Processor time of a scan, the worst and the median, and the share of targets near a confirmed track at the end.

    100 targets in 25 x 25 x 2 km, scans of 4 s, three position sensors of 100 m, P_d 0.9, 10 % false alarms.
    """
    about = {"scans": scans, "interval": 4.0, "width": 25_000.0, "constant_density": True}
    assoc.warm_up()
    for few in (30, 100, 300):
        follow(kind, few, 0, about)
    spent, found = follow(kind, targets, 1, about)
    return {"worst": max(spent), "worst scan": float(np.argmax(spent)) + 1.0,
            "median": float(np.median(spent[SETTLED:])), **found}  # fmt: skip


def follow(kind: str, targets: int, seed: int, about: dict[str, Any]) -> tuple[list[float], Measured]:
    """Processor time of each scan; the share of targets tracked and the confirmed tracks at the end."""
    scene = simulate("crowd", seed, targets=targets, **about)
    tracker = TRACKERS[kind].for_scene(scene)
    spent = []
    for k in range(scene.num_scans):
        spent.append(processor_time(tracker.step, scene.times[k], scene.measurements[k])[1])
    places = np.array([track.position for track in tracker.tracks if track.confirmed]).reshape(-1, 3)
    truth = scene.scan(scene.num_scans - 1).truth_positions
    near = np.asarray(cKDTree(places).query(truth)[0]) < NEAR
    return spent, {"tracked": 100.0 * float(near.mean()), "confirmed": float(len(places))}
