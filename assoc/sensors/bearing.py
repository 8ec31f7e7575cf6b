"""Sensors that measure only a direction in the horizontal plane."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from assoc._system.door import doors
from assoc._types import Array
from assoc.sensors.base import Sensor
from assoc.sensors.radar import NEAREST


@doors
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class BearingSensor(Sensor):
    """A sensor that measures azimuth (rad) from +x towards +y, and neither range nor height.

    See `Sensor` for the parameters; `field_of_view` defaults to the full circle.
    """

    kind = "bearing"
    components = ("azimuth",)
    angular = (True,)

    def _default_field_of_view(self) -> Array:
        return np.array([[-math.pi, math.pi]])

    def measure(self, positions: Array, velocities: Array | None = None) -> Array:
        """Noise-free azimuth, shape (n, 1); see `Sensor.measure`."""
        d = self._places(positions) - self.position
        return np.arctan2(d[:, 1], d[:, 0])[:, None]

    def jacobian(self, positions: Array, velocities: Array | None = None) -> Array:
        """Derivatives by the position, shape (n, 1, 3); see `Sensor.jacobian`."""
        d = self._places(positions) - self.position
        square = np.maximum(np.hypot(d[:, 0], d[:, 1]), NEAREST) ** 2
        result = np.zeros((len(d), 1, 3))
        result[:, 0, 0] = -d[:, 1] / square
        result[:, 0, 1] = d[:, 0] / square
        return result
