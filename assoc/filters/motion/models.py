"""Motion models: how a state moves on, and how uncertain that is.

States hold positions first, then velocities, then accelerations or a turn rate: [x, y, z, vx, vy, vz, ...],
metres and seconds; in two dimensions z is left out.
"""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Literal

import numpy as np

from assoc._parameters import positive
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.kernels.turn import turn
from assoc.filters.state import checked_covariance, finite

_NO_STATES, _NO_SLOPES = np.zeros((0, 7)), np.zeros((0, 7, 7))


class Motion(ABC):
    """A motion model.

    Attributes
    ----------
    dim : int
        Components of the state, n.
    position : tuple of int
        Indices of x, y (and z) in it; without z the height is 0.
    """

    dim: int
    position: tuple[int, ...]

    @abstractmethod
    def propagate(self, states: Array, dt: float) -> Array:
        """Move states (m, n) on by dt seconds, without noise."""

    @abstractmethod
    def jacobian(self, states: Array, dt: float) -> Array:
        """Derivatives of `propagate` at states (m, n): (m, n, n), or (1, n, n) where they are all alike."""

    @abstractmethod
    def noise(self, states: Array, dt: float) -> Array:
        """Process noise covariance at states (m, n): (m, n, n), or (1, n, n)."""

    @property
    def linear(self) -> bool:
        """Whether `propagate` is a matrix."""
        return False

    def noisier(self, factor: float) -> Motion:
        """The same motion with `factor` times the covariance of the process noise."""
        made = copy.copy(self)
        made.noise = lambda states, dt: factor * self.noise(states, dt)  # type: ignore[method-assign]
        return made


class LinearMotion(Motion):
    """A motion model given by matrices: x' = F(dt) x + w, w ~ N(0, Q(dt)).

    Parameters
    ----------
    transition, noise : callable dt -> (n, n)
    dim : int
    position : tuple of int
        As in `Motion`.
    """

    def __init__(
        self,
        transition: Callable[[float], Array],
        noise: Callable[[float], Array],
        dim: int,
        position: tuple[int, ...] = (0, 1, 2),
    ) -> None:
        self.dim, self.position = dim, position
        self._transition, self._noise = transition, noise
        self._known: dict[float, tuple[Array, Array, Array]] = {}

    @property
    def linear(self) -> bool:
        """Whether `propagate` is a matrix."""
        return True

    def matrices(self, dt: float) -> tuple[Array, Array]:
        """Return F and Q, each (1, n, n)."""
        F, Q, _ = self.models(dt)
        return F, Q

    def models(self, dt: float) -> tuple[Array, Array, Array]:
        """Return F, Q and both in one array (2, 1, n, n); remembered, since most trackers use few time steps."""
        known = self._known.get(dt)
        if known is None:
            positive(dt, "dt", zero=True)
            F = finite(self._transition(dt), "transition", 2)
            Q = finite(self._noise(dt), "noise", 2)
            for name, matrix in (("transition", F), ("noise", Q)):
                if matrix.shape != (self.dim, self.dim):
                    raise InvalidInputError(f"{name} must have shape {(self.dim, self.dim)}, got {matrix.shape}")
            if len(self._known) > 64:
                self._known.clear()
            both = np.stack((F[None], Q[None]))
            known = self._known[dt] = (both[0], both[1], both)
        return known

    def noisier(self, factor: float) -> LinearMotion:
        """The same motion with `factor` times the covariance of the process noise."""
        return LinearMotion(self._transition, lambda dt: factor * self._noise(dt), self.dim, self.position)

    def matrices_of_each(self, dt: Array) -> tuple[Array, Array]:
        """F and Q of each of k time steps, both (k, n, n)."""
        steps, which = np.unique(dt, return_inverse=True)
        F, Q = np.concatenate([self.models(step)[2] for step in steps.tolist()], axis=1)
        return F[which], Q[which]

    def propagate(self, states: Array, dt: float) -> Array:
        """Move states (m, n) on by dt seconds, without noise."""
        return states @ self.matrices(dt)[0][0].T

    def jacobian(self, states: Array, dt: float) -> Array:
        """Return the transition matrix, (1, n, n)."""
        return self.matrices(dt)[0]

    def noise(self, states: Array, dt: float) -> Array:
        """Return the process noise covariance, (1, n, n)."""
        return self.matrices(dt)[1]


def dimensions_of(dimensions: int) -> tuple[int, ...]:
    """Components of the position in so many dimensions."""
    if dimensions not in (2, 3):
        raise InvalidInputError(f"dimensions must be 2 or 3, got {dimensions!r}")
    return tuple(range(dimensions))


def polynomial(order: int, dt: float) -> Array:
    """Transition of one axis: position, velocity, ..., the `order`-th derivative constant."""
    F = np.eye(order + 1)
    for i in range(order + 1):
        for j in range(i + 1, order + 1):
            F[i, j] = dt ** (j - i) / math.factorial(j - i)
    return F


def polynomial_noise(order: int, dt: float, sigma: float, kind: str) -> Array:
    """Process noise of one axis.

    "discrete": the derivative of order `order` (velocity model: the acceleration; acceleration model: the
    acceleration's increment) is drawn anew for each step, G sigma^2 G' of the papers. "continuous": white
    noise of density sigma^2 in the next derivative.
    """
    if kind == "discrete":
        gain = np.array([dt ** (2 - i) / math.factorial(2 - i) if i < 2 else 1.0 for i in range(order + 1)])
        return sigma**2 * np.outer(gain, gain)
    Q = np.empty((order + 1, order + 1))
    for i in range(order + 1):
        for j in range(order + 1):
            a, b = order - i, order - j
            Q[i, j] = dt ** (a + b + 1) / ((a + b + 1) * math.factorial(a) * math.factorial(b))
    return sigma**2 * Q


class ConstantVelocity(LinearMotion):
    """Nearly constant velocity, [x, y, z, vx, vy, vz].

    Parameters
    ----------
    noise : float
        Standard deviation of the acceleration, m/s^2 ("discrete": constant over a step), or the root of its
        spectral density, m/s^1.5 ("continuous").
    dimensions : 2 or 3
    kind : "discrete" or "continuous"
    """

    order = 1

    def __init__(self, noise: float, dimensions: int = 3, kind: Literal["discrete", "continuous"] = "discrete") -> None:
        self.sigma = positive(noise, "noise", zero=True)
        self.kind = kind
        if kind not in ("discrete", "continuous"):
            raise InvalidInputError(f"kind must be 'discrete' or 'continuous', got {kind!r}")
        axes, unit, order = dimensions_of(dimensions), np.eye(dimensions), self.order
        # coefficients of the powers of a time step
        self._units = polynomial(order, 1.0), polynomial_noise(order, 1.0, self.sigma, kind)
        super().__init__(
            lambda dt: np.kron(polynomial(order, dt), unit),
            lambda dt: np.kron(polynomial_noise(order, dt, self.sigma, kind), unit),
            (order + 1) * dimensions,
            axes,
        )

    def noisier(self, factor: float) -> ConstantVelocity:
        """The same motion with `factor` times the covariance of the process noise."""
        return type(self)(math.sqrt(factor) * self.sigma, len(self.position), self.kind)

    def matrices_of_each(self, dt: Array) -> tuple[Array, Array]:
        """F and Q of each of k time steps, both (k, n, n); the polynomials are taken of all steps at once."""
        order, axes = self.order, len(self.position)
        both = np.zeros((2, len(dt), order + 1, axes, order + 1, axes))
        # the diagonal of each block, which has a place for each axis
        F, Q = np.einsum("mkiaja->mkija", both)
        unit_F, unit_Q = self._units
        for i in range(order + 1):
            for j in range(order + 1):
                if self.kind == "discrete":
                    power = max(2 - i, 0) + max(2 - j, 0)
                else:
                    power = 2 * order - i - j + 1
                if j >= i:
                    F[:, i, j] = (unit_F[i, j] * dt ** (j - i))[:, None]
                Q[:, i, j] = (unit_Q[i, j] * dt**power)[:, None]
        n = (order + 1) * axes
        return both[0].reshape(-1, n, n), both[1].reshape(-1, n, n)


class ConstantAcceleration(ConstantVelocity):
    """Nearly constant acceleration, [x, y, z, vx, vy, vz, ax, ay, az] (equations 3 to 5 of the fuzzy paper).

    Parameters
    ----------
    noise : float
        Standard deviation of the acceleration's increment over a step, m/s^2 ("discrete"), or the root of the
        jerk's spectral density, m/s^2.5 ("continuous").
    dimensions : 2 or 3
    kind : "discrete" or "continuous"
    """

    order = 2


class CoordinatedTurn(Motion):
    """A horizontal turn at a rate that is part of the state, [x, y, z, vx, vy, vz, w]; w in rad/s.

    Parameters
    ----------
    noise : float
        Standard deviation of the acceleration, constant over a step, m/s^2.
    rate_noise : float
        Standard deviation of the turn rate's increment over a step, rad/s.
    """

    def __init__(self, noise: float, rate_noise: float) -> None:
        self.dim, self.position = 7, (0, 1, 2)
        self.sigma = positive(noise, "noise", zero=True)
        self.rate_sigma = positive(rate_noise, "rate_noise", zero=True)
        self._noise: tuple[float, Array] | None = None

    def propagate(self, states: Array, dt: float) -> Array:
        """Move states (m, 7) on by dt seconds, without noise."""
        states = np.ascontiguousarray(states, dtype=np.float64)
        moved = np.empty(states.shape)
        turn(states, float(dt), moved, _NO_SLOPES)
        return moved

    def jacobian(self, states: Array, dt: float) -> Array:
        """Derivatives of `propagate` at states (m, 7): (m, 7, 7)."""
        states = np.ascontiguousarray(states, dtype=np.float64)
        F = np.empty((len(states), 7, 7))
        turn(states, float(dt), _NO_STATES, F)
        return F

    def noise(self, states: Array, dt: float) -> Array:
        """Process noise covariance, (1, 7, 7); that of the last time step is remembered."""
        # read once: another thread may ask for another time step
        known = self._noise
        if known is None or known[0] != dt:
            Q = np.zeros((1, 7, 7))
            Q[0, :6, :6] = np.kron(polynomial_noise(1, dt, self.sigma, "discrete"), np.eye(3))
            Q[0, 6, 6] = self.rate_sigma**2
            known = self._noise = (dt, Q)
        return known[1]


class Padded(LinearMotion):
    """A linear model with added components that it does not use, to be combined with a larger model.

    In an interacting multiple model all models share one state. The added components are drawn anew with
    each step, N(0, spread^2): constant velocity beside a coordinated turn forgets the turn rate.

    Parameters
    ----------
    model : LinearMotion
    spread : sequence of float
        Standard deviation of each added component.
    """

    def __init__(self, model: LinearMotion, *spread: float) -> None:
        extra = np.array([positive(s, "spread") for s in spread])
        n, m = model.dim, model.dim + len(extra)

        def transition(dt: float) -> Array:
            F = np.zeros((m, m))
            F[:n, :n] = model.matrices(dt)[0][0]
            return F

        def noise(dt: float) -> Array:
            Q = np.diag(np.concatenate([np.zeros(n), extra**2]))
            Q[:n, :n] = model.matrices(dt)[1][0]
            return Q

        super().__init__(transition, noise, m, model.position)


class ForwardDifference(Motion):
    """A motion model that moves by one forward difference a step: x' = x + dt f(x) + w, w ~ N(0, covariance)."""

    def __init__(self, covariance: Array, dim: int, position: tuple[int, ...]) -> None:
        self.dim, self.position = dim, position
        self.covariance = checked_covariance(covariance, (1, dim, dim))

    @abstractmethod
    def rates(self, states: Array) -> Array:
        """Time derivatives f of states (m, n), (m, n)."""

    @abstractmethod
    def slopes(self, states: Array) -> Array:
        """Derivatives of `rates` at states (m, n): (m, n, n)."""

    def propagate(self, states: Array, dt: float) -> Array:
        """Move states (m, n) on by dt seconds, without noise."""
        return np.asarray(states + dt * self.rates(states))

    def jacobian(self, states: Array, dt: float) -> Array:
        """Derivatives of `propagate` at states (m, n): (m, n, n)."""
        return np.asarray(np.eye(self.dim) + dt * self.slopes(states))

    def noise(self, states: Array, dt: float) -> Array:
        """Process noise covariance of a step, (1, n, n)."""
        return self.covariance


def differences(
    function: Callable[[Array], Array], states: Array, minus: Callable[[Array, Array], Array] = np.subtract
) -> Array:
    """Central differences of a vectorised function at states (m, n): (m, d, n).

    `minus` takes one of its values (k, d) from another: angles must not jump.
    """
    m, n = states.shape
    step = 6e-6 * np.maximum(1.0, np.abs(states))
    ends = np.repeat(states[:, None, None, :], n, axis=1).repeat(2, axis=2)
    index = np.arange(n)
    ends[:, index, 0, index] += step
    ends[:, index, 1, index] -= step
    values = function(np.ascontiguousarray(ends.reshape(-1, n))).reshape(m * n, 2, -1)
    slopes: Array = minus(values[:, 0], values[:, 1]).reshape(m, n, -1) / (2 * step[:, :, None])
    return np.ascontiguousarray(slopes.transpose(0, 2, 1))
