"""The interface of all filters: predict, update, log_likelihood.

A filter holds models and no targets: what it knows of the targets is a state that goes in and comes out, so
one filter serves any number of tracks, hypotheses and threads.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Generic, NamedTuple, NoReturn, Protocol, TypeVar

import numpy as np

from assoc.errors import InvalidInputError
from assoc.filters.kernels import BAD_COVARIANCE, BAD_MEASUREMENT, GOOD, PLAIN, STATUSES, expect, pairs
from assoc.filters.kernels import predict as predict_kernel
from assoc.filters.kernels import update as update_kernel
from assoc.filters.measurement import Measurement, Observation, observation
from assoc.filters.motion import Motion
from assoc.filters.state import Gaussian, gaussian

Array = np.ndarray[Any, np.dtype[Any]]

_NOTHING2 = np.zeros((0, 0))
_NOTHING3 = np.zeros((0, 0, 0))


class State(Protocol):
    """What every state of a filter offers: means (B, n), covariances (B, n, n), selection of targets."""

    @property
    def mean(self) -> Array:
        """Means, (B, n)."""

    @property
    def covariance(self) -> Array:
        """Covariances, (B, n, n)."""

    def __len__(self) -> int: ...

    def __getitem__(self, rows: Any) -> Any: ...


S = TypeVar("S", bound=State)


class Update(NamedTuple, Generic[S]):
    """What a correction gives."""

    state: S
    innovation: Array
    """Measured minus expected, angles wrapped, (B, d)."""
    covariance: Array
    """Of the innovation, (B, d, d)."""
    nis: Array
    """Normalised innovation squared, (B,)."""
    log_likelihood: Array
    """Of the measurement under the prediction, (B,)."""


class Expected(NamedTuple):
    """The measurements that a state leads one to expect."""

    mean: Array
    """(B, d)."""
    covariance: Array
    """With the sensor's noise, (B, d, d)."""


class Filter(ABC, Generic[S]):
    """A filter: models of motion, and how a state is predicted and corrected.

    Parameters
    ----------
    motion : Motion
    """

    def __init__(self, motion: Motion) -> None:
        self.motion = motion
        self._seen: tuple[Any, Any] = (None, None)

    @abstractmethod
    def start(self, state: Gaussian) -> S:
        """Make this filter's kind of state of a Gaussian."""

    @abstractmethod
    def predict(self, state: S, dt: float) -> S:
        """Return the state dt seconds later."""

    @abstractmethod
    def update(self, state: S, measured: Array, sensor: Measurement) -> Update[S]:
        """Correct each target with a measurement of its own.

        Parameters
        ----------
        state
            B targets.
        measured : array (B, d); (d,) if there is one target
        sensor
            A sensor of `assoc.sensors`, or a measurement model of `assoc.filters`.

        Raises
        ------
        InvalidInputError
            NaN, a wrong shape, or a covariance that is no longer positive definite.
        """

    @abstractmethod
    def expected(self, state: S, sensor: Measurement) -> Expected:
        """Return the expected measurements and their covariances, for gates."""

    def log_likelihood(self, state: S, measurements: Array, sensor: Measurement) -> Array:
        """Log-likelihood of each of M measurements (M, d) under each of B targets, (B, M)."""
        return self.compare(state, measurements, sensor)[0]

    def distances(self, state: S, measurements: Array, sensor: Measurement) -> Array:
        """Squared Mahalanobis distance of each of M measurements from each of B targets, (B, M)."""
        return self.compare(state, measurements, sensor)[1]

    def compare(self, state: S, measurements: Array, sensor: Measurement) -> tuple[Array, Array]:
        """`log_likelihood` and `distances` in one go."""
        o = self.observe(sensor)
        z = measured_array(measurements, None, o.dim, "measurements")
        if not np.isfinite(z).all():
            raise InvalidInputError("measurements must be finite, got NaN or infinity")
        h, covariance = self.expected(state, sensor)
        if o.code < 0:
            return self._compare_given(o, h, covariance, z)
        status, ll, square = pairs(h, covariance, z, o.code)
        if status != GOOD:
            complain(status)
        return ll, square

    @staticmethod
    def _compare_given(o: Observation, h: Array, covariance: Array, z: Array) -> tuple[Array, Array]:
        """Compare with a user's model, whose residual may be his own."""
        v = np.stack([o.model.residual(z, np.broadcast_to(one, z.shape)) for one in h])
        factor = np.linalg.cholesky(covariance)
        white = np.linalg.solve(factor, v.transpose(0, 2, 1))
        square = (white**2).sum(axis=1)
        log_det = 2 * np.log(np.einsum("bii->bi", factor)).sum(axis=1)
        return -0.5 * (square + log_det[:, None] + o.dim * np.log(2 * np.pi)), square

    def observe(self, sensor: Measurement) -> Observation:
        """Put a measurement model in the form that the kernels take."""
        if self._seen[0] is not sensor:
            self._seen = (sensor, observation(sensor, self.motion))
        return self._seen[1]

    def move(self, state: S, dt: float) -> tuple[S, Array]:
        """`predict`, and the covariance of the states before and after it, (B, n, n), for smoothing."""
        raise NotImplementedError(f"{type(self).__name__} has no cross covariance")

    def prior(self, predicted: S, corrected: S) -> tuple[Array, Array]:
        """Mean and covariance of the prediction as it was corrected; adaptive filters change it."""
        return predicted.mean, predicted.covariance


def measured_array(measured: object, batch: int | None, dim: int, what: str = "measured") -> Array:
    """Return measurements as float64 (B, d); finiteness is left to the kernels."""
    if isinstance(measured, np.ndarray) and measured.dtype == np.float64 and measured.flags.c_contiguous:
        array = measured
    else:
        try:
            array = np.ascontiguousarray(measured, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"{what} must be numbers, got {type(measured).__name__}") from error
    if array.ndim == 1 and batch == 1:
        array = array[None]
    if array.ndim != 2 or array.shape[1] != dim or (batch is not None and len(array) != batch):
        rows = "M" if batch is None else batch
        raise InvalidInputError(f"{what} must have shape ({rows}, {dim}), got {array.shape}")
    return array


def complain(status: int) -> NoReturn:
    """Turn what a kernel found into an error."""
    row, status = divmod(status, STATUSES)
    if status == BAD_MEASUREMENT:
        raise InvalidInputError(f"measured must be finite, row {row} is not")
    if status == BAD_COVARIANCE:
        raise InvalidInputError(f"state: covariance of target {row} is not positive definite")
    raise InvalidInputError(f"state: mean of target {row} gives no finite measurement")


class GaussianFilter(Filter[Gaussian]):
    """What Kalman's filter and those that linearise have in common."""

    kind = PLAIN

    def start(self, state: Gaussian) -> Gaussian:
        """Return the Gaussian itself."""
        return check_dimension(state, self.motion.dim)

    def predict(self, state: Gaussian, dt: float) -> Gaussian:
        """Return the state dt seconds later; see `Filter.predict`."""
        check_dimension(state, self.motion.dim)
        motion = self.motion
        moved = _NOTHING2 if motion.linear else motion.propagate(state.mean, dt)
        F, Q = motion.jacobian(state.mean, dt), motion.noise(state.mean, dt)
        mean, P = np.empty(state.mean.shape), np.empty(state.covariance.shape)
        predict_kernel(state.mean, state.covariance, F, Q, moved, mean, P)
        return gaussian(mean, P)

    def move(self, state: Gaussian, dt: float) -> tuple[Gaussian, Array]:
        """`predict`, and the covariance P F' of the states before and after it."""
        F = self.motion.jacobian(state.mean, dt)
        return self.predict(state, dt), state.covariance @ F.transpose(0, 2, 1)

    def update(self, state: Gaussian, measured: Array, sensor: Measurement) -> Update[Gaussian]:
        """Correct each target with a measurement of its own; see `Filter.update`."""
        o = self.observe(sensor)
        return self.correct(state, measured, o, o.covariance)

    def correct(self, state: Gaussian, measured: Array, o: Observation, R: Array) -> Update[Gaussian]:
        """Correct with a measurement covariance R (B or 1, d, d) of the caller's."""
        mean = state.mean
        if mean.shape[1] != self.motion.dim:
            check_dimension(state, self.motion.dim)
        z = measured_array(measured, len(mean), o.dim)
        given, slopes = _NOTHING2, _NOTHING3
        if o.code < 0:
            given = np.ascontiguousarray(o.model.residual(z, o.model.measure(mean)))
            slopes = np.ascontiguousarray(o.model.jacobian(mean))
        B, d = z.shape
        new_mean, new_P = np.empty(mean.shape), np.empty(state.covariance.shape)
        v, S, nis, ll = np.empty((B, d)), np.empty((B, d, d)), np.empty(B), np.empty(B)
        status = update_kernel(
            mean, state.covariance, z, o.code, o.place, o.columns, o.matrix, R, given, slopes, self.kind,
            new_mean, new_P, v, S, nis, ll,
        )  # fmt: skip
        if status != GOOD:
            complain(status)
        return Update(gaussian(new_mean, new_P), v, S, nis, ll)

    def expected(self, state: Gaussian, sensor: Measurement) -> Expected:
        """Return the expected measurements and their covariances; see `Filter.expected`."""
        check_dimension(state, self.motion.dim)
        o = self.observe(sensor)
        if o.code < 0:
            H = o.model.jacobian(state.mean)
            return Expected(o.model.measure(state.mean), H @ state.covariance @ H.transpose(0, 2, 1) + o.covariance)
        return Expected(
            *expect(state.mean, state.covariance, o.code, o.place, o.columns, o.matrix, o.covariance, self.kind)
        )


def check_dimension(state: Gaussian, dim: int) -> Gaussian:
    """Return a state of the right dimension."""
    if state.mean.shape[1] != dim:
        raise InvalidInputError(f"state must have {dim} components, got {state.mean.shape[1]}")
    return state
