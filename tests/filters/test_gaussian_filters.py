"""Kalman filter and EKF: against the textbook in plain numpy, batches, and refusals."""

from dataclasses import replace

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
    FunctionMotion,
    FuzzyAdaptiveEKF,
    Gaussian,
    InteractingMultipleModel,
    KalmanFilter,
    LinearMeasurement,
    LinearMotion,
    ModifiedEKF,
    UnscentedKalmanFilter,
    bounds,
    nees,
    paper_rules,
)
from assoc.sensors.codes import CODES
from assoc.sensors.kernels.dispatch import linearise, measure, wrap
from tests.filters.common import BEARING, MOTION, PLACE, RADAR, SENSORS, kalman_update, random_state


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


@pytest.mark.slow
def test_users_models_are_as_good_as_ours():
    rng = np.random.default_rng(3)
    state = random_state(5, rng)
    z = RADAR.measure(state.mean[:, :3]) + 1e-3
    own_sensor = FunctionMeasurement(lambda x: RADAR.measure(x[:, :3]), RADAR.covariance, residual=RADAR.residual)
    F, Q = (one[0] for one in MOTION.matrices(1.0))
    own_motion = FunctionMotion(lambda x, dt: x @ F.T, Q, 6)
    for kind in (ExtendedKalmanFilter, UnscentedKalmanFilter):
        ours, users = kind(MOTION), kind(own_motion)
        a, b = ours.predict(state, 1.0), users.predict(state, 1.0)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-6, atol=1e-6)
        u, w = ours.update(a, z, RADAR), users.update(a, z, own_sensor)
        np.testing.assert_allclose(u.state.mean, w.state.mean, rtol=1e-6)
        np.testing.assert_allclose(u.state.covariance, w.state.covariance, rtol=1e-5, atol=1e-4)
        np.testing.assert_allclose(ours.compare(a, z, RADAR)[0], users.compare(a, z, own_sensor)[0], rtol=1e-6)


def test_a_matrix_is_a_position_sensor():
    state = random_state(4, np.random.default_rng(4))
    z = state.mean[:, :3] + 10.0
    matrix = LinearMeasurement(np.eye(3, 6), PLACE.covariance)
    one, two = (KalmanFilter(MOTION).update(state, z, sensor) for sensor in (PLACE, matrix))
    assert np.array_equal(one.state.covariance, two.state.covariance)


def test_position_across_the_cut_of_the_azimuth():
    mean = np.array([-30e3 + 100.0, -200.0 + 1.0, 500.0, 0, 0, 0])
    state = Gaussian(mean, np.diag([1e4, 1e4, 1e4, 100, 100, 100.0]))
    z = RADAR.measure(np.array([[-30e3 + 100.0, -200.0 - 20.0, 500.0]]))
    for one in (ExtendedKalmanFilter(MOTION), ModifiedEKF(MOTION), UnscentedKalmanFilter(MOTION)):
        assert abs(one.update(state, z, RADAR).state.mean[0, 1] + 200) < 30
        assert one.distances(state, z, RADAR)[0, 0] < 1
    enkf = EnsembleKalmanFilter(MOTION, 200, 1)
    assert abs(enkf.update(enkf.start(state), z, RADAR).state.mean[0, 1] + 200) < 30


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*radians are expected")
@pytest.mark.parametrize("noise", [1e-3, 1.0, 1e3])
def test_covariances_stay_positive_definite_for_1e5_steps(noise):
    filters = [ExtendedKalmanFilter(MOTION), UnscentedKalmanFilter(MOTION)]
    if noise == 1.0:
        filters.append(ModifiedEKF(MOTION))
    radar = type(RADAR)(position=np.zeros(3), noise=noise * RADAR.noise, field_of_view=RADAR.field_of_view)
    for one in filters:
        state = Gaussian([30e3, 20e3, 5e3, 0, 0, 0], np.diag([1e8, 1e8, 1e8, 1e6, 1e6, 1e6]))
        z = radar.measure(state.mean[:, :3])
        worst = np.inf
        for k in range(100_000 if noise == 1.0 else 10_000):
            # correction after correction in bursts: the hardest on a covariance
            if k % 3 == 0:
                state = one.predict(state, 0.1)
            state = one.update(state, z, radar).state
            if k % 1000 == 999:
                P = state.covariance[0]
                assert np.array_equal(P, P.T)
                worst = min(worst, np.linalg.eigvalsh(P).min())
        assert worst > 0


def test_refusals():
    state = random_state(3, np.random.default_rng(5))
    ekf = ExtendedKalmanFilter(MOTION)
    z = RADAR.measure(state.mean[:, :3])
    for bad in (np.nan, np.inf):
        broken = z.copy()
        broken[1, 2] = bad
        for one in (ekf, ModifiedEKF(MOTION), UnscentedKalmanFilter(MOTION)):
            with pytest.raises(InvalidInputError, match="measured must be finite, row 1"):
                one.update(state, broken, RADAR)
    with pytest.raises(InvalidInputError, match="measurements must be finite"):
        ekf.log_likelihood(state, broken, RADAR)
    with pytest.raises(InvalidInputError, match=r"measured must have shape \(3, 3\)"):
        ekf.update(state, z[:2], RADAR)
    with pytest.raises(InvalidInputError, match="measured must be numbers"):
        ekf.update(state, "abc", RADAR)
    with pytest.raises(InvalidInputError, match="covariance must be positive definite, number 1"):
        P = state.covariance.copy()
        P[1, 0, 0] = -1.0
        P[1, 0, 1:] = P[1, 1:, 0] = 0.0
        Gaussian(state.mean, P)
    with pytest.raises(InvalidInputError, match="covariance must be symmetric"):
        P = state.covariance.copy()
        P[0, 0, 1] += 100
        Gaussian(state.mean, P)
    with pytest.raises(InvalidInputError, match="mean must be finite"):
        Gaussian(np.full(6, np.nan), np.eye(6))
    with pytest.raises(InvalidInputError, match="covariance must have"):
        Gaussian(np.zeros(6), np.eye(5))
    with pytest.raises(InvalidInputError, match="state must have 6 components, got 4"):
        ekf.predict(Gaussian(np.zeros(4), np.eye(4)), 1.0)
    with pytest.raises(InvalidInputError, match="motion must be linear"):
        KalmanFilter(CoordinatedTurn(1.0, 0.1))
    with pytest.raises(InvalidInputError, match="sensor must be linear"):
        KalmanFilter(MOTION).update(state, z, RADAR)
    with pytest.raises(InvalidInputError, match="sensor must be a Radar3D"):
        ModifiedEKF(MOTION).update(state, z[:, :1], BEARING)
    with pytest.raises(InvalidInputError, match="noise must be a number"):
        ConstantVelocity(float("nan"))
    with pytest.raises(InvalidInputError, match="dt must be"):
        ekf.predict(state, -1.0)
    with pytest.raises(InvalidInputError, match="matrix must have 6 columns"):
        ekf.update(state, z, LinearMeasurement(np.eye(3), np.eye(3)))
    with pytest.raises(InvalidInputError, match="sum to 1"):
        InteractingMultipleModel([ekf, ekf], [[0.9, 0.2], [0.1, 0.9]])
    with pytest.raises(InvalidInputError, match="size must be"):
        EnsembleKalmanFilter(MOTION, 1)
    for wrong in (-1, 0.5, "one", None):
        with pytest.raises(InvalidInputError, match="rng must be a Generator or a seed"):
            EnsembleKalmanFilter(MOTION, 20, wrong)
    with pytest.raises(InvalidInputError, match="window must be"):
        FuzzyAdaptiveEKF(MOTION, paper_rules(), window=0)
    with pytest.raises(InvalidInputError, match="dim and runs must be above 0"):
        bounds(3, float("nan"))
    with pytest.raises(InvalidInputError, match="covariance of target 0 is singular"):
        nees(EnsembleKalmanFilter(MOTION, 4).start(state[:1]), np.zeros((1, 6)))
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


def test_users_matrices_of_a_wrong_shape_are_refused():
    state = random_state(2, np.random.default_rng(6))
    z = state.mean[:, :2]

    def moved(noise, jacobian=None):
        return ExtendedKalmanFilter(FunctionMotion(lambda x, dt: x, noise, 6, jacobian=jacobian)).predict(state, 1.0)

    def corrected(**models):
        sensor = FunctionMeasurement(lambda x: x[:, :2], np.eye(2), **models)
        return ExtendedKalmanFilter(MOTION).update(state, z, sensor)

    for noise in (np.eye(3), np.ones((3, 6, 6)), lambda x, dt: np.eye(3)):
        with pytest.raises(InvalidInputError, match=r"noise must have shape \(2, 6, 6\)"):
            moved(noise)
    with pytest.raises(InvalidInputError, match=r"jacobian must have shape \(2, 6, 6\), got \(2, 2, 2\)"):
        moved(np.eye(6), lambda x, dt: np.ones((len(x), 2, 2)))
    with pytest.raises(InvalidInputError, match=r"jacobian must have shape \(2, 2, 6\), got \(2, 6, 2\)"):
        corrected(jacobian=lambda x: np.ones((len(x), 6, 2)))
    for wrong in (lambda a, b: (a - b)[:, 0], lambda a, b: (a - b)[:, :1]):
        with pytest.raises(InvalidInputError, match=r"residual must have shape \(2, 2\)"):
            corrected(residual=wrong)


def test_differences_of_an_angle_do_not_jump():
    sensor = FunctionMeasurement(
        lambda x: np.arctan2(x[:, 1], x[:, 0])[:, None],
        [[1e-4]],
        residual=lambda a, b: (a - b + np.pi) % (2 * np.pi) - np.pi,
    )
    slopes = sensor.jacobian(np.array([[-1000.0, 0.0, 0.0, 0.0, 0.0, 0.0]]))
    np.testing.assert_allclose(slopes[0, 0], [0.0, -1e-3, 0.0, 0.0, 0.0, 0.0], atol=1e-9)


def test_arrays_of_the_user_stay_his_own():
    mean, P, H, R, Q = np.zeros(6), np.eye(6), np.eye(3, 6), np.eye(3), np.eye(6)
    state, sensor = Gaussian(mean, P), LinearMeasurement(H, R)
    function, motion = FunctionMeasurement(lambda x: x[:, :3], R), FunctionMotion(lambda x, dt: x, Q, 6)
    T, weights = np.array([[0.9, 0.1], [0.1, 0.9]]), np.array([0.5, 0.5])
    imm = InteractingMultipleModel([KalmanFilter(MOTION)] * 2, T, weights)
    for array in (mean, P, H, R, Q, T, weights):
        array += 7.0
    assert not state.mean.any() and np.array_equal(state.covariance[0], np.eye(6))
    assert np.array_equal(sensor.matrix, np.eye(3, 6))
    for one in (sensor.covariance, function.covariance):
        assert np.array_equal(one, np.eye(3))
    assert np.array_equal(motion.noise(state.mean, 1.0)[0], np.eye(6))
    assert imm.transition[0, 0] == 0.9 and imm.weights.tolist() == [0.5, 0.5]


def test_expected_covariances_that_are_none_are_refused():
    """Weights of the unscented transform may be negative, and then what they make of a parabola."""
    one = UnscentedKalmanFilter(MOTION, beta=0.0, kappa=-3.0)
    state = Gaussian(np.zeros(6), np.eye(6))
    sensor = FunctionMeasurement(lambda x: (x**2).sum(axis=1)[:, None], [[1.0]])
    for call in (lambda: one.update(state, [[6.0]], sensor), lambda: one.log_likelihood(state, [[6.0]], sensor)):
        with pytest.raises(InvalidInputError, match="covariance of target 0 is not positive definite"):
            call()


def test_threads_do_not_mix_up_sensors_and_time_steps():
    """Another thread asks with another sensor, just after this one has remembered its own."""
    other = CoordinatedTurn(1.0, 0.1)
    other.noise(np.zeros((1, 7)), 9.0)

    class Interrupted(ExtendedKalmanFilter):
        def _observation(self, sensor):
            if sensor is RADAR:
                for _ in range(70):
                    self.observe(replace(BEARING))
            return super()._observation(sensor)

    class InterruptedTurn(CoordinatedTurn):
        @property
        def _noise(self):
            return other.__dict__["_noise"]

        @_noise.setter
        def _noise(self, value):
            pass

    tracking = Interrupted(MOTION)
    assert tracking.observe(RADAR).dim == 3
    # the sensors of a scan are remembered together
    models = [tracking.observe(sensor) for sensor in (RADAR, BEARING)]
    assert all(tracking.observe(sensor) is model for sensor, model in zip((RADAR, BEARING), models, strict=True))
    turn = InterruptedTurn(1.0, 0.1)
    assert turn.noise(np.zeros((1, 7)), 2.0)[0, 3, 3] == pytest.approx(4.0)
