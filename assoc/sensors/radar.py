"""Radars: range, azimuth and elevation, or range and azimuth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assoc._types import Array
from assoc.sensors.base import Sensor

# closer than this to the sensor an angle has no useful derivative (metres)
NEAREST = 1e-9


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Radar3D(Sensor):
    """A radar that measures slant range (m), azimuth and elevation (rad).

    Azimuth is counted from +x towards +y, elevation from the horizontal plane up. See `Sensor` for the
    parameters; the components of `noise` and `field_of_view` are range, azimuth, elevation.
    """

    kind = "radar3d"
    components = ("range", "azimuth", "elevation")
    # elevation ends at the poles: differences of two elevations need no wrapping
    angular = (False, True, False)

    def measure(self, positions: Array) -> Array:
        """Noise-free range, azimuth, elevation, shape (n, 3); see `Sensor.measure`."""
        d = np.asarray(positions, dtype=np.float64) - self.position
        ground = np.hypot(d[:, 0], d[:, 1])
        return np.stack(
            [np.hypot(ground, d[:, 2]), np.arctan2(d[:, 1], d[:, 0]), np.arctan2(d[:, 2], ground)], axis=1
        )

    def jacobian(self, positions: Array) -> Array:
        """Derivatives by the position, shape (n, 3, 3); see `Sensor.jacobian`."""
        d = np.asarray(positions, dtype=np.float64) - self.position
        ground = np.maximum(np.hypot(d[:, 0], d[:, 1]), NEAREST)
        slant = np.hypot(ground, d[:, 2])
        result = np.zeros((len(d), 3, 3))
        result[:, 0] = d / slant[:, None]
        result[:, 1, 0] = -d[:, 1] / ground**2
        result[:, 1, 1] = d[:, 0] / ground**2
        result[:, 2, 0] = -d[:, 0] * d[:, 2] / (ground * slant**2)
        result[:, 2, 1] = -d[:, 1] * d[:, 2] / (ground * slant**2)
        result[:, 2, 2] = ground / slant**2
        return result


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Radar2D(Sensor):
    """A radar that measures slant range (m) and azimuth (rad), and leaves the height open.

    Azimuth is counted from +x towards +y. See `Sensor` for the parameters; the components of `noise` and
    `field_of_view` are range, azimuth.
    """

    kind = "radar2d"
    components = ("range", "azimuth")
    angular = (False, True)

    def measure(self, positions: Array) -> Array:
        """Noise-free range, azimuth, shape (n, 2); see `Sensor.measure`."""
        d = np.asarray(positions, dtype=np.float64) - self.position
        slant = np.hypot(np.hypot(d[:, 0], d[:, 1]), d[:, 2])
        return np.stack([slant, np.arctan2(d[:, 1], d[:, 0])], axis=1)

    def jacobian(self, positions: Array) -> Array:
        """Derivatives by the position, shape (n, 2, 3); see `Sensor.jacobian`."""
        d = np.asarray(positions, dtype=np.float64) - self.position
        ground = np.maximum(np.hypot(d[:, 0], d[:, 1]), NEAREST)
        result = np.zeros((len(d), 2, 3))
        result[:, 0] = d / np.hypot(ground, d[:, 2])[:, None]
        result[:, 1, 0] = -d[:, 1] / ground**2
        result[:, 1, 1] = d[:, 0] / ground**2
        return result
