"""The base of Kalman's filter and those that linearise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from assoc._parameters import positive
from assoc._system.compiled import for_kernels
from assoc._types import Array
from assoc.filters.base import (
    Expected,
    Filter,
    Fit,
    History,
    Parts,
    Update,
    as_in,
    check_dimension,
    complain,
    measured_array,
    update_of,
)
from assoc.filters.kernels.gates import expect, fits
from assoc.filters.kernels.gaussian import GOOD, PLAIN, STATUSES, follow
from assoc.filters.kernels.gaussian import predict as predict_kernel
from assoc.filters.kernels.gaussian import step as step_kernel
from assoc.filters.kernels.gaussian import update as update_kernel
from assoc.filters.measurement import Measurement, Observation
from assoc.filters.motion.models import LinearMotion, Motion
from assoc.filters.state import Gaussian, gaussian

_NOTHING2 = np.zeros((0, 0))
_FLOAT = np.dtype(np.float64)
_empty = np.empty
_PLAIN_MODELS = LinearMotion.jacobian, LinearMotion.noise


class GaussianFilter(Filter[Gaussian]):
    """The base of Kalman's filter and those that linearise."""

    def __init__(self, motion: Motion) -> None:
        super().__init__(motion)
        # both matrices with one look-up, unless a child class overrides them
        kind = type(motion)
        self._linear: LinearMotion | None = None
        self._plan: tuple[Any, ...] = (None, None)
        self._still: GaussianFilter | None = None
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
            positive(dt, "dt", zero=True)
            if not motion.linear:
                moved = motion.propagate(before, dt)
            F, Q = motion.jacobian(before, dt), motion.noise(before, dt)
        mean, P = _empty(before.shape), _empty(state.covariance.shape)
        predict_kernel(before, state.covariance, F, Q, moved, mean, P)
        return gaussian(mean, P)

    def predict_each(self, state: Gaussian, dt: Array) -> Gaussian:
        """Return each state its own dt seconds later; see `Filter.predict_each`."""
        linear = self._linear
        if linear is None:
            return super().predict_each(state, dt)
        # the kernel takes one of each for all
        steps = dt[:1] if len(dt) and (dt == dt[0]).all() else dt
        F, Q = linear.matrices_of_each(steps)
        # some models add noise at every step, however short: none where there is no step
        Q[steps == 0.0] = 0.0
        mean, P = _empty(state.mean.shape), _empty(state.covariance.shape)
        predict_kernel(state.mean, state.covariance, F, Q, _NOTHING2, mean, P)
        return gaussian(mean, P)

    def step(self, state: Gaussian, dt: float, measured: Array, sensor: Measurement) -> Update[Gaussian]:
        """Predict and correct in one call; see `Filter.step`."""
        known = self._plan
        if known[0] is not sensor or known[1] != dt:
            known = self._make_plan(sensor, dt)
        _, _, models, motion, d, n = known
        before, z = state.mean, measured
        if motion is None or before.shape[0] != 1:
            return super().step(state, dt, measured, sensor)
        if before.shape[1] != n:
            check_dimension(state, n)
        if type(z) is not np.ndarray or z.dtype is not _FLOAT or z.shape != (1, d) or not z.flags.carray:
            z = measured_array(measured, 1, d)
        mean, P, rest = _empty((1, n)), _empty((1, n, n)), _empty(d + d * d + 2)
        status = step_kernel(before, state.covariance, motion, z, models, mean, P, rest)
        if status != GOOD:
            complain(status)
        return update_of(gaussian(mean, P), rest, d)

    def _make_plan(self, sensor: Measurement, dt: float) -> tuple[Any, ...]:
        """Arguments of the kernel for a sensor and a time step; the last plan is remembered."""
        o, n, d = self.observe(sensor), self.motion.dim, self.observe(sensor).dim
        motion = None if self._linear is None or o.code < 0 else self._linear.models(dt)[2]
        plan = self._plan = (sensor, dt, o.packed, motion, d, n)
        return plan

    def run(
        self, state: Gaussian, measured: Array, sensor: Measurement, dt: float | Sequence[float]
    ) -> History[Gaussian]:
        """Predict and correct through K steps; see `Filter.run`."""
        o, linear = self.observe(sensor), self._linear
        if linear is None or o.code < 0:
            return super().run(state, measured, sensor, dt)
        check_dimension(state, self.motion.dim)
        z, times = self._steps(state, measured, sensor, dt)
        motion = np.concatenate(
            [linear.models(step)[2] for step in (times if len({*times}) > 1 else times[:1])], axis=1
        )
        K, (B, n) = len(z), state.mean.shape
        means, Ps, scores = np.empty((K, B, n)), np.empty((K, B, n, n)), np.empty((2, K, B))
        status = follow(state.mean, state.covariance, motion, z, o.packed, means, Ps, scores)
        if status != GOOD:
            step, target = divmod(status // STATUSES, B)
            complain(status % STATUSES + STATUSES * target, f" at step {step}")
        return History(means, Ps, scores[0], scores[1], gaussian(means[-1], Ps[-1]))

    def move(self, state: Gaussian, dt: float) -> tuple[Gaussian, Array]:
        """`predict`, and the covariance P F' of the states before and after it."""
        F = self.motion.jacobian(state.mean, dt)
        return self.predict(state, dt), state.covariance @ F.transpose(0, 2, 1)

    def update(self, state: Gaussian, measured: Array, sensor: Measurement) -> Update[Gaussian]:
        """Correct each target with its measurement; see `Filter.update`."""
        return self.correct(state, measured, self.observe(sensor))

    def correct(self, state: Gaussian, measured: Array, o: Observation, scale: Array | None = None) -> Update[Gaussian]:
        """Correct, on request with the measurement covariance multiplied by a scale for each target, (B,)."""
        mean = state.mean
        B, n = mean.shape
        d = o.dim
        if n != self.motion.dim:
            check_dimension(state, self.motion.dim)
        z = measured
        if type(z) is not np.ndarray or z.dtype is not _FLOAT or z.shape != (B, d) or not z.flags.carray:
            z = measured_array(measured, B, d)
        models = o.packed
        if o.code < 0:
            z = np.ascontiguousarray(o.model.residual(z, o.model.measure(mean)))
            models = o.given(o.model.jacobian(mean))
        if scale is not None:
            models = o.with_noise(models, scale)
        new_mean, new_P, rest = _empty((B, n)), _empty((B, n, n)), _empty(B * (d + d * d + 2))
        status = update_kernel(mean, state.covariance, z, models, new_mean, new_P, rest)
        if status != GOOD:
            complain(status)
        return update_of(gaussian(new_mean, new_P), rest, d)

    def expected(self, state: Gaussian, sensor: Measurement) -> Expected:
        """Return the expected measurements and their covariances; see `Filter.expected`."""
        check_dimension(state, self.motion.dim)
        o = self.observe(sensor)
        if o.code < 0:
            H = o.model.jacobian(state.mean)
            return Expected(o.model.measure(state.mean), H @ state.covariance @ H.transpose(0, 2, 1) + o.covariance)
        return Expected(*expect(state.mean, state.covariance, o.packed, o.dim))

    def sees_like(self, other: Filter[Any]) -> bool:
        """Whether this filter corrects states just as the other does."""
        mine, its, alike = self.motion, other.motion, type(self) is type(other) and self.kind == other.kind
        return alike and self._as_here and (mine.dim, mine.position) == (its.dim, its.position)

    @property
    def _as_here(self) -> bool:
        """Whether states are corrected as this class does, not as a child class may."""
        return as_in(self, GaussianFilter, "update", "correct", "expected", "observe")

    def positions_alone(self, state: Gaussian) -> tuple[Filter[Any], Any]:
        """A filter of positions alone, and the positions of these states; see `Filter.positions_alone`."""
        check_dimension(state, self.motion.dim)
        motion = self.motion
        if self.kind != PLAIN or not self._as_here or len(motion.position) == motion.dim:
            return self, state
        axes = list(motion.position)
        if self._still is None:
            F, Q = np.eye(len(axes)), np.zeros((len(axes), len(axes)))
            self._still = GaussianFilter(LinearMotion(lambda dt: F, lambda dt: Q, len(axes), tuple(range(len(axes)))))
        P = np.ascontiguousarray(state.covariance[:, axes][:, :, axes])
        return self._still, gaussian(np.ascontiguousarray(state.mean[:, axes]), P)

    def _linearises(self, o: Observation) -> bool:
        """Whether states are corrected by such measurements as kernels do, without anything of one's own."""
        return o.code >= 0 and self.kind == PLAIN and self._as_here

    def in_parts(self, state: Gaussian, sensors: Sequence[Measurement]) -> Parts | None:
        """States and models for kernels; see `Filter.in_parts`."""
        seen = [self.observe(sensor) for sensor in sensors]
        if not all(self._linearises(o) for o in seen):
            return None
        mean, P = for_kernels(state.mean), for_kernels(state.covariance)
        return Parts(mean[:, None], P[:, None], np.ones((len(state), 1)), seen)

    def fit(self, state: Gaussian, expected: Expected, rows: Array, measured: Array, sensor: Measurement) -> Fit | None:
        """How well measurements fit, without correcting anything; see `Filter.fit`."""
        o = self.observe(sensor)
        if not self._linearises(o):
            return None
        found = _empty((2, len(rows)))
        status = fits(state.mean, state.covariance, rows, measured, o.packed, found)
        if status != GOOD:
            complain(status)
        return Fit(found[0], found[1])
