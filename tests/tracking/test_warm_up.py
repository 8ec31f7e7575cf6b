"""What ``warm_up`` promises: no step, ranking, probability or link meets a kernel that is not loaded."""

import pytest

from tests.running import process

_PROGRAM = """
import assoc, warnings
import numpy as np
from assoc._system.compiled import loaded
from assoc.simulation import simulate
from assoc.tracking import TRACKERS, LatePlots
from assoc.tracking.filter_choice import FILTERS, make_filter
from assoc.tracking.warm_up import follow

warnings.simplefilter("ignore")
assoc.warm_up()
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
for words in ({}, {"memory": 2, "predict": True}, {"divisions": 2.0, "merges": 2.0}):
    assoc.link(points, 3.0, **words)
if loaded()[0] != before:
    print("rankings, links and filters", loaded()[0] - before)
"""


@pytest.mark.slow
def test_nothing_compiles_or_loads():
    done = process("-c", _PROGRAM)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
