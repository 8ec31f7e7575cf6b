"""The unscented Kalman filter."""

from __future__ import annotations

import math

import numpy as np

from assoc._parameters import positive
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.base import Expected, Filter, Update, check_dimension, complain, measured_array
from assoc.filters.kernels.gaussian import GOOD
from assoc.filters.kernels.gaussian import predict as predict_kernel
from assoc.filters.kernels.points import moments, sigma_points, unscented
from assoc.filters.measurement import Measurement, Observation
from assoc.filters.motion.models import Motion
from assoc.filters.state import Gaussian, gaussian

_NOTHING2 = np.zeros((0, 0))
_NOTHING3 = np.zeros((0, 0, 0))


class UnscentedKalmanFilter(Filter[Gaussian]):
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
        self.scale = math.sqrt(spread)
        self.mean_weights = np.full(2 * n + 1, 0.5 / spread)
        self.covariance_weights = self.mean_weights.copy()
        self.mean_weights[0] = 1 - n / spread
        self.covariance_weights[0] = 1 - n / spread + 1 - alpha**2 + beta

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
        cross = moments(
            np.ascontiguousarray(moved),
            points,
            self.mean_weights,
            self.covariance_weights,
            self.motion.noise(state.mean, dt),
            mean,
            P,
        )
        return gaussian(mean, P), cross

    def _points(self, state: Gaussian) -> Array:
        B, n = state.mean.shape
        points = np.empty((B, 2 * n + 1, n))
        status = sigma_points(state.mean, state.covariance, self.scale, points)
        if status != GOOD:
            complain(status)
        return points

    def update(self, state: Gaussian, measured: Array, sensor: Measurement) -> Update[Gaussian]:
        """Correct each target with a measurement of its own; see `Filter.update`."""
        check_dimension(state, self.motion.dim)
        o = self.observe(sensor)
        z = measured_array(measured, len(state.mean), o.dim)
        return self._run(state, z, o, True)

    def expected(self, state: Gaussian, sensor: Measurement) -> Expected:
        """Return the expected measurements and their covariances; see `Filter.expected`."""
        check_dimension(state, self.motion.dim)
        o = self.observe(sensor)
        done = self._run(state, np.zeros((len(state.mean), o.dim)), o, False)
        return Expected(done.innovation, done.covariance)

    def _run(self, state: Gaussian, z: Array, o: Observation, correcting: bool) -> Update[Gaussian]:
        B, d = len(state.mean), o.dim
        given, first, base = _NOTHING3, _NOTHING2, None
        if o.code < 0:
            points = self._points(state)
            base = o.model.measure(state.mean)
            seen = o.model.measure(points.reshape(-1, points.shape[2]))
            given = np.ascontiguousarray(
                o.model.residual(seen, np.repeat(base, points.shape[1], axis=0)).reshape(B, -1, d)
            )
            first = np.ascontiguousarray(o.model.residual(z, base)) if correcting else z
        mean, P = np.empty(state.mean.shape), np.empty(state.covariance.shape)
        v, S, nis, ll = np.empty((B, d)), np.empty((B, d, d)), np.empty(B), np.empty(B)
        status = unscented(
            state.mean, state.covariance, z, o.code, o.place, o.columns, o.matrix, o.covariance, given, first,
            self.scale, self.mean_weights, self.covariance_weights, correcting, mean, P, v, S, nis, ll,
        )  # fmt: skip
        if status != GOOD:
            complain(status)
        if base is not None and not correcting:
            v += base
        return Update(gaussian(mean, P), v, S, nis, ll)
