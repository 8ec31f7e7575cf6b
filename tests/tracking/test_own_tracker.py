"""A tracker that a user writes: one method, and everything else is there."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.filters import ConstantVelocity, Gaussian, KalmanFilter
from assoc.sensors import PositionSensor
from assoc.tracking import LatePlots, Tracker
from assoc.tracking.method import Method
from assoc.tracking.progress import Association

VIEW = [[-1e4, 1e4]] * 3
SENSOR = PositionSensor(position=np.zeros(3), noise=[10.0] * 3, false_alarm_rate=1.0, field_of_view=VIEW)


class Offset(NamedTuple):
    """How far the last measurement was away from the first track."""

    away: np.ndarray


@dataclass(frozen=True)
class FirstComeMethod(Method):
    """Each measurement to the track of its number, if it is near enough; nothing starts tracks."""

    own_times = False

    reach: float = 100.0

    def associate(self, progress):
        tracks, (z,), (sensor,) = progress.state.tracks, progress.scan.measurements, progress.settings.sensors
        count = min(len(tracks), len(z))
        away = np.linalg.norm(z[:count] - tracks.states.mean[:count, :3], axis=1)
        taken = away < self.reach
        gain = np.full(len(tracks), progress.settings.terms.miss[0])
        states, seen = tracks.states, np.zeros(len(tracks), dtype=np.bool_)
        if taken.all() and count == len(tracks):
            done = progress.settings.filter.update(states, z[:count], sensor)
            states, gain, seen = done.state, progress.settings.terms.detection[0] + done.log_likelihood, ~seen
        ids = np.zeros(len(z), dtype=np.int64)
        ids[np.flatnonzero(seen)] = tracks.track_id
        scored = tracks.scored(states, gain, np.where(seen, progress.scan.time, np.nan))
        return Association(scored.counted(seen), [ids], Offset(away[:1]))

    def begun(self, settings, tracks):
        return Offset(np.zeros(len(tracks)))

    def restored(self, settings, saved, state):
        saved.require(len(saved["away"]) <= 1, "away", "one number at most")
        return Offset(saved["away"])


class FirstComeTracker(Tracker):
    name = "first-come"
    method = FirstComeMethod


def make(**options):
    tracker = FirstComeTracker([SENSOR], KalmanFilter(ConstantVelocity(2.0, kind="continuous")), **options)
    tracker.begin(0.0, Gaussian(np.array([[0.0, 0, 0, 100, 0, 0]]), np.diag([100.0] * 6)))
    return tracker


def test_a_method_of_a_users_own_is_a_tracker(tmp_path):
    tracker, again = make(reach=50.0), FirstComeTracker([SENSOR], make().filter, reach=50.0)
    for k in range(1, 5):
        step = tracker.step(float(k), [np.array([[100.0 * k, 5.0, 0.0]])])
        assert step.assigned[0].tolist() == [1] and step.final[0].scan == k - 1
    (track,) = tracker.tracks
    assert track.hits == 4 and track.position[0] == np.clip(track.position[0], 390.0, 410.0)
    assert tracker.state.method_state.away[0] < 6.0
    tracker.save(tmp_path / "own.npz")
    again.restore(tmp_path / "own.npz")
    assert again.state.method_state.away.tolist() == tracker.state.method_state.away.tolist()
    for one in (tracker, again):
        step = one.step(5.0, [np.array([[600.0, 0.0, 0.0]])])
        assert step.assigned[0].tolist() == [0] and one.tracks[0].hits == 4
        with pytest.raises(InvalidInputError, match="this tracker takes measurements of one instant only"):
            one.step(6.0, [np.zeros((0, 3))], sectors=[[0.0, 1.0]])
        assert one.time == 5.0
    # and what is written around any tracker takes it
    late = LatePlots(make())
    late.step(1.0, [np.array([[100.0, 0.0, 0.0]])])
    assert [track.track_id for track in late.tracks] == [1]


@pytest.mark.parametrize("old", ["at_once", "in_order"])
def test_a_method_written_for_two_functions_is_told_of_the_one(old):
    with pytest.raises(InvalidInputError, match=rf"Mine\.{old}: .* defines associate\(progress\) instead"):
        type("Mine", (FirstComeMethod,), {old: lambda self, progress: None})
