"""Would trackers gain by warm starts? Problems of scan after scan, solved with none, a sensible one and the best one.

    python -m experiments.trackers.warm_starts [--quick] [--seed N] [--json FILE] [--figure FILE] [--publish]

Every problem that a tracker gives its solver is solved three times (the least CPU time of three calls counts): without
a start, with what the tracks suggest (each track its cheapest tuple, the best first; of the tracker mht the hypothesis
that grew out of that of the last scan), and with the optimum itself, which no start can beat. 8 scans of each scene.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

import assoc
from assoc._types import Array
from assoc.problem import AssignmentProblem
from assoc.scene import Scene
from assoc.solution import Solution
from assoc.tracking import TRACKERS, TrackOrientedMHT
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.trackers.close_scenes import SETTINGS, simulate

SCENES = ("formations, 150 false alarms", "formations, unequal radars, P_d 0.6")
NAMES = ("multi-sensor", "static", "mht")
SOLVERS: dict[str, dict[str, Any]] = {"exact": {"nodes": 1_000, "patience": 0}, "aco": {}, "genetic": {}, "tabu": {}}
STARTS = ("no start", "the tracks'", "the optimum")
_CALLS = 3


def begin_with(problem: AssignmentProblem, chosen: Array) -> Solution:
    """Return these tuples, and every measurement that none of them has as a false alarm, as a start."""
    rows = [problem.tuples[chosen]]
    for s, size in enumerate(problem.sizes.tolist()):
        free = np.setdiff1d(np.arange(1, size + 1), rows[0][:, s])
        alone = np.zeros((len(free), problem.num_sensors), dtype=np.int32)
        alone[:, s] = free
        rows.append(alone)
    tuples = np.concatenate(rows)
    return Solution(tuples, np.zeros(len(tuples), dtype=np.intp), 0.0, -np.inf, "start", 0, 0.0)


def by_tracks(problem: AssignmentProblem) -> Solution:
    """Each track (the first list) takes its cheapest tuple, the best track first."""
    used = [np.zeros(size + 1, dtype=np.bool_) for size in problem.sizes.tolist()]
    chosen = []
    for row in np.argsort(problem.costs, kind="stable").tolist():
        members = [(s, i) for s, i in enumerate(problem.tuples[row].tolist()) if i]
        if problem.tuples[row, 0] and problem.costs[row] < 0 and not any(used[s][i] for s, i in members):
            chosen.append(row)
            for s, i in members:
                used[s][i] = True
    return begin_with(problem, np.array(chosen, dtype=np.int64))


def problems(name: str, scene: Scene) -> list[tuple[AssignmentProblem, Solution | None]]:
    """What a tracker gives its solver, in order, and the start that it has at hand (None: its tracks alone)."""
    # with a parameter of its own the solver is asked every scan by mht, too
    tracker = TRACKERS[name].for_scene(scene, solver_parameters={"patience": 0})
    found: list[tuple[AssignmentProblem, Solution | None]] = []
    ask = tracker._assign

    def note(problem: AssignmentProblem) -> Solution:
        start = None
        if isinstance(tracker, TrackOrientedMHT):
            worth = np.flatnonzero(tracker._batch.score > 0)
            start = begin_with(problem, np.flatnonzero(tracker._chosen[worth]))
        found.append((problem, start))
        return ask(problem)

    tracker._assign = note  # type: ignore[method-assign]
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        tracker.step(scan.time, scan.measurements, scan.times, scan.sectors)
    return found


def compare(given: list[tuple[AssignmentProblem, Solution | None]], solver: str) -> Array:
    """CPU milliseconds and cost above the optimum of each problem and each kind of start, (problems, 3, 2)."""
    found = np.zeros((len(given), len(STARTS), 2))
    for i, (problem, known) in enumerate(given):
        best = assoc.assign(problem, advise=False)
        for kind in range(len(STARTS)):
            least = np.inf
            for _ in range(_CALLS):
                begun = time.process_time()
                start = [None, known, best][kind]
                if kind == 1 and start is None:
                    start = by_tracks(problem)
                options = SOLVERS[solver]
                cost = assoc.assign(problem, solver, seed=1, start=start, advise=False, **options).cost
                least = min(least, time.process_time() - begun)
            found[i, kind] = 1e3 * least, cost - best.cost
    return found


def experiment(quick: bool, rng: np.random.Generator) -> tuple[list[Claim], Any]:
    """All scenes, trackers and solvers."""
    seed = int(rng.integers(2**31))
    claims, shown = [], {}
    for label in SCENES[: 1 if quick else None]:
        scene = simulate(SETTINGS[label], seed, 3 if quick else 8)
        for name in NAMES:
            given = problems(name, scene)
            for solver in SOLVERS:
                found = compare(given, solver)
                means = found.mean(axis=0)
                shown[label, name, solver] = means[:, 0]
                for kind, (milliseconds, above) in zip(STARTS, means.tolist(), strict=True):
                    words = f"{label}, {name}, {solver}, {kind}"
                    claims.append(Claim(f"{words}: CPU time of a problem", "ms", ours=milliseconds))
                    claims.append(Claim(f"{words}: cost above the optimum", "", ours=max(above, 0.0)))
    return claims, shown


def draw(figure: Any, shown: Any) -> None:
    """CPU time of a problem with each kind of start, as a multiple of that without."""
    axes = figure.subplots()
    places = np.arange(len(shown))
    for kind, words in list(enumerate(STARTS))[1:]:
        axes.plot([times[kind] / times[0] for times in shown.values()], places, "o", label=words)
    axes.axvline(1.0, color="black", linewidth=1, linestyle=":")
    axes.set_yticks(places, [", ".join(words) for words in shown], fontsize=7)
    axes.set(xlabel="CPU time with a start / without", xlim=(0.0, None))
    axes.invert_yaxis()
    axes.legend(fontsize=8, frameon=False)


TITLE = "Warm starts of trackers' problems"


def program(arguments: list[str] | None = None) -> int:
    """Run the measurement; returns its exit code."""
    return main("trackers.warm_starts", TITLE, experiment, draw, (9, 6), arguments, about=__doc__)


if __name__ == "__main__":
    raise SystemExit(program())
