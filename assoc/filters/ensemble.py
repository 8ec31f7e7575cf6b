"""The ensemble Kalman filter."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Any

import numpy as np

from assoc._parameters import is_whole, positive
from assoc._system import memory
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.base import PointFilter, Update, check_dimension, complain, update_of
from assoc.filters.batches import Batch
from assoc.filters.kernels.gaussian import GOOD
from assoc.filters.kernels.points import ensemble_update, move_ensemble
from assoc.filters.motion.models import Motion
from assoc.filters.state import Gaussian, finite

_NOTHING2 = np.zeros((0, 0))
_NOTHING3 = np.zeros((0, 0, 0))


@dataclass(frozen=True, eq=False, repr=False)
class Ensemble(Batch):
    """Ensembles of N members for each of B targets, (B, N, n)."""

    members: Array

    def __post_init__(self) -> None:
        members = finite(self.members, "members", 3)
        if members.shape[1] < 2:
            raise InvalidInputError(f"members must be at least 2 for each target, got {members.shape[1]}")
        object.__setattr__(self, "members", members)

    @cached_property
    def mean(self) -> Array:
        """Sample means, (B, n)."""
        return self.members.mean(axis=1)

    @cached_property
    def covariance(self) -> Array:
        """Sample covariances, (B, n, n)."""
        deviation = self.members - self.mean[:, None]
        return deviation.transpose(0, 2, 1) @ deviation / (self.members.shape[1] - 1)


def _ensemble(members: Array) -> Ensemble:
    made = object.__new__(Ensemble)
    made.__dict__["members"] = members
    return made


class EnsembleKalmanFilter(PointFilter[Ensemble]):
    """The ensemble Kalman filter with perturbed measurements (equations 8 to 13 of the UAV paper).

    Parameters
    ----------
    motion : Motion
    size : int
        Members of an ensemble, N.
    rng : numpy.random.Generator or int
        The source of all perturbations; the same seed gives the same result.
    """

    def __init__(self, motion: Motion, size: int = 100, rng: np.random.Generator | int = 0) -> None:
        super().__init__(motion)
        if isinstance(size, bool) or not isinstance(size, (int, np.integer)) or size < 2:
            raise InvalidInputError(f"size must be a whole number of at least 2, got {size!r}")
        self.size = int(size)
        if not (isinstance(rng, np.random.Generator) or is_whole(rng, 0)):
            raise InvalidInputError(f"rng must be a Generator or a seed, a whole number >= 0, got {rng!r}")
        self.rng = np.random.default_rng(rng)
        self._factors: tuple[Any, Array] = (None, _NOTHING3)

    def start(self, state: Gaussian) -> Ensemble:
        """Draw ensembles from Gaussians."""
        check_dimension(state, self.motion.dim)
        B, n = state.mean.shape
        factors = np.linalg.cholesky(state.covariance)
        shocks = self._drawn((B, self.size, n), state.mean)
        return _ensemble(state.mean[:, None] + shocks @ factors.transpose(0, 2, 1))

    def predict(self, state: Ensemble, dt: float) -> Ensemble:
        """Return the ensembles dt seconds later, with noise for each member."""
        members, motion = self._points(state), self.motion
        B, N, n = members.shape
        positive(dt, "dt", zero=True)
        if motion.linear:
            moved, F = _NOTHING3, motion.jacobian(_NOTHING2, dt)
        else:
            flat = motion.propagate(members.reshape(-1, n), dt)
            moved, F = np.ascontiguousarray(flat).reshape(B, N, n), _NOTHING3
        out = np.empty(members.shape)
        move_ensemble(members, F, self._drawn((B, N, n), members[:, 0]), moved, self._roots(state, dt), out)
        return _ensemble(out)

    def _roots(self, state: Ensemble, dt: float) -> Array:
        """Lower factors of the process noise, which may be singular."""
        Q = self.motion.noise(state.mean, dt) if not self.motion.linear else self.motion.noise(_NOTHING2, dt)
        known = self._factors
        if known[0] is not Q:
            known = self._factors = (Q, _lower_roots(Q))
        return known[1]

    def move(self, state: Ensemble, dt: float) -> tuple[Ensemble, Array]:
        """`predict`, and the sample covariance of the members before and after it, (B, n, n)."""
        after = self.predict(state, dt)
        before = state.members - state.mean[:, None]
        cross = before.transpose(0, 2, 1) @ (after.members - after.mean[:, None])
        return after, cross / (state.members.shape[1] - 1)

    def _correct(self, state: Ensemble, z: Array, models: Array) -> Update[Ensemble]:
        members = self._points(state)
        (B, N, _), d = members.shape, z.shape[1]
        shocks = self._drawn((B, N, d), z, members[:, 0]) if len(z) else _NOTHING3
        out, rest = np.empty(members.shape), np.empty(B * (d + d * d + 2))
        status = ensemble_update(members, z, models, shocks, out, rest)
        if status != GOOD:
            complain(status)
        return update_of(_ensemble(out), rest, d)

    def _drawn(self, shape: tuple[int, ...], *rows: Array) -> Array:
        """Standard normal numbers for each of the rows, the same in whatever order these come."""
        # the members, their noise, and the next ones
        memory.require(24.0 * prod(shape), f"size = {shape[1]}: {shape[0]} ensembles", "take fewer members")
        order = np.lexsort(np.concatenate(rows, axis=1).T)
        shocks = np.empty(shape)
        shocks[order] = self.rng.standard_normal(shape)
        return shocks

    def _points(self, state: Ensemble) -> Array:
        n = state.members.shape[2]
        if n != self.motion.dim:
            raise InvalidInputError(f"state must have {self.motion.dim} components, got {n}")
        return state.members


def _lower_roots(Q: Array) -> Array:
    """Lower triangular L with L L' = Q for positive semidefinite Q (B, n, n)."""
    values, vectors = np.linalg.eigh(Q)
    if (values < -1e-9 * np.abs(values).max(axis=1, keepdims=True)).any():
        raise InvalidInputError("noise must be a positive semidefinite covariance")
    root = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    # Q = root root' = (R' R) with the triangular R of root' = q R
    lower: Array = np.linalg.qr(root.transpose(0, 2, 1))[1].transpose(0, 2, 1)
    # entries that are rounding errors cost time in the kernel
    lower[np.abs(lower) < 1e-14 * np.abs(lower).max(axis=(1, 2), keepdims=True)] = 0.0
    return np.ascontiguousarray(lower)
