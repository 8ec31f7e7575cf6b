"""What ``warm_up`` promises for trackers: no step meets a kernel that is not loaded."""

import pytest

from tests.running import process

_PROGRAM = """
import assoc, warnings
from assoc._system.compiled import loaded
from assoc.simulation import simulate
from assoc.tracking import TRACKERS
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
"""


@pytest.mark.slow
def test_no_step_compiles_or_loads():
    done = process("-c", _PROGRAM)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
