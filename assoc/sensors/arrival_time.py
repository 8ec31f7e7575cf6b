"""Receivers of waves that targets emit: arrival times of which the time of emission is not known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.sensors.base import Sensor
from assoc.sensors.radar import NEAREST


@explains_wrong_types
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ArrivalTimeSensor(Sensor):
    """A receiver that measures when a wave arrives (s): a station of multilateration, a seismometer, a microphone.

    When it was emitted is not known, and the same for all receivers. Arrival times are seconds since any instant that
    the sensors of a scan share, as the scan's time. See `Sensor` for the parameters; `noise` and `field_of_view`, the
    earliest and latest arrival in a scan, are seconds. Receivers are alone in a scene: their times are compared with
    each other. Two phases of one wave, as P and S of an earthquake, are two sensors at one place.

    Parameters
    ----------
    wave_speed : float
        Required, m/s: 299,792,458 for radio, 343 for sound in air.
    """

    wave_speed: float = 0.0

    kind: ClassVar[str] = "arrival time"
    components: ClassVar[tuple[str, ...]] = ("arrival time",)
    angular: ClassVar[tuple[bool, ...]] = (False,)

    def __post_init__(self) -> None:
        super().__post_init__()
        value = self.wave_speed
        if isinstance(value, (bool, str)) or np.ndim(value) != 0 or not 0.0 < float(value) < 1e12:
            raise InvalidInputError(f"{self._label}: wave_speed must be a number above 0, m/s, got {value!r}")
        object.__setattr__(self, "wave_speed", float(value))

    def measure(self, positions: Array, velocities: Array | None = None) -> Array:
        """Noise-free arrival times of waves emitted at time 0, shape (n, 1); see `Sensor.measure`."""
        away = np.linalg.norm(self._places(positions) - self.position, axis=1)
        return away[:, None] / self.wave_speed

    def jacobian(self, positions: Array, velocities: Array | None = None) -> Array:
        """Derivatives by the position, shape (n, 1, 3), s/m; see `Sensor.jacobian`."""
        d = self._places(positions) - self.position
        away = np.maximum(np.linalg.norm(d, axis=1), NEAREST)
        return np.asarray(d / (away * self.wave_speed)[:, None])[:, None]

    def __eq__(self, other: object) -> bool:
        same = super().__eq__(other)
        if same is not True or not isinstance(other, ArrivalTimeSensor):
            return same
        return self.wave_speed == other.wave_speed

    __hash__ = Sensor.__hash__


def refuse_arrival_times(sensors: Sequence[Sensor], what: str) -> None:
    """Refuse receivers where a measurement must say something of the position by itself."""
    for sensor in sensors:
        if isinstance(sensor, ArrivalTimeSensor):
            raise InvalidInputError(
                f"{sensor._label}: {what} cannot take arrival times, whose time of emission is not known; "
                "assoc.associate finds positions from them, scan by scan"
            )
