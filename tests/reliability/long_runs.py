"""Trackers and solvers that run for weeks: memory, speed and covariances must not get worse.

    python -m tests.reliability.long_runs [--steps 2000]

The multi-sensor tracker processes 10^5 scans of three radars (four circling targets and false alarms), two others a
fifth of that. Then 10^5 random problems are solved, most of them by `exact`, one in fifty by another solver. All in one
process, one after the other, as in a program that never ends. Measured a hundred times on the way: resident memory,
the objects that Python's collector knows, processor time a step, the least eigenvalue of the correlation matrix of
every track (above 0: positive definite), and the distance of confirmed tracks from the targets.

Processor time depends on the load of the machine (caches, clock rate). So a fixed piece of work that uses nothing of
this package is done and timed between the steps; the time of a step divided by the time of that work must not grow.
"""

import argparse
import gc
import os
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from assoc._types import Array
from assoc.problem import AssignmentProblem
from assoc.ranking.kbest import kbest
from assoc.simulation.observation import observe
from assoc.simulation.radars import on_circle, radar_over
from assoc.solvers.assign import assign
from assoc.tracking import TRACKERS, Tracker
from experiments.common.claims import Claim
from experiments.common.measuring import processor_time
from experiments.common.results import print_claims

REGION = np.array([[-40e3, 40e3], [-40e3, 40e3], [0.0, 12e3]])
RADII = np.array([10e3, 15e3, 20e3, 25e3])
SPEEDS = np.array([200.0, -220.0, 240.0, -260.0])
LOOKS = 100
KINDS = {"multi-sensor": 1.0, "mht": 0.2, "nearest-neighbour": 0.2}
"""Trackers, and their shares of the steps."""
OTHERS = ("greedy", "lagrangian", "tabu", "genetic", "aco", "milp", "kbest")
SHARE = 50
"""One solve in so many is by one of the others."""


def unchanging() -> float:
    """Do some work of Python and numpy, about a millisecond, always the same."""
    matrix, total = np.eye(6) + 0.01 * np.arange(36.0).reshape(6, 6), 0.0
    for number in range(100):
        total += float((matrix @ matrix.T)[0, number % 6]) + sum(place * place for place in range(40))
        total += float(np.sort(np.sin(np.arange(200.0) * number))[number])
    return total


def living() -> int:
    """Number of the objects that Python's collector knows."""
    gc.collect()
    return len(gc.get_objects())


class Watch:
    """What is seen on the way, at a look every so many steps."""

    def __init__(self, every: int, count: Callable[[], int] = living) -> None:
        self.every, self.count = max(every, 1), count
        self.resident: list[float] = []
        self.objects: list[int] = []
        self.seconds: list[float] = []
        self.unchanging: list[float] = []
        self._steps = 0.0
        self._between: list[float] = []

    def add(self, number: int, seconds: float) -> bool:
        """Count step ``number`` (from 1) and its processor time; True where it was time for a look."""
        self._steps += seconds
        if number % max(self.every // 20, 1) == 0:
            self._between.append(processor_time(unchanging)[1])
        if number % self.every:
            return False
        self.look(self._steps / self.every, float(np.mean(self._between)))
        self._steps, self._between = 0.0, []
        return True

    def look(self, seconds: float, unchanging: float) -> None:
        """Note memory, and the processor time (s) of a step and of the unchanging work since the last look."""
        self.objects.append(self.count())
        with open("/proc/self/statm", encoding="ascii") as file:
            self.resident.append(int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20)
        self.seconds.append(seconds)
        self.unchanging.append(unchanging)

    def claims(self, name: str) -> list[Claim]:
        """Memory at the end against that after a tenth, and the pace of the last tenth against the first."""
        tenth = len(self.seconds) // 10
        grown, more = (
            float(np.median(values[-tenth:]) - np.median(values[tenth : 2 * tenth]))
            for values in (self.resident, self.objects)
        )
        pace = np.array(self.seconds) / np.array(self.unchanging)
        # the first look has what was compiled and imported on the way
        slower = float(np.median(pace[-tenth:]) / np.median(pace[1 : tenth + 1]))
        return [
            Claim(f"{name}: processor time of a step", "ms", None, 1e3 * float(np.median(self.seconds))),
            _limited(f"{name}: growth of resident memory from the second tenth", grown, most=5.0, unit="MB"),
            _limited(f"{name}: growth of Python's objects", more, most=1_000.0),
            _limited(f"{name}: time of a step over that of unchanging work, last tenth / first", slower, most=1.15),
        ]


def _limited(
    what: str, value: float, *, least: float | None = None, most: float | None = None, unit: str = ""
) -> Claim:
    return Claim(what, unit, ours=value, band=(least, most), source="chosen by us")


def scans(count: int, rng: np.random.Generator) -> Iterator[tuple[float, tuple[Array, ...], Array]]:
    """Time, measurements and targets (4, 3) of one scan after the other, a second apart; nothing is kept."""
    for begin in range(0, count, 100):
        times = np.arange(begin, min(begin + 100, count), dtype=float)
        angle = times[:, None] * SPEEDS / RADII + np.arange(4)
        height = np.full_like(angle, 5e3) + 500.0 * np.arange(4)
        places = np.stack([RADII * np.cos(angle), RADII * np.sin(angle), height], axis=-1)
        scene = observe(RADARS, times, [np.arange(4)] * len(times), list(places), rng, region=REGION)
        for k, when in enumerate(times):
            yield float(when), tuple(scene.measurements[k]), places[k]


RADARS = [
    radar_over(REGION, place, name=f"radar {i}", range_noise=50.0, angle_noise=1e-3, detection_probability=0.9,
               false_alarm_rate=1.0)
    for i, place in enumerate(on_circle(REGION.mean(axis=1), 60e3, 3))
]  # fmt: skip


def track(kind: str, steps: int, rng: np.random.Generator, looks: int = LOOKS) -> tuple[list[Claim], Watch]:
    """Let a tracker run, and look at it so often."""
    tracker: Tracker = TRACKERS[kind](RADARS, region=REGION, time_limit=None)
    watch, least = Watch(steps // looks), np.inf
    errors: list[float] = []
    for number, (when, measurements, targets) in enumerate(scans(steps, rng), start=1):
        if not watch.add(number, processor_time(tracker.step, when, measurements)[1]):
            continue
        for one in tracker.tracks:
            scale = np.sqrt(np.diag(one.covariance))
            least = min(least, float(np.linalg.eigvalsh(one.covariance / np.outer(scale, scale)).min()))
        confirmed = [one.position for one in tracker.tracks if one.confirmed]
        away = np.array([[np.linalg.norm(place - one) for one in confirmed] for place in targets])
        errors.append(float(np.minimum(away.min(axis=1, initial=1_000.0), 1_000.0).mean()))
    worse = float(np.mean(errors[len(errors) // 2 :]) / np.mean(errors[: len(errors) // 2]))
    return [
        *watch.claims(kind),
        _limited(f"{kind}: least eigenvalue of a correlation matrix", least, least=1e-12),
        _limited(f"{kind}: distance of the targets to the next track, second half / first", worse, least=0.5, most=1.5),
        Claim(f"{kind}: that distance (cut at 1 km)", "m", None, float(np.mean(errors))),
    ], watch


def drawn(rng: np.random.Generator) -> AssignmentProblem:
    """Draw a gated problem of three sensors, as a scan of ten targets makes it."""
    near = np.arange(1, 11)[:, None] + rng.integers(-1, 2, (10, 8, 3)).reshape(10, -1)
    tuples = np.clip(near.reshape(-1, 3), 1, 10)
    tuples[rng.random(tuples.shape) < 0.15] = 0
    tuples = np.unique(tuples[np.count_nonzero(tuples, axis=1) >= 2], axis=0)
    return AssignmentProblem(tuples, rng.normal(-3.0, 5.0, len(tuples)), [10, 10, 10])


def solve(count: int, rng: np.random.Generator, looks: int = LOOKS) -> tuple[list[Claim], Watch]:
    """Solve one problem after the other, and look so often."""
    others: list[Callable[[AssignmentProblem], object]] = [
        partial(kbest, k=3) if name == "kbest" else partial(assign, solver=name) for name in OTHERS
    ]
    for other in others:
        # what they import and compile is no growth
        other(drawn(rng))
    watch, wrong = Watch(count // looks), 0
    for number in range(1, count + 1):
        problem = drawn(rng)
        solution, seconds = processor_time(assign, problem, "exact")
        wrong += solution.status != "optimal"
        if number % SHARE == 0:
            others[number // SHARE % len(others)](problem)
        watch.add(number, seconds)
    return [*watch.claims("exact"), _limited("exact: solves that end without a proof", wrong, most=0.0)], watch


def main(arguments: Sequence[str] | None = None) -> int:
    """Run all, one after the other, in this process; returns 1 if something is not as it should be."""
    parser = argparse.ArgumentParser(prog="python -m tests.reliability.long_runs", description=__doc__.split("\n")[0])
    parser.add_argument(
        "--steps", type=int, default=100_000, metavar="N", help="of the multi-sensor tracker, and solves"
    )
    steps, rng = parser.parse_args(arguments).steps, np.random.default_rng(0)
    claims = [claim for kind, share in KINDS.items() for claim in track(kind, int(share * steps), rng)[0]]
    claims += solve(steps, rng)[0]
    print_claims(claims, "Long runs")
    return int(any(claim.holds is False for claim in claims))


if __name__ == "__main__":
    raise SystemExit(main())
