"""What ``warm_up`` promises: no solver, step, ranking, probability or link meets a kernel that is not loaded."""

import pytest

import assoc
from assoc.errors import InvalidInputError
from tests.running import process

_PROGRAM = """
import assoc, warnings
import numpy as np
from assoc._system.compiled import loaded
from assoc.costs import emission_times, positions_and_covariances
from assoc.simulation import simulate
from assoc.tracking import TRACKERS, LatePlots
from assoc.tracking.filter_choice import FILTERS, make_filter
from assoc.tracking.warm_up import follow
from experiments.common.instances import scenes as instances, synthetic

warnings.simplefilter("ignore")
problems = [assoc.build_problem(instances.ghost(20, 2), 0), assoc.build_problem(instances.gated(4, 40, 1), 0)]
problems += [synthetic.axial_random(11, 0), synthetic.planted(5, 0)[0]]
assoc.warm_up()
before = loaded()[0]
for problem in problems:
    for solver in ("exact", "lagrangian", "aco", "genetic", "tabu", "greedy"):
        assoc.assign(problem, solver)
        assoc.assign(problem, solver, time_limit=60.0, seed=1)
if loaded()[0] != before:
    print("solvers", loaded()[0] - before)
scenes = [
    simulate("crowd", 5, targets=40, scans=4, width=8000.0),
    simulate("crowd", 6, targets=60, scans=3, width=3000.0),
    simulate("crowd", 7, targets=15, scans=4, sensor="radar", width=20000.0),
    simulate("bearing-only", 8, targets=8, scans=4),
    simulate("three-radar", 9, scans=5),
]
for scene in scenes:
    for name in TRACKERS:
        if name == "mht-hypothesis" and scene is scenes[1]:
            continue
        for own_times in (False, True):
            before = loaded()[0]
            follow(TRACKERS[name].for_scene(scene), scene, own_times)
            if loaded()[0] != before:
                print(scene.name, name, own_times, loaded()[0] - before)

before = loaded()[0]
for name in FILTERS:
    scene = scenes[0 if name == "kalman" else 4]
    tracker = TRACKERS["nearest-neighbour"].for_scene(scene, filter=make_filter(name, scene.sensors))
    follow(LatePlots(tracker), scene, True)
rng = np.random.default_rng(4)
points = [rng.uniform(0, 60, (50, 2)) for _ in range(8)]
for problem in (rng.random((30, 40)), rng.normal(size=(70, 70)), assoc.build_problem(scenes[4], 1)):
    assoc.kbest(problem, 5)
    assoc.marginals(problem, time_limit=1.0)
assoc.kbest(assoc.AssignmentProblem.from_dense(rng.normal(size=(6, 6, 6))), 200)
for words in ({}, {"memory": 2, "predict": True}, {"divisions": 2.0, "merges": 2.0}):
    assoc.link(points, 3.0, **words)
for depth in (20e3, 0.0):
    heard = simulate("arrival-times", 3, scans=1, stations=12, depth=depth)
    for density in (None, "auto"):
        tuples = assoc.build_problem(heard, 0, target_density=density).tuples
        emission_times(heard, 0, tuples)
        positions_and_covariances(heard, 0, tuples)
if loaded()[0] != before:
    print("rankings, links, filters and arrival times", loaded()[0] - before)
"""


@pytest.mark.slow
def test_nothing_compiles_or_loads():
    done = process("-c", _PROGRAM)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


def test_unknown_solver():
    with pytest.raises(InvalidInputError, match="solver: unknown name 'antz'"):
        assoc.warm_up(["antz"])
