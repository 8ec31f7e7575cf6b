"""The instances of the set: how each is made, from a seed; costs are rounded to six decimals: they are exact."""

import math
from collections.abc import Callable
from dataclasses import dataclass
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
from experiments.sdlib.recorded import WATCHES

DECIMALS = 6


@dataclass(frozen=True)
class Instance:
    """A problem of the set.

    name: Of its files.
    raw: Makes the problem before its costs are rounded.
    recorded: Whether the recording of recorded.py is needed to make it.
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


def _scan(make: Callable[[], Scene], scan: int = 0, **gating: float) -> Callable[[], AssignmentProblem]:
    return lambda: build_problem(make(), scan, **gating)  # type: ignore[arg-type]


def _from_scenes() -> list[Instance]:
    found = [
        Instance(f"paper-{seed}-{scan}", "paper", _scan(lambda seed=seed: scenes.three_radar(seed), scan))
        for seed, scan in ((1, 0), (1, 50), (2, 25), (2, 75))
    ]
    sizes = ((3, 30), (3, 100), (3, 300), (3, 1000), (3, 3000), (4, 100), (4, 300), (5, 200), (6, 30), (6, 100))
    for sensors, targets in sizes:
        for seed in (1, 2) if targets <= 1000 else (1,):
            make = lambda sensors=sensors, targets=targets, seed=seed: scenes.gated(sensors, targets, seed)  # noqa: E731
            found.append(Instance(f"gated-{sensors}x{targets}-{seed}", "gated", _scan(make)))
    for targets, seeds in ((10, 3), (15, 3), (20, 4), (30, 3), (40, 3), (60, 2), (100, 2), (150, 2)):
        for seed in range(2001, 2001 + seeds):
            make = lambda targets=targets, seed=seed: scenes.ghost(targets, seed)  # noqa: E731
            found.append(Instance(f"bearings-{targets}-{seed}", "bearings", _scan(make)))
    for targets in (20, 100, 300):
        make = lambda targets=targets: scenes.radar_field(targets, 3)  # noqa: E731
        found.append(Instance(f"radars-{targets}", "radars", _scan(make)))
    for targets in (30, 100, 300):
        for seed in (1, 2):
            make = lambda targets=targets, seed=seed: simulate(  # noqa: E731
                "crowd", seed, targets=targets, detection_probability=0.6, false_alarms_per_target=0.3
            )
            found.append(Instance(f"low-detection-{targets}-{seed}", "low detection", _scan(make)))
    for targets in (6, 12, 25):
        for seed in (1, 2):
            make = lambda targets=targets, seed=seed: mixed(targets, seed)  # noqa: E731
            found.append(Instance(f"mixed-{targets}-{seed}", "mixed sensors", _scan(make)))
    return found


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


def _posed(kind: str, targets: int, seed: int) -> Callable[[], AssignmentProblem]:
    def make() -> AssignmentProblem:
        scene = simulate("crowd", seed, targets=targets, scans=8, interval=4.0, detection_probability=0.8)
        return max(_problems(kind, scene)[-4:], key=lambda one: one.num_tuples)

    return make


def _from_trackers() -> list[Instance]:
    found = []
    kinds = (
        ("multi-sensor", "tracks and sensors", (20, 60, 150)),
        ("mht", "histories of several scans", (20, 40, 60)),
    )
    for kind, name, sizes in kinds:
        for targets in sizes:
            for seed in (1, 2):
                posed = _posed(kind, targets, seed)
                found.append(Instance(f"{kind}-{targets}-{seed}", name, posed, kept=True))
    return found


def _synthetic() -> list[Instance]:
    found = []
    for n in (10, 20, 30, 40, 50):
        for seed in (1, 2) if n <= 40 else (1,):
            known = lambda n=n, seed=seed: synthetic.axial_known_optimum(n, seed)[0]  # noqa: E731
            found.append(Instance(f"known-optimum-{n}-{seed}", "axial, known optimum", known))
    for n in (4, 8, 12, 16, 20, 26):
        for seed in (1, 2):
            drawn = lambda n=n, seed=seed: synthetic.axial_random(n, seed)  # noqa: E731
            found.append(Instance(f"axial-{n}-{seed}", "axial, random", drawn))
    for sensors in (4, 5, 6):
        for seed in (1, 2):
            planted = lambda sensors=sensors, seed=seed: synthetic.planted(sensors, seed)[0]  # noqa: E731
            found.append(Instance(f"planted-{sensors}-{seed}", "planted", planted))
    for targets, seed in ((100, 1), (100, 2), (300, 1), (300, 2), (1000, 1)):
        wide = lambda targets=targets, seed=seed: synthetic.wide_gates(targets, seed)  # noqa: E731
        found.append(Instance(f"wide-gates-{targets}-{seed}", "wide gates", wide))
    for seed in (1, 2, 3):
        found.append(Instance(f"near-ties-{seed}", "near ties", lambda seed=seed: near_ties(seed)))
    return found


def near_ties(seed: int) -> AssignmentProblem:
    """Some 300 tuples of seven sensors with 26 measurements each, whose costs differ by a ten-thousandth at most."""
    rng = np.random.default_rng(seed)
    tuples = rng.integers(1, 27, (300, 7)) * (rng.random((300, 7)) < 0.5)
    tuples = np.unique(tuples[np.count_nonzero(tuples, axis=1) >= 2], axis=0)
    costs = -1.0 + 1e-6 * rng.integers(0, 100, len(tuples))
    return AssignmentProblem(tuples, costs, [26] * 7)
