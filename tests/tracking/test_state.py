"""A tracker is its settings and one state: a step that is thrown away never was, and a file is the state."""

from functools import cache

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.filters import ConstantVelocity, EnsembleKalmanFilter
from assoc.simulation import simulate
from assoc.tracking import TRACKERS, IdentityParameters
from assoc.tracking.file import FORMAT, file_arrays
from tests.sizes import sample

# scenes of one instant, of own times and sectors, and of bearings alone, where a starter begins tracks
SCENES = {
    "three-radar": {"scans": 6},
    "rotating-radars": {"aircraft": 3, "duration": 12.0},
    "bearing-only": {"targets": 3, "scans": 8},
}


@cache
def scene(name):
    return simulate(name, 1, **SCENES[name])


def given(one, k, codes=False):
    """What a step is given: with `codes` each measurement tells its target."""
    scan = one.scan(k)
    told = [np.stack([np.maximum(source + 1, 0), np.zeros_like(source)], axis=1) for source in scan.sources]
    return scan.time, scan.measurements, scan.times, scan.sectors, told if codes else None


def content(tracker):
    """The state, byte for byte."""
    arrays = file_arrays(tracker.settings, tracker.state)
    return {name: (value.dtype.str, value.shape, value.tobytes()) for name, value in arrays.items()}


def said(step):
    decisions = [(one.scan, one.time, [ids.tolist() for ids in one.assigned]) for one in (step, *step.final)]
    return decisions, step.ended.tolist()


def ensemble():
    return EnsembleKalmanFilter(ConstantVelocity(20.0, kind="continuous"), 20, 1)


# name of the scene, what the tracker is made with, whether measurements tell codes
KINDS = [
    *((tracker, name, dict, False) for tracker in TRACKERS for name in SCENES),
    *((tracker, "three-radar", lambda: {"registration": "online"}, False) for tracker in ("static", "mht")),
    *((tracker, "rotating-radars", lambda: {"identity": IdentityParameters()}, True) for tracker in TRACKERS),
    *((tracker, name, lambda: {"filter": ensemble()}, False) for tracker, name in
      [("mht", "three-radar"), ("nearest-neighbour", "bearing-only")]),
]  # fmt: skip


@sample("kind, name, options, codes", KINDS, every=4)
def test_a_step_that_is_thrown_away_never_was(kind, name, options, codes):
    one = scene(name)
    plain, other = (TRACKERS[kind].for_scene(one, **options()) for _ in range(2))
    for k in range(one.num_scans):
        before, known = other.state, content(other)
        # the scan after the next, and nothing at all
        other.step(*given(one, min(k + 1, one.num_scans - 1), codes))
        other.step(one.times[-1] + 1.0, [z[:0] for z in one.measurements[0]])
        other.state = before
        assert content(other) == known
        assert said(plain.step(*given(one, k, codes))) == said(other.step(*given(one, k, codes)))
        assert content(plain) == content(other)
    assert [said_of.scan for said_of in plain.flush()] == [said_of.scan for said_of in other.flush()]


@sample("kind, name, options, codes", KINDS, every=4)
def test_a_tracker_saved_in_the_middle_of_a_scene_goes_on(kind, name, options, codes, tmp_path):
    one = scene(name)
    plain, other = (TRACKERS[kind].for_scene(one, **options()) for _ in range(2))
    half = one.num_scans // 2
    for k in range(half):
        plain.step(*given(one, k, codes))
    plain.save(tmp_path / "state.npz")
    other.restore(tmp_path / "state.npz")
    assert content(plain) == content(other)
    for k in range(half, one.num_scans):
        assert said(plain.step(*given(one, k, codes))) == said(other.step(*given(one, k, codes)))
    assert content(plain) == content(other)


def test_a_file_of_version_1_is_refused(tmp_path):
    tracker, path = TRACKERS["mht"].for_scene(scene("three-radar")), tmp_path / "state.npz"
    np.savez(path, format=np.array(FORMAT), version=np.array(1), settings=np.array("{}"))
    with pytest.raises(InvalidInputError, match=r"state\.npz: has version 1 of 'assoc\.tracker', .* version 8 only"):
        tracker.restore(path)
