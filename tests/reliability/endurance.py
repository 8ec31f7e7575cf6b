"""Mixed problems, mixed steps of trackers and long sessions in one process: does it live, right, in as much memory?

    python -m tests.reliability.endurance --problems 100000 --steps 20000 --scans 10000 --seed 1 [--publish]

Every problem of problems.py is answered in one way of differential.py, in turn, and judged there. Between them sessions
of all trackers and filters take steps: plots that are late, doubled, missing or crowded, and states that go through
files; what comes late must give the tracks of plots in order. Then a few trackers follow circling targets for as long
as one likes. All in one process, which may take 1 GB more than it had after its first steps; resident memory, Python's
objects and, of the long sessions, the time of a step (over that of work that never changes) must not grow.

Under ``NUMBA_BOUNDSCHECK=1`` (with a cache of its own: ``NUMBA_CACHE_DIR``), kernels raise IndexError where they would
read or write beyond an array; with ``PYTHONMALLOC=debug MALLOC_PERTURB_=165`` what is freed is overwritten.
"""

import argparse
import ctypes
import faulthandler
import gc
import math
import os
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from assoc._system.compile_time import compile_seconds
from assoc._types import Array
from assoc.errors import AssocError
from assoc.scene import Scene
from assoc.simulation import simulate
from assoc.simulation.observation import observe
from assoc.simulation.radars import on_circle, radar_over
from assoc.tracking import TRACKERS, LatePlots, Tracker
from assoc.tracking.filter_choice import FILTERS, make_filter
from experiments.common.claims import Claim
from experiments.common.measuring import processor_time
from tests.reliability.differential import LISTED, WAYS, Judge, sampled_claims
from tests.reliability.fuzzing import limit_memory
from tests.reliability.results import add_ends, report

SCANS = 8
"""Scans of a tracking session."""
LOOKS = 100
"""How often memory is looked at."""
LONG = {"multi-sensor": 1.0, "mht": 0.2, "nearest-neighbour": 0.2}
"""Trackers of long sessions, and their shares of the scans."""
_SCENES = ("three-radar", "rotating-radar", "bearing-only", "crowd")
_PROGRESS = 60.0
Faults = Counter[str]


# --- steps of sessions ----------------------------------------------------------------------------------------


def track_some(seed: int, number: int, folder: Path, counts: Faults) -> None:
    """A session of one tracker: `SCANS` hostile scans, some of them late, the state through a file in between."""
    rng = np.random.default_rng([seed, number, 7])
    name, filter_name = list(TRACKERS)[number % len(TRACKERS)], FILTERS[number // len(TRACKERS) % len(FILTERS)]
    scene = simulate(_SCENES[int(rng.integers(len(_SCENES)))], number, scans=SCANS)
    options: dict[str, Any] = {"adapt": bool(rng.random() < 0.5)}
    options["filter"] = make_filter(filter_name, scene.sensors, region=scene.region, seed=number)
    options["max_tuples"] = int(rng.choice([300, 3000, 20_000]))
    tracker = TRACKERS[name].for_scene(scene, **options)
    late = LatePlots(tracker) if rng.random() < 0.5 else None
    waiting: list[list[tuple[float, Any]]] = [[] for _ in scene.sensors]
    for k in range(scene.num_scans):
        measurements = _spoiled(rng, scene, k)
        stamps = [np.full(len(z), scene.times[k]) for z in measurements]
        if late is not None:
            measurements, stamps = _delayed(rng, measurements, stamps, waiting)
        counts["steps"] += 1
        try:
            step = (tracker if late is None else late).step(float(scene.times[k]), measurements, stamps)
        except AssocError:
            counts["steps refused"] += 1
            continue
        counts["late plots"] += step.late
        for track in tracker.tracks:
            assert np.array_equal(track.covariance, track.covariance.T), "a covariance is not symmetric"
    tracker.save(folder / "state.npz")
    again = TRACKERS[name].for_scene(scene, **options)
    again.restore(folder / "state.npz")


def _spoiled(rng: np.random.Generator, scene: Scene, k: int) -> list[Any]:
    """A scan's measurements: as they are, none of a sensor, doubled, repeated with noise, or those of another scan."""
    found = []
    for s, z in enumerate(scene.scan(k).measurements):
        z = np.asarray(z)[:40]
        style = rng.integers(6)
        if style == 0:
            z = z[:0]
        elif style == 1:
            z = np.concatenate([z, z])
        elif style == 2 and len(z):
            noise, near = np.sqrt(np.diagonal(scene.sensors[s].covariance)), z[:3].repeat(3, axis=0)
            z = np.concatenate([z, near + 0.5 * noise * rng.random(near.shape)])
        elif style == 3:
            z = np.asarray(scene.scan(int(rng.integers(scene.num_scans))).measurements[s])[:40]
        found.append(z)
    return found


def _delayed(
    rng: np.random.Generator, measurements: list[Any], stamps: list[Any], waiting: list[list[tuple[float, Any]]],
    share: float = 0.2,
) -> tuple[list[Any], list[Any]]:  # fmt: skip
    """Keep a share of the measurements for later, and deliver some of those that were kept; all if it is 0."""
    values, times = [], []
    for z, own, kept in zip(measurements, stamps, waiting, strict=True):
        now = rng.random(len(z)) >= share
        come = [kept.pop() for _ in range(len(kept)) if rng.random() < 0.5 or share == 0.0]
        kept.extend(zip(own[~now].tolist(), z[~now], strict=True))
        values.append(np.concatenate([z[now], *(row[None] for _, row in come)]))
        times.append(np.concatenate([own[now], [time for time, _ in come]]))
    return values, times


def deliver_late(seed: int, number: int, counts: Faults) -> None:
    """A session in which a fifth of the plots comes late: its tracks are those of a tracker that got all in order."""
    rng = np.random.default_rng([seed, number, 8])
    name, filter_name = list(TRACKERS)[number % len(TRACKERS)], FILTERS[number // len(TRACKERS) % len(FILTERS)]
    scene = simulate("rotating-radars", number, aircraft=4, duration=2.0 * SCANS, false_alarms=2.0)

    def fresh() -> Tracker:
        return TRACKERS[name].for_scene(scene, filter=make_filter(filter_name, scene.sensors, region=scene.region))

    plain, late = fresh(), LatePlots(fresh())
    waiting: list[list[tuple[float, Any]]] = [[] for _ in scene.sensors]
    for k in range(scene.num_scans):
        scan, last = scene.scan(k), k == scene.num_scans - 1
        values, times = [np.asarray(z) for z in scan.measurements], [np.asarray(t) for t in scan.times or ()]
        counts["steps"] += 1
        plain.step(scan.time, values, times, scan.sectors)
        values, times = _delayed(rng, values, times, waiting, 0.0 if last else 0.2)
        counts["late plots"] += late.step(scan.time, values, times, scan.sectors).late
    counts["late sessions"] += 1
    mine, theirs = (np.array(sorted(track.mean.tolist() for track in one.tracks)) for one in (late, plain))
    assert mine.shape == theirs.shape, f"{name}, {filter_name}: {len(mine)} tracks, in order {len(theirs)}"
    away = float(np.abs(mine - theirs).max(initial=0.0))
    assert away < 1e-3, f"{name}, {filter_name}: tracks are {away:.2g} from those of plots in order"


# --- long sessions --------------------------------------------------------------------------------------------

REGION = np.array([[-40e3, 40e3], [-40e3, 40e3], [0.0, 12e3]])
RADII = np.array([10e3, 15e3, 20e3, 25e3])
SPEEDS = np.array([200.0, -220.0, 240.0, -260.0])
RADARS = [
    radar_over(REGION, place, name=f"radar {i}", range_noise=50.0, angle_noise=1e-3, detection_probability=0.9,
               false_alarm_rate=1.0)
    for i, place in enumerate(on_circle(REGION.mean(axis=1), 60e3, 3))
]  # fmt: skip


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


def unchanging() -> float:
    """Do some work of Python and numpy, about a millisecond, always the same."""
    matrix, total = np.eye(6) + 0.01 * np.arange(36.0).reshape(6, 6), 0.0
    for number in range(100):
        total += float((matrix @ matrix.T)[0, number % 6]) + sum(place * place for place in range(40))
        total += float(np.sort(np.sin(np.arange(200.0) * number))[number])
    return total


class Watch:
    """Memory, objects and pace, looked at every so many steps."""

    def __init__(self, every: int) -> None:
        self.every = max(every, 1)
        self.resident: list[float] = []
        self.objects: list[int] = []
        self.pace: list[float] = []
        self._steps = self._unchanging = self._compiled = 0.0
        self._last, self._of_kernels = np.zeros(2), np.zeros(2)

    def add(self, number: int, seconds: float = 0.0) -> bool:
        """Count step ``number`` (from 1) and its processor time; True where it was time for a look."""
        self._steps += seconds
        if number % max(self.every // 20, 1) == 0:
            self._unchanging += processor_time(unchanging)[1]
        if number % self.every:
            return False
        gc.collect()
        # what is free, and kept by the C library for later, is no growth
        if trim := getattr(ctypes.CDLL(None), "malloc_trim", None):
            trim(0)
        with open("/proc/self/statm", encoding="ascii") as file:
            resident = int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20
        now = np.array([len(gc.get_objects()), resident])
        # a kernel that is compiled or loaded late stays, with what numba knows of it: hundreds of objects, megabytes
        if compile_seconds() != self._compiled:
            self._of_kernels += now - self._last
        self._last, self._compiled = now, compile_seconds()
        count, resident = now - self._of_kernels
        self.objects.append(int(count))
        self.resident.append(float(resident))
        self.pace.append(self._steps / self._unchanging)
        self._steps = self._unchanging = 0.0
        return True

    def claims(self, name: str, growth: float = 5.0) -> list[Claim]:
        """Memory at the end against that after a tenth, and the pace of the last tenth against the first."""
        tenth = len(self.pace) // 10
        if not tenth:
            return []

        def grown(values: Sequence[float]) -> float:
            return float(np.median(values[-tenth:]) - np.median(values[tenth : 2 * tenth]))

        found = [
            _limited(f"{name}: growth of resident memory but for new kernels", grown(self.resident), growth, "MB"),
            _limited(f"{name}: growth of Python's objects but for new kernels", grown(self.objects), 1_000.0),
        ]
        if any(self.pace):
            # the first look has what was compiled and imported on the way
            slower = float(np.median(self.pace[-tenth:]) / np.median(self.pace[1 : tenth + 1]))
            found.append(_limited(f"{name}: time of a step, last tenth / first", slower, 1.15))
        return found


def _limited(what: str, value: float, most: float | None, unit: str = "", least: float | None = None) -> Claim:
    return Claim(what, unit, ours=value, band=(least, most), source="chosen by us")


def follow(kind: str, count: int, rng: np.random.Generator, looks: int = LOOKS) -> list[Claim]:
    """Let a tracker run for so many scans, and look at it so often."""
    tracker: Tracker = TRACKERS[kind](RADARS, region=REGION, time_limit=None)
    watch, least = Watch(count // looks), np.inf
    errors: list[float] = []
    for number, (when, measurements, targets) in enumerate(scans(count, rng), start=1):
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
        Claim(f"{kind}: scans", ours=count),
        *watch.claims(kind),
        _limited(f"{kind}: least eigenvalue of a correlation matrix", least, None, least=1e-12),
        _limited(f"{kind}: distance to the next track, second half / first", worse, 1.5, least=0.5),
    ]


# --- all in one process ---------------------------------------------------------------------------------------


def guarded(work: Callable[[], object], label: str, faults: Faults) -> None:
    """Do the work; what it raises, other than an `AssocError`, is a fault."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            work()
    except AssocError:
        pass
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        own = [frame for frame in traceback.extract_tb(error.__traceback__) if "/assoc/" in frame.filename] or [last]
        kind = f"{type(error).__name__} at {Path(own[-1].filename).name}:{own[-1].lineno}: {str(error)[:100]}"
        faults[kind] += 1
        if faults[kind] <= 3:
            print(f"{label}: {kind}", flush=True)


def run(seed: int, problems: range, steps: int, minutes: float = math.inf) -> tuple[Faults, Faults, Watch]:
    """Answer the problems, and between them track until there were so many steps; counts, faults, and the memory."""
    last = time.monotonic() + 60.0 * minutes
    counts, faults, watch = Counter[str](), Counter[str](), Watch(max(len(problems), 1) // LOOKS)
    judge, session, said = Judge(seed, [*WAYS, *LISTED], each=1), problems.start, time.perf_counter()
    with tempfile.TemporaryDirectory() as name:
        for place, number in enumerate([*problems] or [0], start=1):
            if len(problems):
                counts["problems"] += 1
                _, _, lines, compared = judge(number)
                counts.update({what: count for what, count in compared.items() if what not in judge.names})
                for line in lines:
                    print(f"seed {seed} problem {number}: {line}", flush=True)
                    faults[" ".join(line.split()[:4])] += 1
            while counts["steps"] < steps * place // max(len(problems), 1):
                ways = (lambda at: track_some(seed, at, Path(name), counts), lambda at: deliver_late(seed, at, counts))
                for way in ways:
                    guarded(lambda way=way, at=session: way(at), f"seed {seed} session {session}", faults)
                session += 1
            if time.monotonic() > last:
                break
            if watch.add(place) and len(watch.pace) == LOOKS // 10:
                limit_memory()
            if time.perf_counter() - said > _PROGRESS:
                said = time.perf_counter()
                print(f"... {dict(counts)}, {sum(faults.values())} faults", flush=True)
    return counts, faults, watch


def main(arguments: list[str] | None = None) -> int:
    """Run the program; exit code 1 if something is not as it should be."""
    parser = argparse.ArgumentParser(description="Mixed problems and steps of trackers, and long sessions.")
    parser.add_argument("--problems", type=int, default=20_000)
    parser.add_argument("--steps", type=int, default=5_000, help="of sessions, between the problems")
    parser.add_argument("--scans", type=int, default=0, help="of the multi-sensor tracker's long session")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--start", type=int, default=0, help="number of the first problem")
    add_ends(parser)
    chosen = parser.parse_args(arguments)
    faulthandler.enable()
    counts, faults, watch = run(
        chosen.seed, range(chosen.start, chosen.start + chosen.problems), chosen.steps, chosen.minutes
    )
    rng = np.random.default_rng(chosen.seed)
    name = chosen.publish or "endurance"
    claims = [*watch.claims(name, growth=20.0), *sampled_claims(name, counts)]
    for kind, share in LONG.items() if chosen.scans else ():
        claims += follow(kind, int(share * chosen.scans), rng)
    return report("endurance", chosen.publish, counts, faults, claims)


if __name__ == "__main__":
    sys.exit(main())
