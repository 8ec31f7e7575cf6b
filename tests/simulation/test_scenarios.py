"""Named scenarios: what they promise, one seed one scene, and clear refusals."""

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.simulation import simulate
from assoc.simulation.scenarios.bearing_only import BearingOnlyParameters, sensor_positions


def test_three_radar_is_the_papers_scene():
    scene = simulate("three-radar")
    assert scene.num_scans == 100
    assert np.array_equal(np.diff(scene.times), np.ones(99))
    assert [s.kind for s in scene.sensors] == ["radar3d"] * 3
    assert all(s.detection_probability == 0.9 and s.false_alarm_rate == 1.0 for s in scene.sensors)
    first = scene.scan(0).truth_positions / 1000
    np.testing.assert_allclose(first, [[30, 20, 2], [20.45, 11.25, 2], [50, 20, 2]])
    # ten seconds on at constant velocity; the second target ten seconds after its second turn, worked out by hand
    np.testing.assert_allclose(scene.scan(10).truth_positions[[0, 2]] / 1000, [[25.5, 17.5, 3], [44, 17.5, 5]])
    np.testing.assert_allclose(scene.scan(12).truth_positions[1] / 1000, [15.05, 8.25, 2.12])
    np.testing.assert_allclose(scene.scan(33).truth_positions[1] / 1000, [4.6, 10.525, 2.33])
    paths = np.concatenate([scene.scan(k).truth_positions for k in range(100)])
    extent = np.ptp(paths, axis=0)
    np.testing.assert_allclose(scene.region[:, 0], paths.min(axis=0) - 0.1 * extent)
    np.testing.assert_allclose(scene.region[:, 1], paths.max(axis=0) + 0.1 * extent)
    for sensor in scene.sensors:
        assert sensor.in_view(sensor.measure(paths)).all()
        assert sensor.noise[0] == 50.0
        assert sensor.noise[1] * 50e3 == pytest.approx(50.0)


def test_crowd_keeps_its_density_on_request():
    small, large = (simulate("crowd", targets=n, constant_density=True) for n in (100, 400))
    area = [float(np.prod(s.region[:2, 1] - s.region[:2, 0])) for s in (small, large)]
    assert area[1] / area[0] == pytest.approx(4.0)
    fixed = simulate("crowd", targets=400)
    assert np.array_equal(fixed.region, small.region)
    assert fixed.sensors[0].false_alarm_rate == pytest.approx(40.0)


def test_bearing_only_has_the_stated_geometry():
    np.testing.assert_allclose(sensor_positions(BearingOnlyParameters()) / 1000, [[0, 0, 0], [50, -10, 0], [100, 0, 0]])
    scene = simulate("bearing-only", sensors=5, targets=12, scans=20, interval=30.0)
    assert len(scene.sensors) == 5 and {s.kind for s in scene.sensors} == {"bearing"}
    for k in range(20):
        where = scene.scan(k).truth_positions
        assert ((where >= scene.region[:, 0]) & (where <= scene.region[:, 1])).all()


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("four-radar", {}, "unknown name 'four-radar'"),
        ("three-radar", {"colour": 1}, "colour: no parameter"),
        ("three-radar", {"detection_probability": 1.0}, "detection_probability: expected .* between 0 and 1"),
        ("three-radar", {"noise": -1.0}, "noise: expected a number above 0"),
        ("three-radar", {"scans": 0}, "scans: expected a whole number from 1"),
        ("crowd", {"sensor": "sonar"}, "sensor: expected 'position' or 'radar'"),
        ("bearing-only", {"sensors": 1}, "sensors: expected a whole number from 2"),
        ("from-tracks", {}, "file: scenario 'from-tracks' needs a value"),
    ],
)
def test_refusals(name, values, message):
    with pytest.raises(InvalidInputError, match=message):
        simulate(name, **values)
