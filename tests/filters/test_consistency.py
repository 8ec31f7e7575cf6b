"""NEES and NIS on a case in which all assumptions hold: exact filters lie within chi-square bounds."""

import numpy as np
import pytest
from scipy.stats import chi2

from assoc.filters import (
    ConstantVelocity,
    EnsembleKalmanFilter,
    ExtendedKalmanFilter,
    Gaussian,
    KalmanFilter,
    UnscentedKalmanFilter,
    nees,
)
from assoc.sensors import PositionSensor

RUNS, STEPS, SENSOR = (
    100,
    40,
    PositionSensor(position=np.zeros(3), noise=np.full(3, 50.0), field_of_view=[[-1e6, 1e6]] * 3),
)
MOTION = ConstantVelocity(1.0)


def consistency(one):
    """NEES (RUNS,) at the last step, and NIS (STEPS / 2, RUNS) over the second half of them.

    The truth starts and moves as the filter believes, drawn by hand with a piecewise constant acceleration.
    """
    rng = np.random.default_rng(0)
    F = np.eye(6) + np.diag(np.ones(3), 3)
    root = np.kron(np.array([[0.5], [1.0]]), np.eye(3))
    P, mean = np.diag([1e4, 1e4, 1e4, 100.0, 100.0, 100.0]), np.tile([5e3, 4e3, 1e3, -50.0, 20.0, 0.0], (RUNS, 1))
    truth = mean + rng.standard_normal((RUNS, 6)) @ np.sqrt(P)
    state, nis = one.start(Gaussian(mean, P)), []
    for _ in range(STEPS):
        truth = truth @ F.T + rng.standard_normal((RUNS, 3)) @ root.T
        measured = truth[:, :3] + 50.0 * rng.standard_normal((RUNS, 3))
        done = one.update(one.predict(state, 1.0), measured, SENSOR)
        state = done.state
        nis.append(done.nis)
    return nees(state, truth), np.array(nis[STEPS // 2 :])


def inside(values, dim):
    """Whether their mean is that of as many independent chi-square values, but for 0.1 %."""
    low, high = chi2.ppf([0.0005, 0.9995], dim * values.size) / values.size
    return low < values.mean() < high


@pytest.mark.parametrize("kind", [KalmanFilter, ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_exact_filters_are_consistent(kind):
    last, nis = consistency(kind(MOTION))
    assert inside(last, 6) and inside(nis, 3)


def test_a_small_ensemble_is_overconfident():
    """Its gain is estimated from the sample."""
    last, _ = consistency(EnsembleKalmanFilter(MOTION, 20, 3))
    assert last.mean() > 7 and not inside(last, 6)
