"""Flight under gravity alone, beside Kepler's laws."""

import math

import numpy as np

from assoc.filters import FreeFlight
from assoc.filters.motion.free_flight import GM, RADIUS


def test_a_circular_orbit_closes_after_its_period():
    r = RADIUS + 600e3
    speed, period = math.sqrt(GM / r), 2.0 * math.pi * math.sqrt(r**3 / GM)
    start = np.array([[0.0, 0.0, 600e3, speed, 0.0, 0.0]])
    motion = FreeFlight(1.0)
    np.testing.assert_allclose(motion.propagate(start, period), start, atol=5.0)
    # a quarter on it is as far along x as the Earth's centre is below
    np.testing.assert_allclose(motion.propagate(start, period / 4)[0, :3], [r, 0.0, -RADIUS], atol=5.0)


def test_a_stone_falls_and_derivatives_are_those_of_the_motion():
    motion, x = FreeFlight(2.0), np.array([[3e5, -2e5, 1e5, 1500.0, -300.0, 800.0]])
    fallen = motion.propagate(np.array([[0.0, 0.0, 1e3, 0.0, 0.0, 0.0]]), 10.0)[0]
    np.testing.assert_allclose(fallen[[2, 5]], [1e3 - 0.5 * 9.82 * 100.0, -98.2], rtol=2e-3)
    for dt in (1.0, 10.0):
        F = motion.jacobian(x, dt)[0]
        for axis, step in enumerate([10.0] * 3 + [1.0] * 3):
            ends = [motion.propagate(x + sign * step * np.eye(6)[axis], dt)[0] for sign in (1, -1)]
            np.testing.assert_allclose(F[:, axis], (ends[0] - ends[1]) / (2 * step), atol=2e-5 * dt)
    np.testing.assert_allclose(motion.noisier(4.0).noise(x, 3.0), 4.0 * motion.noise(x, 3.0))
