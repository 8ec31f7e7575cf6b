"""Measurement models of filters: sensors of `assoc.sensors`, matrices, or a user's function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.kernels.gaussian import GIVEN, LINEAR, PLAIN
from assoc.filters.motion.models import Motion, differences
from assoc.filters.state import checked_covariance, finite
from assoc.sensors.arrival_time import refuse_arrival_times
from assoc.sensors.base import Sensor
from assoc.sensors.codes import CODES, POSITION, RADAR3D

_NO_MATRIX = np.zeros((0, 0))
_NO_POSITION = np.zeros(3)


class LinearMeasurement:
    """z = H x + v, v ~ N(0, R), on any components of the state.

    Parameters
    ----------
    matrix : array_like (d, n)
    covariance : array_like (d, d)
    """

    def __init__(self, matrix: Array, covariance: Array) -> None:
        self.matrix = finite(matrix, "matrix", 2)
        self.dim = len(self.matrix)
        self.covariance = checked_covariance(covariance, (1, self.dim, self.dim))[0]

    def measure(self, states: Array) -> Array:
        """Noise-free measurements (m, d) of states (m, n)."""
        return states @ self.matrix.T


class FunctionMeasurement:
    """A user's own measurement model of the whole state.

    Parameters
    ----------
    function : callable states (m, n) -> (m, d)
    covariance : array_like (d, d)
    jacobian : callable states (m, n) -> (m, d, n), optional
        Without it central differences are taken.
    residual : callable (measured, predicted) -> difference, optional
        For angles; without it the plain difference.
    """

    def __init__(
        self,
        function: Callable[[Array], Array],
        covariance: Array,
        *,
        jacobian: Callable[[Array], Array] | None = None,
        residual: Callable[[Array, Array], Array] | None = None,
    ) -> None:
        covariance = finite(covariance, "covariance", 2)
        self.dim = len(covariance)
        self.covariance = checked_covariance(covariance, (1, self.dim, self.dim))[0]
        self._function, self._jacobian, self._residual = function, jacobian, residual

    def measure(self, states: Array) -> Array:
        """Noise-free measurements (m, d) of states (m, n)."""
        result = finite(self._function(states), "the measurement function's result", 2)
        if result.shape != (len(states), self.dim):
            raise InvalidInputError(
                f"the measurement function's result must have shape {(len(states), self.dim)}, got {result.shape}"
            )
        return result

    def jacobian(self, states: Array) -> Array:
        """Derivatives of `measure`, (m, d, n)."""
        if self._jacobian is None:
            return differences(self.measure, states, self.residual)
        slopes = finite(self._jacobian(states), "the measurement function's jacobian", 3)
        wanted = (len(states), self.dim, states.shape[1])
        if slopes.shape != wanted:
            raise InvalidInputError(f"the measurement function's jacobian must have shape {wanted}, got {slopes.shape}")
        return slopes

    def residual(self, measured: Array, predicted: Array) -> Array:
        """Return measured - predicted."""
        if self._residual is None:
            return np.asarray(measured) - predicted
        difference = finite(self._residual(measured, predicted), "the measurement function's residual")
        if difference.shape != np.shape(measured):
            raise InvalidInputError(
                f"the measurement function's residual must have shape {np.shape(measured)}, got {difference.shape}"
            )
        return difference


Measurement = Sensor | LinearMeasurement | FunctionMeasurement


def periods_of(sensor: Measurement) -> tuple[float, ...]:
    """After how much each component of a measurement comes back; 0 where it does not, as in models of users."""
    return sensor.periods if isinstance(sensor, Sensor) else (0.0,) * sensor.dim


class Observation(NamedTuple):
    """A measurement model in the form that the kernels take."""

    code: int
    """That of a sensor (`assoc.sensors.codes`), LINEAR or GIVEN."""
    dim: int
    covariance: Array
    """(1, d, d)."""
    model: FunctionMeasurement
    """The user's model; used only where `code` is GIVEN."""
    packed: Array
    """All that kernels need, in one piece, (1, ...); see `assoc.filters.kernels.gaussian.unpack`."""

    @property
    def folding(self) -> float:
        """Interval at which range rates fold, 0 where they do not; see `assoc.filters.kernels.gaussian.folding_of`."""
        c = int(self.packed[0, 2]) if self.code == RADAR3D else 0
        return float(self.packed[0, 6 + c]) if c and self.packed.shape[1] > 6 + c + self.dim**2 else 0.0

    def given(self, values: Array) -> Array:
        """Packed models, one for each target, with what the user's functions gave for it, (B, rows, columns)."""
        B, rows, columns = values.shape
        empty = pack(GIVEN, PLAIN, _NO_POSITION, np.arange(columns), np.zeros((rows, columns)), self.covariance)
        models = np.repeat(empty, B, axis=0)
        models[:, 6 + columns : -self.covariance.size] = values.reshape(B, rows * columns)
        return models

    def with_noise(self, models: Array, scale: Array) -> Array:
        """Packed models whose covariances are multiplied by the scale of each target, (B,)."""
        scaled = np.repeat(models, len(scale), axis=0) if len(models) == 1 else models.copy()
        scaled[:, -self.covariance.size :] *= scale[:, None]
        return scaled


def pack(code: int, kind: int, position: Array, columns: Array, matrix: Array, covariance: Array) -> Array:
    """Put a measurement model in one piece, (1, ...), integers of `columns` by their bits."""
    bits = columns.astype(np.int64).view(np.float64)
    return np.concatenate(([code, kind, len(columns)], position, bits, matrix, covariance), axis=None)[None]


class _SensorAsFunction(FunctionMeasurement):
    """A sensor of a user's class, which has no compiled model."""

    def __init__(self, sensor: Sensor, position: Array, dim: int) -> None:
        self.dim, self.covariance = sensor.dim, np.array(sensor.covariance)
        self.sensor, self.position, self.states = sensor, position, dim

    def _positions(self, states: Array) -> tuple[Array, ...]:
        """Positions and, if the sensor measures a velocity, velocities, each (m, 3)."""
        if not self.sensor.measures_velocity:
            positions = np.zeros((len(states), 3))
            positions[:, : len(self.position)] = states[:, self.position]
            return (positions,)
        both = np.zeros((len(states), 2, 3))
        axes = len(self.position) // 2
        both[:, :, :axes] = states[:, self.position].reshape(-1, 2, axes)
        return both[:, 0], both[:, 1]

    def measure(self, states: Array) -> Array:
        return finite(self.sensor.measure(*self._positions(states)), "the sensor's measure", 2)

    def jacobian(self, states: Array) -> Array:
        H = np.zeros((len(states), self.dim, self.states))
        slopes = self.sensor.jacobian(*self._positions(states))
        if self.sensor.measures_velocity:
            axes = len(self.position) // 2
            slopes = slopes.reshape(len(states), self.dim, 2, 3)[..., :axes].reshape(len(states), self.dim, -1)
        H[:, :, self.position] = slopes[:, :, : len(self.position)]
        return H

    def residual(self, measured: Array, predicted: Array) -> Array:
        return self.sensor.residual(measured, predicted)


_NO_MODEL: Any = None


def _velocity_columns(motion: Motion) -> Array:
    """Columns of the velocities in a state: after the positions, in their order."""
    position = np.array(motion.position, dtype=np.int64)
    columns = position + len(position)
    if len(position) < 2 or columns.max() >= motion.dim or np.isin(columns, position).any():
        raise InvalidInputError(
            f"sensor measures range rate, but the states of {type(motion).__name__} have no velocity of each coordinate"
        )
    return columns


def observation(measurement: Measurement, motion: Motion, kind: int = PLAIN) -> Observation:
    """Put a measurement model in the form that the kernels take, for states of a motion model."""
    if isinstance(measurement, Sensor):
        refuse_arrival_times([measurement], "a filter")
        columns = np.array(motion.position, dtype=np.int64)
        code = CODES.get(type(measurement))
        if code == POSITION and measurement.dim > len(columns):
            raise InvalidInputError(
                f"sensor measures {measurement.dim} coordinates, the motion model has {len(columns)}"
            )
        if len(columns) not in (2, 3) or len({*columns.tolist()} & {*range(motion.dim)}) < len(columns):
            raise InvalidInputError(
                f"motion: position must be two or three different components of {motion.dim}, got {motion.position}"
            )
        if measurement.measures_velocity:
            columns = np.concatenate([columns, _velocity_columns(motion)])
        if code is not None:
            R = np.ascontiguousarray(measurement.covariance)[None].copy()
            matrix = _NO_MATRIX
            if measurement.measures_velocity and measurement.periods[-1]:
                matrix = np.zeros((1, len(columns)))
                matrix[0, 0] = measurement.periods[-1]
            packed = pack(code, kind, measurement.position, columns, matrix, R)
            return Observation(code, measurement.dim, R, _NO_MODEL, packed)
        measurement = _SensorAsFunction(measurement, columns, motion.dim)
    if isinstance(measurement, LinearMeasurement):
        if measurement.matrix.shape[1] != motion.dim:
            raise InvalidInputError(f"matrix must have {motion.dim} columns, got shape {measurement.matrix.shape}")
        R = measurement.covariance[None]
        # most entries are zeros: only the components that are read take part
        read = np.flatnonzero(measurement.matrix.any(axis=0))
        matrix = np.ascontiguousarray(measurement.matrix[:, read])
        packed = pack(LINEAR, kind, _NO_POSITION, read, matrix, R)
        return Observation(LINEAR, measurement.dim, R, _NO_MODEL, packed)
    if isinstance(measurement, FunctionMeasurement):
        return Observation(GIVEN, measurement.dim, measurement.covariance[None], measurement, _NO_MATRIX)
    raise InvalidInputError(f"sensor must be a sensor or a measurement model, got {type(measurement).__name__}")
