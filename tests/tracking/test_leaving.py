"""A target that flies out of the region and is missed has left, unless a sensor that measures distances sees so far."""

import numpy as np
import pytest

from assoc.filters.state import Gaussian
from assoc.sensors import BearingSensor, PositionSensor
from assoc.tracking import TRACKERS
from assoc.tracking.filter_choice import two_speeds

POSITIONS = PositionSensor(
    position=[0.0, 0.0, 0.0], noise=[20.0, 20.0], detection_probability=0.9, false_alarm_rate=0.5,
    field_of_view=[[-20e3, 20e3], [-20e3, 20e3]],
)  # fmt: skip
BEARINGS = [
    BearingSensor(position=place, noise=[1e-3], detection_probability=0.999, false_alarm_rate=0.5)
    for place in ([0.0, -5e3, 0.0], [0.0, 5e3, 0.0], [-5e3, 0.0, 0.0])
]


@pytest.mark.parametrize("name", ["multi-sensor", "mht", "mht-hypothesis", "joint-probabilistic"])
@pytest.mark.parametrize(
    ("sensors", "edge", "shown"), [(BEARINGS, 2_150.0, False), (BEARINGS, 5_000.0, True), ([POSITIONS], 2_150.0, True)]
)
def test_a_target_that_leaves_the_region_is_not_shown_on(name, sensors, edge, shown):
    region = [[-10e3, edge], [-10e3, 10e3], [0.0, 1e3]]
    tracker = TRACKERS[name](sensors, two_speeds(5.0, 2), region=region)
    tracker.begin(0.0, Gaussian(np.array([[0.0, 50.0, 0.0, 0.0]]), np.diag([400.0, 25.0, 400.0, 25.0])[None]))

    def step(k):
        tracker.step(4.0 * k, [sensor.measure(np.array([[200.0 * k, 0.0, 0.0]])) for sensor in sensors])

    for k in range(1, 11):
        step(k)
    (track,) = [one for one in tracker.tracks if one.confirmed]
    assert track.reported
    # it was expected at 2,200 m
    tracker.step(44.0, [np.zeros((0, sensor.dim)) for sensor in sensors])
    assert any(one.reported for one in tracker.tracks) == shown
    # detected after all, it is shown again
    for k in range(12, 15):
        step(k)
    found = [one for one in tracker.tracks if one.reported]
    assert len(found) == 1 and (sensors is BEARINGS or found[0].track_id == track.track_id)
