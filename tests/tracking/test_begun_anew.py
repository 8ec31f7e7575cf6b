"""A tentative track that began with a false alarm does not hold back the target whose measurements it takes."""

import numpy as np
import pytest

from assoc.scene import Scene
from assoc.sensors import PositionSensor
from assoc.tracking import TRACKERS, Initiation, smoothed, track_scene
from assoc.tracking.filter_choice import two_speeds

RADAR = PositionSensor(
    position=[0.0, 0.0, 0.0], noise=[6.0, 6.0], detection_probability=0.9, false_alarm_rate=3.0,
    field_of_view=[[-300.0, 300.0], [-300.0, 300.0]],
)  # fmt: skip
REGION = np.array([[-300.0, 300.0], [-300.0, 300.0], [-1.0, 1.0]])
NOTHING = np.zeros((0, 2))


def make(name="multi-sensor"):
    return TRACKERS[name]([RADAR], two_speeds(0.5, 2), region=REGION, initiation=Initiation(speed=5.0))


def step(tracker, time, z, own):
    tracker.step(time, [np.atleast_2d(z)], [np.full(len(np.atleast_2d(z)), time)] if own else None)


@pytest.mark.parametrize("name", ["multi-sensor", "static"])
@pytest.mark.parametrize("own", [False, True])
def test_a_track_of_a_false_alarm_begins_anew(name, own):
    """From the target's first measurement on, all is as if the false alarm had not been, but for the id."""
    old, fresh = make(name), make(name)
    for time, z in ((0.0, [0.0, 0.0]), (1.7, NOTHING), (3.4, NOTHING)):
        step(old, time, z, own)
    rng = np.random.default_rng(0)
    for k in range(6):
        z = [12.0 + 3.0 * k, 5.0] + rng.normal(0.0, 6.0, 2)
        for tracker in (old, fresh):
            step(tracker, 5.1 + 1.7 * k, z, own)
        (one,), (other,) = old.tracks, fresh.tracks
        assert one.score == pytest.approx(other.score) and one.hits == other.hits
        assert one.confirmed == other.confirmed == (k > 2)
        assert one.position == pytest.approx(other.position) and one.covariance == pytest.approx(other.covariance)


def test_a_track_that_is_likelier_than_a_new_one_goes_on():
    tracker = make()
    for k in range(3):
        step(tracker, 1.7 * k, [3.0 * k, 0.0], False)
    (track,) = tracker.tracks
    step(tracker, 5.1, NOTHING, False)
    step(tracker, 6.8, [12.0, 0.0], False)
    (later,) = tracker.tracks
    assert later.track_id == track.track_id and later.started == 0.0 and later.score > 0.0


@pytest.mark.parametrize("name", ["multi-sensor", "static"])
@pytest.mark.parametrize("own", [False, True])
def test_its_history_begins_where_it_began_anew(name, own):
    rng, times = np.random.default_rng(0), 1.7 * np.arange(9)
    target = np.array([12.0, 5.0]) + times[3:, None] * [1.8, 0.0] + rng.normal(0.0, 6.0, (6, 2))
    plots = [[np.zeros((1, 2))], [NOTHING], [NOTHING], *([z[None]] for z in target)]
    stamps = [[np.full(len(z), time) for z in scan] for time, scan in zip(times, plots, strict=True)] if own else None
    scene, tracker = Scene([RADAR], times, plots, REGION, measurement_times=stamps), make(name)
    table, decisions = track_scene(tracker, scene, confirmed=False)
    (track,) = tracker.tracks
    assert track.confirmed and track.started == times[3] and track.hits == 6
    assert [one.scan for one in decisions if (one.assigned[0] == track.track_id).any()] == [3, 4, 5, 6, 7, 8]
    rows = table.to_frame().query("track_id == @track.track_id")
    assert rows.time.tolist() == times[3:].tolist() and rows.hits.tolist() == [1, 2, 3, 4, 5, 6]
    smooth = smoothed(tracker, scene, decisions).to_frame()
    assert smooth.time.tolist() == times[3:].tolist() and smooth.hits.tolist() == [1, 2, 3, 4, 5, 6]
