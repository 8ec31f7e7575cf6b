"""The model of the modified EKF's paper: range, azimuth and elevation each grow by one unit a second."""

from __future__ import annotations

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.motion.models import ForwardDifference


class UnitRates(ForwardDifference):
    """A target whose range (m), azimuth and elevation (rad) each grow by 1 a second, [x, y, z, vx, vy, vz].

    Positions move by the first derivatives of x = r cos(a) cos(e), ..., velocities by the second; the velocities of
    the state have no part in it, so that measurements of positions do not determine them.

    Parameters
    ----------
    covariance : array_like (6, 6)
        Process noise of one step.

    References
    ----------
    The paper on the modified EKF, equations 4.1 to 4.15 (2.13 with all rates 1), a forward difference. Equations 4.4
    and 4.5 each print a term twice; 4.10 to 4.12, which the paper uses, are right. Its Jacobian prints dt^2 in the rows
    of the velocities, where dt belongs, and six wrong entries.
    """

    def __init__(self, covariance: Array) -> None:
        super().__init__(covariance, 6, (0, 1, 2))

    def rates(self, states: Array) -> Array:
        """Time derivatives of states (m, 6), equations 4.7 to 4.12."""
        x, y, z, r, s = _parts(states)
        return np.stack(
            [
                x / r - y - x * z / s,
                y / r + x - y * z / s,
                z / r + s,
                -2 * y / r - 2 * x * z / (r * s) - 2 * x + 2 * y * z / s,
                2 * x / r - 2 * y * z / (r * s) - 2 * y - 2 * x * z / s,
                2 * s / r - z,
            ],
            axis=1,
        )

    def slopes(self, states: Array) -> Array:
        """Derivatives of `rates` at states (m, 6): (m, 6, 6)."""
        x, y, z, r, s = _parts(states)
        zero, unit = np.zeros_like(x), np.ones_like(x)
        # derivatives of 1/r and 1/s by x, y, z
        dr = [-p / r**3 for p in (x, y, z)]
        ds = [-x / s**3, -y / s**3, zero]
        J = np.zeros((len(states), 6, 6))
        for i in range(3):
            dx, dy, dz = (unit if i == k else zero for k in range(3))
            by_s = ds[i] * z + dz / s  # of z / s
            by_rs = dr[i] * z / s + by_s / r  # of z / (r s)
            both = (dx * x + dy * y) / s  # of s
            J[:, 0, i] = dx / r + x * dr[i] - dy - dx * z / s - x * by_s
            J[:, 1, i] = dy / r + y * dr[i] + dx - dy * z / s - y * by_s
            J[:, 2, i] = dz / r + z * dr[i] + both
            J[:, 3, i] = 2 * (-dy / r - y * dr[i] - dx * z / (r * s) - x * by_rs - dx + dy * z / s + y * by_s)
            J[:, 4, i] = 2 * (dx / r + x * dr[i] - dy * z / (r * s) - y * by_rs - dy - dx * z / s - x * by_s)
            J[:, 5, i] = 2 * (both / r + s * dr[i]) - dz
        return J


def _parts(states: Array) -> tuple[Array, ...]:
    x, y, z = states[:, :3].T
    s = np.hypot(x, y)
    if not s.all():
        raise InvalidInputError("states must not be right above the radar (x = y = 0)")
    return x, y, z, np.hypot(s, z), s
