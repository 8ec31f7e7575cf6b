"""The unscented Kalman filter."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from assoc._parameters import positive
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.base import Filter, PointFilter, Update, as_in, check_dimension, complain, update_of
from assoc.filters.kernels.gaussian import GOOD
from assoc.filters.kernels.gaussian import predict as predict_kernel
from assoc.filters.kernels.points import moments, sigma_points, unscented
from assoc.filters.motion.models import Motion
from assoc.filters.state import Gaussian, gaussian

_NOTHING2 = np.zeros((0, 0))


class UnscentedKalmanFilter(PointFilter[Gaussian]):
    """The unscented Kalman filter, sigma points drawn anew for each correction.

    Parameters
    ----------
    motion : Motion
    alpha, beta, kappa : float
        Of the scaled unscented transform; lambda = alpha^2 (n + kappa) - n. With the defaults no weight is
        negative, whatever the dimension, so that covariances stay positive definite.

    References
    ----------
    R. van der Merwe, Sigma-point Kalman filters for probabilistic inference, 2004, algorithm 3.1.
    """

    def __init__(self, motion: Motion, alpha: float = 1.0, beta: float = 2.0, kappa: float = 0.0) -> None:
        super().__init__(motion)
        n = motion.dim
        spread = alpha**2 * (n + kappa)
        if not (math.isfinite(spread) and spread > 0 and math.isfinite(beta)):
            raise InvalidInputError(
                f"alpha, kappa: alpha^2 (n + kappa) must be above 0, got {alpha!r}, {kappa!r} for n = {n}"
            )
        scale = math.sqrt(spread)
        self.weights = np.full((3, 2 * n + 1), 0.5 / spread)
        """Steps of the points in columns of the covariance's factor, weights of means, weights of covariances."""
        self.weights[0] = [0.0, *[scale] * n, *[-scale] * n]
        self.weights[1:, 0] = 1 - n / spread, 1 - n / spread + 1 - alpha**2 + beta

    def start(self, state: Gaussian) -> Gaussian:
        """Return the Gaussian itself."""
        return check_dimension(state, self.motion.dim)

    def predict(self, state: Gaussian, dt: float) -> Gaussian:
        """Return the state dt seconds later; see `Filter.predict`."""
        check_dimension(state, self.motion.dim)
        if not self.motion.linear:
            return self.move(state, dt)[0]
        # the unscented transform of a linear model is exact
        F, Q = self.motion.jacobian(state.mean, dt), self.motion.noise(state.mean, dt)
        mean, P = np.empty(state.mean.shape), np.empty(state.covariance.shape)
        predict_kernel(state.mean, state.covariance, F, Q, _NOTHING2, mean, P)
        return gaussian(mean, P)

    def move(self, state: Gaussian, dt: float) -> tuple[Gaussian, Array]:
        """`predict`, and the covariance of the states before and after it, (B, n, n)."""
        check_dimension(state, self.motion.dim)
        positive(dt, "dt", zero=True)
        points = self._points(state)
        moved = self.motion.propagate(points.reshape(-1, self.motion.dim), dt).reshape(points.shape)
        mean, P = np.empty(state.mean.shape), np.empty(state.covariance.shape)
        Q = self.motion.noise(state.mean, dt)
        cross = moments(np.ascontiguousarray(moved), points, self.weights[1], self.weights[2], Q, mean, P)
        return gaussian(mean, P), cross

    def _points(self, state: Gaussian) -> Array:
        check_dimension(state, self.motion.dim)
        B, n = state.mean.shape
        points = np.empty((B, 2 * n + 1, n))
        status = sigma_points(state.mean, state.covariance, self.weights[0, 1], points)
        if status != GOOD:
            complain(status)
        return points

    def sees_like(self, other: Filter[Any]) -> bool:
        """Whether this filter corrects states just as the other does."""
        if type(self) is not type(other) or not isinstance(other, UnscentedKalmanFilter):
            return False
        if not as_in(self, UnscentedKalmanFilter, "update", "expected", "observe", "_correct", "_points"):
            return False
        return self.motion.position == other.motion.position and np.array_equal(self.weights, other.weights)

    def _correct(self, state: Gaussian, z: Array, models: Array) -> Update[Gaussian]:
        check_dimension(state, self.motion.dim)
        B, d = len(state.mean), z.shape[1]
        mean, P, rest = np.empty(state.mean.shape), np.empty(state.covariance.shape), np.empty(B * (d + d * d + 2))
        status = unscented(state.mean, state.covariance, z, models, self.weights, mean, P, rest)
        if status != GOOD:
            complain(status)
        return update_of(gaussian(mean, P), rest, d)
