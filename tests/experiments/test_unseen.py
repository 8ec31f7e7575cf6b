"""Scenes from a file outside of the project: read, tracked by all, and judged as they should be."""

import numpy as np
import pytest

from assoc.tracking import TRACKERS
from assoc.tracking.records.estimates import ALARMS, DETECTION, NOISE
from experiments.trackers import recorded, unseen
from experiments.trackers.real_scenes import ROWS

FILE = """
from dataclasses import dataclass, field
from assoc.simulation import simulate

@dataclass
class Case:
    scene: object
    cutoff: float = 500.0
    plane: bool = False
    targets: object = None
    opts: dict = field(default_factory=dict)
    oracle: object = None

CASES = {"three": lambda seed: Case(simulate("three-radar", seed, scans=12))}

def make(name, seed):
    return CASES[name](seed)
"""


@pytest.mark.slow
def test_all_trackers_follow_an_easy_scene(tmp_path):
    pytest.importorskip("stonesoup")
    (tmp_path / "scenes.py").write_text(FILE)
    found = unseen.runs((tmp_path / "scenes.py", "three", 1, unseen.NAMES))
    case = unseen.cases(tmp_path / "scenes.py").make("three", 1)
    targets = len(np.unique(np.concatenate(case.scene.truth.target_ids)))
    for name, (distance, false, missed, changes) in found.items():
        # squared, no scan is further than what it misses and adds, and twelve scans show most of the targets
        assert 0 < distance < 500 * np.sqrt(0.5 * targets) and 0 <= false < 1 and 0 <= missed < 0.5 * targets, name
        assert 0 <= changes < 10
    # others have other filters
    assert found["oracle"][0] <= min(found[name][0] for name in unseen.NAMES if name.startswith(unseen.CHOSEN)) + 1e-9


@pytest.mark.slow
def test_without_its_parts_nothing_adapts():
    def tracked(adapt):
        return unseen.tracked(TRACKERS["multi-sensor"].for_scene(scene, adapt=adapt), scene).positions

    scene = ROWS["noise twice the declared"](3).declared
    every = {name: other for changes in unseen.PARTS.values() for name, other in changes.items()}
    with unseen.without(every | {unseen.SETTLED: unseen.as_declared(NOISE, DETECTION, ALARMS)}):
        none = tracked(True)
    with unseen.without(unseen.PARTS["noise and manoeuvres"]):
        some = tracked(True)
    np.testing.assert_array_equal(none, tracked(False))
    assert not np.array_equal(tracked(True), none) and not np.array_equal(tracked(True), some)


def test_reports_of_ships_are_tracked(tmp_path):
    lines = ["Time,MMSI,Latitude_degrees,Longitude_degrees"]
    for k in range(60):
        clock = f"2016-01-12 13:{2 + k // 12:02}:{5 * (k % 12):02}.0"
        # 5 m/s north, half a nautical mile apart
        lines += [f"{clock},{ship},{50.7 + 25 * k / 111e3},{-1.1 + 0.02 * ship}" for ship in range(3)]
    (tmp_path / "ais.csv").write_text("\n".join(lines))
    kind = "AIS every 10 s"
    found = unseen.runs((tmp_path / "ais.csv", kind, 0, ("oracle", "plain GNN", "multi-sensor, adapting")))
    assert recorded.case(tmp_path / "ais.csv", kind).scene.num_scans == 30
    for name, (_, false, missed, changes) in found.items():
        assert false < 0.1 and missed < 0.5 and changes == 0, name


def test_a_file_without_scenes_is_refused(tmp_path):
    (tmp_path / "scenes.py").write_text("x = 1\n")
    with pytest.raises(ValueError, match="scenes.py: expected a function make"):
        unseen.cases(tmp_path / "scenes.py")
