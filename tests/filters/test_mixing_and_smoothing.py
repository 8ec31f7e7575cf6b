"""IMM, ensemble, smoother, motion models, the UAV and consistency: each against something independent."""

import numpy as np
import pytest
from scipy.integrate import quad_vec, solve_ivp
from scipy.linalg import expm
from scipy.stats import multivariate_normal

from assoc.errors import InvalidInputError
from assoc.filters import (
    ConstantAcceleration,
    ConstantVelocity,
    CoordinatedTurn,
    EnsembleKalmanFilter,
    ExtendedKalmanFilter,
    FixedLagSmoother,
    FuzzyAdaptiveEKF,
    Gaussian,
    InteractingMultipleModel,
    Jerk,
    KalmanFilter,
    LinearMeasurement,
    Singer,
    UnmannedAircraft,
    UnscentedKalmanFilter,
    transition_from_sojourns,
)
from assoc.filters.imm import Mixture, _mixed
from assoc.filters.motion.models import differences
from tests.filters.common import MOTION, PLACE, RADAR, kalman_update, random_state


def test_one_cycle_of_the_imm_in_plain_numpy():
    rng = np.random.default_rng(0)
    models = [ConstantVelocity(0.5), ConstantVelocity(20.0)]
    T = np.array([[0.9, 0.1], [0.3, 0.7]])
    imm = InteractingMultipleModel([KalmanFilter(m) for m in models], T, [0.6, 0.4])
    state = imm.start(random_state(1, rng))
    z = state.mean[:, :3] + np.array([[80.0, -60.0, 30.0]])
    H = np.eye(3, 6)
    means, covs, weights = list(state.means[0]), list(state.covariances[0]), np.array([0.6, 0.4])
    for _ in range(3):
        predicted = imm.predict(state, 1.0)
        table = imm.log_likelihood(predicted, z, PLACE)
        done = imm.update(predicted, z, PLACE)
        state = done.state
        c = weights @ T
        mixed = []
        for j in range(2):
            share = weights * T[:, j] / c[j]
            m = sum(share[i] * means[i] for i in range(2))
            P = sum(share[i] * (covs[i] + np.outer(means[i] - m, means[i] - m)) for i in range(2))
            mixed.append((m, P))
        density = []
        for j, (m, P) in enumerate(mixed):
            F, Q = (one[0] for one in models[j].matrices(1.0))
            m, P = F @ m, F @ P @ F.T + Q
            means[j], covs[j], v, S = kalman_update(m, P, z[0], H @ m, H, PLACE.covariance)
            density.append(multivariate_normal.pdf(v, np.zeros(3), S))
        weights = c * density
        assert done.log_likelihood[0] == pytest.approx(np.log(weights.sum()))
        assert table[0, 0] == pytest.approx(np.log(weights.sum()))
        weights /= weights.sum()
        np.testing.assert_allclose(state.weights[0], weights, rtol=1e-9)
        np.testing.assert_allclose(state.mean[0], weights @ np.array(means), rtol=1e-9)
        np.testing.assert_allclose(state.covariances[0], covs, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("modes", [2, 3])
def test_four_seconds_are_four_seconds_however_they_are_cut(modes):
    if modes == 2:
        transition = np.array([[0.9, 0.1], [0.25, 0.75]])
    else:
        transition = transition_from_sojourns([20.0, 6.0, 3.0])
    models = [KalmanFilter(ConstantVelocity(noise)) for noise in (0.5, 5.0, 20.0)[:modes]]
    imm = InteractingMultipleModel(models, transition, np.eye(modes)[0])
    start = imm.start(random_state(2, np.random.default_rng(3)))
    found = []
    for calls in (1, 4, 16, 160):
        state = start
        for _ in range(calls):
            state = imm.predict(state, 4.0 / calls)
        found.append(state.weights)
    wanted = np.linalg.matrix_power(transition, 4)[0]
    np.testing.assert_allclose(found[0], np.broadcast_to(wanted, (2, modes)), rtol=1e-12)
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], rtol=0, atol=1e-12)
    # a second is what `transition` says, to the bit
    assert np.array_equal(imm.predict(start, 1.0).weights, start.weights @ transition)
    np.testing.assert_array_equal(imm.predict(start, 0.0).weights, start.weights)


def test_transitions_of_another_interval_and_of_mean_times():
    models = [KalmanFilter(ConstantVelocity(noise)) for noise in (0.5, 20.0)]
    slow = InteractingMultipleModel(models, np.array([[0.9, 0.1], [0.1, 0.9]]), interval=4.0)
    np.testing.assert_allclose(slow.transition_over(8.0), np.linalg.matrix_power(slow.transition, 2), rtol=1e-12)
    made = InteractingMultipleModel(models, transition_from_sojourns([30.0, 5.0], 2.0), interval=2.0)
    np.testing.assert_allclose(made.rates, [[-1 / 30, 1 / 30], [1 / 5, -1 / 5]], rtol=1e-9)


@pytest.mark.parametrize("wrong", [[[0.2, 0.8], [0.9, 0.1]], [[0.5, 0.5], [0.5, 0.5]], [[0.0, 1.0], [1.0, 0.0]]])
def test_transitions_that_no_chain_in_time_has_are_refused(wrong):
    models = [KalmanFilter(ConstantVelocity(noise)) for noise in (0.5, 20.0)]
    with pytest.raises(InvalidInputError, match="transition: .* chain in continuous time"):
        InteractingMultipleModel(models, wrong)
    with pytest.raises(InvalidInputError, match="seconds"):
        transition_from_sojourns([1.0, 0.0])


def batch_least_squares(start, motion, sensor, measured, dt):
    """All states of one target from the whole normal equations, means and covariances."""
    F, Q = (one[0] for one in motion.matrices(dt))
    n, K = motion.dim, len(measured)
    A, b = np.zeros((n * (K + 1), n * (K + 1))), np.zeros(n * (K + 1))
    W, V, R = np.linalg.inv(start.covariance[0]), np.linalg.inv(Q), np.linalg.inv(sensor.covariance)
    A[:n, :n] += W
    b[:n] += W @ start.mean[0]
    H = np.eye(sensor.dim, n)
    for k in range(K):
        i, j = slice(n * k, n * k + n), slice(n * k + n, n * k + 2 * n)
        A[i, i] += F.T @ V @ F
        A[i, j] -= F.T @ V
        A[j, i] -= V @ F
        A[j, j] += V + H.T @ R @ H
        b[j] += H.T @ R @ measured[k]
    P = np.linalg.inv(A)
    return (P @ b).reshape(-1, n), P


@pytest.mark.parametrize("kind", ["kalman", "ekf", "ukf", "imm", "fuzzy"])
def test_smoothing_is_batch_least_squares(kind):
    rng = np.random.default_rng(2)
    motion = ConstantVelocity(2.0, kind="continuous")
    filter_ = {
        "kalman": lambda: KalmanFilter(motion),
        "ekf": lambda: ExtendedKalmanFilter(motion),
        "ukf": lambda: UnscentedKalmanFilter(motion),
        "imm": lambda: InteractingMultipleModel([KalmanFilter(motion)] * 2, [[0.9, 0.1], [0.2, 0.8]]),
        "fuzzy": lambda: FuzzyAdaptiveEKF(motion, None),
    }[kind]()
    start = random_state(1, rng)
    z = start.mean[0, :3] + np.arange(1, 7)[:, None] * start.mean[0, 3:] + rng.normal(0, 40, (6, 3))
    means, P = batch_least_squares(start, motion, PLACE, z, 1.0)
    smoother = FixedLagSmoother(filter_, 10)
    window = smoother.start(start)
    for one in z:
        window = smoother.predict(window, 1.0)
        window, _ = smoother.update(window, one[None], PLACE)
    smoothed = window.smoothed()
    assert len(smoothed) == 7
    for k, state in enumerate(smoothed):
        np.testing.assert_allclose(state.mean[0], means[k], rtol=1e-7, atol=1e-5)
        part = P[6 * k : 6 * k + 6, 6 * k : 6 * k + 6]
        np.testing.assert_allclose(state.covariance[0], part, rtol=1e-5, atol=1e-4)


def test_a_large_ensemble_is_a_kalman_filter():
    start = random_state(1, np.random.default_rng(4))
    kalman, enkf = KalmanFilter(MOTION), EnsembleKalmanFilter(MOTION, 100_000, 7)
    a, b = start, enkf.start(start)
    z = start.mean[:, :3] + 30.0
    a, b = kalman.predict(a, 1.0), enkf.predict(b, 1.0)
    np.testing.assert_allclose(
        enkf.expected(b, PLACE).covariance, kalman.expected(a, PLACE).covariance, rtol=0.05, atol=100
    )
    u, w = kalman.update(a, z, PLACE), enkf.update(b, z, PLACE)
    scale = np.sqrt(np.diag(u.state.covariance[0]))
    assert np.abs((u.state.mean - w.state.mean)[0] / scale).max() < 0.02
    assert np.abs((u.state.covariance - w.state.covariance)[0] / np.outer(scale, scale)).max() < 0.03
    assert w.log_likelihood[0] == pytest.approx(u.log_likelihood[0], abs=0.05)


def test_coordinated_turn_against_integration():
    state = np.array([[1e3, 2e3, 3e3, 120.0, -80.0, 5.0, 0.07], [0, 0, 0, 10.0, 20.0, 1.0, 1e-7]])
    turn = CoordinatedTurn(1.0, 0.01)
    for row, moved in zip(state, turn.propagate(state, 3.0), strict=True):
        w = row[6]
        flow = solve_ivp(lambda _, y, w=w: [*y[3:6], -w * y[4], w * y[3], 0.0], (0, 3), row[:6], rtol=1e-11, atol=1e-9)
        np.testing.assert_allclose(moved[:6], flow.y[:, -1], rtol=1e-8)
    numeric = differences(lambda x: turn.propagate(x, 3.0), state)
    np.testing.assert_allclose(turn.jacobian(state, 3.0), numeric, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("model", [ConstantVelocity, ConstantAcceleration])
def test_continuous_noise_adds_up_over_steps(model):
    motion = model(1.5, kind="continuous")
    F, Q = (one[0] for one in motion.matrices(0.4))
    both = F @ Q @ F.T + Q
    np.testing.assert_allclose(motion.matrices(0.8)[1][0], both, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(("model", "order"), [(Singer, 2), (Jerk, 3)])
def test_correlated_motion_is_its_stochastic_differential_equation(model, order):
    """F and Q by their definitions, at steps from a thousandth of the correlation time to a hundred of it."""
    motion, n = model(3.0, 20.0, 2), order + 1
    A = np.eye(n, k=1)
    A[-1, -1] = -1.0 / 20.0
    for dt in (0.02, 4.0, 90.0):
        F, Q = (one[0][::2, ::2] for one in motion.matrices(dt))
        np.testing.assert_allclose(F, expm(A * dt), rtol=1e-9, atol=1e-12)
        spread = quad_vec(lambda t: np.outer(expm(A * t)[:, -1], expm(A * t)[:, -1]), 0.0, dt, epsrel=1e-10)[0]
        np.testing.assert_allclose(Q, 2.0 * 9.0 / 20.0 * spread, rtol=1e-7)
    # in the long run the last derivative has the standard deviation that is given
    F, Q = (one[0] for one in motion.matrices(2000.0))
    assert Q[-1, -1] == pytest.approx(9.0) and F[-1, -1] == pytest.approx(0.0, abs=1e-12)
    assert motion.matrices(0.0)[0][0] == pytest.approx(np.eye(2 * n)) and not motion.matrices(0.0)[1].any()
    with pytest.raises(InvalidInputError, match="correlation_time"):
        model(3.0, 0.0)


def test_discrete_noise_is_the_papers():
    dt = 0.5
    F, Q = (one[0] for one in ConstantAcceleration(2.0, dimensions=2).matrices(dt))
    G = np.kron(np.array([[dt**2 / 2], [dt], [1.0]]), np.eye(2))
    np.testing.assert_allclose(Q, 4.0 * G @ G.T)
    assert F[0, 2] == dt and F[0, 4] == dt**2 / 2 and F[2, 4] == dt


def test_the_aircraft_is_the_papers_in_body_axes():
    motion = UnmannedAircraft(3000.0, 0.03, np.eye(4))
    state = np.array([[0.1, 272.0, 5.0, 150.0]])
    g, v, _, h = state[0]
    rho = 3.312e-9 * h**2 - 1.142e-4 * h + 1.224
    a = 0.03
    D = 0.5 * (-1.9431 * a**2 - 0.1499 * a + 0.2359) * rho * v**2 * 0.3376
    L = 0.5 * rho * v**2 * 0.3376 * 21.9 * a
    dt = 0.0167
    # body axes, turned by the angle of attack against the path
    force = complex(3000 - D, L) * np.exp(1j * a) - 1005 * 9.81 * complex(np.sin(g), np.cos(g))
    expected = [
        g + dt * force.imag / (1005 * v),
        v + dt * force.real / 1005,
        5.0 + dt * v * np.cos(g),
        h + dt * v * np.sin(g),
    ]
    np.testing.assert_allclose(motion.propagate(state, dt)[0], expected, rtol=1e-13)
    numeric = differences(lambda x: motion.propagate(x, dt), state)
    np.testing.assert_allclose(motion.jacobian(state, dt), numeric, rtol=1e-7, atol=1e-7)
    with pytest.raises(InvalidInputError, match="attack"):
        UnmannedAircraft(3000.0, float("nan"), np.eye(4))
    seen = LinearMeasurement(np.eye(4)[[2]], np.eye(1))
    done = ExtendedKalmanFilter(motion).update(Gaussian(state, np.eye(4)), np.array([[6.0]]), seen)
    assert done.state.mean[0, 2] == pytest.approx(5.5)


class _Alone(ExtendedKalmanFilter):
    """A class of its own, so that a mixture does not know that it sees as others do."""


@pytest.mark.parametrize("sensor", [RADAR, PLACE])
def test_modes_as_one_batch_and_one_by_one_agree(sensor):
    """A mixture whose modes see alike corrects them in one call; the numbers are those of the modes by themselves."""
    rng = np.random.default_rng(5)
    motions = [ConstantVelocity(noise, dimensions=3, kind="continuous") for noise in (1.0, 30.0)]
    transition = np.array([[0.9, 0.1], [0.2, 0.8]])
    together = InteractingMultipleModel([ExtendedKalmanFilter(motion) for motion in motions], transition)
    apart = InteractingMultipleModel([ExtendedKalmanFilter(motions[0]), _Alone(motions[1])], transition)
    # azimuths around pi, where angles jump
    mean = np.column_stack([rng.normal((-9000.0, 0.0, 3000.0), 300.0, (7, 3)), rng.normal(0.0, 100.0, (7, 3))])
    begun = Gaussian(mean, np.diag([300.0**2] * 3 + [90.0**2] * 3))
    states = together.predict(together.predict(together.start(begun), 2.0), 4.0)
    z = sensor.measure(mean[:, :3] + rng.normal(0.0, 200.0, (7, 3)))
    one, other = together.update(states, z, sensor), apart.update(states, z, sensor)
    for name in ("innovation", "covariance", "nis", "log_likelihood"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-9, err_msg=name)
    np.testing.assert_allclose(one.state.means, other.state.means, rtol=1e-12)
    np.testing.assert_allclose(one.state.covariances, other.state.covariances, rtol=1e-12)
    np.testing.assert_allclose(one.state.weights, other.state.weights, rtol=1e-12)
    expected, rows = together.expected(states, sensor), np.array([0, 0, 3, 6])
    for mine, its in zip(expected, apart.expected(states, sensor), strict=True):
        np.testing.assert_allclose(mine, its, rtol=1e-12)
    fit = together.fit(states, expected, rows, z[rows], sensor)
    assert fit is not None
    np.testing.assert_allclose(fit.log_likelihood, one.log_likelihood[rows], rtol=1e-9)
    np.testing.assert_allclose(fit.nis, one.nis[rows], rtol=1e-9)
    # positions alone give the same likelihoods, also of the next measurement
    still, seen = together.positions_alone(states)
    assert still is not together and seen.means.shape == (7, 2, 3)
    corrected = still.update(seen, z, sensor)
    np.testing.assert_allclose(corrected.log_likelihood, one.log_likelihood, rtol=1e-9)
    np.testing.assert_allclose(corrected.state.mean, one.state.mean[:, :3], rtol=1e-9)
    again, full = still.update(corrected.state, z, sensor), together.update(one.state, z, sensor)
    np.testing.assert_allclose(again.log_likelihood, full.log_likelihood, rtol=1e-9)


def test_a_mixture_on_both_sides_of_the_azimuth_pi():
    """West of a radar azimuths jump; the mixture's spread is that of its mirror image in the east."""
    imm = InteractingMultipleModel([ExtendedKalmanFilter(MOTION)] * 2, np.array([[0.9, 0.1], [0.2, 0.8]]))
    found = []
    for side in (-1.0, 1.0):
        begun = imm.start(Gaussian(np.zeros((1, 6)), np.diag([50.0**2] * 6)))
        begun.means[0, :, :3] = RADAR.position + np.array([[side * 9e3, -100.0, 2e3], [side * 9e3, 300.0, 2e3]])
        found.append(imm.expected(begun, RADAR))
    west, east = found
    assert abs(west.mean[0, 1] % (2.0 * np.pi) - np.pi + east.mean[0, 1]) < 1e-9
    np.testing.assert_allclose(np.diagonal(west.covariance[0]), np.diagonal(east.covariance[0]), rtol=1e-9)


@pytest.mark.parametrize("models", [2, 3])
def test_covariances_of_mixtures_are_symmetric_to_the_last_bit(models):
    rng = np.random.default_rng(4)
    modes = [ExtendedKalmanFilter(ConstantVelocity(noise, kind="continuous")) for noise in (1.0, 10.0, 50.0)[:models]]
    model = InteractingMultipleModel(modes, np.full((models, models), 0.1) + np.eye(models) * (1 - 0.1 * models))
    roots = rng.normal(size=(20, models, 6, 6))
    P = roots @ roots.transpose(0, 1, 3, 2)
    P = 0.5 * (P + P.transpose(0, 1, 3, 2))
    state = Mixture(1e3 * rng.normal(size=(20, models, 6)), P, rng.dirichlet(np.ones(models), 20))
    mixed = _mixed(state, model.transition)
    for covariance in (state.covariance, mixed.covariances, model.predict(state, 2.0).covariance):
        np.testing.assert_array_equal(covariance, covariance.swapaxes(-1, -2))
