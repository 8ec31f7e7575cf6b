"""States and times that floats hold, and what is computed of them not: no warning of numpy reaches users."""

import numpy as np
import pytest

from assoc.filters.state import Gaussian
from assoc.sensors import PositionSensor
from assoc.tracking import MultiSensorTracker
from assoc.tracking.filter_choice import two_speeds

SENSOR = PositionSensor(
    position=[0.0, 0.0, 0.0], noise=[20.0, 20.0], detection_probability=0.9, false_alarm_rate=1e-4,
    field_of_view=[[-20e3, 20e3], [-20e3, 20e3]],
)  # fmt: skip
REGION = [[-20e3, 20e3], [-20e3, 20e3], [0.0, 1e3]]


@pytest.mark.parametrize("wide", [1e160, 1e-160])
def test_tracks_whose_determinant_is_beyond_floats(wide):
    """Missed, with a plot that no track has: how much wider its gate may be follows from its determinant."""
    tracker = MultiSensorTracker([SENSOR], two_speeds(5.0, 2), region=REGION, adapt=True)
    tracker.begin(0.0, Gaussian(np.zeros((1, 4)), wide * np.eye(4)[None]))
    for k in range(1, 8):
        tracker.step(float(k), [np.array([[9e3, 9e3 - 10.0 * k]]) if k % 2 else np.zeros((0, 2))])
    assert np.isfinite([track.mean for track in tracker.tracks]).all()


def test_scans_so_close_in_time_that_speeds_are_beyond_floats():
    tracker = MultiSensorTracker([SENSOR], two_speeds(5.0, 2), region=REGION, adapt=True)
    rng = np.random.default_rng(1)
    for k in range(6):
        tracker.step(k * 1e-306, [rng.uniform(-19e3, 19e3, (6, 2))])
    assert np.isfinite([track.mean for track in tracker.tracks]).all()
