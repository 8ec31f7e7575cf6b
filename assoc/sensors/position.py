"""Sensors that report Cartesian positions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assoc._system.door import doors
from assoc._types import Array
from assoc.sensors.base import Sensor


@doors
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PositionSensor(Sensor):
    """A sensor that reports x, y or x, y, z (m) in the scene's own frame, whatever its place.

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
