"""Flight under gravity alone, as missiles after burnout and satellites fly; drag and thrust are process noise."""

from __future__ import annotations

import numpy as np

from assoc._parameters import positive
from assoc._types import Array
from assoc.filters.motion.models import Motion, polynomial_noise

GM = 3.986004418e14
"""The Earth's gravitational constant times its mass, m^3/s^2 (WGS 84)."""
RADIUS = 6_371_000.0
"""Mean radius of the Earth, metres."""
_CENTRE = np.array([0.0, 0.0, -RADIUS])
# seconds in one step of Runge and Kutta: satellites keep to centimetres
_STEP = 20.0


class FreeFlight(Motion):
    """Free flight around a spherical Earth, [x, y, z, vx, vy, vz], z up from the ground at x = y = 0.

    The frame turns with the Earth, but its rotation (0.1 m/s^2 at 1 km/s, across) and flattening are left to the
    process noise.

    Parameters
    ----------
    noise : float
        Root of the spectral density of all other accelerations, m/s^1.5.
    """

    def __init__(self, noise: float) -> None:
        self.dim, self.position = 6, (0, 1, 2)
        self.sigma = positive(noise, "noise", zero=True)

    def propagate(self, states: Array, dt: float) -> Array:
        """Move states (m, 6) on by dt seconds."""
        moved = np.array(states, dtype=np.float64)
        steps = max(1, int(np.ceil(dt / _STEP)))
        h = dt / steps
        for _ in range(steps):
            a = _rates(moved)
            b = _rates(moved + 0.5 * h * a)
            c = _rates(moved + 0.5 * h * b)
            moved = moved + h / 6.0 * (a + 2.0 * b + 2.0 * c + _rates(moved + h * c))
        return moved

    def jacobian(self, states: Array, dt: float) -> Array:
        """Derivatives of `propagate` at states (m, 6), to the third power of dt: (m, 6, 6)."""
        away = states[:, :3] - _CENTRE
        r = np.linalg.norm(away, axis=1)[:, None, None]
        G = GM / r**3 * (3.0 * away[:, :, None] * away[:, None, :] / r**2 - np.eye(3))
        F = np.empty((len(states), 6, 6))
        F[:, :3, :3] = F[:, 3:, 3:] = np.eye(3) + 0.5 * dt**2 * G
        F[:, :3, 3:], F[:, 3:, :3] = dt * np.eye(3) + dt**3 / 6.0 * G, dt * G
        return F

    def noise(self, states: Array, dt: float) -> Array:
        """Process noise covariance, (1, 6, 6)."""
        return np.kron(polynomial_noise(1, dt, self.sigma, "continuous"), np.eye(3))[None]

    def noisier(self, factor: float) -> FreeFlight:
        """The same motion with `factor` times the covariance of the process noise."""
        return FreeFlight(self.sigma * factor**0.5)


def _rates(states: Array) -> Array:
    """Velocities and accelerations of states (m, 6); as at the surface below it, where no estimate is any good."""
    away = states[:, :3] - _CENTRE
    r = np.maximum(np.linalg.norm(away, axis=1), RADIUS)[:, None]
    return np.hstack([states[:, 3:], -GM / r**3 * away])
