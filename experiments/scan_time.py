"""From one scan's measurements to a proven answer: what a tracker without tracks waits for, part by part.

Each scene is taken apart as often as it takes a tenth of a second, and the median counts: ``build_problem`` (the tuples
within the gates, their positions and costs), ``AssignmentProblem`` of tuples and costs that are there already (for
users with costs of their own), ``exact`` and ``greedy``, both with their bounds. A problem prepares itself at the
first call of a solver: each call has a new one. HiGHS, from the tuples to the chosen tuples, is there to compare with:
ratios say more than times of one machine. Processor time of one thread, pinned to a core, kernels compiled.
"""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

import assoc
from assoc.scene import Scene
from assoc.simulation import simulate
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.common.contestants import run
from experiments.common.instances import scenes
from experiments.common.measuring import fresh, one_core


class Kind(NamedTuple):
    """Scenes that are alike.

    goal: Milliseconds that building and solving may take.
    """

    make: Callable[[int], Scene]
    goal: float | None = None


KINDS = {
    "three radars, 3 targets": Kind(lambda seed: simulate("three-radar", seed, scans=1)),
    "3 sensors x 100 targets": Kind(lambda seed: scenes.gated(3, 100, seed)),
    "3 sensors x 300 targets": Kind(lambda seed: scenes.gated(3, 300, seed)),
    "3 sensors x 1,000 targets": Kind(lambda seed: scenes.gated(3, 1000, seed), 15.0),
}
PARTS = ("build_problem", "exact", "AssignmentProblem", "greedy", "HiGHS")
TOGETHER = "build_problem and exact"
_SCENES = 10
_SECONDS, _MOST = 0.1, 40


def median_ms(call: Callable[[Any], Any], prepare: Callable[[], Any] = lambda: None) -> float:
    """Median of the processor time of a call, milliseconds; what it is given is made anew each time, and not timed."""
    call(prepare())
    spent: list[float] = []
    while len(spent) < 3 or (sum(spent) < _SECONDS and len(spent) < _MOST):
        given = prepare()
        begin = time.thread_time()
        call(given)
        spent.append(time.thread_time() - begin)
    return 1e3 * float(np.median(spent))


def parts_of(scene: Scene) -> dict[str, float]:
    """Milliseconds of each part, for the first scan of a scene."""
    problem = assoc.build_problem(scene, 0)

    return {
        "build_problem": median_ms(lambda _: assoc.build_problem(scene, 0)),
        "exact": median_ms(assoc.assign, lambda: assoc.build_problem(scene, 0)),
        "AssignmentProblem": median_ms(lambda _: fresh(problem)),
        "greedy": median_ms(lambda given: assoc.assign(given, "greedy"), lambda: fresh(problem)),
        "HiGHS": median_ms(lambda given: run("highs", given, 60.0), lambda: fresh(problem)),
    }


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Take scenes of every kind apart."""
    claims = []
    with one_core():
        for name, kind in KINDS.items():
            seeds = rng.integers(2**31, size=2 if quick else _SCENES)
            found = [parts_of(kind.make(int(seed))) for seed in seeds]
            medians = {part: float(np.median([times[part] for times in found])) for part in PARTS}
            both = [times["build_problem"] + times["exact"] for times in found]
            ratio = float(np.median([times["HiGHS"] / times["exact"] for times in found]))
            source = "" if kind.goal is None else "goal chosen by us"
            band = None if kind.goal is None else (None, kind.goal)
            claims += [
                Claim(f"{name}: {TOGETHER}", "ms", None, float(np.median(both)), None, band, source=source),
                *(Claim(f"{name}: {part}", "ms", None, value) for part, value in medians.items()),
                Claim(f"{name}: HiGHS / exact", "", None, ratio),
            ]
    return claims


if __name__ == "__main__":
    raise SystemExit(main("scan_time", experiment, __doc__))
