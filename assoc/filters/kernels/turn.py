"""A horizontal turn and its derivatives, compiled."""

from __future__ import annotations

import math

from assoc._system.compiled import njit
from assoc._types import Array


@njit
def turn(states: Array, dt: float, moved: Array, F: Array) -> None:
    """Move states (m, 7) on a coordinated turn by dt into `moved`, and write the derivatives (m, 7, 7) into F.

    Either of the two may have no rows; then it is left out. sin(w t) / w and (1 - cos(w t)) / w are
    smooth through w = 0.
    """
    for b in range(len(states)):
        x = states[b]
        vx, vy, w = x[3], x[4], x[6]
        a = w * dt
        s, c = math.sin(a), math.cos(a)
        if abs(a) < 1e-3:
            sine, versine = dt * (1 - a**2 / 6), dt * (a / 2 - a**3 / 24)
            d_sine, d_versine = dt**2 * (-a / 3 + a**3 / 30), dt**2 * (0.5 - a**2 / 8)
        else:
            sine, versine = s / w, (1 - c) / w
            d_sine, d_versine = (a * c - s) / w**2, (a * s - 1 + c) / w**2
        if len(moved) > 0:
            moved[b, 0] = x[0] + sine * vx - versine * vy
            moved[b, 1] = x[1] + versine * vx + sine * vy
            moved[b, 2] = x[2] + dt * x[5]
            moved[b, 3] = c * vx - s * vy
            moved[b, 4] = s * vx + c * vy
            moved[b, 5] = x[5]
            moved[b, 6] = w
        if len(F) > 0:
            for i in range(7):
                for j in range(7):
                    F[b, i, j] = 1.0 if i == j else 0.0
            F[b, 0, 3], F[b, 0, 4], F[b, 0, 6] = sine, -versine, d_sine * vx - d_versine * vy
            F[b, 1, 3], F[b, 1, 4], F[b, 1, 6] = versine, sine, d_versine * vx + d_sine * vy
            F[b, 2, 5] = dt
            F[b, 3, 3], F[b, 3, 4], F[b, 3, 6] = c, -s, -dt * (s * vx + c * vy)
            F[b, 4, 3], F[b, 4, 4], F[b, 4, 6] = s, c, dt * (c * vx - s * vy)
