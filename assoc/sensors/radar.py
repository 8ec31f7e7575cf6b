"""Radars: range, azimuth and elevation, with or without range rate, or range and azimuth."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.sensors.base import Sensor

# closer than this to the sensor an angle has no useful derivative (metres)
NEAREST = 1e-9


@explains_wrong_types
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Radar3D(Sensor):
    """A radar that measures slant range (m), azimuth and elevation (rad), and on request range rate (m/s).

    Azimuth is counted from +x towards +y, elevation from the horizontal plane up; the range rate is positive
    when the target recedes. See `Sensor` for the parameters; the components of `noise` and `field_of_view` are
    range, azimuth, elevation and, with a fourth, range rate.

    Parameters
    ----------
    folding : float, optional
        Interval of m/s by which range rates are known alone, the unambiguous velocities from end to end: a target at
        rate v is measured at v + k * folding, in [-folding / 2, folding / 2). inf: they do not fold. Not said: trackers
        that adapt take the field of view's width where it is narrower than targets are fast.
    notch : float
        A target whose range rate, as measured, is closer to 0 than this, m/s, is never seen.
    """

    folding: float | None = None
    notch: float = 0.0

    kind = "radar3d"
    components = ("range", "azimuth", "elevation", "range rate")
    # elevation ends at the poles: differences of two elevations need no wrapping
    angular = (False, True, False, False)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, least in (("folding", 0.0), ("notch", -1e-300)):
            value = getattr(self, name)
            if value is None and name == "folding":
                continue
            if isinstance(value, (bool, str)) or np.ndim(value) != 0 or not float(value) > least:
                kind = "above 0" if name == "folding" else "of at least 0"
                raise InvalidInputError(f"{self._label}: {name} must be a number {kind}, m/s, got {value!r}")
            if self.dim < 4 and (name == "folding" or value > 0.0):
                raise InvalidInputError(f"{self._label}: {name} needs a range rate, a fourth component of noise")
            object.__setattr__(self, name, float(value))
        if self.notch >= 0.5 * self.interval:
            raise InvalidInputError(f"{self._label}: notch must be below half of folding, got {self.notch:g}")

    @property
    def interval(self) -> float:
        """`folding`, m/s, infinite where range rates do not fold."""
        return math.inf if self.folding is None else self.folding

    @property
    def periods(self) -> tuple[float, ...]:
        """See `Sensor.periods`; that of folded range rates is their interval."""
        turns = super().periods
        return (*turns[:3], self.folding) if self.folding and math.isfinite(self.folding) else turns

    @classmethod
    def _allowed_dims(cls) -> tuple[int, ...]:
        return (3, 4)

    @property
    def measures_velocity(self) -> bool:
        """Whether it measures range rate."""
        return self.dim == 4

    @cached_property
    def _without_range_rate(self) -> Radar3D:
        view = self.field_of_view[:3]
        apart = None if self.resolution is None else self.resolution[:3]
        noise = self.covariance[:3, :3]
        return replace(self, noise=noise, field_of_view=view, resolution=apart, folding=None, notch=0.0)

    @property
    def position_part(self) -> Sensor:
        """The same radar without range rate."""
        return self._without_range_rate if self.measures_velocity else self

    def measure(self, positions: Array, velocities: Array | None = None) -> Array:
        """Noise-free range, azimuth, elevation (and range rate), shape (n, d); see `Sensor.measure`."""
        d = self._places(positions) - self.position
        ground = np.hypot(d[:, 0], d[:, 1])
        found = [np.hypot(ground, d[:, 2]), np.arctan2(d[:, 1], d[:, 0]), np.arctan2(d[:, 2], ground)]
        if self.measures_velocity:
            found.append((d * self._velocities(velocities)).sum(axis=1) / np.maximum(found[0], NEAREST))
        return np.stack(found, axis=1)

    def sees(self, exact: Array) -> Array:
        """As `Sensor.sees`, but for targets in the notch."""
        inside = super().sees(exact)
        return inside & (np.abs(self.folded(exact)[:, 3]) >= self.notch) if self.notch > 0.0 else inside

    def jacobian(self, positions: Array, velocities: Array | None = None) -> Array:
        """Derivatives by the position, (n, 3, 3), with range rate by the velocity, too, (n, 4, 6)."""
        d = self._places(positions) - self.position
        ground = np.maximum(np.hypot(d[:, 0], d[:, 1]), NEAREST)
        slant = np.hypot(ground, d[:, 2])
        result = np.zeros((len(d), self.dim, 6 if self.measures_velocity else 3))
        result[:, 0, :3] = d / slant[:, None]
        result[:, 1, 0] = -d[:, 1] / ground**2
        result[:, 1, 1] = d[:, 0] / ground**2
        result[:, 2, 0] = -d[:, 0] * d[:, 2] / (ground * slant**2)
        result[:, 2, 1] = -d[:, 1] * d[:, 2] / (ground * slant**2)
        result[:, 2, 2] = ground / slant**2
        if self.measures_velocity:
            v, u = self._velocities(velocities), result[:, 0, :3]
            result[:, 3, :3] = (v - (u * v).sum(axis=1, keepdims=True) * u) / slant[:, None]
            result[:, 3, 3:] = u
        return result

    def aligned(self, measurements: Array, times: Array, *, back: bool = False) -> Array:
        """As `Sensor.aligned`, with range rates relative to the scene's frame."""
        result = super().aligned(measurements, times, back=back)
        if self.platform is None or not self.measures_velocity or not len(result):
            return result
        azimuth, elevation = (measurements if back else result)[:, 1:3].T
        away = np.stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)], axis=1) * np.cos(elevation)[:, None]
        rate = (away * self.platform.of(self.position).velocities(times)).sum(axis=1)
        result[:, 3] += -rate if back else rate
        return self.folded(result)

    def __eq__(self, other: object) -> bool:
        same = super().__eq__(other)
        if same is not True or not isinstance(other, Radar3D):
            return same
        return self.folding == other.folding and self.notch == other.notch

    __hash__ = Sensor.__hash__

    def _velocities(self, velocities: Array | None) -> Array:
        if velocities is None:
            raise InvalidInputError(f"{self._label}: a range rate needs the targets' velocities")
        return np.asarray(velocities, dtype=np.float64)


@explains_wrong_types
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Radar2D(Sensor):
    """A radar that measures slant range (m) and azimuth (rad), and leaves the height open.

    On request it measures heights (m, the target's z), too, as secondary radars do that ask for Mode C. Azimuth is
    counted from +x towards +y. See `Sensor` for the parameters; the components of `noise` and `field_of_view` are
    range, azimuth and, with a third, height.
    """

    kind = "radar2d"
    components = ("range", "azimuth", "height")
    angular = (False, True, False)

    @classmethod
    def _allowed_dims(cls) -> tuple[int, ...]:
        return (2, 3)

    def measure(self, positions: Array, velocities: Array | None = None) -> Array:
        """Noise-free range, azimuth (and height), shape (n, d); see `Sensor.measure`."""
        at = self._places(positions)
        d = at - self.position
        slant = np.hypot(np.hypot(d[:, 0], d[:, 1]), d[:, 2])
        return np.stack([slant, np.arctan2(d[:, 1], d[:, 0]), at[:, 2]][: self.dim], axis=1)

    def jacobian(self, positions: Array, velocities: Array | None = None) -> Array:
        """Derivatives by the position, shape (n, d, 3); see `Sensor.jacobian`."""
        d = self._places(positions) - self.position
        ground = np.maximum(np.hypot(d[:, 0], d[:, 1]), NEAREST)
        result = np.zeros((len(d), self.dim, 3))
        result[:, 2:, 2] = 1.0
        result[:, 0] = d / np.hypot(ground, d[:, 2])[:, None]
        result[:, 1, 0] = -d[:, 1] / ground**2
        result[:, 1, 1] = d[:, 0] / ground**2
        return result
