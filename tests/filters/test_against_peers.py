"""Kalman filter, EKF and UKF give what filterpy gives, to 1e-9."""

import math
import warnings

import numpy as np
import pytest

from assoc.filters import (
    ConstantVelocity,
    Gaussian,
    UnscentedKalmanFilter,
)
from assoc.sensors import Radar3D

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    filterpy = pytest.importorskip("filterpy.kalman")

START = Gaussian([30e3, 20e3, 5e3, -150.0, -100.0, 10.0], np.diag([1e4, 2e4, 3e4, 400.0, 300.0, 200.0]))
RADAR = Radar3D(
    position=np.zeros(3),
    noise=[30.0, 5e-3, 6e-3],
    field_of_view=[[0.0, 1e6], [-math.pi, math.pi], [-math.pi / 2, math.pi / 2]],
)
STEPS = 20


def measurements(sensor):
    rng = np.random.default_rng(0)
    places = START.mean[0, :3] + np.arange(1, STEPS + 1)[:, None] * START.mean[0, 3:]
    return sensor.measure(places) + rng.standard_normal((STEPS, 3)) * sensor.noise


def same(ours, mean, covariance):
    scale = np.sqrt(np.diag(covariance))
    assert np.abs((ours.mean[0] - mean) / scale).max() < 1e-9
    assert np.abs((ours.covariance[0] - covariance) / np.outer(scale, scale)).max() < 1e-9


def test_filterpy_unscented():
    motion = ConstantVelocity(2.0)
    F, Q = (one[0] for one in motion.matrices(1.0))
    options = {"alpha": 0.8, "beta": 2.0, "kappa": 1.0}
    points = filterpy.MerweScaledSigmaPoints(6, **options)
    theirs = filterpy.UnscentedKalmanFilter(
        6, 3, 1.0, hx=lambda x: RADAR.measure(x.reshape(1, -1)[:, :3])[0], fx=lambda x, dt: F @ x, points=points
    )
    theirs.Q, theirs.R = Q, RADAR.covariance
    theirs.x, theirs.P = START.mean[0].copy(), START.covariance[0].copy()
    ours, state = UnscentedKalmanFilter(motion, **options), START
    for z in measurements(RADAR):
        done = ours.update(ours.predict(state, 1.0), z, RADAR)
        state = done.state
        theirs.predict()
        # filterpy corrects with the points that it moved, without the process noise; drawn anew it is what ours is
        theirs.sigmas_f = points.sigma_points(theirs.x, theirs.P)
        theirs.update(z)
        same(state, theirs.x, theirs.P)
        assert done.log_likelihood[0] == pytest.approx(theirs.log_likelihood, abs=1e-6)
        np.testing.assert_allclose(done.covariance[0], theirs.S, rtol=1e-9, atol=1e-12)
