"""Many steps in one call, thousands of steps, and all of it without the compiler."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.filters import (
    ConstantVelocity,
    CoordinatedTurn,
    EnsembleKalmanFilter,
    ExtendedKalmanFilter,
    FuzzyAdaptiveEKF,
    InteractingMultipleModel,
    KalmanFilter,
    LinearMeasurement,
    ModifiedEKF,
    Padded,
    UnscentedKalmanFilter,
    paper_rules,
)
from experiments.filter_endurance import endure
from experiments.filter_endurance import filters as of_each_kind
from tests.filters.common import MOTION, PLACE, RADAR, random_state

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


def results():
    found = {}
    for name, (one, sensor) in every_filter().items():
        start, places = problem(one)
        z = places if name in ("kalman", "matrix") else np.stack([sensor.measure(p) for p in places])
        done = one.run(one.start(start), z, sensor, 1.0)
        found[name] = [part.tolist() for part in done[:4]]
        found[name] += [one.log_likelihood(done.state, z[-1], sensor).tolist()]
    return found


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


def test_refusals_of_a_run():
    ekf, start = ExtendedKalmanFilter(MOTION), random_state(2, np.random.default_rng(0))
    z = np.stack([RADAR.measure(start.mean[:, :3])] * 3)
    broken = z.copy()
    broken[1, 1, 0] = np.nan
    for measured, dt, message in (
        (broken, 1.0, "measured must be finite"),
        (z[:, :1], 1.0, r"measured must have shape \(K, 2, 3\)"),
        (z[:0], 1.0, "K > 0"),
        (z, [1.0], "dt must be one number or 3"),
        (z, -1.0, "dt must be a number >= 0"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            ekf.run(start, measured, RADAR, dt)
    far = start[:1]
    far.mean[0, 0] = np.inf
    with pytest.raises(InvalidInputError, match="target 0 .* at step 0"):
        ekf.run(far, z[:, :1], RADAR, 1.0)


def test_a_sensor_that_was_refused_once_is_refused_again():
    one, start = KalmanFilter(MOTION), random_state(1, np.random.default_rng(0))
    for _ in range(2):
        with pytest.raises(InvalidInputError, match="must be linear"):
            one.update(start, RADAR.measure(start.mean[:, :3]), RADAR)


@pytest.mark.parametrize("name", ["EnKF, N 20", "fuzzy-adaptive EKF", "IMM"])
def test_covariances_stay_positive_definite_for_many_steps(name):
    """10^5 steps of every filter: python -m experiments.filter_endurance."""
    rng = np.random.default_rng(5)
    least, asymmetry, deviation = endure(of_each_kind(rng)[name], 3_000, rng).T
    assert least.min() > 1e-12 and asymmetry.max() < 1e-12 and deviation.max() < 300


def test_without_the_compiler_it_is_the_same():
    code = "import json; from tests.filters.test_running import results; print(json.dumps(results()))"
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, cwd=os.getcwd(),
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    plain, compiled = json.loads(done.stdout), results()
    for name, parts in compiled.items():
        for a, b in zip(plain[name], parts, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * np.abs(b).max(), err_msg=name)
