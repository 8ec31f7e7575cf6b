"""The modified EKF for a radar that measures range, azimuth and, if it can, elevation."""

from __future__ import annotations

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.base import scores
from assoc.filters.kernels.gaussian import MODIFIED, SIMPLIFIED
from assoc.filters.linearised import GaussianFilter
from assoc.filters.measurement import Measurement, Observation
from assoc.filters.motion.models import Motion
from assoc.filters.state import Gaussian, finite
from assoc.sensors.base import Sensor, wrap_angle
from assoc.sensors.codes import RADAR2D, RADAR3D

# of radars, how many quantities they measure
_DIMENSIONS = {RADAR3D: 3, RADAR2D: 2}


class ModifiedEKF(GaussianFilter):
    """The modified EKF of Park and Lee: the residual debiased, its covariance widened by the curvature.

    It linearises the position that a measurement points at instead of the measurement itself. What matters
    is r sigma_azimuth^2 / sigma_range: above about 0.25 an ordinary EKF becomes overconfident. Sensors are `Radar3D`,
    and `Radar2D` without heights, where the terms of the elevation fall away; a missed measurement is a prediction
    without a correction, as with any filter.

    Parameters
    ----------
    motion : Motion
    simplified : bool
        The short form of the paper (equations 2.29 and 2.32): only the range is debiased, at any elevation
        as if it were low, and the prior's share of the covariance is left out.

    References
    ----------
    S.-T. Park and J. G. Lee, Improved Kalman filter design for three-dimensional radar tracking, 2001. The
    full form has the corrected terms: cos^2 and cos^4 of the elevation, azimuth and elevation debiased too,
    and the prior variances of the angles.
    """

    def __init__(self, motion: Motion, simplified: bool = False) -> None:
        super().__init__(motion)
        self.kind = SIMPLIFIED if simplified else MODIFIED

    def _observation(self, sensor: Measurement) -> Observation:
        """What `observe` remembers."""
        o = super()._observation(sensor)
        if o.code not in _DIMENSIONS:
            raise InvalidInputError(
                f"sensor must be a Radar3D or Radar2D for a modified EKF, got {type(sensor).__name__}"
            )
        if o.dim != _DIMENSIONS[o.code]:
            raise InvalidInputError("sensor: a modified EKF takes no range rate or height; use ExtendedKalmanFilter")
        if np.count_nonzero(o.covariance[0] - np.diag(np.diag(o.covariance[0]))):
            raise InvalidInputError("sensor: a modified EKF needs uncorrelated noise")
        return o

    def compare(self, state: Gaussian, measurements: Array, sensor: Measurement) -> tuple[Array, Array]:
        """`log_likelihood` and `distances` of debiased residuals, (B, M) each."""
        o = self.observe(sensor)
        z = finite(measurements, "measurements", 2)
        if z.shape[1] != o.dim:
            raise InvalidInputError(f"measurements must have shape (M, {o.dim}), got {z.shape}")
        h, covariance = self.expected(state, sensor)
        v = z[None] - h[:, None]
        v[..., 1] = wrap_angle(v[..., 1])
        r, t, st = h[:, 0, None], v[..., 1].copy(), o.covariance[0, 1, 1]
        p, sp = (v[..., 2].copy(), o.covariance[0, 2, 2]) if o.dim == 3 else (0.0, 0.0)
        if self.kind == SIMPLIFIED:
            v[..., 0] -= 0.5 * r * (t**2 + p**2 - st - sp)
            return scores(v, covariance)
        # observe has refused all but radars
        assert isinstance(sensor, Sensor)
        ground = np.hypot(*(state.mean[:, self.motion.position[:2]] - sensor.position[:2]).T)
        c2 = (ground[:, None] / r) ** 2
        v[..., 0] -= 0.5 * r * (c2 * (t**2 - st) + p**2 - sp)
        if o.dim == 3:
            e = h[:, 2, None]
            v[..., 1] -= np.tan(e) * t * p
            v[..., 2] += 0.5 * np.sin(e) * np.cos(e) * (t**2 - st)
        return scores(v, covariance)
