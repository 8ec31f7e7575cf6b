"""Kalman filter and EKF: against the textbook in plain numpy, batches, and refusals."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from assoc.errors import InvalidInputError
from assoc.filters import (
    ConstantVelocity,
    CoordinatedTurn,
    EnsembleKalmanFilter,
    ExtendedKalmanFilter,
    FunctionMeasurement,
    FuzzyAdaptiveEKF,
    Gaussian,
    InteractingMultipleModel,
    KalmanFilter,
    LinearMeasurement,
    LinearMotion,
    ModifiedEKF,
    Motion,
    UnscentedKalmanFilter,
    bounds,
    paper_rules,
)
from assoc.filters.motion.models import differences
from assoc.sensors.codes import CODES
from assoc.sensors.kernels.dispatch import linearise, measure, wrap
from tests.filters.common import BEARING, MOTION, RADAR, SENSORS, kalman_update, random_state


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda s: s.kind)
def test_compiled_sensors_are_the_sensors(sensor):
    rng = np.random.default_rng(0)
    code, d = CODES[type(sensor)], sensor.dim
    places = np.concatenate([rng.normal(0, 1e4, (50, 3)), sensor.position[None]])
    h, H = np.zeros(d), np.ones((d, 3))
    for place, z, slopes in zip(places, sensor.measure(places), sensor.jacobian(places), strict=True):
        linearise(code, d, sensor.position, *place, h, H)
        np.testing.assert_allclose(h, z, rtol=1e-15, atol=1e-15)
        np.testing.assert_allclose(H, slopes, rtol=1e-14, atol=0)
        h[:] = 0
        measure(code, d, sensor.position, *place, h)
        np.testing.assert_allclose(h, z, rtol=1e-15, atol=1e-15)
    for v in (*rng.uniform(-9, 9, (20, d)), np.full(d, np.pi), np.full(d, -np.pi)):
        wrapped = v.copy()
        wrap(code, wrapped)
        np.testing.assert_allclose(wrapped, sensor.residual(v, np.zeros(d)), atol=1e-14)


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda s: s.kind)
def test_textbook(sensor):
    rng = np.random.default_rng(1)
    state = random_state(20, rng)
    ekf = ExtendedKalmanFilter(MOTION)
    F, Q = (one[0] for one in MOTION.matrices(0.7))
    predicted = ekf.predict(state, 0.7)
    np.testing.assert_allclose(predicted.mean, state.mean @ F.T, rtol=1e-13)
    np.testing.assert_allclose(predicted.covariance, F @ state.covariance @ F.T + Q, rtol=1e-10, atol=1e-8)
    z = sensor.measure(predicted.mean[:, :3]) + rng.standard_normal((20, sensor.dim)) * sensor.noise
    done = ekf.update(predicted, z, sensor)
    expected = ekf.expected(predicted, sensor)
    table, squares = ekf.compare(predicted, z, sensor)
    for b in range(20):
        place = predicted.mean[b : b + 1, :3]
        H = np.hstack([sensor.jacobian(place)[0], np.zeros((sensor.dim, 3))])
        mean, P, v, S = kalman_update(
            predicted.mean[b], predicted.covariance[b], z[b], sensor.measure(place)[0], H, sensor.covariance,
            sensor.residual,
        )  # fmt: skip
        np.testing.assert_allclose(done.state.mean[b], mean, rtol=1e-9)
        np.testing.assert_allclose(done.state.covariance[b], P, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(done.covariance[b], S, rtol=1e-10)
        np.testing.assert_allclose(expected.covariance[b], S, rtol=1e-10)
        assert done.nis[b] == pytest.approx(v @ np.linalg.solve(S, v))
        assert done.log_likelihood[b] == pytest.approx(multivariate_normal.logpdf(v, np.zeros(len(v)), S))
        for m in range(20):
            w = sensor.residual(z[m], expected.mean[b])
            assert squares[b, m] == pytest.approx(w @ np.linalg.solve(S, w), rel=1e-8)
        assert table[b, b] == pytest.approx(done.log_likelihood[b])


def test_a_batch_is_its_targets_one_by_one():
    rng = np.random.default_rng(2)
    state = random_state(7, rng)
    z = RADAR.measure(state.mean[:, :3])
    for one in (ExtendedKalmanFilter(MOTION), ModifiedEKF(MOTION), UnscentedKalmanFilter(MOTION)):
        together = one.update(one.predict(state, 1.0), z, RADAR)
        for b in range(7):
            alone = one.update(one.predict(state[b : b + 1], 1.0), z[b], RADAR)
            assert np.array_equal(alone.state.mean[0], together.state.mean[b])
            assert np.array_equal(alone.state.covariance[0], together.state.covariance[b])
    order = rng.permutation(7)
    assert np.array_equal(state[order].mean, state.mean[order])
    assert len(Gaussian.concatenate([state, state[:2]])) == 9


class OwnMotion(Motion):
    """A user's model, of which nothing is known but what it does."""

    def __init__(self, F, Q):
        self.dim, self.position, self.F, self.Q = 6, (0, 1, 2), F, Q

    def propagate(self, states, dt):
        return states @ self.F.T

    def jacobian(self, states, dt):
        return differences(lambda x: self.propagate(x, dt), states)

    def noise(self, states, dt):
        return self.Q[None]


@pytest.mark.slow
def test_users_models_are_as_good_as_ours():
    rng = np.random.default_rng(3)
    state = random_state(5, rng)
    z = RADAR.measure(state.mean[:, :3]) + 1e-3
    own_sensor = FunctionMeasurement(lambda x: RADAR.measure(x[:, :3]), RADAR.covariance, residual=RADAR.residual)
    F, Q = (one[0] for one in MOTION.matrices(1.0))
    own_motion = OwnMotion(F, Q)
    for kind in (ExtendedKalmanFilter, UnscentedKalmanFilter):
        ours, users = kind(MOTION), kind(own_motion)
        a, b = ours.predict(state, 1.0), users.predict(state, 1.0)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-6, atol=1e-6)
        u, w = ours.update(a, z, RADAR), users.update(a, z, own_sensor)
        np.testing.assert_allclose(u.state.mean, w.state.mean, rtol=1e-6)
        np.testing.assert_allclose(u.state.covariance, w.state.covariance, rtol=1e-5, atol=1e-4)
        np.testing.assert_allclose(ours.compare(a, z, RADAR)[0], users.compare(a, z, own_sensor)[0], rtol=1e-6)


def spoiled(covariance, place, value):
    changed = covariance.copy()
    changed[place] = value
    return changed


def test_refusals():
    state = random_state(3, np.random.default_rng(5))
    ekf, z, P = ExtendedKalmanFilter(MOTION), RADAR.measure(state.mean[:, :3]), state.covariance
    broken = z.copy()
    broken[1, 2] = np.nan
    for act, message in [
        *((lambda one=one: one(MOTION).update(state, broken, RADAR), "measured must be finite, row 1")
          for one in (ExtendedKalmanFilter, ModifiedEKF, UnscentedKalmanFilter)),
        (lambda: ekf.log_likelihood(state, broken, RADAR), "measurements must be finite"),
        (lambda: ekf.update(state, z[:2], RADAR), r"measured must have shape \(3, 3\)"),
        (lambda: Gaussian(state.mean, spoiled(P, (1, 0, 0), -1.0)), "covariance must be positive definite, number 1"),
        (lambda: Gaussian(state.mean, spoiled(P, (0, 0, 1), 1e6)), "covariance must be symmetric"),
        (lambda: Gaussian(np.zeros(6), np.eye(5)), "covariance must have"),
        (lambda: ekf.predict(Gaussian(np.zeros(4), np.eye(4)), 1.0), "state must have 6 components, got 4"),
        (lambda: KalmanFilter(CoordinatedTurn(1.0, 0.1)), "motion must be linear"),
        (lambda: KalmanFilter(MOTION).update(state, z, RADAR), "sensor must be linear"),
        (lambda: ModifiedEKF(MOTION).update(state, z[:, :1], BEARING), "sensor must be a Radar3D"),
        (lambda: ConstantVelocity(float("nan")), "noise must be a number"),
        (lambda: ekf.predict(state, -1.0), "dt must be"),
        (lambda: ekf.update(state, z, LinearMeasurement(np.eye(3), np.eye(3))), "matrix must have 6 columns"),
        (lambda: InteractingMultipleModel([ekf, ekf], [[0.9, 0.2], [0.1, 0.9]]), "sum to 1"),
        (lambda: EnsembleKalmanFilter(MOTION, 1), "size must be"),
        (lambda: EnsembleKalmanFilter(MOTION, 20, "one"), "rng must be a Generator or a seed"),
        (lambda: FuzzyAdaptiveEKF(MOTION, paper_rules(), window=0), "window must be"),
        (lambda: bounds(3, float("nan")), "dim and runs must be above 0"),
    ]:  # fmt: skip
        with pytest.raises(InvalidInputError, match=message):
            act()
    # a covariance that a user's own computing has ruined
    state.covariance[:] *= -1
    with pytest.raises(InvalidInputError, match="covariance of target 0 is not positive definite"):
        ekf.update(state, z, RADAR)


@pytest.mark.parametrize(
    ("dim", "position"), [(2, (0, 1, 2)), (6, (0, 1, 2, 3)), (6, (-6, -5, -4)), (6, (0,)), (6, (0, 0))]
)
def test_sensors_ask_for_coordinates_that_the_state_has(dim, position):
    """Kernels read what they are told to: beyond the state that is somebody else's memory."""
    motion = LinearMotion(lambda dt: np.eye(dim), lambda dt: np.eye(dim), dim, position)
    with pytest.raises(InvalidInputError, match="position must be two or three different components"):
        ExtendedKalmanFilter(motion).expected(Gaussian(np.ones(dim), np.eye(dim)), RADAR)


def test_expected_covariances_that_are_none_are_refused():
    """Weights of the unscented transform may be negative, and then what they make of a parabola."""
    one = UnscentedKalmanFilter(MOTION, beta=0.0, kappa=-3.0)
    state = Gaussian(np.zeros(6), np.eye(6))
    sensor = FunctionMeasurement(lambda x: (x**2).sum(axis=1)[:, None], [[1.0]])
    for call in (lambda: one.update(state, [[6.0]], sensor), lambda: one.log_likelihood(state, [[6.0]], sensor)):
        with pytest.raises(InvalidInputError, match="covariance of target 0 is not positive definite"):
            call()
