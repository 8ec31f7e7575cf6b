"""Kalman's filter and the extended Kalman filter."""

from __future__ import annotations

from assoc.errors import InvalidInputError
from assoc.filters.kernels.gaussian import LINEAR
from assoc.filters.linearised import GaussianFilter
from assoc.filters.measurement import Measurement, Observation
from assoc.filters.motion.models import Motion
from assoc.sensors.codes import POSITION


class KalmanFilter(GaussianFilter):
    """Kalman's filter: linear motion, linear measurements (position sensors, or a matrix).

    Parameters
    ----------
    motion : Motion
        A linear one.

    Raises
    ------
    InvalidInputError
        The motion, or later a sensor, is not linear.
    """

    def __init__(self, motion: Motion) -> None:
        if not motion.linear:
            raise InvalidInputError(
                f"motion must be linear for a Kalman filter, got {type(motion).__name__}; use ExtendedKalmanFilter"
            )
        super().__init__(motion)

    def _observation(self, sensor: Measurement) -> Observation:
        """What `observe` remembers."""
        o = super()._observation(sensor)
        if o.code not in (LINEAR, POSITION):
            raise InvalidInputError(
                f"sensor must be linear for a Kalman filter, got {type(sensor).__name__}; use ExtendedKalmanFilter"
            )
        return o


class ExtendedKalmanFilter(GaussianFilter):
    """The extended Kalman filter: models linearised at the mean."""
