"""Mixed problems and mixed steps of trackers in one process: does it live, and is memory left as it should be?

    python -m tests.reliability.endurance --problems 20000 --steps 5000 --seed 1

Every problem of problems.py goes one way of differential.py, in turn; tracking sessions take all trackers and filters,
plots that are late, doubled, missing or crowded, and go through files. Under ``NUMBA_BOUNDSCHECK=1`` (with a cache of
its own: ``NUMBA_CACHE_DIR``), kernels raise IndexError where they would read or write beyond an array; with
``PYTHONMALLOC=debug MALLOC_PERTURB_=165`` what is freed is overwritten. Answers are compared elsewhere: here only
errors that no input may cause count as faults, and the death of the process.
"""

import argparse
import faulthandler
import gc
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from assoc.errors import AssocError
from assoc.ranking.marginals import weighed
from assoc.scene import Scene
from assoc.simulation import simulate
from assoc.tracking import TRACKERS, LatePlots
from assoc.tracking.filter_choice import FILTERS, make_filter
from tests.reliability.differential import LISTED, WAYS
from tests.reliability.problems import draw

SCANS = 8
"""Scans of a tracking session."""
_SCENES = ("three-radar", "rotating-radar", "bearing-only", "crowd")
_PROGRESS = 60.0


def solve_one(seed: int, number: int) -> None:
    """Draw a problem, and answer it in the way whose turn it is."""
    problem = draw(seed, number).problem
    name = [*WAYS, *LISTED][number % (len(WAYS) + len(LISTED))]
    if name in LISTED:
        widest, length = LISTED[name]
        weighed(problem, None, widest, length)
    else:
        WAYS[name](problem)


def track_some(seed: int, number: int, folder: Path, stepped: Callable[[], None]) -> None:
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
        stepped()
        try:
            (tracker if late is None else late).step(float(scene.times[k]), measurements, stamps)
        except AssocError:
            continue
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
    rng: np.random.Generator, measurements: list[Any], stamps: list[Any], waiting: list[list[tuple[float, Any]]]
) -> tuple[list[Any], list[Any]]:
    """Keep some measurements for later, and deliver some of those that were kept."""
    values, times = [], []
    for z, own, kept in zip(measurements, stamps, waiting, strict=True):
        now = rng.random(len(z)) < 0.8
        come = [kept.pop() for _ in range(len(kept)) if rng.random() < 0.5 and kept]
        kept.extend(zip(own[~now].tolist(), z[~now], strict=True))
        values.append(np.concatenate([z[now], *(row[None] for _, row in come)]))
        times.append(np.concatenate([own[now], [time for time, _ in come]]))
    return values, times


def guarded(work: Callable[[], object], label: str, faults: Counter[str]) -> None:
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
        if faults[kind] == 1:
            print(f"{label}: {kind}", flush=True)


def run(seed: int, problems: range, steps: int) -> tuple[int, int, Counter[str]]:
    """Answer the problems, and between them track until there were so many steps; problems, steps and faults."""
    faults: Counter[str] = Counter()
    done = session = 0
    said = time.perf_counter()

    def stepped() -> None:
        nonlocal done
        done += 1

    with tempfile.TemporaryDirectory() as name:
        for place, number in enumerate([*problems] or [0]):
            if len(problems):
                guarded(lambda number=number: solve_one(seed, number), f"seed {seed} problem {number}", faults)
            share = steps * (place + 1) // max(len(problems), 1)
            while done < share:
                at = session + problems.start
                guarded(lambda at=at: track_some(seed, at, Path(name), stepped), f"seed {seed} session {at}", faults)
                session += 1
            if place % 100 == 99:
                # a damaged object is met here at the latest
                gc.collect()
            if time.perf_counter() - said > _PROGRESS:
                said = time.perf_counter()
                print(f"... {place + 1} problems, {done} steps, {sum(faults.values())} faults", flush=True)
    return len(problems), done, faults


def main(arguments: list[str] | None = None) -> int:
    """Run the program; exit code 1 if there were faults."""
    parser = argparse.ArgumentParser(description="Mixed problems and steps of trackers in one process.")
    parser.add_argument("--problems", type=int, default=20_000)
    parser.add_argument("--steps", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--start", type=int, default=0, help="number of the first problem")
    chosen = parser.parse_args(arguments)
    faulthandler.enable()
    started = time.perf_counter()
    solved, stepped, faults = run(chosen.seed, range(chosen.start, chosen.start + chosen.problems), chosen.steps)
    print(f"{solved} problems, {stepped} steps, {time.perf_counter() - started:.0f} s: {sum(faults.values())} faults")
    for kind, count in faults.most_common():
        print(f"{count:6d} {kind}")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
