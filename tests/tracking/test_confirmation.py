"""How sure a track must be before it is confirmed: by the number of false tracks that may come in an hour."""

import math

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.filters import ConstantVelocity, KalmanFilter
from assoc.sensors import PositionSensor
from assoc.tracking import TRACKERS, Initiation, LifeCycle

REGION = np.array([[-5e3, 5e3], [-5e3, 5e3], [0.0, 1.0]])


def sensor(alarms, detection=0.9):
    return PositionSensor(
        position=np.zeros(3), noise=[20.0, 20.0], detection_probability=detection, false_alarm_rate=alarms,
        field_of_view=REGION[:2],
    )  # fmt: skip


def tracker(name, sensors, **life_cycle):
    filter_ = KalmanFilter(ConstantVelocity(1.0, dimensions=2, kind="continuous"))
    return TRACKERS[name](
        sensors, filter_, region=REGION, initiation=Initiation(speed=15.0), life_cycle=LifeCycle(**life_cycle)
    )


def test_the_share_is_false_tracks_over_false_alarms():
    assert LifeCycle(false_tracks_per_hour=2.0).false_share(20_000.0) == pytest.approx(1e-4)
    assert LifeCycle().false_share(1.0) == LifeCycle().false_share(0.0) == 0.01
    assert LifeCycle().false_share(math.inf) == 1e-6
    assert LifeCycle(false_probability=0.2).false_share(1e5) == 0.2
    with pytest.raises(InvalidInputError, match="false_tracks_per_hour must be a number above 0"):
        LifeCycle(false_tracks_per_hour=0.0)


def seconds_to_confirm(name, sensors, pace, **life_cycle):
    """Until the one target there, which every sensor sees in every scan among no false alarms, is confirmed."""
    one = tracker(name, sensors, **life_cycle)
    for k in range(40):
        place = np.array([[10.0 * k * pace, -5.0 * k * pace]])
        one.step(k * pace, [place for _ in sensors])
        if any(track.confirmed for track in one.tracks):
            return k * pace
    return math.inf


@pytest.mark.parametrize("name", TRACKERS)
def test_more_false_tracks_allowed_confirm_earlier(name):
    """Far apart, each tracker must wait longer for fewer false tracks."""
    many, few = (seconds_to_confirm(name, [sensor(30.0, 0.6)], 4.0, false_tracks_per_hour=n) for n in (300.0, 1e-9))
    assert many < few < math.inf


@pytest.mark.parametrize("name", ["multi-sensor", "mht"])
def test_clutter_alone_makes_no_more_false_tracks_than_said(name):
    """An hour of 900 scans of 4 s with 20 false alarms each, seldom a track: at most a handful where 1 is said."""
    rng = np.random.default_rng(1)
    one, seen = tracker(name, [sensor(20.0)]), set()
    for k in range(300):
        one.step(4.0 * k, [rng.uniform(-5e3, 5e3, (rng.poisson(20.0), 2))])
        seen |= {track.track_id for track in one.tracks if track.confirmed}
    assert len(seen) <= 2
