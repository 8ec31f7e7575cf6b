"""The interface of all filters: predict, update, log_likelihood.

A filter holds models and no targets: what it knows of the targets is a state that goes in and comes out, so
one filter serves any number of tracks, hypotheses and threads.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, Generic, NamedTuple, NoReturn, Protocol, TypeVar

import numpy as np

from assoc.errors import InvalidInputError
from assoc.filters.kernels import BAD_COVARIANCE, BAD_MEASUREMENT, GOOD, PLAIN, STATUSES, expect, follow, pairs
from assoc.filters.kernels import predict as predict_kernel
from assoc.filters.kernels import update as update_kernel
from assoc.filters.measurement import Measurement, Observation, observation
from assoc.filters.motion import LinearMotion, Motion
from assoc.filters.state import Gaussian, finite, gaussian

Array = np.ndarray[Any, np.dtype[Any]]

_NOTHING2 = np.zeros((0, 0))
_NOTHING3 = np.zeros((0, 0, 0))
_FLOAT = np.dtype(np.float64)
_PLAIN_MODELS = LinearMotion.jacobian, LinearMotion.noise


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


class History(NamedTuple, Generic[S]):
    """What `Filter.run` gives: the corrected states of K steps."""

    mean: Array
    """(K, B, n)."""
    covariance: Array
    """(K, B, n, n)."""
    nis: Array
    """Normalised innovation squared, (K, B)."""
    log_likelihood: Array
    """Of each measurement under its prediction, (K, B)."""
    state: S
    """The last one, to go on from."""


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

    def run(self, state: S, measured: Array, sensor: Measurement, dt: float | Sequence[float]) -> History[S]:
        """Predict and correct through K steps, as a recording or a Monte Carlo study needs it.

        For linear motion and the filters that linearise, all steps are one compiled call.

        Parameters
        ----------
        state
            B targets before the first step.
        measured : array (K, B, d); (K, d) if there is one target
        sensor
            As in `update`.
        dt : float or sequence of K floats
            Seconds from the step before to each step.

        Raises
        ------
        InvalidInputError
            As in `update`, or no steps.
        """
        z, times = self._steps(state, measured, sensor, dt)
        done: list[Update[S]] = []
        for one, step in zip(z, times, strict=True):
            done.append(self.update(self.predict(state, step), one, sensor))
            state = done[-1].state
        return History(
            np.stack([one.state.mean for one in done]),
            np.stack([one.state.covariance for one in done]),
            np.stack([one.nis for one in done]),
            np.stack([one.log_likelihood for one in done]),
            state,
        )

    def _steps(
        self, state: S, measured: Array, sensor: Measurement, dt: float | Sequence[float]
    ) -> tuple[Array, list[float]]:
        """Measurements as (K, B, d), and K time steps."""
        z = finite(measured, "measured", 2, 3)
        if z.ndim == 2 and len(state) == 1:
            z = z[:, None]
        dim = self.observe(sensor).dim
        if z.ndim != 3 or z.shape[1:] != (len(state), dim) or len(z) == 0:
            raise InvalidInputError(f"measured must have shape (K, {len(state)}, {dim}), K > 0, got {z.shape}")
        times = [float(dt)] * len(z) if isinstance(dt, (int, float)) else [float(step) for step in dt]
        if len(times) != len(z):
            raise InvalidInputError(f"dt must be one number or {len(z)}, got {len(times)}")
        return z, times

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


def complain(status: int, where: str = "") -> NoReturn:
    """Turn what a kernel found into an error."""
    row, status = divmod(status, STATUSES)
    if status == BAD_MEASUREMENT:
        raise InvalidInputError(f"measured must be finite, row {row} is not{where}")
    if status == BAD_COVARIANCE:
        raise InvalidInputError(f"state: covariance of target {row} is not positive definite{where}")
    raise InvalidInputError(f"state: mean of target {row} gives no finite measurement{where}")


class GaussianFilter(Filter[Gaussian]):
    """What Kalman's filter and those that linearise have in common."""

    kind = PLAIN

    def __init__(self, motion: Motion) -> None:
        super().__init__(motion)
        # both matrices with one look-up, unless a child class has its own idea of them
        kind = type(motion)
        self._linear: LinearMotion | None = None
        if isinstance(motion, LinearMotion) and (kind.jacobian, kind.noise) == _PLAIN_MODELS:
            self._linear = motion

    def start(self, state: Gaussian) -> Gaussian:
        """Return the Gaussian itself."""
        return check_dimension(state, self.motion.dim)

    def predict(self, state: Gaussian, dt: float) -> Gaussian:
        """Return the state dt seconds later; see `Filter.predict`."""
        before, motion, linear = state.mean, self.motion, self._linear
        if before.shape[1] != motion.dim:
            check_dimension(state, motion.dim)
        moved = _NOTHING2
        if linear is not None:
            F, Q = linear.matrices(dt)
        else:
            if not motion.linear:
                moved = motion.propagate(before, dt)
            F, Q = motion.jacobian(before, dt), motion.noise(before, dt)
        mean, P = np.empty(before.shape), np.empty(state.covariance.shape)
        predict_kernel(before, state.covariance, F, Q, moved, mean, P)
        return gaussian(mean, P)

    def run(
        self, state: Gaussian, measured: Array, sensor: Measurement, dt: float | Sequence[float]
    ) -> History[Gaussian]:
        """Predict and correct through K steps; see `Filter.run`."""
        o, linear = self.observe(sensor), self._linear
        if linear is None or o.code < 0:
            return super().run(state, measured, sensor, dt)
        check_dimension(state, self.motion.dim)
        z, times = self._steps(state, measured, sensor, dt)
        models = [linear.matrices(step) for step in (times if len({*times}) > 1 else times[:1])]
        F, Q = np.concatenate([one[0] for one in models]), np.concatenate([one[1] for one in models])
        K, (B, n) = len(z), state.mean.shape
        means, Ps, nis, ll = np.empty((K, B, n)), np.empty((K, B, n, n)), np.empty((K, B)), np.empty((K, B))
        status = follow(
            state.mean, state.covariance, F, Q, z, o.code, o.place, o.columns, o.matrix, o.covariance, self.kind,
            means, Ps, nis, ll,
        )  # fmt: skip
        if status != GOOD:
            step, target = divmod(status // STATUSES, B)
            complain(status % STATUSES + STATUSES * target, f" at step {step}")
        return History(means, Ps, nis, ll, gaussian(means[-1], Ps[-1]))

    def move(self, state: Gaussian, dt: float) -> tuple[Gaussian, Array]:
        """`predict`, and the covariance P F' of the states before and after it."""
        F = self.motion.jacobian(state.mean, dt)
        return self.predict(state, dt), state.covariance @ F.transpose(0, 2, 1)

    def update(self, state: Gaussian, measured: Array, sensor: Measurement) -> Update[Gaussian]:
        """Correct each target with a measurement of its own; see `Filter.update`."""
        seen = self._seen
        o = seen[1] if seen[0] is sensor else self.observe(sensor)
        return self.correct(state, measured, o, o.covariance)

    def correct(self, state: Gaussian, measured: Array, o: Observation, R: Array) -> Update[Gaussian]:
        """Correct with a measurement covariance R (B or 1, d, d) of the caller's."""
        mean = state.mean
        if mean.shape[1] != self.motion.dim:
            check_dimension(state, self.motion.dim)
        z = measured
        if type(z) is not np.ndarray or z.dtype != _FLOAT or not z.flags.c_contiguous or z.shape != (len(mean), o.dim):
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
