"""The base of all sensors: position, noise, detection probability, false alarms and field of view."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError, warn
from assoc.sensors.arrays import finite_array, numbers
from assoc.sensors.platform import Platform

ANGLES = ("azimuth", "elevation")
"""Components that are angles, in radians; others are in metres, but range rates in m/s and arrival times in s."""

LARGEST_ANGLE_NOISE = 0.3
"""Standard deviation of an angle (rad, 17 degrees) from which a warning suggests degrees."""


def wrap_angle(angle: Array) -> Array:
    """Angles brought into (-pi, pi]."""
    return math.pi - np.mod(math.pi - angle, 2 * math.pi)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Sensor(ABC):
    """A sensor that measures the positions of targets, misses some and reports false alarms.

    Parameters
    ----------
    position : array_like (3,)
        Metres.
    noise : array_like (d,) or (d, d)
        Standard deviations, or the covariance matrix, of one measurement.
    detection_probability : float
        P_d, strictly between 0 and 1.
    false_alarm_rate : float
        Mean number of false alarms per scan (Poisson), above 0.
    field_of_view : array_like (d, 2)
        Lower and upper bound of each component of a measurement.
    name : str
        For people.
    platform : Platform, optional
        What carries the sensor. Its position is then that on the carrier, forward, left and up, and measurements and
        the field of view are relative to the carrier's position and heading; see `at`.
    resolution : array_like (d,), optional
        Two targets give two measurements where they differ by at least this in some component; closer in all of them,
        one. inf: the component parts no targets; 0: any difference does. Not said: none in simulations, and trackers
        that adapt learn it.

    Raises
    ------
    InvalidInputError
        Any of these is not as described.

    Warns
    -----
    AssocWarning
        The noise of an angle, or the field of view of an elevation, is hardly one in radians.
    """

    position: Array
    noise: Array
    detection_probability: float = 0.9
    false_alarm_rate: float = 1.0
    field_of_view: Array = None  # type: ignore[assignment]  # only sensors with a natural default leave it out
    name: str = ""
    platform: Platform | None = None
    resolution: Array | None = None

    kind: ClassVar[str]
    components: ClassVar[tuple[str, ...]]
    angular: ClassVar[tuple[bool, ...]]

    def __post_init__(self) -> None:
        label = self._label
        if not isinstance(self.name, str):
            raise InvalidInputError(f"{type(self).__name__}: name must be text, got {type(self.name).__name__}")
        put = object.__setattr__
        put(self, "position", finite_array(self.position, f"{label}: position", (3,)))
        put(self, "noise", self._checked_noise())
        for field in ("detection_probability", "false_alarm_rate"):
            value = getattr(self, field)
            if isinstance(value, (bool, str)) or np.ndim(value) != 0:
                raise InvalidInputError(f"{label}: {field} must be one number, got {value!r}")
            put(self, field, float(value))
        if not 0.0 < self.detection_probability < 1.0:
            raise InvalidInputError(
                f"{label}: detection_probability must be strictly between 0 and 1, got {self.detection_probability}"
            )
        if not 0.0 < self.false_alarm_rate < math.inf:
            raise InvalidInputError(f"{label}: false_alarm_rate must be above 0 per scan, got {self.false_alarm_rate}")
        view: object = self.field_of_view
        if view is None:
            put(self, "field_of_view", self._default_field_of_view())
        put(self, "field_of_view", finite_array(self.field_of_view, f"{label}: field_of_view", (self.dim, 2)))
        for component, angular, (low, high) in zip(self.components, self.angular, self.field_of_view, strict=False):
            if not low < high:
                raise InvalidInputError(
                    f"{label}: field_of_view of {component} must have lower < upper, got {low:g}, {high:g}"
                )
            if angular and high - low > 2 * math.pi * (1 + 1e-9):
                raise InvalidInputError(
                    f"{label}: field_of_view of {component} spans {high - low:g} rad, more than a full circle"
                )
        if self.platform is not None:
            if not isinstance(self.platform, Platform):
                raise InvalidInputError(f"{label}: platform must be a Platform, got {type(self.platform).__name__}")
        if self.resolution is not None:
            put(self, "resolution", self._checked_resolution())
        for line in self.warnings:
            warn(line)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Probable mistakes in these values, one line each."""
        found = []
        for axis in range(self.dim):
            name, (low, high) = self.components[axis], self.field_of_view[axis]
            sigma = float(np.sqrt(self.covariance[axis, axis]))
            if name in ANGLES and sigma > LARGEST_ANGLE_NOISE:
                found.append(f"{self._label}: noise of {name} is {sigma:.4g} rad: degrees? radians are expected")
            if name == "elevation" and max(-low, high) > 1.1 * math.pi / 2:
                found.append(
                    f"{self._label}: field_of_view of elevation is {low:.4g} to {high:.4g} rad, but nothing is seen "
                    "beyond pi/2: degrees? radians are expected"
                )
        if self.platform is not None and self.platform.warning:
            found.append(f"{self._label}: {self.platform.warning}")
        return tuple(found)

    def label(self, number: int) -> str:
        """Name of the sensor in messages: its kind and name, or its number."""
        return self._label if self.name else f"{self._label} (sensor {number})"

    def _checked_noise(self) -> Array:
        label = self._label
        noise = finite_array(np.atleast_1d(np.asarray(self.noise)), f"{label}: noise")
        dims = self._allowed_dims()
        if noise.ndim > 2 or noise.shape[0] not in dims or noise.shape[-1] != noise.shape[0]:
            wanted = " or ".join(f"({d},) or ({d}, {d})" for d in dims)
            raise InvalidInputError(f"{label}: noise must have shape {wanted}, got {noise.shape}")
        if noise.ndim == 1:
            if not (noise > 0).all():
                raise InvalidInputError(f"{label}: noise must be positive standard deviations, got {noise.min():g}")
            variances = noise**2
        else:
            # rounding counts by the sizes of the two components: a rotated covariance may have +-1e-16 for 0
            size = np.sqrt(np.abs(np.diagonal(noise)))
            if not (np.abs(noise - noise.T) <= 1e-9 * np.outer(size, size)).all():
                raise InvalidInputError(f"{label}: noise must be a symmetric covariance matrix")
            variances = np.linalg.eigvalsh(noise)
            if not variances.min() > 0:
                raise InvalidInputError(f"{label}: noise must be a positive definite covariance matrix")
        if np.sqrt(variances.min()) < 1e-12:
            raise InvalidInputError(f"{label}: noise below 1e-12 is too small to compute with")
        return noise

    @property
    def _said(self) -> list[float] | None:
        return None if self.resolution is None else self.resolution.tolist()

    def _checked_resolution(self) -> Array:
        found = numbers(self.resolution, f"{self._label}: resolution")
        if found.shape != (self.dim,) or not (found >= 0.0).all():
            raise InvalidInputError(
                f"{self._label}: resolution must be {self.dim} numbers of at least 0, one for each of "
                f"{', '.join(self.components[: self.dim])}, got {found.tolist()}"
            )
        found.setflags(write=False)
        return found

    @classmethod
    def _allowed_dims(cls) -> tuple[int, ...]:
        return (len(cls.components),)

    def _default_field_of_view(self) -> Array:
        raise InvalidInputError(f"{self._label}: field_of_view is missing, expected ({self.dim}, 2) bounds")

    @property
    def _label(self) -> str:
        name = f" {self.name!r}" if isinstance(self.name, str) and self.name else ""
        return f"{type(self).__name__}{name}"

    @property
    def dim(self) -> int:
        """Number of components of a measurement, d."""
        return int(self.noise.shape[0])

    @cached_property
    def covariance(self) -> Array:
        """Measurement covariance R, shape (d, d)."""
        full = np.diag(self.noise**2) if self.noise.ndim == 1 else np.array(self.noise)
        full.setflags(write=False)
        return full

    @property
    def volume(self) -> float:
        """Volume V of the field of view in measurement space (m, rad and their products)."""
        return float(np.prod(self.field_of_view[:, 1] - self.field_of_view[:, 0]))

    @cached_property
    def limits(self) -> tuple[tuple[int, float, float], ...]:
        """Components that the field of view limits, with their bounds; ends that exclude nothing are infinite."""
        found = []
        for axis, (low, high) in enumerate(self.field_of_view.tolist()):
            name = self.components[axis]
            if self.angular[axis] and high - low >= 2.0 * math.pi * (1.0 - 1e-9):
                continue
            if name == "range" and low <= 0.0 or name == "elevation" and low <= -math.pi / 2:
                low = -math.inf
            if name == "elevation" and high >= math.pi / 2:
                high = math.inf
            if math.isfinite(low) or math.isfinite(high):
                found.append((axis, low, high))
        return tuple(found)

    @property
    def periods(self) -> tuple[float, ...]:
        """After how much each component of a measurement comes back, (d,): angles after a turn; 0 where none does."""
        return tuple(2 * math.pi if turns else 0.0 for turns in self.angular[: self.dim])

    @property
    def measures_velocity(self) -> bool:
        """Whether measurements depend on the target's velocity: `measure` then needs velocities."""
        return False

    @property
    def position_part(self) -> Sensor:
        """The same sensor without the components that depend on a velocity."""
        return self

    def at(self, time: float) -> Sensor:
        """The sensor as it stands at a time (seconds) in the scene's frame: itself if no platform carries it.

        Raises
        ------
        InvalidInputError
            The time is outside of the platform's times.
        """
        if self.platform is None:
            return self
        (position,) = self.platform.places(np.array([time]), self.position)
        return self._by_pose(position, float(self.platform.poses(np.array([time]))[1][0]))

    def _by_pose(self, position: Array, heading: float) -> Sensor:
        """The sensor at a position (3,) of the frame, turned by a heading, radians."""
        view = np.array(self.field_of_view)
        view[[axis for axis in range(self.dim) if self.components[axis] == "azimuth"]] += heading
        return replace(self, platform=None, position=position, field_of_view=view)

    def aligned(self, measurements: Array, times: Array, *, back: bool = False) -> Array:
        """Measurements (n, d) made at times (n,) as the sensors `at` these times make them; `back`: the other way."""
        if self.platform is None or not len(measurements):
            return measurements
        result, headings = np.array(measurements), self.platform.poses(times)[1]
        for axis in range(self.dim):
            if self.components[axis] == "azimuth" and self.platform.headings is not None:
                result[:, axis] = wrap_angle(result[:, axis] + (-headings if back else headings))
        return result

    @abstractmethod
    def measure(self, positions: Array, velocities: Array | None = None) -> Array:
        """Noise-free measurements of targets.

        Parameters
        ----------
        positions : ndarray (n, 3)
            Metres.
        velocities : ndarray (n, 3), optional
            m/s; only sensors that measure a velocity need them.

        Returns
        -------
        ndarray (n, d)
        """

    def jacobian(self, positions: Array, velocities: Array | None = None) -> Array:
        """Derivatives of `measure` by the position, shape (n, d, 3).

        Of a sensor that measures a velocity, by position and velocity, shape (n, d, 6). At the
        sensor itself, where angles have no derivative, the distance is taken as 1e-9 m. Of a class that says none they
        are central differences.
        """
        points, slopes = self._places(positions), []
        x = points if not self.measures_velocity else np.hstack([points, np.asarray(velocities, dtype=np.float64)])
        for axis in range(x.shape[1]):
            step = np.zeros(x.shape)
            step[:, axis] = np.maximum(1e-6 * np.abs(points - self.position).max(axis=1), 1e-4)
            ends = [self.measure(*np.split(x + sign * step, x.shape[1] // 3, axis=1)) for sign in (1, -1)]
            slopes.append(self.residual(*ends) / (2.0 * step[:, axis, None]))
        return np.stack(slopes, axis=2)

    def residual(self, measured: Array, predicted: Array) -> Array:
        """Return measured - predicted, shape (n, d), angles wrapped into (-pi, pi], folded range rates likewise."""
        difference = self._components(measured, "measured") - self._components(predicted, "predicted")
        for axis in range(self.dim):
            if self.angular[axis]:
                difference[..., axis] = wrap_angle(difference[..., axis])
        return self.folded(difference)

    def folded(self, measurements: Array) -> Array:
        """Measurements (n, d) with components that come back, angles apart, within half a period of 0."""
        z = measurements
        for axis, period in enumerate(self.periods):
            if period and not self.angular[axis]:
                z = np.array(z)
                z[..., axis] = np.mod(z[..., axis] + 0.5 * period, period) - 0.5 * period
        return z

    def sees(self, exact: Array) -> Array:
        """Whether targets whose noise-free measurements are these (n, d) can be seen, bool (n,)."""
        return self.in_view(self.folded(exact))

    def in_view(self, measurements: Array) -> Array:
        """Whether measurements (n, d) lie in the field of view; azimuth intervals may pass through pi."""
        z = self._components(measurements, "measurements")
        low, high = self.field_of_view[:, 0], self.field_of_view[:, 1]
        inside = np.ones(z.shape[:-1], dtype=np.bool_)
        for axis in range(self.dim):
            if self.angular[axis]:
                inside &= np.mod(z[..., axis] - low[axis], 2 * math.pi) <= high[axis] - low[axis]
            else:
                inside &= (z[..., axis] >= low[axis]) & (z[..., axis] <= high[axis])
        return inside

    def _places(self, positions: Array) -> Array:
        points = np.asarray(positions, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise InvalidInputError(f"{self._label}: positions must have shape (n, 3), got {points.shape}")
        return points

    def _components(self, measurements: Array, what: str) -> Array:
        z = np.asarray(measurements, dtype=np.float64)
        if z.shape[-1:] != (self.dim,):
            raise InvalidInputError(f"{self._label}: {what} must have shape (n, {self.dim}), got {z.shape}")
        return z

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return (
            self.name == other.name
            and self.detection_probability == other.detection_probability
            and self.false_alarm_rate == other.false_alarm_rate
            and np.array_equal(self.position, other.position)
            and np.array_equal(self.covariance, other.covariance)
            and np.array_equal(self.field_of_view, other.field_of_view)
            and self.platform == other.platform
            and self._said == other._said
        )

    def __hash__(self) -> int:
        # 0 and -0 are equal
        return hash((type(self), self.name, self.detection_probability, (self.position + 0.0).tobytes()))

    def __repr__(self) -> str:
        position = ", ".join(f"{x:g}" for x in self.position)
        return (
            f"{self._label}(({position}) m, P_d {self.detection_probability:g}, "
            f"{self.false_alarm_rate:g} false alarms per scan)"
        )
