"""How sure a track must be before it is confirmed: by the number of false tracks that may come in an hour."""

import math

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.filters import ConstantVelocity, KalmanFilter
from assoc.sensors import PositionSensor, Radar2D
from assoc.tracking import TRACKERS, Initiation, LifeCycle, MultiSensorTracker
from assoc.tracking.filter_choice import two_speeds

REGION = np.array([[-5e3, 5e3], [-5e3, 5e3], [0.0, 1.0]])


def sensor(alarms, detection=0.9):
    return PositionSensor(
        position=np.zeros(3), noise=[20.0, 20.0], detection_probability=detection, false_alarm_rate=alarms,
        field_of_view=REGION[:2],
    )  # fmt: skip


def tracker(name, sensors, birth_rate=0.1, **life_cycle):
    filter_ = KalmanFilter(ConstantVelocity(1.0, dimensions=2, kind="continuous"))
    return TRACKERS[name](
        sensors, filter_, region=REGION, initiation=Initiation(speed=15.0, birth_rate=birth_rate),
        life_cycle=LifeCycle(**life_cycle),
    )  # fmt: skip


def test_the_share_is_false_tracks_over_new_targets():
    assert LifeCycle(false_tracks_per_hour=2.0).false_share(20_000.0) == pytest.approx(1e-4)
    assert LifeCycle().false_share(1.0) == LifeCycle().false_share(0.0) == 0.01
    assert LifeCycle().false_share(math.inf) == 1e-6
    assert LifeCycle(false_probability=0.2).false_share(1e5) == 0.2
    with pytest.raises(InvalidInputError, match="false_tracks_per_hour must be a number above 0"):
        LifeCycle(false_tracks_per_hour=0.0)


def seconds_to_confirm(name, sensors, pace, shift=0.0, **life_cycle):
    """Until the one target there, which every sensor sees in every scan among no false alarms, is confirmed."""
    one = tracker(name, sensors, **life_cycle)
    for k in range(40):
        place = np.array([[shift + 10.0 * k * pace, -5.0 * k * pace]])
        one.step(k * pace, [place for _ in sensors])
        if any(track.confirmed for track in one.tracks):
            return k * pace
    return math.inf


@pytest.mark.parametrize("name", TRACKERS)
def test_more_false_tracks_allowed_confirm_earlier(name):
    """Far apart, each tracker must wait longer for fewer false tracks."""
    many, few = (seconds_to_confirm(name, [sensor(30.0, 0.6)], 4.0, false_tracks_per_hour=n) for n in (300.0, 1e-9))
    assert many < few < math.inf


@pytest.mark.parametrize("name", TRACKERS)
def test_targets_wait_for_the_odds_of_a_target_not_for_the_number_of_false_alarms(name):
    """A score begins with the density of new targets over that of false alarms: these do not count twice.

    A fifth of a new target a scan of 4 s is 180 in an hour: odds of 180 to 1 are one false track an
    hour. So a target whose score has come to that is shown, though there are 18,000 false alarms in an hour.
    """
    one = tracker(name, [sensor(20.0)], birth_rate=0.2)
    for k in range(20):
        one.step(4.0 * k, [np.array([[40.0 * k, -20.0 * k]])])
        if k:
            for track in one.tracks:
                assert track.confirmed == (track.score >= math.log((1.0 - 2e-3) * 0.2 * 900.0))
    assert len(one.tracks) == 1 and one.tracks[0].confirmed


def test_outside_of_the_region_false_alarms_count():
    """No number of new targets is said of what lies outside of it: the same target is shown later there."""
    wide = PositionSensor(position=np.zeros(3), noise=[20.0, 20.0], detection_probability=0.6, false_alarm_rate=80.0,
                          field_of_view=[[-30e3, 30e3], [-30e3, 30e3]])  # fmt: skip
    inside, outside = (seconds_to_confirm("multi-sensor", [wide], 4.0, shift) for shift in (0.0, 20e3))
    assert inside < outside < math.inf


def test_beside_a_track_whose_echo_it_may_be_false_alarms_count():
    """A radar makes more false plots at the range of a target than it has false alarms elsewhere."""

    def scans(farther):
        radar = Radar2D(position=np.zeros(3), noise=[20.0, 2e-3], detection_probability=0.9, false_alarm_rate=80.0,
                        field_of_view=[[0.0, 30e3], [-np.pi, np.pi]])  # fmt: skip
        one = MultiSensorTracker([radar], two_speeds(10.0, 2), adapt=True, region=6.0 * REGION)
        rng = np.random.default_rng(0)
        for k in range(20):
            away = 8e3 + 200.0 * k
            plots = [[away, 0.5], [away + farther, 1.5]][: 1 + (k >= 6)]
            # the false alarms there are, or fewer would be learnt
            one.step(4.0 * k, [np.concatenate([plots, rng.uniform([0.0, -np.pi], [30e3, 0.0], (80, 2))])])
            if k >= 6 and sum(track.confirmed for track in one.tracks) == 2:
                return k
        return 20

    assert scans(3e3) < scans(0.0) < 20


@pytest.mark.parametrize("name", ["multi-sensor", "mht"])
def test_clutter_alone_makes_no_more_false_tracks_than_said(name):
    """An hour of 900 scans of 4 s with 20 false alarms each, seldom a track: at most a handful where 1 is said."""
    rng = np.random.default_rng(1)
    one, seen = tracker(name, [sensor(20.0)]), set()
    for k in range(300):
        one.step(4.0 * k, [rng.uniform(-5e3, 5e3, (rng.poisson(20.0), 2))])
        seen |= {track.track_id for track in one.tracks if track.confirmed}
    assert len(seen) <= 2
