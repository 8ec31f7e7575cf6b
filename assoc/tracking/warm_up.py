"""Compile all kernels before the first scan: of solvers, rankings, probabilities and trackers."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterable
from typing import Any

import numpy as np

from assoc._system.compiled import compile_ahead, wait_for_kernels
from assoc._system.interpreted import compiled_only
from assoc._system.wrong_types import explains_wrong_types
from assoc.costs import build_problem, positions_and_covariances
from assoc.errors import AssocWarning
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.ranking.kbest import kbest, rank
from assoc.ranking.marginals import marginals
from assoc.ranking.pairs.messages import bound_pairs
from assoc.scene.scene import Scene
from assoc.simulation import simulate
from assoc.solvers import warm_up as of_solvers
from assoc.tracking import TRACKERS
from assoc.tracking.filter_choice import FILTERS, make_filter
from assoc.tracking.tracker import Tracker

# many targets, and trackers that have kernels for these alone
_CROWDS = {60: ("mht", "joint-probabilistic"), 250: ("multi-sensor",)}


@explains_wrong_types
def warm_up(solvers: Iterable[str] | None = None) -> float:
    """Compile all kernels, or load them, so that no later call has to: of solvers, `kbest`, `marginals`, trackers.

    Call it once after installation, when it takes a minute or two and uses two processes. Afterwards it takes some
    seconds, and can be called at the start of a program with time limits. On a terminal it shows progress on stderr.

    Parameters
    ----------
    solvers : iterable of str, optional
        Names of solvers, for these alone; by default all but ``milp``, which compiles little itself, and all else:
        trackers with each of their filters.

    Returns
    -------
    float
        Seconds that the call took.

    Raises
    ------
    InvalidInputError
        A name is not that of a solver.
    """
    started = time.perf_counter()
    of_solvers.warm_up(solvers)
    if solvers is None:
        # another process ranks meanwhile
        compile_ahead(bound_pairs, rank_all, anyway=True)
        follow_all()
        wait_for_kernels()
        rank_all()
    return time.perf_counter() - started


def follow_all() -> None:
    """Compile the kernels of trackers, with each of their filters."""
    with compiled_only(), warnings.catch_warnings():
        warnings.simplefilter("ignore", AssocWarning)
        scenes = _scenes()
        for scene in scenes:
            for kind in TRACKERS.values():
                for own_times in (False, True):
                    follow(kind.for_scene(scene), scene, own_times)
        for name in FILTERS:
            scene = scenes[0 if name == "kalman" else 2]
            chosen = make_filter(name, scene.sensors)
            for own_times in (False, True):
                follow(TRACKERS["multi-sensor"].for_scene(scene, filter=chosen), scene, own_times)
        for targets, names in _CROWDS.items():
            scene = simulate("crowd", 5, targets=targets, scans=3, width=50.0 * targets)
            for name in names:
                follow(TRACKERS[name].for_scene(scene), scene, False)


def rank_all() -> None:
    """Rank and weigh matrices, with and without all rows matched, and a scan; branch for three lists; arrival times."""
    rng = np.random.default_rng(3)
    # the last is too wide for exact sums
    costs, small, wide = rng.normal(size=(12, 12)), np.zeros((2, 3)), rng.normal(size=(50, 50))
    scene = simulate("crowd", 5, targets=20, scans=1, width=1_000.0)
    with compiled_only(), warnings.catch_warnings():
        warnings.simplefilter("ignore", AssocWarning)
        for problem in (
            costs,
            small,
            wide,
            AssignmentProblem.from_matrix(costs, unassigned=0.5),
            build_problem(scene, 0),
        ):
            kbest(problem, 4)
            marginals(problem, time_limit=1.0)
        # at once, which harder ones do after some thousands of steps
        rank(AssignmentProblem.from_dense(rng.normal(size=(5, 5, 5))), 20, Run(0), budget=0)
        for depth, density in ((5e3, None), (5e3, "auto"), (0.0, None)):
            heard = simulate("arrival-times", 1, scans=1, stations=10, depth=depth)
            positions_and_covariances(heard, 0, build_problem(heard, 0, target_density=density).tuples[:9])


def follow(tracker: Tracker, scene: Scene, own_times: bool) -> None:
    """Give a tracker the scans of a scene, as of one instant or with times of their own."""
    for when, z in zip(scene.times, scene.measurements, strict=True):
        tracker.step(float(when), z, [np.full(len(rows), when) for rows in z] if own_times else None)


def _scenes() -> list[Scene]:
    """Few targets close together, seen by each kind of sensor; bearings alone, which begin tracks where they cross."""
    few: dict[str, Any] = {"targets": 6, "scans": 5, "interval": 4.0, "width": 3_000.0}
    return [
        *(simulate("crowd", 1, sensor=sensor, **few) for sensor in ("position", "radar")),
        simulate("three-radar", 1, scans=4),
        simulate("bearing-only", 1, targets=4, scans=4),
    ]
