"""A target that flies out of the region and is not detected has left; inside, it is shown when it is missed once."""

import numpy as np
import pytest

from assoc.sensors import PositionSensor
from assoc.tracking import TRACKERS, Initiation
from assoc.tracking.filter_choice import two_speeds

SENSOR = PositionSensor(
    position=[0.0, 0.0, 0.0], noise=[20.0, 20.0], detection_probability=0.999, false_alarm_rate=0.5,
    field_of_view=[[-20e3, 20e3], [-20e3, 20e3]],
)  # fmt: skip


@pytest.mark.parametrize("name", ["multi-sensor", "mht", "mht-hypothesis", "joint-probabilistic"])
def test_a_target_that_leaves_the_region_is_not_shown_on(name):
    for edge, shown in ((2_150.0, False), (5_000.0, True)):
        region = [[-10e3, edge], [-10e3, 10e3], [0.0, 1e3]]
        tracker = TRACKERS[name]([SENSOR], two_speeds(5.0, 2), region=region, initiation=Initiation(speed=100.0))
        for k in range(11):
            tracker.step(4.0 * k, [np.array([[200.0 * k, 0.0]])])
        (track,) = [one for one in tracker.tracks if one.confirmed]
        assert track.reported
        # it was expected at 2,200 m
        tracker.step(44.0, [np.zeros((0, 2))])
        assert any(one.reported for one in tracker.tracks) == shown
        # detected after all, it is the same track
        for k in range(12, 15):
            tracker.step(4.0 * k, [np.array([[200.0 * k, 0.0]])])
        found = [one for one in tracker.tracks if one.reported]
        assert [one.track_id for one in found] == [track.track_id]
