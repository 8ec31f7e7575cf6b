"""Tracks do not depend on the clock: what ends a solver's work on a scan is counted."""

import itertools
import time

import numpy as np
import pytest

from assoc import simulation
from assoc.errors import LimitExceededError
from assoc.tracking import TRACKERS, MultiSensorTracker, TrackTable, track_scene


@pytest.fixture
def scene():
    # bearings cross where no target is: the assignment problems need branching
    return simulation.simulate("bearing-only", 3, scans=3)


def rows(tracker, scene):
    table, decisions = track_scene(tracker, scene, confirmed=False)
    assert isinstance(table, TrackTable) and len(table)
    return table.to_frame().to_csv(), [one.assigned[0].tolist() for one in decisions]


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(TRACKERS))
def test_a_slow_clock_changes_nothing(name, scene, monkeypatch):
    crowd = simulation.simulate("crowd", 1, targets=12, scans=3, width=400.0, height=300.0)
    quick = rows(TRACKERS[name].for_scene(crowd), crowd)
    # every look at the clock finds a minute gone
    minutes = itertools.count(start=1e6, step=60.0)
    for clock in ("perf_counter", "monotonic", "process_time"):
        monkeypatch.setattr(time, clock, lambda: next(minutes))
    assert rows(TRACKERS[name].for_scene(crowd), crowd) == quick


@pytest.mark.parametrize("seed", (200, 201))
def test_the_default_holds_a_target_through_five_g(seed):
    """The second target of the three-radar scene turns at 12 s and at 23 s."""
    scene = simulation.simulate("three-radar", seed, scans=35)
    table, _ = track_scene(MultiSensorTracker.for_scene(scene), scene)
    frame = table.to_frame()
    assert frame.track_id.nunique() == 3
    assert (frame.groupby("track_id").size() >= 34).all()


@pytest.mark.parametrize("own_times", [False, True])
def test_candidates_of_a_step_are_limited_before_they_take_memory(own_times):
    """Thirty copies of each measurement belong to each track thirty times over, at each of three radars."""
    scene = simulation.simulate("three-radar", 3, scans=5)
    tracker = TRACKERS["joint-probabilistic"].for_scene(scene, max_tuples=1000)
    for k in range(4):
        tracker.step(float(scene.times[k]), scene.scan(k).measurements)
    crowd = [np.asarray(z).repeat(60, axis=0) for z in scene.scan(4).measurements]
    stamps = [np.linspace(scene.times[3] + 0.5, scene.times[4], len(z)) if own_times else None for z in crowd]
    before = tracker.state
    with pytest.raises(LimitExceededError, match="more than max_tuples = 1000; lower gate_probability"):
        tracker.step(float(scene.times[4]), crowd, stamps if own_times else None)
    assert tracker.state is before
