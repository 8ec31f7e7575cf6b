"""Scenes from a file outside of the project: read, tracked by all, and judged as they should be."""

import numpy as np
import pytest

from experiments.trackers import unseen

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


def test_all_trackers_follow_an_easy_scene(tmp_path):
    (tmp_path / "scenes.py").write_text(FILE)
    module = unseen.cases(tmp_path / "scenes.py")
    case = module.make("three", 1)
    found = unseen.runs(case)
    assert {"oracle", "plain GNN", "multi-sensor", "multi-sensor, adapting"} <= {*found}
    targets = len(np.unique(np.concatenate(case.scene.truth.target_ids)))
    for name, (distance, false, missed) in found.items():
        # squared, no scan is further than what it misses and adds, and twelve scans show most of the targets
        assert 0 < distance < 500 * np.sqrt(0.5 * targets) and 0 <= false < 1 and 0 <= missed < 0.5 * targets, name
    assert found["oracle"][0] <= min(values[0] for values in found.values()) + 1e-9


def test_a_file_without_scenes_is_refused(tmp_path):
    (tmp_path / "scenes.py").write_text("x = 1\n")
    with pytest.raises(ValueError, match="scenes.py: expected a function make"):
        unseen.cases(tmp_path / "scenes.py")
