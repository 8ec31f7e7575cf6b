"""Sensors that measure only a direction: in the horizontal plane, or in space."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.sensors.base import Sensor
from assoc.sensors.radar import NEAREST


@explains_wrong_types
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class BearingSensor(Sensor):
    """A sensor that measures azimuth (rad) from +x towards +y, and neither range nor height.

    See `Sensor` for the parameters; `field_of_view` defaults to the full circle.
    """

    kind = "bearing"
    components: ClassVar[tuple[str, ...]] = ("azimuth",)
    angular: ClassVar[tuple[bool, ...]] = (True,)

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


@explains_wrong_types
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class DirectionSensor(BearingSensor):
    """A sensor that measures azimuth and elevation (rad), and no range: a camera, or passive tracking.

    Azimuth is counted from +x towards +y, elevation from the horizontal plane up. See `Sensor` for the parameters;
    `field_of_view` defaults to all directions.
    """

    kind = "direction"
    components: ClassVar[tuple[str, ...]] = ("azimuth", "elevation")
    # elevation ends at the poles: differences of two elevations need no wrapping
    angular: ClassVar[tuple[bool, ...]] = (True, False)

    def _default_field_of_view(self) -> Array:
        return np.array([[-math.pi, math.pi], [-math.pi / 2, math.pi / 2]])

    def measure(self, positions: Array, velocities: Array | None = None) -> Array:
        """Noise-free azimuth and elevation, shape (n, 2); see `Sensor.measure`."""
        d = self._places(positions) - self.position
        return np.stack([np.arctan2(d[:, 1], d[:, 0]), np.arctan2(d[:, 2], np.hypot(d[:, 0], d[:, 1]))], axis=1)

    def jacobian(self, positions: Array, velocities: Array | None = None) -> Array:
        """Derivatives by the position, shape (n, 2, 3); see `Sensor.jacobian`."""
        d = self._places(positions) - self.position
        ground = np.maximum(np.hypot(d[:, 0], d[:, 1]), NEAREST)
        square = ground**2 + d[:, 2] ** 2
        up = np.stack([-d[:, 0] * d[:, 2] / (ground * square), -d[:, 1] * d[:, 2] / (ground * square), ground / square])
        return np.concatenate([super().jacobian(positions), up.T[:, None]], axis=1)
