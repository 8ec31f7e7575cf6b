"""Trajectories against numerical integration and against the paper's numbers."""

import numpy as np
import pytest
from scipy.integrate import quad

from assoc.errors import InvalidInputError
from assoc.simulation.scenarios.three_radar import TRAJECTORIES
from assoc.simulation.trajectories import Manoeuvre, Trajectory


def test_manoeuvres_against_numerical_integration():
    manoeuvres = (Manoeuvre(2.0, 5.0, (1.0, -2.0, 0.3)), Manoeuvre(4.0, np.inf, (-3.0, 0.0, 0.1)))
    target = Trajectory([5.0, 6.0, 7.0], [1.0, 2.0, 3.0], manoeuvres)

    def acceleration(t, axis):
        return sum(m.acceleration[axis] for m in manoeuvres if m.start <= t < m.end)

    for t in (1.0, 3.0, 4.5, 6.0, 12.0):
        for axis in range(3):
            # x(t) = x0 + v0 t + integral of (t - s) a(s) ds
            moved = quad(lambda s, t=t, axis=axis: (t - s) * acceleration(s, axis), 0, t, points=[2, 4, 5])[0]
            gained = quad(lambda s, axis=axis: acceleration(s, axis), 0, t, points=[2, 4, 5])[0]
            where = target.positions(np.array([t]))[0, axis]
            speed = target.velocities(np.array([t]))[0, axis]
            assert where == pytest.approx(5.0 + axis + (1.0 + axis) * t + moved, abs=1e-6)
            assert speed == pytest.approx(1.0 + axis + gained, abs=1e-6)


def test_the_papers_second_target():
    """By hand, km and s: it turns at 12 s (+0.05 in y) and at 23 s (-0.02 in x and y)."""
    x, y, z = TRAJECTORIES[1].positions(np.array([99.0]))[0] / 1000
    assert x == pytest.approx(20.45 - 0.45 * 99 - 0.01 * 76**2)
    assert y == pytest.approx(11.25 - 0.25 * 99 + 0.025 * 11**2 + 0.55 * 76 - 0.01 * 76**2)
    assert z == pytest.approx(2 + 0.01 * 99)


def test_bad_trajectories():
    with pytest.raises(InvalidInputError, match="position"):
        Trajectory([1.0, np.nan, 0.0], [0.0, 0.0, 0.0])
    with pytest.raises(InvalidInputError, match="start < end"):
        Manoeuvre(3.0, 3.0, (0.0, 0.0, 0.0))
    with pytest.raises(InvalidInputError, match="start >= 0"):
        Trajectory([0.0] * 3, [0.0] * 3, (Manoeuvre(-1.0, 3.0, (0.0, 0.0, 0.0)),))
