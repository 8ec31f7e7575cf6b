"""Trackers and solvers that run for weeks: memory, speed and covariances must not get worse.

The multi-sensor tracker processes 10^5 scans of three radars (four circling targets and false alarms), a tracker of
each other family a fifth of that. Then 10^5 random problems are solved, most of them by `exact`, one in fifty by
another solver. All in one process, one after the other, as in a program that never ends. Measured a hundred times on
the way: resident memory, the objects that Python's collector knows, processor time a step, the least eigenvalue of
the correlation matrix of every track (above 0: positive definite), its asymmetry, and the distance of confirmed
tracks from the targets.

Processor time depends on the load of the machine (caches, clock rate). So a fixed piece of work that uses nothing of
this package is done and timed between the steps; the time of a step divided by the time of that work must not grow.
"""

import gc
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from assoc._types import Array
from assoc.problem import AssignmentProblem
from assoc.ranking.kbest import kbest
from assoc.sensors.base import Sensor
from assoc.simulation.observation import observe
from assoc.simulation.radars import on_circle, radar_over
from assoc.solvers.assign import assign
from assoc.tracking import TRACKERS, Tracker
from experiments.common.claims import Claim
from experiments.common.command import main

REGION = np.array([[-40e3, 40e3], [-40e3, 40e3], [0.0, 12e3]])
RADII = np.array([10e3, 15e3, 20e3, 25e3])
SPEEDS = np.array([200.0, -220.0, 240.0, -260.0])
WATCHED = 100
"""How often one looks."""
KINDS = {"multi-sensor": 1.0, "mht": 0.2, "nearest-neighbour": 0.2}
"""Trackers, and their shares of the steps."""
OTHERS = ("greedy", "lagrangian", "tabu", "genetic", "aco", "milp", "kbest")
SHARE = 50
"""One solve in so many is by one of the others."""
MEASURED = 20
"""How often the unchanging work is timed between two looks."""


def unchanging() -> float:
    """Do some work of Python and numpy, about a millisecond, always the same; its processor time, s."""
    started = time.process_time()
    matrix, total = np.eye(6) + 0.01 * np.arange(36.0).reshape(6, 6), 0.0
    for number in range(100):
        total += float((matrix @ matrix.T)[0, number % 6])
        total += sum(place * place for place in range(40))
        total += float(np.sort(np.sin(np.arange(200.0) * number))[number])
    assert total > 0.0
    return time.process_time() - started


def living() -> int:
    """Number of the objects that Python's collector knows."""
    gc.collect()
    return len(gc.get_objects())


@dataclass
class Watch:
    """What is seen on the way; one entry for each look."""

    steps: list[int] = field(default_factory=list)
    resident: list[float] = field(default_factory=list)
    objects: list[int] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    unchanging: list[float] = field(default_factory=list)
    count: Callable[[], int] = living

    def look(self, step: int, seconds: float, unchanging: float) -> None:
        """Note the memory, and the processor time (s) of a step and of the unchanging work since the last look."""
        living = self.count()
        with open("/proc/self/statm", encoding="ascii") as file:
            self.resident.append(int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20)
        self.objects.append(living)
        self.steps.append(step)
        self.seconds.append(seconds)
        self.unchanging.append(unchanging)

    def pace(self) -> Array:
        """Return the time of a step over that of the unchanging work, for each look."""
        return np.array(self.seconds) / np.array(self.unchanging)

    def claims(self, name: str) -> list[Claim]:
        """Memory at the end against that after a tenth, and the pace of the last tenth against the first."""
        tenth = len(self.steps) // 10
        grown = np.median(self.resident[-tenth:]) - np.median(self.resident[tenth : 2 * tenth])
        more = np.median(self.objects[-tenth:]) - np.median(self.objects[tenth : 2 * tenth])
        # the first look has what was compiled and imported on the way
        slower, raw, machine = (
            float(np.median(values[-tenth:]) / np.median(values[1 : tenth + 1]))
            for values in (self.pace(), self.seconds, self.unchanging)
        )
        return [
            Claim(f"{name}: processor time of a step", "ms", None, 1e3 * float(np.median(self.seconds))),
            Claim(f"{name}: growth of resident memory from the second tenth to the last", "MB", None, grown, None,
                  (None, 5.0)),
            Claim(f"{name}: growth of Python's objects", "", None, more, None, (None, 1_000.0)),
            Claim(f"{name}: time of a step over that of unchanging work, last tenth / first", "", None, slower, None,
                  (None, 1.15)),
            Claim(f"{name}: time of a step, last tenth / first", "", None, raw),
            Claim(f"{name}: time of the unchanging work, last tenth / first", "", None, machine),
        ]  # fmt: skip


@dataclass
class Clock:
    """Processor time of the steps between two looks, and of unchanging work among them."""

    watch: Watch
    every: int
    _steps: float = 0.0
    _between: list[float] = field(default_factory=list)

    def add(self, number: int, seconds: float) -> bool:
        """Count step ``number`` (from 1); True where it was time for a look."""
        self._steps += seconds
        if number % max(self.every // MEASURED, 1) == 0:
            self._between.append(unchanging())
        if number % self.every:
            return False
        self.watch.look(number, self._steps / self.every, float(np.mean(self._between)))
        self._steps, self._between = 0.0, []
        return True


def sensors() -> list[Sensor]:
    """Return three radars around the region."""
    options = {"range_noise": 50.0, "angle_noise": 1e-3, "detection_probability": 0.9, "false_alarm_rate": 1.0}
    places = on_circle(REGION.mean(axis=1), 60e3, 3)
    return [radar_over(REGION, place, name=f"radar {i}", **options) for i, place in enumerate(places)]


def positions(times: Array) -> Array:
    """Where the targets are, (K, 4, 3); metres."""
    angle = times[:, None] * SPEEDS / RADII + np.arange(4)
    height = np.full_like(angle, 5e3) + 500.0 * np.arange(4)
    return np.stack([RADII * np.cos(angle), RADII * np.sin(angle), height], axis=-1)


def scans(count: int, rng: np.random.Generator) -> Iterator[tuple[float, tuple[Array, ...], Array]]:
    """Time, measurements and targets of one scan after the other, a second apart; nothing is kept."""
    radars, at_once = sensors(), 100
    for begin in range(0, count, at_once):
        times = np.arange(begin, min(begin + at_once, count), dtype=float)
        places = positions(times)
        scene = observe(radars, times, [np.arange(4)] * len(times), list(places), rng, region=REGION)
        for k, when in enumerate(times):
            yield float(when), tuple(scene.measurements[k]), places[k]


def track(kind: str, steps: int, rng: np.random.Generator, looks: int = WATCHED) -> tuple[list[Claim], Watch]:
    """Let a tracker run, and look at it so often."""
    tracker: Tracker = TRACKERS[kind](sensors(), region=REGION, time_limit=None)
    watch = Watch()
    clock = Clock(watch, max(steps // looks, 1))
    least, asymmetry = np.inf, 0.0
    spread: list[float] = []
    errors: list[float] = []
    for number, (when, measurements, targets) in enumerate(scans(steps, rng), start=1):
        started = time.process_time()
        tracker.step(when, measurements)
        if not clock.add(number, time.process_time() - started):
            continue
        for track in tracker.tracks:
            scale = np.sqrt(np.diag(track.covariance))
            unit = track.covariance / np.outer(scale, scale)
            least = min(least, float(np.linalg.eigvalsh(unit).min()))
            asymmetry = max(asymmetry, float(np.abs(unit - unit.T).max()))
        confirmed = [track for track in tracker.tracks if track.confirmed]
        away = np.array([[np.linalg.norm(track.position - place) for track in confirmed] for place in targets])
        errors.append(float(np.minimum(away.min(axis=1, initial=1_000.0), 1_000.0).mean()))
        spread += [float(np.sqrt(np.trace(track.covariance[:3, :3]))) for track in confirmed]
    half, part = len(spread) // 2, len(errors) // 2
    last_id = max(track.track_id for track in tracker.tracks)
    return [
        *watch.claims(kind),
        Claim(f"{kind}: least eigenvalue of a correlation matrix", "", None, least, None, (1e-12, None)),
        Claim(f"{kind}: largest asymmetry", "", None, asymmetry, None, (None, 1e-12)),
        Claim(f"{kind}: deviation that covariances claim, second half / first", "", None,
              np.median(spread[half:]) / np.median(spread[:half]), None, (0.9, 1.1)),
        Claim(f"{kind}: distance of the targets to the next track, second half / first (cut at 1 km)", "", None,
              np.mean(errors[part:]) / np.mean(errors[:part]), None, (0.5, 1.5)),
        Claim(f"{kind}: that distance", "m", None, float(np.mean(errors))),
        Claim(f"{kind}: tracks begun in all", "", None, float(last_id)),
    ], watch  # fmt: skip


def drawn(rng: np.random.Generator) -> AssignmentProblem:
    """Draw a gated problem of three sensors, as a scan of ten targets makes it."""
    near = np.arange(1, 11)[:, None] + rng.integers(-1, 2, (10, 8, 3)).reshape(10, -1)
    tuples = np.clip(near.reshape(-1, 3), 1, 10)
    tuples[rng.random(tuples.shape) < 0.15] = 0
    tuples = np.unique(tuples[np.count_nonzero(tuples, axis=1) >= 2], axis=0)
    return AssignmentProblem(tuples, rng.normal(-3.0, 5.0, len(tuples)), [10, 10, 10])


def solve(count: int, rng: np.random.Generator, looks: int = WATCHED) -> tuple[list[Claim], Watch]:
    """Solve one problem after the other, and look so often."""
    others: list[Callable[[AssignmentProblem], object]] = [
        (lambda problem, name=name: kbest(problem, 3) if name == "kbest" else assign(problem, name)) for name in OTHERS
    ]
    for other in others:
        # what they import and compile is no growth
        other(drawn(rng))
    watch, wrong = Watch(), 0
    clock = Clock(watch, max(count // looks, 1))
    for number in range(1, count + 1):
        problem = drawn(rng)
        started = time.process_time()
        solution = assign(problem, "exact")
        seconds = time.process_time() - started
        wrong += solution.status != "optimal"
        if number % SHARE == 0:
            others[number // SHARE % len(others)](problem)
        clock.add(number, seconds)
    unproved = Claim("exact: solves that end without a proof", "", None, float(wrong), None, (None, 0.0))
    return [*watch.claims("exact"), unproved], watch


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Run all, one after the other, in this process."""
    steps = 2_000 if quick else 100_000
    claims: list[Claim] = []
    for kind, share in KINDS.items():
        claims += track(kind, int(share * steps), rng)[0]
    return claims + solve(steps, rng)[0]


if __name__ == "__main__":
    raise SystemExit(main("long_runs", experiment, __doc__))
