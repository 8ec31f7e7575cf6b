import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from assoc.errors import InvalidInputError
from assoc.sensors import BearingSensor, DirectionSensor, PositionSensor, Radar2D, Radar3D

CIRCLE = [-math.pi, math.pi]
SENSORS = {
    "radar3d": Radar3D(
        name="north",
        position=[100, -200, 30],
        noise=[50, 1e-3, 2e-3],
        field_of_view=[[0, 1e5], CIRCLE, [0, 1]],
    ),
    "radar2d": Radar2D(position=[100, -200, 30], noise=[50, 1e-3], field_of_view=[[0, 1e5], CIRCLE]),
    "height": Radar2D(position=[100, -200, 30], noise=[50, 1e-3, 40], field_of_view=[[0, 1e5], CIRCLE, [0, 1e4]]),
    "bearing": BearingSensor(position=[100, -200, 30], noise=[5e-3]),
    "direction": DirectionSensor(position=[100, -200, 30], noise=[[3e-5, 1e-5], [1e-5, 4e-5]]),
    "position": PositionSensor(position=[0, 0, 0], noise=[1, 2, 3], field_of_view=[[-1, 1], [-2, 2], [0, 4]]),
    "plane": PositionSensor(position=[0, 0, 0], noise=[[2, 1], [1, 3]], field_of_view=[[-1, 1], [-2, 2]]),
}


@pytest.mark.parametrize("sensor", SENSORS.values(), ids=SENSORS)
def test_jacobian_is_the_derivative_of_the_measurement(sensor):
    x = np.random.default_rng(0).uniform(-1e4, 1e4, (50, 3))
    differences = []
    for axis in range(3):
        h = 1e-2 * np.eye(3)[axis]
        differences.append(sensor.residual(sensor.measure(x + h), sensor.measure(x - h)) / 2e-2)
    np.testing.assert_allclose(sensor.jacobian(x), np.stack(differences, axis=2), rtol=1e-4, atol=1e-8)
    assert sensor.measure(x).shape == (50, sensor.dim)


def test_azimuth_turns_from_x_to_y_and_elevation_up():
    radar = Radar3D(
        position=[1, 2, 3], noise=[1, 0.1, 0.1], field_of_view=[[0, 9], CIRCLE, [-math.pi / 2, math.pi / 2]]
    )
    places = np.array([[1, 7, 3], [-4, 2, 3], [1, 2, 8], [4, 2, 3 + 4], [1, -3, 3]], dtype=float)
    expected = [
        [5, math.pi / 2, 0],
        [5, math.pi, 0],
        [5, 0, math.pi / 2],
        [5, 0, math.atan2(4, 3)],
        [5, -math.pi / 2, 0],
    ]
    np.testing.assert_allclose(radar.measure(places), expected, atol=1e-12)
    flat = Radar2D(position=[1, 2, 3], noise=[1, 0.1], field_of_view=[[0, 9], CIRCLE])
    np.testing.assert_allclose(flat.measure(places), np.array(expected)[:, :2], atol=1e-12)
    both = DirectionSensor(position=[1, 2, 3], noise=[0.1, 0.1])
    np.testing.assert_allclose(both.measure(places), np.array(expected)[:, 1:], atol=1e-12)
    only = BearingSensor(position=[1, 2, 3], noise=[0.1])
    np.testing.assert_allclose(only.measure(places), np.array(expected)[:, 1:2], atol=1e-12)


@pytest.mark.parametrize("sensor", SENSORS.values(), ids=SENSORS)
def test_a_target_on_the_sensor_gives_numbers(sensor):
    assert np.isfinite(sensor.measure(sensor.position[None])).all()
    assert np.isfinite(sensor.jacobian(sensor.position[None])).all()


@given(st.floats(-50, 50), st.floats(-50, 50))
def test_residuals_of_angles_are_wrapped(a, b):
    sensor = SENSORS["bearing"]
    difference = float(sensor.residual(np.array([[a]]), np.array([[b]]))[0, 0])
    assert -math.pi <= difference <= math.pi
    assert math.isclose(math.cos(difference), math.cos(a - b), abs_tol=1e-9)
    assert math.isclose(math.sin(difference), math.sin(a - b), abs_tol=1e-9)


def test_noise_is_standard_deviations_or_a_covariance():
    np.testing.assert_allclose(SENSORS["radar3d"].covariance, np.diag([2500, 1e-6, 4e-6]))
    np.testing.assert_allclose(SENSORS["plane"].covariance, [[2, 1], [1, 3]])
    assert [s.dim for s in SENSORS.values()] == [3, 2, 3, 1, 2, 3, 2]
    # a circle that was turned: rounding leaves other numbers than 0 on both sides of the diagonal
    turned = np.array([[25.0, -3.1e-16], [-7.5e-16, 25.0]])
    assert np.array_equal(dataclasses.replace(SENSORS["plane"], noise=turned).covariance, turned)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"detection_probability": 0.0}, "detection_probability must be strictly between"),
        ({"detection_probability": "0.9"}, "detection_probability must be one number"),
        ({"false_alarm_rate": 0.0}, "false_alarm_rate must be above 0"),
        ({"noise": [50, -1e-3, 1e-3]}, "noise must be positive"),
        ({"noise": [50, 1e-3]}, r"noise must have shape \(3,\) or \(3, 3\) or \(4,\) or \(4, 4\), got \(2,\)"),
        ({"noise": [[1, 2, 0], [2, 1, 0], [0, 0, 1]]}, "positive definite"),
        ({"noise": [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]}, "symmetric"),
        ({"noise": [1e-30] * 3}, "too small"),
        ({"position": [0, 0]}, r"position must have shape \(3,\)"),
        ({"position": [0, 0, 1e15]}, "position must be within"),
        ({"field_of_view": [[0, 1], [0, 1]]}, "field_of_view must have shape"),
        ({"field_of_view": [[1, 0], CIRCLE, [0, 1]]}, "field_of_view of range must have lower < upper"),
        ({"field_of_view": [[0, 1], [0, 7], [0, 1]]}, "more than a full circle"),
        ({"field_of_view": None}, "field_of_view is missing"),
    ],
)
def test_bad_sensors_are_refused_in_one_line(changes, words):
    with pytest.raises(InvalidInputError, match=words) as caught:
        dataclasses.replace(SENSORS["radar3d"], **changes)
    assert "\n" not in str(caught.value)
    assert "Radar3D" in str(caught.value)


@pytest.mark.parametrize("sensor", SENSORS.values(), ids=SENSORS)
def test_places_and_measurements_of_a_wrong_shape_are_refused(sensor):
    for call in (sensor.measure, sensor.jacobian):
        for wrong in ([1.0, 2.0, 3.0], [[1.0, 2.0]]):
            with pytest.raises(InvalidInputError, match=r"positions must have shape \(n, 3\)"):
                call(wrong)
    wrong, right = np.zeros((2, sensor.dim + 1)), np.zeros((2, sensor.dim))
    for call, name in (
        (lambda: sensor.in_view(wrong), "measurements"),
        (lambda: sensor.residual(wrong, right), "measured"),
        (lambda: sensor.residual(right, wrong), "predicted"),
    ):
        with pytest.raises(InvalidInputError, match=rf"{name} must have shape \(n, {sensor.dim}\)"):
            call()
