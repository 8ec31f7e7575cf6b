"""The paper's model of the modified EKF: derivatives of spherical coordinates that grow by one unit a second."""

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.filters import UnitRates
from assoc.filters.motion.models import differences

MOTION = UnitRates(1e-4 * np.eye(6))
STATES = np.random.default_rng(0).normal(size=(50, 6)) * 10 + np.array([15, 12, 5, -60, -70, -40.0])


def place(t: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Positions (n, 3) after t seconds, each coordinate grown by t: the path itself, not its derivatives."""
    x, y, z = start
    r, a, e = np.linalg.norm(start) + t, np.arctan2(y, x) + t, np.arctan2(z, np.hypot(x, y)) + t
    return np.stack([r * np.cos(a) * np.cos(e), r * np.sin(a) * np.cos(e), r * np.sin(e)], axis=-1)


def test_rates_are_the_derivatives_of_the_path():
    h = 1e-4
    for state, rate in zip(STATES, MOTION.rates(STATES), strict=True):
        before, at, after = place(np.array([-h, 0.0, h]), state[:3])
        assert rate[:3] == pytest.approx((after - before) / (2 * h), rel=1e-6, abs=1e-6)
        assert rate[3:] == pytest.approx((after - 2 * at + before) / h**2, rel=1e-4, abs=1e-4)


def test_the_jacobian_against_differences():
    for dt in (1e-5, 0.5):
        expected = differences(lambda x, dt=dt: MOTION.propagate(x, dt), STATES)
        assert MOTION.jacobian(STATES, dt) == pytest.approx(expected, abs=1e-7)


def test_right_above_the_radar_is_refused():
    with pytest.raises(InvalidInputError, match="right above the radar"):
        MOTION.propagate(np.array([[0.0, 0, 5, 0, 0, 0]]), 0.1)
