"""The modified EKF: its bias and covariance against a million samples, and what it is for."""

import math

import numpy as np
import pytest

from assoc.filters import ConstantVelocity, Gaussian, ModifiedEKF
from assoc.sensors import BearingSensor, Radar3D

MOTION = ConstantVelocity(0.01)


def radar(range_noise: float, angle: float) -> Radar3D:
    return Radar3D(
        position=np.zeros(3),
        noise=[range_noise, angle, 0.8 * angle],
        field_of_view=[[0.0, 1e6], [-math.pi, math.pi], [-math.pi / 2, math.pi / 2]],
    )


@pytest.mark.slow
@pytest.mark.parametrize("elevation", [5.0, 35.0, 60.0])
def test_debiased_mean_and_covariance_against_samples(elevation):
    """What is left of the residual, less H times the error, has mean 0 and the stated covariance.

    The expansion is of second order: what it leaves out is of the order of the angles' square.
    """
    rng = np.random.default_rng(0)
    sensor = radar(30.0, math.radians(1.5))
    e, r = math.radians(elevation), 100e3
    place = r * np.array([math.cos(e) * math.cos(0.4), math.cos(e) * math.sin(0.4), math.sin(e)])
    H = np.hstack([sensor.jacobian(place[None])[0], np.zeros((3, 3))])
    J = np.linalg.inv(H[:, :3])
    # prior: as wide across as half the measurement's noise, along as the range's noise
    prior = J @ np.diag([30.0**2, (0.7 * sensor.noise[1]) ** 2, (0.7 * sensor.noise[2]) ** 2]) @ J.T
    P = np.diag([1.0] * 6)
    P[:3, :3] = prior
    count = 1_000_000
    error = rng.multivariate_normal(np.zeros(3), prior, count)
    z = sensor.measure(place + error) + rng.standard_normal((count, 3)) * sensor.noise
    state = Gaussian(np.concatenate([place, np.zeros(3)]), P)
    big = Gaussian(np.tile(state.mean, (20_000, 1)), P)
    for simplified in (True, False):
        one = ModifiedEKF(MOTION, simplified)
        rest = np.concatenate(
            [
                one.update(big, z[k : k + 20_000], sensor).innovation - error[k : k + 20_000] @ H[:, :3].T
                for k in range(0, count, 20_000)
            ]
        )
        stated = one.expected(state, sensor).covariance[0] - H @ P @ H.T
        mean, spread = rest.mean(axis=0), np.cov(rest.T)
        if simplified:
            short, simple = spread[0, 0], spread[0, 0] / stated[0, 0]
            continue
        assert np.abs(mean / np.sqrt(np.diag(spread))).max() < 0.05
        np.testing.assert_allclose(np.diag(spread) / np.diag(stated), 1.0, atol=0.03)
    # the short form states far too little in range
    assert simple > 1.5
    # equation 2.28 lacks cos^4 of the elevation at sigma_azimuth^4: at 35 and 60 deg it fits neither residual
    printed = stated[0, 0] + 0.5 * r**2 * sensor.noise[1] ** 4 * (1 - math.cos(e) ** 4)
    assert elevation < 30 or 1.15 * spread[0, 0] < printed < short / 1.15
    # an ordinary EKF leaves a bias in range that the modified one has not
    plain = sensor.residual(z, sensor.measure(place[None])) - error @ H[:, :3].T
    assert abs(plain[:, 0].mean()) > 3 * abs(mean[0])
    assert np.var(plain[:, 0]) > 1.2 * sensor.covariance[0, 0]


def test_formulas_of_both_forms():
    """Straight from the corrected equations, one target."""
    sensor = radar(30.0, 0.02)
    rng = np.random.default_rng(1)
    A = rng.standard_normal((6, 9)) * 300
    state = Gaussian([60e3, 50e3, 40e3, 0, 0, 0], A @ A.T)
    z = sensor.measure(state.mean[:, :3]) + np.array([[20.0, 0.03, -0.02]])
    H = np.hstack([sensor.jacobian(state.mean[:, :3])[0], np.zeros((3, 3))])
    prior = H @ state.covariance[0] @ H.T
    r, _, phi = sensor.measure(state.mean[:, :3])[0]
    t, p, st, sp, bt, bp = 0.03, -0.02, 0.02, 0.016, prior[1, 1] ** 0.5, prior[2, 2] ** 0.5
    c, s, tan = math.cos(phi), math.sin(phi), math.tan(phi)
    full_mu = [
        r / 2 * (c**2 * (t**2 - st**2) + p**2 - sp**2), tan * t * p, -0.5 * s * c * (t**2 - st**2)
    ]  # fmt: skip
    full_R = [
        30.0**2 + r**2 * (st**4 * c**4 + sp**4) / 2 + r**2 * c**4 * st**2 * bt**2 + r**2 * sp**2 * bp**2,
        st**2 + tan**2 * (st**2 * sp**2 + st**2 * bp**2 + sp**2 * bt**2),
        sp**2,
    ]
    short_mu = [r / 2 * (t**2 + p**2 - st**2 - sp**2), 0.0, 0.0]
    short_R = [30.0**2 + r**2 * (st**4 + sp**4) / 2, st**2, sp**2]
    for simplified, mu, R in ((False, full_mu, full_R), (True, short_mu, short_R)):
        one = ModifiedEKF(MOTION, simplified)
        done = one.update(state, z, sensor)
        np.testing.assert_allclose(done.innovation[0], np.array([20.0, 0.03, -0.02]) - mu, rtol=1e-9)
        np.testing.assert_allclose(done.covariance[0], prior + np.diag(R), rtol=1e-9)
        assert one.log_likelihood(state, z, sensor)[0, 0] == pytest.approx(done.log_likelihood[0])
        assert one.distances(state, z, sensor)[0, 0] == pytest.approx(done.nis[0])


def test_other_sensors_are_refused():
    state = Gaussian([30e3, 20e3, 5e3, 0, 0, 0], np.eye(6))
    bearing = BearingSensor(position=np.zeros(3), noise=[0.01], field_of_view=[[-math.pi, math.pi]])
    with pytest.raises(ValueError, match="sensor must be a Radar3D or Radar2D"):
        ModifiedEKF(MOTION).update(state, bearing.measure(state.mean[:, :3]), bearing)
    mixed = Radar3D(
        position=np.zeros(3),
        noise=[[900.0, 0.1, 0.0], [0.1, 4e-4, 0.0], [0.0, 0.0, 4e-4]],
        field_of_view=[[0.0, 1e6], [-math.pi, math.pi], [-math.pi / 2, math.pi / 2]],
    )
    with pytest.raises(ValueError, match="uncorrelated"):
        ModifiedEKF(MOTION).update(state, np.zeros((1, 3)), mixed)
