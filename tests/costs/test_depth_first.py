"""The kernel that grows tuples of tracks, beside the way for all filters, which corrects states sensor by sensor."""

import math
from dataclasses import replace

import numpy as np
import pytest

from assoc.costs.tracks import depth_first
from assoc.costs.tracks.scores import score_terms
from assoc.costs.tracks.tuples import grow_track_tuples
from assoc.errors import InvalidInputError
from assoc.filters import (
    ConstantVelocity,
    ExtendedKalmanFilter,
    Gaussian,
    InteractingMultipleModel,
    LinearMeasurement,
)
from assoc.sensors import BearingSensor, DirectionSensor, PositionSensor, Radar2D, Radar3D

SPACE = [(-3e4, 3e4), (-3e4, 3e4), (0.0, 1e4)]
RANGE = [(0.0, 1e5), (-math.pi, math.pi), (-1.5, 1.5), (-1e3, 1e3)]


def sensor(kind, position, noise, view):
    return kind(
        position=position, noise=noise, field_of_view=view[: len(noise)],
        detection_probability=0.9, false_alarm_rate=5.0,
    )  # fmt: skip


PLACES = [sensor(PositionSensor, [0.0] * 3, noise, SPACE) for noise in ([150.0] * 3, [80.0, 90.0, 100.0], [120.0] * 3)]
RADARS = [
    sensor(Radar3D, [9e3, 0.0, 0.0], [40.0, 0.02, 0.03], RANGE),
    sensor(Radar3D, [-9e3, 3e3, 0.0], [50.0, 0.015, 0.02, 5.0], RANGE),
    sensor(DirectionSensor, [0.0, 9e3, 0.0], [0.02, 0.02], RANGE[1:]),
]
FOLDED = [
    RADARS[0],
    replace(RADARS[1], folding=90.0),
    replace(sensor(Radar3D, [0.0, 9e3, 0.0], [40.0, 0.02, 0.03, 2.0], RANGE), folding=250.0),
]
MIXED = [
    sensor(PositionSensor, [0.0] * 3, [150.0, 100.0], SPACE),
    sensor(BearingSensor, [1e4, 1e3, 0.0], [0.03], RANGE[1:]),
    sensor(Radar2D, [-1e4, 0.0, 0.0], [60.0, 0.02], RANGE),
    PLACES[1],
]
GATE = 0.999


class SensorBySensor(ExtendedKalmanFilter):
    """An extended Kalman filter that says no more of itself than a user's own does."""

    def in_parts(self, state, sensors):
        return None

    def positions_alone(self, state):
        return self, state


def filters(kind, modes):
    models = [kind(ConstantVelocity(noise, kind="continuous")) for noise in (2.0, 20.0, 60.0)[:modes]]
    if modes == 1:
        return models[0]
    return InteractingMultipleModel(models, 0.1 / (modes - 1) + np.eye(modes) * (0.9 - 0.1 / (modes - 1)))


def predicted(filter_, rng, count=25):
    """Tracks around a radar's azimuth of pi, of different age: some gates are far wider than others."""
    wide = rng.uniform(0.2, 2.0, count)[:, None, None]
    mean = np.column_stack([rng.uniform((-3e3, -2e3, 3e3), (1e3, 2e3, 5e3), (count, 3)), rng.normal(0, 50, (count, 3))])
    begun = Gaussian(mean, wide * np.diag([300.0**2] * 3 + [60.0**2] * 3))
    return filter_.predict(filter_.predict(filter_.start(begun), 2.0), 4.0)


def scan(sensors, states, rng):
    found = []
    for sensor in sensors:
        seen = states.mean[rng.random(len(states)) < 0.9]
        z = sensor.folded(sensor.measure(seen[:, :3] + rng.normal(0, 200.0, (len(seen), 3)), seen[:, 3:]))
        found.append(rng.permutation(z + rng.normal(0, 1.0, z.shape) * np.sqrt(np.diag(sensor.covariance))))
    return found


def grown(filter_, states, z, sensors, terms=None, **options):
    terms = terms or score_terms(sensors)
    # an array of its own: one without steps between rows would be compiled for anew
    misses = np.broadcast_to(terms.miss, (len(states), len(sensors))).copy()
    return grow_track_tuples(filter_, states, z, sensors, terms, misses, gate_probability=GATE, **options)


@pytest.mark.parametrize("modes", [1, 2])
def test_linear_measurements_of_whole_states(modes):
    rng = np.random.default_rng(modes)
    states = predicted(filters(ExtendedKalmanFilter, modes), rng)
    mixed = np.array([[1.0, 0.0, 0.0, 2.0, 0.0, 0.0], [0.0, 1.0, 0.5, 0.0, 0.0, 1.0]])
    models = [LinearMeasurement(matrix, np.eye(len(matrix)) * 150.0**2) for matrix in (mixed, np.eye(6)[:3], mixed[:1])]
    z = [model.measure(states.mean) + rng.normal(0.0, 150.0, (len(states), model.dim)) for model in models]
    peak = np.array([-0.5 * np.linalg.slogdet(2.0 * np.pi * model.covariance)[1] for model in models])
    one, other = (
        grown(filters(kind, modes), states, z, models, score_terms(PLACES)._replace(peak=peak))
        for kind in (ExtendedKalmanFilter, SensorBySensor)
    )
    assert (one.rows > 0).all(axis=1).sum() > 20
    np.testing.assert_array_equal(one.track, other.track)
    np.testing.assert_array_equal(one.rows, other.rows)
    np.testing.assert_allclose(one.costs, other.costs, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("modes", [1, 2, 3])
@pytest.mark.parametrize("sensors", [PLACES, RADARS, FOLDED, MIXED], ids=["places", "radars", "folded", "mixed"])
def test_the_same_tuples_at_the_same_costs_as_sensor_by_sensor(sensors, modes):
    rng = np.random.default_rng(modes)
    states = predicted(filters(ExtendedKalmanFilter, modes), rng)
    z = scan(sensors, states, rng)
    for margin in (0.0, math.inf):
        one = grown(filters(ExtendedKalmanFilter, modes), states, z, sensors, margin=margin)
        other = grown(filters(SensorBySensor, modes), states, z, sensors, margin=margin)
        assert (one.rows > 0).all(axis=1).sum() > 20
        np.testing.assert_array_equal(one.track, other.track)
        np.testing.assert_array_equal(one.rows, other.rows)
        np.testing.assert_allclose(one.costs, other.costs, rtol=1e-9, atol=1e-9)
    # compiled once for all sensors and numbers of models
    assert len(getattr(depth_first.grow, "signatures", ())) <= 1


def test_a_track_without_a_covariance_is_named():
    one, rng = filters(ExtendedKalmanFilter, 1), np.random.default_rng(0)
    states = predicted(one, rng)
    z = scan(PLACES, states, rng)
    states.covariance[4, 0, 1] = states.covariance[4, 1, 0] = 1e9
    with pytest.raises(InvalidInputError, match="covariance of target 4 is not positive definite"):
        grown(one, states, z, PLACES)
