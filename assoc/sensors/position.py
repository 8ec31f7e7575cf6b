"""Sensors that report Cartesian positions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.sensors.base import Sensor
from assoc.sensors.platform import turned


@explains_wrong_types
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PositionSensor(Sensor):
    """A sensor that reports x, y or x, y, z (m) in the scene's own frame, whatever its place.

    On a platform they are relative to the sensor: forward and left, or along x and y if the platform has no headings.
    See `Sensor` for the parameters; two or three components of `noise` make it two- or three-dimensional.
    """

    kind = "position"
    components = ("x", "y", "z")
    angular = (False, False, False)

    @classmethod
    def _allowed_dims(cls) -> tuple[int, ...]:
        return (2, 3)

    def measure(self, positions: Array, velocities: Array | None = None) -> Array:
        """Noise-free positions, shape (n, d); see `Sensor.measure`."""
        return np.array(self._places(positions)[:, : self.dim])

    def jacobian(self, positions: Array, velocities: Array | None = None) -> Array:
        """Derivatives by the position, shape (n, d, 3): ones on the diagonal."""
        return np.broadcast_to(np.eye(3)[: self.dim], (len(self._places(positions)), self.dim, 3)).copy()

    def _by_pose(self, position: Array, heading: float) -> Sensor:
        view, d = self.field_of_view, self.dim
        corners = np.stack(np.meshgrid(*view), axis=-1).reshape(-1, d)
        spots = turned(corners, np.full(len(corners), heading)) + position[:d]
        around = np.stack([spots.min(axis=0), spots.max(axis=0)], axis=1)
        turn = turned(np.eye(d), np.full(d, heading)).T
        # the box around is larger: as many false alarms for the volume as before
        rate = self.false_alarm_rate * float(np.prod(np.diff(around)) / self.volume)
        noise = turn @ self.covariance @ turn.T
        return replace(
            self, platform=None, position=position, noise=0.5 * (noise + noise.T), field_of_view=around,
            false_alarm_rate=rate,
        )  # fmt: skip

    def aligned(self, measurements: Array, times: Array, *, back: bool = False) -> Array:
        """Positions (n, d) in the scene's frame; see `Sensor.aligned`."""
        if self.platform is None or not len(measurements):
            return measurements
        position, headings = self.platform.places(times, self.position)[:, : self.dim], self.platform.poses(times)[1]
        return turned(measurements - position, -headings) if back else turned(measurements, headings) + position
