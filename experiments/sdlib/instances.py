"""The instances of the set: how each is made, from a seed; costs are rounded to six decimals: they are exact.

Some need a recording that is not here, an excerpt of the OpenSky Network's state vectors of 12 July 2021, 14:00 to
14:20 UTC: a row for each aircraft every 10 seconds, from 50.0 to 54.5 degrees north and 5.0 degrees west to 1.6 east.
It may not be given away here. What is stored are instances alone: indices, and costs of tuples of measurements that
simulated radars made of the traffic, with noise, misses and false alarms; no position, time or aircraft can be had from
them. Who has the recording can make them anew: the environment variable named by `PATH` says where it lies.
"""

import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple
from unittest import mock

import numpy as np

from assoc.costs import build_problem
from assoc.problem import AssignmentProblem
from assoc.scene import Scene
from assoc.simulation import simulate
from assoc.solution import Solution
from assoc.tracking import TRACKERS
from assoc.tracking.filter_choice import make_filter
from assoc.tracking.progress import Work
from experiments.common.instances import scenes, synthetic

DECIMALS = 6
PATH = "SDLIB_RECORDING"


class Watch(NamedTuple):
    """Radars over the traffic: how many, how good, how much else they see, and which scan (10 s each) it is.

    ``noise`` is the standard deviation of range, and across the line of sight at 50 km, metres.
    """

    radars: int
    detection_probability: float
    false_alarms: float
    noise: float
    scan: int
    seed: int

    def make(self) -> AssignmentProblem:
        """Make the problem from the recording."""
        if PATH not in os.environ:
            raise FileNotFoundError(f"{PATH}: names no recording; without it this instance cannot be made anew")
        options = self._asdict()
        seed, scan = options.pop("seed"), options.pop("scan")
        return build_problem(simulate("from-tracks", seed, file=os.environ[PATH], scans=scan + 1, **options), scan)


WATCHES = {
    "recorded-3-1": Watch(3, 0.9, 20.0, 300.0, 30, 1),
    "recorded-3-2": Watch(3, 0.7, 60.0, 1500.0, 50, 2),
    "recorded-3-3": Watch(3, 0.6, 400.0, 4000.0, 70, 3),
    "recorded-4-1": Watch(4, 0.6, 100.0, 3000.0, 40, 1),
    "recorded-4-2": Watch(4, 0.6, 300.0, 4000.0, 60, 2),
    "recorded-4-3": Watch(4, 0.7, 150.0, 8000.0, 80, 3),
    "recorded-5-1": Watch(5, 0.5, 100.0, 6000.0, 45, 1),
    "recorded-5-2": Watch(5, 0.6, 200.0, 5000.0, 90, 2),
    "recorded-6-1": Watch(6, 0.5, 80.0, 5000.0, 55, 1),
    "recorded-6-2": Watch(6, 0.7, 40.0, 3000.0, 100, 2),
}


@dataclass(frozen=True)
class Instance:
    """A problem of the set.

    name: Of its files.
    raw: Makes the problem before its costs are rounded.
    recorded: Whether the recording of air traffic is needed to make it.
    kept: Whether the tracker that poses it has changed since: what is stored stays, and `make` makes another one.
    """

    name: str
    family: str
    raw: Callable[[], AssignmentProblem]
    recorded: bool = False
    kept: bool = False

    def make(self) -> AssignmentProblem:
        """Make the problem: the same on every machine, as far as its mathematical library rounds alike."""
        problem = self.raw()
        costs = np.round(problem.costs, DECIMALS) + 0.0  # no negative zeros
        return AssignmentProblem(problem.tuples, costs, problem.sizes, dummy=problem.dummy)


def instances() -> list[Instance]:
    """Return all instances, family by family."""
    recorded = [Instance(name, "recorded traffic", watch.make, recorded=True) for name, watch in WATCHES.items()]
    return [*_from_scenes(), *recorded, *_from_trackers(), *_synthetic()]


def _scan(make: Callable[..., Scene], *size: Any, scan: int = 0, **options: Any) -> Callable[[], AssignmentProblem]:
    return lambda: build_problem(make(*size, **options), scan)


def _from_scenes() -> list[Instance]:
    found = [
        Instance(f"paper-{seed}-{scan}", "paper", _scan(scenes.three_radar, seed, scan=scan))
        for seed, scan in ((1, 0), (1, 50), (2, 25), (2, 75))
    ]
    sizes = ((3, 30), (3, 100), (3, 300), (3, 1000), (3, 3000), (4, 100), (4, 300), (5, 200), (6, 30), (6, 100))
    found += [
        Instance(f"gated-{sensors}x{targets}-{seed}", "gated", _scan(scenes.gated, sensors, targets, seed))
        for sensors, targets in sizes
        for seed in ((1, 2) if targets <= 1000 else (1,))
    ]
    found += [
        Instance(f"bearings-{targets}-{seed}", "bearings", _scan(scenes.ghost, targets, seed))
        for targets, seeds in ((10, 3), (15, 3), (20, 4), (30, 3), (40, 3), (60, 2), (100, 2), (150, 2))
        for seed in range(2001, 2001 + seeds)
    ]
    found += [Instance(f"radars-{n}", "radars", _scan(scenes.radar_field, n, 3)) for n in (20, 100, 300)]
    rare = {"detection_probability": 0.6, "false_alarms_per_target": 0.3}
    found += [
        Instance(f"low-detection-{n}-{seed}", "low detection", _scan(simulate, "crowd", seed, targets=n, **rare))
        for n in (30, 100, 300)
        for seed in (1, 2)
    ]
    return found + [
        Instance(f"mixed-{n}-{seed}", "mixed sensors", _scan(mixed, n, seed)) for n in (6, 12, 25) for seed in (1, 2)
    ]


def mixed(targets: int, seed: int) -> Scene:
    """Two radars (one without elevation) and two bearing sensors around targets in 40 x 40 x 10 km."""
    from assoc.scene import Truth
    from assoc.sensors import BearingSensor, Radar2D, Radar3D, Sensor

    rng = np.random.default_rng(seed)
    circle, reach = [-math.pi, math.pi], [0.0, 8e4]
    common = {"detection_probability": 0.9, "false_alarm_rate": 0.1 * targets}
    sensors: list[Sensor] = [
        Radar3D(position=[-2e4, 0, 0], noise=[50.0, 3e-3, 3e-3], field_of_view=[reach, circle, [-0.5, 1.5]], **common),
        Radar2D(position=[2e4, 1e4, 0], noise=[80.0, 3e-3], field_of_view=[reach, circle], **common),
        BearingSensor(position=[0, -2e4, 0], noise=[5e-3], **common),
        BearingSensor(position=[1e4, 2e4, 0], noise=[5e-3], **common),
    ]
    truth = np.column_stack([rng.uniform(-2e4, 2e4, (targets, 2)), rng.uniform(500.0, 9500.0, targets)])
    measured, sources = [], []
    for sensor in sensors:
        seen = np.flatnonzero(rng.random(targets) < sensor.detection_probability)
        z = sensor.measure(truth[seen]) + rng.normal(size=(len(seen), sensor.dim)) * np.sqrt(np.diag(sensor.covariance))
        low, high = sensor.field_of_view.T
        alarms = low + (high - low) * rng.random((rng.poisson(sensor.false_alarm_rate), sensor.dim))
        azimuth = 0 if sensor.dim == 1 else 1
        z = np.vstack([z, alarms])
        z[:, azimuth] = np.mod(z[:, azimuth] + math.pi, 2 * math.pi) - math.pi
        order = rng.permutation(len(z))
        measured.append(z[order])
        sources.append(np.append(seen, np.full(len(alarms), -1))[order])
    region = [[-2e4, 2e4], [-2e4, 2e4], [0.0, 1e4]]
    return Scene(sensors, [0.0], [measured], region=region, truth=Truth([np.arange(targets)], [truth], [sources]))


def _problems(kind: str, scene: Scene) -> list[AssignmentProblem]:
    """Problems that a tracker poses on a scene."""
    found: list[AssignmentProblem] = []
    solve = Work.assign

    def listening(work: Work, problem: AssignmentProblem) -> Solution:
        found.append(problem)
        return solve(work, problem)

    tracker = TRACKERS[kind](scene.sensors, make_filter("imm", scene.sensors, 20.0, 0), region=scene.region)
    with mock.patch.object(Work, "assign", listening):
        for k in range(scene.num_scans):
            tracker.step(float(scene.times[k]), scene.measurements[k])
    return found


def _posed(kind: str, targets: int, seed: int) -> AssignmentProblem:
    """The largest of the last problems that a tracker poses."""
    scene = simulate("crowd", seed, targets=targets, scans=8, interval=4.0, detection_probability=0.8)
    return max(_problems(kind, scene)[-4:], key=lambda problem: problem.num_tuples)


def _from_trackers() -> list[Instance]:
    kinds = (
        ("multi-sensor", "tracks and sensors", (20, 60, 150)),
        ("mht", "histories of several scans", (20, 40, 60)),
    )
    return [
        Instance(f"{kind}-{targets}-{seed}", name, partial(_posed, kind, targets, seed), kept=True)
        for kind, name, sizes in kinds
        for targets in sizes
        for seed in (1, 2)
    ]


def _synthetic() -> list[Instance]:
    kinds: tuple[tuple[str, str, Callable[..., Any], list[tuple[int, int]]], ...] = (
        ("known-optimum", "axial, known optimum", lambda n, seed: synthetic.axial_known_optimum(n, seed)[0],
         [(n, seed) for n in (10, 20, 30, 40, 50) for seed in ((1, 2) if n <= 40 else (1,))]),
        ("axial", "axial, random", synthetic.axial_random,
         [(n, seed) for n in (4, 8, 12, 16, 20, 26) for seed in (1, 2)]),
        ("planted", "planted", lambda sensors, seed: synthetic.planted(sensors, seed)[0],
         [(sensors, seed) for sensors in (4, 5, 6) for seed in (1, 2)]),
        ("wide-gates", "wide gates", synthetic.wide_gates, [(100, 1), (100, 2), (300, 1), (300, 2), (1000, 1)]),
    )  # fmt: skip
    found = [
        Instance(f"{name}-{size}-{seed}", family, partial(make, size, seed))
        for name, family, make, sizes in kinds
        for size, seed in sizes
    ]
    return found + [Instance(f"near-ties-{seed}", "near ties", partial(near_ties, seed)) for seed in (1, 2, 3)]


def near_ties(seed: int) -> AssignmentProblem:
    """Some 300 tuples of seven sensors with 26 measurements each, whose costs differ by a ten-thousandth at most."""
    rng = np.random.default_rng(seed)
    tuples = rng.integers(1, 27, (300, 7)) * (rng.random((300, 7)) < 0.5)
    tuples = np.unique(tuples[np.count_nonzero(tuples, axis=1) >= 2], axis=0)
    costs = -1.0 + 1e-6 * rng.integers(0, 100, len(tuples))
    return AssignmentProblem(tuples, costs, [26] * 7)
