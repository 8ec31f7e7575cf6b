"""Sensors in both directions: what Stone Soup's models say and what our sensors say must be the same."""

import math

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.sensors import BearingSensor, PositionSensor, Radar2D, Radar3D

pytest.importorskip("stonesoup")

from stonesoup.models.clutter import ClutterModel
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.measurement.nonlinear import (
    Cartesian2DToBearing,
    CartesianToBearingRange,
    CartesianToElevationBearingRange,
)
from stonesoup.sensor.radar import RadarElevationBearingRange
from stonesoup.types.array import StateVector
from stonesoup.types.detection import Detection
from stonesoup.types.state import State

from assoc.integrations.stonesoup import adapt, measurement_model
from assoc.integrations.stonesoup.frame import make_frame

PLACE = np.array([100.0, -200.0, 30.0])
VIEW = np.array([[0.0, 1e5], [-math.pi, math.pi], [-1.5, 1.5]])
OURS = [
    Radar3D(position=PLACE, noise=[50.0, 0.001, 0.002], field_of_view=VIEW, name="a"),
    Radar2D(position=PLACE, noise=[50.0, 0.001], field_of_view=VIEW[:2], name="b"),
    BearingSensor(position=PLACE, noise=[0.01], name="c"),
    PositionSensor(position=PLACE, noise=[10.0, 20.0], field_of_view=[[0, 1e3]] * 2, name="d"),
    PositionSensor(position=PLACE, noise=[10.0, 20.0, 5.0], field_of_view=[[0, 1e3]] * 3, name="e"),
]


@pytest.mark.parametrize("ours", OURS, ids=lambda sensor: sensor.kind + str(sensor.dim))
def test_models_measure_what_our_sensors_measure(ours):
    rng = np.random.default_rng(0)
    model = measurement_model(ours)
    back = adapt(model, field_of_view=ours.field_of_view, name=ours.name)
    assert type(back.sensor) is type(ours)
    np.testing.assert_allclose(back.sensor.covariance, ours.covariance)
    positions = rng.normal(0.0, 1e4, (20, 3))
    for position in positions:
        state = State(StateVector([position[0], 1.0, position[1], 2.0, position[2], 3.0]))
        theirs = back.measurement(model.function(state))
        expected = ours.measure(position[None])[0]
        np.testing.assert_allclose(ours.residual(theirs, expected), 0.0, atol=1e-9)


@pytest.mark.parametrize("turn", [0.4, -3.0])
def test_a_sensor_turned_about_z_reports_bearings_from_its_own_front(turn):
    model = CartesianToElevationBearingRange(
        ndim_state=3,
        mapping=(0, 1, 2),
        noise_covar=np.diag([1e-6, 1e-6, 100.0]),
        translation_offset=StateVector(PLACE),
        rotation_offset=StateVector([0.0, 0.0, turn]),
    )
    one = adapt(model, max_range=1e5)
    for position in np.random.default_rng(1).normal(0.0, 1e3, (10, 3)):
        measured = one.measurement(model.function(State(StateVector(position))))
        expected = one.sensor.measure(position[None])[0]
        np.testing.assert_allclose(one.sensor.residual(measured, expected), 0.0, atol=1e-9)


def test_what_a_stone_soup_sensor_says_of_itself():
    clutter = ClutterModel(clutter_rate=3.0, dist_params=((-1, 1),) * 3)
    radar = RadarElevationBearingRange(
        position_mapping=(0, 2, 4),
        ndim_state=6,
        noise_covar=np.diag([1e-6, 4e-6, 900.0]),
        max_range=7e4,
        clutter_model=clutter,
        position=StateVector(PLACE),
    )
    one = adapt(radar, detection_probability=0.8, name="north")
    assert one.sensor.false_alarm_rate == 3.0
    assert one.sensor.field_of_view[0].tolist() == [0.0, 7e4]
    assert one.sensor.covariance.tolist() == np.diag([900.0, 4e-6, 1e-6]).tolist()
    assert one.sensor.position.tolist() == PLACE.tolist()
    # a sensor makes a new model for each scan
    assert one.measured(Detection(StateVector([0, 0, 1]), measurement_model=radar.measurement_model))


def model_of(kind, **changes):
    noise = {CartesianToElevationBearingRange: [1e-6, 1e-6, 9.0], Cartesian2DToBearing: [1e-4]}.get(kind, [1e-6, 9.0])
    options = {"ndim_state": 4, "mapping": (0, 2), "noise_covar": np.diag(noise)}
    return kind(**{**options, **changes})


def spatial(kind, **changes):
    return model_of(kind, ndim_state=6, mapping=(0, 2, 4), **changes)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: adapt(3.0), "measurement model float is not known here; known: CartesianToElevationBearingRange"),
        (lambda: adapt(model_of(CartesianToBearingRange)), "max_range: expected a finite range"),
        (lambda: adapt(model_of(LinearGaussian)), "field_of_view: expected bounds"),
        (
            lambda: adapt(
                spatial(CartesianToElevationBearingRange, rotation_offset=StateVector([0.1, 0, 0])), max_range=1.0
            ),
            "the sensor is tilted by",
        ),
        (lambda: make_frame([]), "sensors: expected at least one"),
        (lambda: make_frame([adapt(model_of(Cartesian2DToBearing))] * 2), "number 1 has the same measurement model"),
        (
            lambda: make_frame(
                [
                    adapt(spatial(CartesianToBearingRange), max_range=1e5),
                    adapt(spatial(CartesianToElevationBearingRange), max_range=1e5),
                ]
            ),
            "measures the range on the ground",
        ),
    ],
)
def test_what_cannot_be_taken_over_is_one_clear_line(make, message):
    with pytest.raises(InvalidInputError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)
