"""What no sensor can have made is refused in one line, and the tracker is as it was."""

import numpy as np
import pytest

from assoc import InvalidInputError, simulation
from assoc.tracking import TRACKERS
from assoc.tracking.filter_choice import make_filter

SCENE = simulation.simulate("three-radar", 1, scans=3)


def with_row(s, row):
    z = list(SCENE.scan(1).measurements)
    z[s] = np.vstack([z[s], [row]])
    return z


HOSTILE = {
    "measurement . of sensor 0: range must be metres from 0": with_row(0, [-5e3, 0.3, 0.1]),
    "measurement . of sensor 0: range must be .* got 1e.12": with_row(0, [1e12, 0.3, 0.1]),
    "measurement . of sensor 1: azimuth must be radians": with_row(1, [5e4, 1e12, 0.1]),
    "measurement . of sensor 1: elevation must be radians": with_row(1, [5e4, 0.3, -1e6]),
    "measurements of sensor 1 must be finite": with_row(1, [np.nan, 0.3, 0.1]),
    "measurements of sensor 2 must be an array of shape .n, 3., got None": [*SCENE.scan(1).measurements[:2], None],
    "measurements of sensor 0 .* rows of several lengths": [[[1.0, 2.0], [3.0]], *SCENE.scan(1).measurements[1:]],
    "measurements of 2 sensors, expected 3": SCENE.scan(1).measurements[:2],
    "measurements of sensor 1 must have shape .2, 3.": [np.zeros((0, 3)), np.zeros((2, 2)), np.zeros((0, 3))],
    "measurements must be one array for each of 3 sensors, got None": None,
    "measurements must be one array for each of 3 sensors, got int": 5,
}


@pytest.mark.parametrize("name", TRACKERS)
@pytest.mark.parametrize("filter", ["imm-cv", "ekf"])
def test_a_scan_that_is_refused_changes_nothing(name, filter):
    own, other = (TRACKERS[name].for_scene(SCENE, make_filter(filter, SCENE.sensors)) for _ in range(2))
    for k in range(3):
        for message, z in HOSTILE.items():
            with pytest.raises(InvalidInputError, match=message):
                own.step(SCENE.times[k], z)
        for time in ("1", np.nan):
            with pytest.raises(InvalidInputError, match="time must be a finite number"):
                own.step(time, SCENE.scan(k).measurements)
        # a step in time that no filter survives
        if k:
            with pytest.raises(InvalidInputError, match="time must not run backwards: got -1 s after"):
                own.step(-1.0, SCENE.scan(k).measurements)
            with pytest.raises(InvalidInputError, match="numbers out of range"):
                own.step(1e150, SCENE.scan(k).measurements)
        steps = [one.step(SCENE.times[k], SCENE.scan(k).measurements) for one in (own, other)]
        for a, b in zip(steps[0].assigned, steps[1].assigned, strict=True):
            np.testing.assert_array_equal(a, b)
    assert own.num_steps == 3
    for a, b in zip(own.tracks, other.tracks, strict=True):
        np.testing.assert_array_equal(a.mean, b.mean)
        assert a.track_id == b.track_id


def test_a_path_that_is_none_is_refused():
    tracker = TRACKERS["mht"].for_scene(SCENE)
    for act in (tracker.save, tracker.restore):
        with pytest.raises(InvalidInputError, match="path: expected"):
            act(None)
