"""The interface of all filters: predict, update, log_likelihood.

A filter holds models and no targets: what it knows of the targets is a state that goes in and comes out, so
one filter serves any number of tracks, hypotheses and threads.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, NoReturn, Protocol, TypeVar

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.batches import concatenate
from assoc.filters.kernels.gates import pairs
from assoc.filters.kernels.gaussian import BAD_COVARIANCE, BAD_MEASUREMENT, GOOD, LOG_TURN, PLAIN, STATUSES
from assoc.filters.kernels.linear_algebra import all_factors
from assoc.filters.measurement import Measurement, Observation, observation
from assoc.filters.motion.models import Motion
from assoc.filters.state import Gaussian, finite
from assoc.sensors.arrays import numbers


class State(Protocol):
    """State of a filter."""

    @property
    def mean(self) -> Array:
        """Means, (B, n)."""

    @property
    def covariance(self) -> Array:
        """Covariances, (B, n, n)."""

    def __len__(self) -> int: ...

    def __getitem__(self, rows: Any) -> Any: ...


# models of so many sensors are remembered
_MOST_SENSORS = 64

S = TypeVar("S", bound=State)
_new = object.__new__


@dataclass(frozen=True, eq=False, repr=False)
class Update(Generic[S]):
    """Result of a correction."""

    state: S
    innovation: Array
    """Measured minus expected, angles wrapped, (B, d)."""
    covariance: Array
    """Of the innovation, (B, d, d)."""
    nis: Array
    """Normalised innovation squared, (B,)."""
    log_likelihood: Array
    """Of the measurement under the prediction, (B,)."""

    def __getattr__(self, name: str) -> Array:
        """Take apart what `update_of` was given in one piece, on first use."""
        parts = self.__dict__
        if "rest" not in parts or name not in ("innovation", "covariance", "nis", "log_likelihood"):
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        if callable(parts["rest"]):
            parts["innovation"], parts["covariance"], parts["nis"] = parts["rest"]()
            return parts[name]
        rest, d, B = parts["rest"], parts["measured"], len(parts["state"])
        v, S = B * d, B * d + B * d * d
        parts["innovation"], parts["covariance"] = rest[:v].reshape(B, d), rest[v:S].reshape(B, d, d)
        parts["nis"], parts["log_likelihood"] = rest[S : S + B], rest[S + B :]
        return parts[name]

    def __getstate__(self) -> dict[str, Any]:
        # taken apart before it goes to another process
        names = ("state", "innovation", "covariance", "nis", "log_likelihood")
        return {name: getattr(self, name) for name in names}

    def __repr__(self) -> str:
        return f"Update({self.state!r})"


def update_of(state: S, rest: Array, measured: int) -> Update[S]:
    """Make an update of `rest`, which kernels write for `measured` quantities.

    For a single target making its four arrays would take as long as the correction; few of them are used.
    """
    made: Update[S] = _new(Update)
    parts = made.__dict__
    parts["state"], parts["rest"], parts["measured"] = state, rest, measured
    return made


def update_later(state: S, log_likelihood: Array, rest: Callable[[], tuple[Array, Array, Array]]) -> Update[S]:
    """Make an update whose innovation, its covariance and NIS are computed on first use."""
    made: Update[S] = _new(Update)
    made.__dict__.update(state=state, log_likelihood=log_likelihood, rest=rest)
    return made


class Expected(NamedTuple):
    """Expected measurements of a state."""

    mean: Array
    """(B, d)."""
    covariance: Array
    """With the sensor's noise, (B, d, d)."""


class Fit(NamedTuple):
    """How well K measurements fit targets."""

    log_likelihood: Array
    nis: Array
    """Squared Mahalanobis distance from the expected measurement."""


class Parts(NamedTuple):
    """States of B targets as mixtures of m Gaussians, and models of S sensors, as kernels take them."""

    means: Array
    """(B, m, n)."""
    covariances: Array
    """(B, m, n, n)."""
    weights: Array
    """(B, m)."""
    observations: list[Observation]


class History(NamedTuple, Generic[S]):
    """Result of `Filter.run`: the corrected states of K steps."""

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

    kind = PLAIN

    def __init__(self, motion: Motion) -> None:
        self.motion = motion
        self._seen: dict[int, tuple[Any, Observation]] = {}

    @abstractmethod
    def start(self, state: Gaussian) -> S:
        """Make this filter's kind of state of a Gaussian."""

    @abstractmethod
    def predict(self, state: S, dt: float) -> S:
        """Return the state dt seconds later."""

    def predict_each(self, state: S, dt: Array) -> S:
        """Return each state its own dt seconds later; callers use `assoc.filters.base.predict_each`.

        Parameters
        ----------
        state
            B targets, at least one.
        dt : array (B,)
            Seconds, 0 or more, not all the same.
        """
        # one prediction for each time step that occurs: any filter can
        steps, which = np.unique(dt, return_inverse=True)
        order = np.argsort(which, kind="stable")
        bounds = np.searchsorted(which[order], np.arange(len(steps) + 1))
        parts: list[Any] = []
        states: Any = state
        for number, step in enumerate(steps):
            rows = states[order[bounds[number] : bounds[number + 1]]]
            parts.append(self.predict(rows, float(step)) if step > 0 else rows)
        back = np.empty(len(order), dtype=np.int64)
        back[order] = np.arange(len(order))
        return concatenate(parts)[back]

    @abstractmethod
    def update(self, state: S, measured: Array, sensor: Measurement) -> Update[S]:
        """Correct each target with its measurement.

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

    def step(self, state: S, dt: float, measured: Array, sensor: Measurement) -> Update[S]:
        """`predict` and `update` in one call: the quickest way if the prediction itself is not needed."""
        return self.update(self.predict(state, dt), measured, sensor)

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
        K, B, n = len(z), len(state), self.motion.dim
        means, Ps, nis, ll = np.empty((K, B, n)), np.empty((K, B, n, n)), np.empty((K, B)), np.empty((K, B))
        for k in range(K):
            done = self.step(state, times[k], z[k], sensor)
            state = done.state
            means[k], Ps[k], nis[k], ll[k] = state.mean, state.covariance, done.nis, done.log_likelihood
        return History(means, Ps, nis, ll, state)

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
        times = finite(dt, "dt", 1).tolist()
        if np.ndim(dt) == 0:
            times *= len(z)
        if len(times) != len(z):
            raise InvalidInputError(f"dt must be one number or {len(z)}, got {len(times)}")
        return z, times

    def fit(self, state: S, expected: Expected, rows: Array, measured: Array, sensor: Measurement) -> Fit | None:
        """How well measurements fit, as `update` says, without correcting anything.

        Parameters
        ----------
        state
            B targets.
        expected : Expected
            What `expected` returns for them.
        rows : int array (K,)
            Target of each measurement; those of one target side by side.
        measured : array (K, d)
        sensor
            As in `update`.

        Returns
        -------
        Fit or None
            None: this filter, or this sensor's model, has to correct states for it.
        """
        return None

    def sees_like(self, other: Filter[Any]) -> bool:
        """Whether this filter corrects states just as the other does; False where that is not known."""
        return False

    def positions_alone(self, state: S) -> tuple[Filter[Any], Any]:
        """A filter of positions alone, and the positions of B states: sensors without range rates see no more of them.

        Whoever only asks how well measurements fit, one after the other, need not correct the rest of a state. Filters
        that cannot say return themselves and the states.
        """
        return self, state

    def in_parts(self, state: S, sensors: Sequence[Measurement]) -> Parts | None:
        """States and models for kernels that correct as `update` does.

        None where this filter, or one of these sensors, corrects in a way of its own.
        """
        return None

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
            residuals = [o.model.residual(z, np.broadcast_to(row, z.shape)) for row in h]
            return scores(np.stack(residuals), covariance)
        status, ll, square = pairs(h, covariance, z, o.code, o.folding)
        if status != GOOD:
            complain(status)
        return ll, square

    def observe(self, sensor: Measurement) -> Observation:
        """Put a measurement model in the form that the kernels take."""
        # by address, with the sensor kept beside, so that no other has it
        seen = self._seen.get(id(sensor))
        if seen is None or seen[0] is not sensor:
            if len(self._seen) >= _MOST_SENSORS:
                self._seen = {}
            seen = self._seen[id(sensor)] = (sensor, self._observation(sensor))
        return seen[1]

    def _observation(self, sensor: Measurement) -> Observation:
        """What `observe` remembers."""
        return observation(sensor, self.motion, self.kind)

    def move(self, state: S, dt: float) -> tuple[S, Array]:
        """`predict`, and the covariance of the states before and after it, (B, n, n), for smoothing."""
        raise NotImplementedError(f"{type(self).__name__} has no cross covariance")

    def prior(self, predicted: S, corrected: S) -> tuple[Array, Array]:
        """Mean and covariance of the prediction as it was corrected; adaptive filters change it."""
        return predicted.mean, predicted.covariance


def as_in(filter: Filter[Any], base: type, *names: str) -> bool:
    """Whether a filter's class has these methods as its base class has them, none of its own."""
    return all(getattr(type(filter), name) is getattr(base, name) for name in names)


def measured_array(measured: object, batch: int | None, dim: int, what: str = "measured") -> Array:
    """Return measurements as float64 (B, d); finiteness is left to the kernels."""
    if isinstance(measured, np.ndarray) and measured.dtype == np.float64:
        array = measured
    else:
        array = numbers(measured, what)
    if array.ndim == 1 and batch == 1:
        array = array[None]
    if array.ndim != 2 or array.shape[1] != dim or (batch is not None and len(array) != batch):
        rows = "M" if batch is None else batch
        raise InvalidInputError(f"{what} must have shape ({rows}, {dim}), got {array.shape}")
    # a kernel would be compiled once more for arrays that are read only, as those of scenes are
    return array if array.flags.carray else array.copy()


def complain(status: int, where: str = "") -> NoReturn:
    """Raise the error of a kernel's status."""
    row, status = divmod(status, STATUSES)
    if status == BAD_MEASUREMENT:
        raise InvalidInputError(f"measured must be finite, row {row} is not{where}")
    if status == BAD_COVARIANCE:
        raise InvalidInputError(f"state: covariance of target {row} is not positive definite{where}")
    raise InvalidInputError(f"state: mean of target {row} gives no finite measurement{where}")


def scores(residuals: Array, covariance: Array) -> tuple[Array, Array]:
    """Log-likelihoods and squared Mahalanobis distances, each (B, M), of residuals (B, M, d)."""
    bad, factor = all_factors(np.ascontiguousarray(covariance))
    if bad >= 0:
        complain(BAD_COVARIANCE + STATUSES * bad)
    white = np.linalg.solve(factor, residuals.transpose(0, 2, 1))
    square = (white**2).sum(axis=1)
    log_det = 2 * np.log(np.einsum("bii->bi", factor)).sum(axis=1)
    return -0.5 * (square + log_det[:, None] + residuals.shape[2] * LOG_TURN), square


def check_dimension(state: Gaussian, dim: int) -> Gaussian:
    """Return a state of the right dimension."""
    if state.mean.shape[1] != dim:
        raise InvalidInputError(f"state must have {dim} components, got {state.mean.shape[1]}")
    return state


def predict_each(filter: Filter[Any], state: Any, dt: Array) -> Any:
    """Predict each of B targets by its time step (B,), seconds, 0 or more."""
    if not len(dt):
        return state
    low, high = float(dt.min()), float(dt.max())
    if low < 0:
        raise InvalidInputError(f"dt must be a number >= 0, got {low!r}")
    if low == high:
        return filter.predict(state, low) if low > 0 else state
    return filter.predict_each(state, dt)


class PointFilter(Filter[S]):
    """The base of filters that carry points: sigma points or the members of an ensemble."""

    @abstractmethod
    def _points(self, state: S) -> Array:
        """Points of each target, (B, m, n)."""

    @abstractmethod
    def _correct(self, state: S, z: Array, models: Array) -> Update[S]:
        """Run the kernel; without measurements z it gives expected ones instead of innovations."""

    def update(self, state: S, measured: Array, sensor: Measurement) -> Update[S]:
        """Correct each target with its measurement; see `Filter.update`."""
        o = self.observe(sensor)
        return self._run(state, measured_array(measured, len(state), o.dim), o)[0]

    def expected(self, state: S, sensor: Measurement) -> Expected:
        """Return the expected measurements and their covariances; see `Filter.expected`."""
        o = self.observe(sensor)
        done, first = self._run(state, np.zeros((0, o.dim)), o)
        return Expected(done.innovation + first, done.covariance)

    def _run(self, state: S, z: Array, o: Observation) -> tuple[Update[S], Array]:
        """Results, and measurements (B or 1, d) that expected ones are relative to."""
        if o.code >= 0:
            return self._correct(state, z, o.packed), np.zeros((1, o.dim))
        # a user's model: its measurements of all points, relative to that of the first
        points = self._points(state)
        B, m, n = points.shape
        measured = o.model.measure(points.reshape(-1, n))
        first = measured[::m]
        relative = o.model.residual(measured, np.repeat(first, m, axis=0)).reshape(B, m, o.dim)
        residual = np.ascontiguousarray(o.model.residual(z, first)) if len(z) else z
        return self._correct(state, residual, o.given(relative)), first
