import math
from dataclasses import replace

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.filters import (
    ConstantVelocity,
    ExtendedKalmanFilter,
    Gaussian,
    InteractingMultipleModel,
    KalmanFilter,
    ModifiedEKF,
    UnscentedKalmanFilter,
)
from assoc.filters.motion.models import LinearMotion
from assoc.sensors import Radar3D
from tests.filters.common import MOTION, kalman_update, random_state

RADAR = Radar3D(
    position=[100.0, -200.0, 10.0],
    noise=[30.0, 2e-3, 3e-3, 0.5],
    field_of_view=[[0.0, 1e6], [-math.pi, math.pi], [-math.pi / 2, math.pi / 2], [-500.0, 500.0]],
)


def measured(state, rng, sensor=RADAR):
    z = sensor.measure(state.mean[:, :3], state.mean[:, 3:6])
    return z + rng.standard_normal(z.shape) * sensor.noise


def test_textbook():
    rng = np.random.default_rng(0)
    state, ekf = random_state(20, rng), ExtendedKalmanFilter(MOTION)
    z = measured(state, rng)
    done, expected = ekf.update(state, z, RADAR), ekf.expected(state, RADAR)
    h = RADAR.measure(state.mean[:, :3], state.mean[:, 3:])
    H = RADAR.jacobian(state.mean[:, :3], state.mean[:, 3:])
    np.testing.assert_allclose(expected.mean, h, rtol=1e-12)
    for b in range(20):
        mean, P, v, S = kalman_update(
            state.mean[b], state.covariance[b], z[b], h[b], H[b], RADAR.covariance, RADAR.residual
        )
        np.testing.assert_allclose(done.state.mean[b], mean, rtol=1e-9, atol=1e-6)
        np.testing.assert_allclose(done.state.covariance[b], P, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(done.innovation[b], v, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(expected.covariance[b], S, rtol=1e-9)
        assert done.nis[b] == pytest.approx(v @ np.linalg.solve(S, v), rel=1e-8)
    ll, square = ekf.compare(state, z, RADAR)
    np.testing.assert_allclose(np.diag(square), done.nis, rtol=1e-8)
    np.testing.assert_allclose(np.diag(ll), done.log_likelihood, rtol=1e-8)


def test_what_is_refused():
    still = LinearMotion(lambda dt: np.eye(3), lambda dt: np.eye(3), 3)
    for filter_, message in (
        (KalmanFilter(MOTION), "sensor must be linear"),
        (ModifiedEKF(MOTION), "takes no range rate"),
        (ExtendedKalmanFilter(still), "have no velocity of each coordinate"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            filter_.observe(RADAR)


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter, "imm"])
def test_folded_rates_count_around_the_interval_and_not_while_they_are_unknown(kind):
    if kind == "imm":
        modes = [ExtendedKalmanFilter(ConstantVelocity(q)) for q in (1.0, 20.0)]
        filter_ = InteractingMultipleModel(modes, [[0.9, 0.1], [0.1, 0.9]])
    else:
        filter_ = kind(MOTION)
    rng, folding = np.random.default_rng(0), replace(RADAR, folding=60.0)
    state = random_state(20, rng)
    z = measured(state, rng)
    # rates are expected to 10 m/s or so: every fold is known
    start = filter_.start(state)
    plain, folded = filter_.update(start, z, RADAR), filter_.update(start, folding.folded(z), folding)
    assert (np.abs(z[:, 3]) > 30.0).sum() > 5
    np.testing.assert_allclose(folded.state.mean, plain.state.mean, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(folded.log_likelihood, plain.log_likelihood, rtol=1e-9)
    # then to hundreds: as without rates, at the density of a number anywhere on the interval
    wide = state.covariance.copy()
    wide[:, 3:6, 3:6] += 300.0**2 * np.eye(3)
    start = filter_.start(Gaussian(state.mean, wide))
    without = filter_.update(start, z[:, :3], RADAR.position_part)
    folded = filter_.update(start, folding.folded(z), folding)
    np.testing.assert_allclose(folded.state.mean, without.state.mean, rtol=1e-9, atol=1e-6)
    off = folded.log_likelihood - without.log_likelihood + math.log(60.0)
    assert (off > -1.2).all() and (off < 0.33).all() and abs(off.mean()) < 0.4
    rows = np.arange(20)
    fit = filter_.fit(start, filter_.expected(start, folding), rows, folding.folded(z), folding)
    if fit is not None:
        np.testing.assert_allclose(fit.log_likelihood, folded.log_likelihood, rtol=1e-9)
    compared = filter_.log_likelihood(start, folding.folded(z), folding)
    np.testing.assert_allclose(compared[rows, rows], folded.log_likelihood, rtol=1e-9)
