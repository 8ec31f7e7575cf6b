"""The interacting multiple model filter: several filters side by side, mixed at each step.

The modes are a continuous-time Markov chain: over dt seconds the probabilities of a change are those of the matrix
exp(Q dt), Q the rates per second, so that four seconds are four seconds, in one prediction or in sixteen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any

import numpy as np

from assoc._parameters import positive
from assoc._system.compiled import for_kernels
from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.base import (
    Expected,
    Filter,
    Fit,
    Parts,
    Update,
    as_in,
    check_dimension,
    complain,
    measured_array,
    update_later,
)
from assoc.filters.batches import Batch
from assoc.filters.kernels.gates import distances, matched
from assoc.filters.kernels.gaussian import GOOD
from assoc.filters.linearised import GaussianFilter
from assoc.filters.measurement import Measurement, periods_of
from assoc.filters.state import Gaussian, finite, gaussian, symmetric
from assoc.filters.unscented import UnscentedKalmanFilter


@dataclass(frozen=True, eq=False, repr=False)
class Mixture(Batch):
    """Gaussian mixtures, one component for each of m models: (B, m, n), (B, m, n, n), weights (B, m)."""

    means: Array
    covariances: Array
    weights: Array

    @cached_property
    def mean(self) -> Array:
        """Means of the mixtures, (B, n)."""
        return np.einsum("bm,bmi->bi", self.weights, self.means)

    @cached_property
    def covariance(self) -> Array:
        """Covariances of the mixtures, (B, n, n)."""
        spread = self.means - self.mean[:, None]
        covariance: Array = np.einsum("bm,bmij->bij", self.weights, self.covariances)
        return symmetric(covariance + np.einsum("bm,bmi,bmj->bij", self.weights, spread, spread))

    def component(self, j: int) -> Gaussian:
        """Return the Gaussians of one model."""
        return gaussian(np.ascontiguousarray(self.means[:, j]), np.ascontiguousarray(self.covariances[:, j]))


# eigenvectors of the rates with a smaller condition number give transitions to ten digits
_LARGEST_CONDITION = 1e4
# time steps whose transitions are remembered
_MOST_STEPS = 64


def transition_rates(transition: Array, interval: float) -> Array:
    """Rates per second of the continuous-time Markov chain with these probabilities over `interval` seconds.

    InvalidInputError where no chain in continuous time has them.
    """
    # away from a negative or zero eigenvalue the logarithm is real
    values = np.linalg.eigvals(transition)
    good = bool((np.abs(values) > 1e-12).all() and not ((np.abs(values.imag) < 1e-12) & (values.real < 0)).any())
    # slow to import: not every tracker has several models
    from scipy.linalg import expm, logm

    rates = np.real(logm(transition)) if good else np.full(transition.shape, -1.0)
    off = rates - np.diag(np.diagonal(rates))
    if not good or (off < -1e-9).any() or np.abs(expm(rates) - transition).max() > 1e-9:
        raise InvalidInputError(
            f"transition: {transition.tolist()} are not the probabilities of a chain in continuous time "
            "(modes must tend to stay: with two, the diagonal sums to more than 1)"
        )
    off = np.maximum(off, 0.0) / interval
    return np.asarray(off - np.diag(off.sum(axis=1)))


@explains_wrong_types
def transition_from_sojourns(seconds: Sequence[float], interval: float = 1.0) -> Array:
    """Transition probabilities of modes that last for these mean times, each change as likely to any other mode.

    Parameters
    ----------
    seconds : sequence of m floats
        Mean time that a target stays in each mode, seconds.
    interval : float
        Seconds over which the probabilities are wanted.

    Returns
    -------
    array (m, m)
    """
    leave = 1.0 / np.array([positive(sojourn, "seconds") for sojourn in seconds])
    m = len(leave)
    if m < 2:
        raise InvalidInputError(f"seconds: expected at least 2 modes, got {m}")
    rates = np.repeat(leave[:, None] / (m - 1), m, axis=1)
    np.fill_diagonal(rates, -leave)
    from scipy.linalg import expm

    return np.asarray(expm(rates * positive(interval, "interval")))


class InteractingMultipleModel(Filter[Mixture]):
    """The interacting multiple model filter.

    Parameters
    ----------
    filters : sequence of filters with Gaussian states
        Their motion models share one state; see `assoc.filters.Padded`.
    transition : array_like (m, m)
        Probability that a target in mode i is in mode j `interval` seconds later; rows sum to 1. A Markov chain in
        continuous time must have them: with two modes the diagonal sums to more than 1. `transition_from_sojourns`
        makes them of mean times.
    weights : array_like (m,), optional
        Probabilities of the modes at the start; without it the stationary ones of `transition`.
    interval : float
        Seconds to which `transition` belongs; 1 by default, which makes it a probability per second.

    Attributes
    ----------
    rates : array (m, m)
        Rates of the changes per second, Q; its rows sum to 0, and -1 / Q_ii is the mean time spent in mode i.

    References
    ----------
    Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation, 11.6.6.
    """

    def __init__(
        self,
        filters: Sequence[GaussianFilter | UnscentedKalmanFilter],
        transition: Array,
        weights: Array | None = None,
        *,
        interval: float = 1.0,
    ) -> None:
        if len(filters) < 2:
            raise InvalidInputError(f"filters must be at least 2, got {len(filters)}")
        dims = [model.motion.dim for model in filters]
        if len(set(dims)) > 1:
            raise InvalidInputError(f"filters must share one state, got dimensions {dims}")
        super().__init__(filters[0].motion)
        self.filters: tuple[GaussianFilter | UnscentedKalmanFilter, ...] = tuple(filters)
        self._alike = all(model.sees_like(filters[0]) for model in filters)
        self._still: InteractingMultipleModel | None = None
        m = len(filters)
        self.transition = finite(transition, "transition", 2)
        if self.transition.shape != (m, m):
            raise InvalidInputError(f"transition must have shape {(m, m)}, got {self.transition.shape}")
        if (self.transition < 0).any() or np.abs(self.transition.sum(axis=1) - 1).max() > 1e-9:
            raise InvalidInputError("transition must have probabilities in its rows that sum to 1")
        self.interval = positive(interval, "interval")
        self.rates = transition_rates(self.transition, self.interval)
        self._exact = {0.0: np.eye(m), self.interval: self.transition}
        self._known = self._exact.copy()
        self._eigen: tuple[Array, Array, Array | None] | None = None
        if weights is None:
            values, vectors = np.linalg.eig(self.transition.T)
            if np.count_nonzero(values.real > 1 - 1e-12) > 1:
                raise InvalidInputError("weights must be given: transition has several stationary probabilities")
            stationary = np.abs(vectors[:, np.argmax(values.real)].real)
            weights = stationary / stationary.sum()
        self.weights = finite(weights, "weights", 1)
        if self.weights.shape != (m,) or (self.weights < 0).any() or abs(self.weights.sum() - 1) > 1e-9:
            raise InvalidInputError(f"weights must be {m} probabilities that sum to 1")

    def start(self, state: Gaussian) -> Mixture:
        """Give every model the same Gaussian."""
        check_dimension(state, self.motion.dim)
        m, B = len(self.filters), len(state)
        return Mixture(
            np.repeat(state.mean[:, None], m, axis=1),
            np.repeat(state.covariance[:, None], m, axis=1),
            np.broadcast_to(self.weights, (B, m)).copy(),
        )

    def transition_over(self, dt: float) -> Array:
        """Probability that a target in mode i is in mode j dt seconds later, (m, m)."""
        known = self._known.get(dt)
        if known is None:
            dt = positive(dt, "dt", zero=True)
            if len(self._known) > _MOST_STEPS:
                self._known = self._exact.copy()
            known = self._known[dt] = self._transitions(np.array([dt]))[0]
        return known

    def _transitions(self, dt: Array) -> Array:
        """`transition_over` of each of k time steps, (k, m, m)."""
        if self._eigen is None:
            values, vectors = np.linalg.eig(self.rates)
            self._eigen = (
                values,
                vectors,
                np.linalg.inv(vectors) if np.linalg.cond(vectors) < _LARGEST_CONDITION else None,
            )
        values, vectors, inverse = self._eigen
        if inverse is None:
            from scipy.linalg import expm

            return np.stack([expm(self.rates * step) for step in dt.tolist()])
        # much quicker than expm, which plots with times of their own would call once each
        return np.maximum(np.real((vectors * np.exp(values * dt[:, None])[:, None]) @ inverse), 0.0)

    def predict(self, state: Mixture, dt: float) -> Mixture:
        """Mix the models and predict each; see `Filter.predict`."""
        mixed = _mixed(state, self.transition_over(dt))
        moved = [model.predict(mixed.component(j), dt) for j, model in enumerate(self.filters)]
        return _mixture(moved, mixed.weights)

    def predict_each(self, state: Mixture, dt: Array) -> Mixture:
        """Return each state its own dt seconds later; see `Filter.predict_each`."""
        mixed = _mixed(state, self._transitions(dt))
        moved = [model.predict_each(mixed.component(j), dt) for j, model in enumerate(self.filters)]
        return _mixture(moved, mixed.weights)

    def move(self, state: Mixture, dt: float) -> tuple[Mixture, Array]:
        """`predict`, and the covariance of the mixtures before and after it, (B, n, n)."""
        mixed = _mixed(state, self.transition_over(dt))
        moved = [model.move(mixed.component(j), dt) for j, model in enumerate(self.filters)]
        cross = np.zeros((len(state), self.motion.dim, self.motion.dim))
        for j, (after, between) in enumerate(moved):
            # the factors (means - mean) sum to zero over the models: `after` need not be centred
            away = (mixed.means[:, j] - state.mean)[:, :, None]
            cross += mixed.weights[:, j, None, None] * (between + away * after.mean[:, None, :])
        return _mixture([after for after, _ in moved], mixed.weights), cross

    def _of_modes(
        self, state: Mixture, run: Callable[[GaussianFilter | UnscentedKalmanFilter, Gaussian, int], tuple[Array, ...]]
    ) -> list[Array]:
        """Results (B, m, ...) of `run`, given a filter, Gaussians, and how many of them belong to each target.

        All modes are one batch where they see alike.
        """
        if self._alike:
            B, m, _ = state.means.shape
            # what is wrong with a target is told below, where rows are targets
            with suppress(InvalidInputError):
                return [array.reshape(B, m, *array.shape[1:]) for array in run(self.filters[0], _flat(state), m)]
        each = [run(model, state.component(j), 1) for j, model in enumerate(self.filters)]
        return [np.stack(parts, axis=1) for parts in zip(*each, strict=True)]

    def update(self, state: Mixture, measured: Array, sensor: Measurement) -> Update[Mixture]:
        """Correct each model and its probability; see `Filter.update`."""
        o = self.observe(sensor)
        z = measured_array(measured, len(state), o.dim)

        def run(model: GaussianFilter | UnscentedKalmanFilter, part: Gaussian, times: int) -> tuple[Array, ...]:
            done = model.update(part, np.repeat(z, times, axis=0), sensor)
            return done.state.mean, done.state.covariance, done.innovation, done.covariance, done.log_likelihood

        means, covariances, v, S, fits = self._of_modes(state, run)
        joint, total = _joint(fits, state.weights)
        corrected = Mixture(means, covariances, np.exp(joint - total[:, None]))

        def as_one() -> tuple[Array, Array, Array]:
            mean, covariance = matched(state.weights, v, S, _periods(sensor))
            return mean, covariance, np.einsum("bi,bi->b", mean, np.linalg.solve(covariance, mean[..., None])[..., 0])

        return update_later(corrected, total, as_one)

    def expected(self, state: Mixture, sensor: Measurement) -> Expected:
        """Return the expected measurements and covariances of the mixtures; see `Filter.expected`."""
        h, S = self._of_modes(state, lambda model, part, times: model.expected(part, sensor))
        return Expected(*matched(state.weights, h, S, _periods(sensor)))

    def fit(self, state: Mixture, expected: Expected, rows: Array, measured: Array, sensor: Measurement) -> Fit | None:
        """How well measurements fit, without correcting anything; see `Filter.fit`."""
        fits, m, flat = np.empty((len(rows), len(self.filters))), len(self.filters), _flat(state)
        for j, model in enumerate(self.filters):
            part, of_part = (flat, rows * m + j) if self._alike else (state.component(j), rows)
            found = model.fit(part, expected, of_part, measured, sensor)
            if found is None:
                return None
            fits[:, j] = found.log_likelihood
        o = self.observe(sensor)
        status, nis = distances(*expected, rows, measured, o.code, o.folding)
        if status != GOOD:
            complain(status)
        return Fit(_joint(fits, state.weights[rows])[1], nis)

    def in_parts(self, state: Mixture, sensors: Sequence[Measurement]) -> Parts | None:
        """States and models for kernels; see `Filter.in_parts`."""
        flat = self.filters[0].in_parts(_flat(state), sensors) if self._alike else None
        if flat is None or not as_in(self, InteractingMultipleModel, "update", "expected", "fit"):
            return None
        means, covariances = flat.means.reshape(state.means.shape), flat.covariances.reshape(state.covariances.shape)
        return Parts(means, covariances, for_kernels(state.weights), flat.observations)

    def positions_alone(self, state: Mixture) -> tuple[Filter[Any], Any]:
        """A filter of positions alone, and the positions of these states; see `Filter.positions_alone`."""
        model, flat = self.filters[0].positions_alone(_flat(state))
        if not self._alike or model is self.filters[0]:
            return self, state
        if self._still is None:
            assert isinstance(model, GaussianFilter)
            self._still = copy(self)
            self._still.motion, self._still.filters, self._still._seen = model.motion, (model,) * len(self.filters), {}
        B, m, _ = state.means.shape
        n = flat.mean.shape[1]
        return self._still, Mixture(flat.mean.reshape(B, m, n), flat.covariance.reshape(B, m, n, n), state.weights)

    def log_likelihood(self, state: Mixture, measurements: Array, sensor: Measurement) -> Array:
        """Log-likelihood under the mixture of the models' predictions, (B, M)."""
        each = [model.log_likelihood(state.component(j), measurements, sensor) for j, model in enumerate(self.filters)]
        with np.errstate(divide="ignore"):
            joint = np.stack(each, axis=1) + np.log(state.weights)[:, :, None]
        return np.logaddexp.reduce(joint, axis=1)

    def compare(self, state: Mixture, measurements: Array, sensor: Measurement) -> tuple[Array, Array]:
        """`log_likelihood` and `distances`, these from the mixture as one Gaussian; (B, M) each."""
        return self.log_likelihood(state, measurements, sensor), super().compare(state, measurements, sensor)[1]


def _flat(state: Mixture) -> Gaussian:
    """The components of all targets as one batch, those of a target side by side."""
    n = state.means.shape[2]
    return gaussian(state.means.reshape(-1, n), state.covariances.reshape(-1, n, n))


def _joint(log_likelihoods: Array, weights: Array) -> tuple[Array, Array]:
    """Logarithms of likelihoods (K, m) times weights (K, m), and of their sums over the models, (K,)."""
    with np.errstate(divide="ignore"):
        joint = log_likelihoods + np.log(weights)
    # model by model: numpy is slow with short rows
    return joint, reduce(np.logaddexp, joint.T)


def _periods(sensor: Measurement) -> Array:
    """After how much each component comes back, (d,)."""
    return np.array(periods_of(sensor))


def _mixture(parts: Sequence[Gaussian], weights: Array) -> Mixture:
    means, covariances = [part.mean for part in parts], [part.covariance for part in parts]
    return Mixture(np.stack(means, axis=1), np.stack(covariances, axis=1), weights)


def _mixed(state: Mixture, transition: Array) -> Mixture:
    """What each model starts from, and the new weights, given transitions (m, m) or (B, m, m)."""
    weights = (state.weights[:, None] @ transition)[:, 0] if transition.ndim == 3 else state.weights @ transition
    # share of model i in what model j starts from
    share = state.weights[:, :, None] * transition / np.maximum(weights, 1e-300)[:, None, :]
    dead = weights < 1e-300
    if dead.any():
        # a model of weight zero goes on from its own state
        share = np.where(dead[:, None, :], np.eye(weights.shape[1]), share)
    means = share.transpose(0, 2, 1) @ state.means
    away = state.means[:, :, None] - means[:, None]
    # sum over i of share_ij (P_i + away away')
    B, m, n = means.shape
    P = (share.transpose(0, 2, 1) @ state.covariances.reshape(B, m, n * n)).reshape(B, m, n, n)
    P += (share[..., None] * away).transpose(0, 2, 3, 1) @ away.transpose(0, 2, 1, 3)
    return Mixture(means, symmetric(P), weights)
