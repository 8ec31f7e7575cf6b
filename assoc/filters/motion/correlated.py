"""Motion with an acceleration, or a jerk, that is correlated over time: the models of Singer and of Mehrotra."""

from __future__ import annotations

import math

import numpy as np

from assoc._parameters import positive
from assoc._types import Array
from assoc.filters.motion.models import LinearMotion, dimensions_of


class Singer(LinearMotion):
    """Singer's model, [x, y, z, vx, vy, vz, ax, ay, az]: an acceleration that is forgotten exponentially.

    Its correlation over t seconds is sigma^2 exp(-t / correlation_time). A long correlation time is nearly constant
    acceleration, a short one nearly constant velocity.

    Parameters
    ----------
    sigma : float
        Standard deviation of the acceleration along each axis, m/s^2.
    correlation_time : float
        Seconds; about 60 for a lazy turn, 20 for evasive manoeuvres.
    dimensions : 2 or 3

    References
    ----------
    R. A. Singer, Estimating optimal tracking filter performance for manned maneuvering targets, 1970.
    """

    order = 2

    def __init__(self, sigma: float, correlation_time: float, dimensions: int = 3) -> None:
        self.sigma, self.correlation_time = positive(sigma, "sigma"), positive(correlation_time, "correlation_time")
        axes, unit, n = dimensions_of(dimensions), np.eye(dimensions), self.order
        density = 2.0 * self.sigma**2 / self.correlation_time
        power = np.arange(n + 1)

        def transition(dt: float) -> Array:
            F, _ = _in_units_of_a_step(n, dt / self.correlation_time)
            return np.kron(F * _powers(dt, power - power[:, None]), unit)

        def noise(dt: float) -> Array:
            _, Q = _in_units_of_a_step(n, dt / self.correlation_time)
            return np.kron(density * Q * _powers(dt, 2 * n + 1 - power - power[:, None]), unit)

        super().__init__(transition, noise, (n + 1) * dimensions, axes)


class Jerk(Singer):
    """The jerk model, [x, y, z, vx, ..., ax, ..., jx, jy, jz]: a jerk that is forgotten exponentially.

    Parameters
    ----------
    sigma : float
        Standard deviation of the jerk along each axis, m/s^3.
    correlation_time : float
        Seconds.
    dimensions : 2 or 3

    References
    ----------
    K. Mehrotra and P. R. Mahapatra, A jerk model for tracking highly maneuvering targets, 1997.
    """

    order = 3


def _powers(dt: float, exponents: Array) -> Array:
    # entries below the diagonal of a transition are zero, and a step of no time has none
    return np.where(exponents < 0, 0.0, dt ** np.maximum(exponents, 0.0))


def _in_units_of_a_step(order: int, decay: float) -> tuple[Array, Array]:
    """Transition and noise of one axis for a step of length 1 and noise of density 1, `decay` steps of forgetting.

    Van Loan's matrix exponential of a part of the step in which little is forgotten, doubled until it is whole.
    """
    from scipy.linalg import expm

    n = order + 1
    doublings = max(0, math.ceil(math.log2(decay))) if decay > 0.0 else 0
    A = np.eye(n, k=1)
    A[-1, -1] = -decay
    both = np.zeros((2 * n, 2 * n))
    both[:n, :n], both[n:, n:], both[n - 1, -1] = -A, A.T, 1.0
    E = expm(both / 2**doublings)
    F = E[n:, n:].T
    Q = F @ E[:n, n:]
    for _ in range(doublings):
        Q, F = Q + F @ Q @ F.T, F @ F
    return F, 0.5 * (Q + Q.T)
