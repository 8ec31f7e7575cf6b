"""What no sensor can have made is refused in one line, and the tracker is as it was."""

import numpy as np
import pytest

from assoc import InvalidInputError, simulation
from assoc.tracking import TRACKERS, Initiation
from assoc.tracking.filter_choice import make_filter, two_speeds

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
        # a step in time that no filter survives
        if k:
            with pytest.raises(InvalidInputError, match="numbers out of range"):
                own.step(1e150, SCENE.scan(k).measurements)
        steps = [one.step(SCENE.times[k], SCENE.scan(k).measurements) for one in (own, other)]
        for a, b in zip(steps[0].assigned, steps[1].assigned, strict=True):
            np.testing.assert_array_equal(a, b)
    assert own.num_steps == 3
    for a, b in zip(own.tracks, other.tracks, strict=True):
        np.testing.assert_array_equal(a.mean, b.mean)
        assert a.track_id == b.track_id


@pytest.mark.parametrize("name", ["mht", "mht-hypothesis"])
def test_the_order_of_the_measurements_of_a_scan_does_not_matter(name):
    scene = simulation.simulate("three-radar", 0, scans=6, false_alarms=8.0)
    found = []
    for shuffle in range(3):
        rng, own = np.random.default_rng(shuffle), TRACKERS[name].for_scene(scene)
        decided = []
        for k in range(6):
            orders = [rng.permutation(len(z)) if shuffle else np.arange(len(z)) for z in scene.scan(k).measurements]
            z = [one[order] for one, order in zip(scene.scan(k).measurements, orders, strict=True)]
            step = own.step(scene.times[k], z)
            decided.append([ids[np.argsort(o)].tolist() for ids, o in zip(step.assigned, orders, strict=True)])
        found.append(([(t.track_id, t.score, *t.mean.tolist()) for t in own.tracks], decided))
    assert found[0] == found[1] == found[2]


def test_the_speed_of_other_axes_is_refused_and_any_number_will_do():
    for dimensions, speed in ((3, (200.0, 200.0)), (2, [200.0, 200.0, 50.0])):
        with pytest.raises(InvalidInputError, match=f"speed must be one number, or one for each of {dimensions} axes"):
            TRACKERS["mht"](SCENE.sensors, two_speeds(dimensions=dimensions), initiation=Initiation(speed=speed))
    found = []
    for speed in (200.0, np.int64(200), np.float32(200.0)):
        tracker = TRACKERS["nearest-neighbour"].for_scene(SCENE, initiation=Initiation(speed=speed))
        tracker.step(0.0, SCENE.scan(0).measurements)
        found.append([track.covariance.tolist() for track in tracker.tracks])
    assert found[0] and found[0] == found[1] == found[2]


def test_a_path_that_is_none_is_refused():
    tracker = TRACKERS["mht"].for_scene(SCENE)
    for act in (tracker.save, tracker.restore):
        with pytest.raises(InvalidInputError, match="path: expected"):
            act(None)
