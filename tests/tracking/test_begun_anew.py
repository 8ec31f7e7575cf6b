"""A tentative track that began with a false alarm does not hold back the target whose measurements it takes."""

import numpy as np
import pytest

from assoc.sensors import PositionSensor
from assoc.tracking import TRACKERS, Initiation
from assoc.tracking.filter_choice import two_speeds
from assoc.tracking.target_kinds import evidence_in

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
        assert one.confirmed == other.confirmed == (k > 1)
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


@pytest.mark.parametrize(("aside", "number"), [(44.0, 1), (60.0, 2)])
def test_what_a_track_scored_before_it_began_anew_is_evidence(aside, number):
    """It keeps its number, or another takes its place, where a target jumps: a kind of targets had explained both."""
    tracker, rng, before = make("nearest-neighbour"), np.random.default_rng(1), []

    def steps():
        for k in range(40):
            step(tracker, 1.7 * k, [3.4 * k - 150.0, aside * (k > 30)] + rng.normal(0.0, 6.0, 2), False)
            before.append(tracker.tracks[0].score)
            yield

    evidence = evidence_in(tracker, steps())
    (track,) = tracker.tracks
    assert track.track_id == number and track.started > 50.0 and track.score < 50.0
    if number == 1:
        # what the old one scored of the new one's plots does not count twice
        assert evidence == pytest.approx(before[30] + track.score)
    else:
        assert before[30] + track.score - 12.0 < evidence < before[30] + track.score
