"""Our sensors as Stone Soup's measurement models."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from stonesoup.base import Property
from stonesoup.models.measurement import MeasurementModel
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.measurement.nonlinear import (
    Cartesian2DToBearing,
    CartesianToElevationBearingRange,
    NonLinearGaussianMeasurement,
)
from stonesoup.types.angle import Bearing
from stonesoup.types.array import StateVector, StateVectors

from assoc.errors import InvalidInputError
from assoc.sensors import BearingSensor, PositionSensor, Radar2D, Radar3D, Sensor


class CartesianToSlantRangeBearing(NonLinearGaussianMeasurement):  # type: ignore[misc]
    """Bearing and slant range of a target in space, as measured by a radar without elevation.

    Stone Soup's own ``CartesianToBearingRange`` takes the range on the ground. ``mapping`` names the state's
    x, y and z; a measurement is (bearing, range).
    """

    translation_offset: StateVector = Property(
        default_factory=lambda: StateVector([[0.0], [0.0], [0.0]]), doc="Place of the sensor: x, y, z."
    )

    @property
    def ndim_meas(self) -> int:
        """Two: bearing and range."""
        return 2

    def function(self, state: Any, noise: Any = False, **kwargs: Any) -> Any:
        """Bearing and range of a state, with the model's noise if asked for."""
        if isinstance(noise, bool) or noise is None:
            noise = self.rvs(num_samples=state.state_vector.shape[1], **kwargs) if noise else 0
        points = np.asarray(state.state_vector[list(self.mapping), :], dtype=np.float64)
        d = self.rotation_matrix @ (points - np.asarray(self.translation_offset, dtype=np.float64))
        slant = np.sqrt((d**2).sum(axis=0))
        return np.array([[Bearing(0.0)], [0.0]]) + StateVectors([np.arctan2(d[1], d[0]), slant]) + noise


def measurement_model(sensor: Sensor, ndim_state: int = 6, mapping: Sequence[int] = (0, 2, 4)) -> MeasurementModel:
    """Return the Stone Soup measurement model of a sensor.

    Parameters
    ----------
    sensor : Sensor
    ndim_state : int, default 6
        Number of state dimensions; the default is that of a constant-velocity model in space.
    mapping : sequence of int, default (0, 2, 4)
        Indices of x, y and z in the state.

    Returns
    -------
    stonesoup.models.measurement.MeasurementModel
        Its components are in Stone Soup's order: elevation, bearing, range.

    Raises
    ------
    InvalidInputError
        The sensor is of a user-defined kind.
    """
    common = {"ndim_state": ndim_state, "noise_covar": sensor.covariance}
    offset = StateVector(sensor.position)
    if isinstance(sensor, PositionSensor):
        return LinearGaussian(mapping=tuple(mapping[: sensor.dim]), **common)
    if type(sensor) is BearingSensor:
        return Cartesian2DToBearing(mapping=tuple(mapping[:2]), translation_offset=offset[:2], **common)
    common.update(mapping=tuple(mapping), translation_offset=offset, noise_covar=sensor.covariance[::-1, ::-1])
    if isinstance(sensor, Radar3D):
        if sensor.measures_velocity:
            raise InvalidInputError("Radar3D: range rate is not handed to Stone Soup; leave the fourth component out")
        return CartesianToElevationBearingRange(**common)
    if isinstance(sensor, Radar2D):
        if sensor.dim == 3:
            raise InvalidInputError("Radar2D: heights are not handed to Stone Soup; leave the third component out")
        return CartesianToSlantRangeBearing(**common)
    raise InvalidInputError(f"{type(sensor).__name__}: Stone Soup has no measurement model for this kind of sensor")
