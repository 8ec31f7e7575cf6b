"""Many steps in one call, thousands of steps, and all of it without the compiler."""

import numpy as np
import pytest

from assoc.costs.tracks import gating
from assoc.errors import InvalidInputError
from assoc.filters import (
    ConstantVelocity,
    CoordinatedTurn,
    EnsembleKalmanFilter,
    ExtendedKalmanFilter,
    FuzzyAdaptiveEKF,
    Gaussian,
    InteractingMultipleModel,
    KalmanFilter,
    LinearMeasurement,
    ModifiedEKF,
    Padded,
    UnscentedKalmanFilter,
    paper_rules,
)
from assoc.filters.kernels import gaussian, points
from tests.filters.common import MOTION, PLACE, RADAR, random_state
from tests.sizes import sample

MIXED = [
    ExtendedKalmanFilter(Padded(ConstantVelocity(0.5), 0.1)),
    ExtendedKalmanFilter(CoordinatedTurn(5.0, 0.01)),
]


def every_filter():
    return {
        "kalman": (KalmanFilter(MOTION), PLACE),
        "matrix": (KalmanFilter(MOTION), LinearMeasurement(np.eye(3, 6), PLACE.covariance)),
        "ekf": (ExtendedKalmanFilter(MOTION), RADAR),
        "turn": (ExtendedKalmanFilter(CoordinatedTurn(2.0, 0.01)), RADAR),
        "modified": (ModifiedEKF(MOTION), RADAR),
        "unscented": (UnscentedKalmanFilter(MOTION), RADAR),
        "ensemble": (EnsembleKalmanFilter(MOTION, 20, 3), RADAR),
        "fuzzy": (FuzzyAdaptiveEKF(MOTION, paper_rules(), paper_rules(), immediate=True), RADAR),
        "imm": (InteractingMultipleModel(MIXED, np.array([[0.9, 0.1], [0.2, 0.8]])), RADAR),
    }


def problem(one, steps=4, count=3):
    """A start and measurements (K, B, 3) on the way that it expects."""
    start = random_state(count, np.random.default_rng(0), one.motion.dim)
    rng = np.random.default_rng(1)
    places = start.mean[:, :3] + np.arange(1, steps + 1)[:, None, None] * start.mean[:, 3:6]
    return start, places + rng.normal(0, 50.0, places.shape)


KERNELS = {"ekf": gaussian.update, "unscented": points.unscented, "gate": gating._sweep}


@pytest.mark.parametrize("name", KERNELS)
def test_read_only_measurements_compile_no_kernel_again(name):
    """Those of scenes are read only, and numba compiles for each kind of array."""
    one, sensor = every_filter()["ekf" if name == "gate" else name]
    start, z = problem(one, steps=1)
    kinds = []
    for writable in (True, False):
        z.setflags(write=writable)
        if name == "gate":
            gating.near_pairs(one.expected(start, sensor), z[0], (False, True, True), 16.0)
        else:
            one.update(start, z[0], sensor)
        kinds.append(len(KERNELS[name].signatures))
    assert kinds[0] == kinds[1]


@pytest.mark.slow
@pytest.mark.parametrize("name", every_filter())
@pytest.mark.parametrize("dt", [1.0, [1.0, 0.5, 2.0, 1.0]])
def test_a_run_is_its_steps(name, dt):
    (one, sensor), (again, _) = every_filter()[name], every_filter()[name]
    start, places = problem(one)
    z = places if name in ("kalman", "matrix") else np.stack([sensor.measure(p) for p in places])
    whole = one.run(one.start(start), z, sensor, dt)
    state = again.start(start)
    for k in range(4):
        done = again.update(again.predict(state, dt if dt == 1.0 else dt[k]), z[k], sensor)
        state = done.state
        for ours, theirs in (
            (whole.mean[k], state.mean),
            (whole.covariance[k], state.covariance),
            (whole.nis[k], done.nis),
            (whole.log_likelihood[k], done.log_likelihood),
        ):
            assert np.array_equal(ours, theirs)
    assert np.array_equal(whole.state.mean, state.mean) and type(whole.state) is type(state)


@pytest.mark.parametrize("dt", [-1.0, np.nan, np.inf, "1"])
@sample("name", every_filter(), every=5)
def test_time_does_not_run_backwards(name, dt):
    one, sensor = every_filter()[name]
    turning = ("turn", "unscented", "ensemble", "fuzzy")
    if name in turning:
        # models that are no matrix take another way
        kind = {"turn": ExtendedKalmanFilter, "unscented": UnscentedKalmanFilter, "ensemble": EnsembleKalmanFilter}
        turn = CoordinatedTurn(2.0, 0.01)
        one = kind[name](turn) if name in kind else FuzzyAdaptiveEKF(turn, paper_rules())
    state = one.start(random_state(2, np.random.default_rng(0), one.motion.dim))
    with pytest.raises(InvalidInputError, match="dt must be a number >= 0"):
        one.predict(state, dt)


@pytest.mark.parametrize("name", every_filter())
def test_covariances_stay_positive_definite_for_many_steps(name):
    """A target that stands still, corrected three times for each prediction: the hardest case for a covariance."""
    one, sensor = every_filter()[name]
    n, rng, kept = one.motion.dim, np.random.default_rng(5), np.array([30e3, 20e3, 5e3])
    mean = np.zeros((1, n))
    mean[:, :3] = kept
    state = one.start(Gaussian(mean, np.diag([1e8, 1e8, 1e8, 1e6, 1e6, 1e6, 1.0][:n])[None]))
    exact = kept[None] if isinstance(sensor, LinearMeasurement) else sensor.measure(kept[None])
    for k in range(3_000):
        if k % 3 == 0:
            state = one.predict(state, 0.1)
        noise = rng.standard_normal((1, 3)) * np.sqrt(np.diag(sensor.covariance))
        state = one.update(state, exact + noise, sensor).state
        if k % 100 == 99:
            P = state.covariance[0]
            scale = np.sqrt(np.diag(P))
            unit = P / np.outer(scale, scale)
            assert np.linalg.eigvalsh(unit).min() > 1e-12 and np.abs(unit - unit.T).max() < 1e-12
            assert np.sqrt(np.trace(P[:3, :3])) < 300


@pytest.mark.parametrize("name", every_filter())
def test_a_fit_is_what_an_update_says(name):
    """To the last bit, so that trackers may choose pairs first and correct states after; a mixture's NIS but nearly."""
    one, sensor = every_filter()[name]
    start, _ = problem(one, count=6)
    state, rng = one.start(start), np.random.default_rng(4)
    rows = np.repeat(np.arange(6), [3, 0, 1, 5, 2, 4])
    if isinstance(sensor, LinearMeasurement):
        places = start.mean[rows, :3]
    else:
        places = sensor.measure(start.mean[rows, :3])
    z = places + 3.0 * rng.standard_normal(places.shape) * np.sqrt(np.diag(sensor.covariance))
    fit = one.fit(state, one.expected(state, sensor), rows, z, sensor)
    if name in ("modified", "unscented", "ensemble", "fuzzy"):
        assert fit is None
        return
    done = one.update(state[rows], z, sensor)
    np.testing.assert_array_equal(fit.log_likelihood, done.log_likelihood)
    np.testing.assert_allclose(fit.nis, done.nis, rtol=1e-9 if name == "imm" else 0.0)


def test_a_filter_with_its_own_update_is_asked_for_it():
    class Cautious(KalmanFilter):
        def update(self, state, measured, sensor):
            return super().update(state, measured + 1.0, sensor)

    one, state = Cautious(MOTION), random_state(2, np.random.default_rng(0))
    assert one.fit(state, one.expected(state, PLACE), np.arange(2), state.mean[:, :3].copy(), PLACE) is None
