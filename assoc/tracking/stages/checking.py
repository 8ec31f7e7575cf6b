"""Checks of a tracker's input."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from assoc._parameters import is_number
from assoc._text.times import moment
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.sensors import Sensor
from assoc.sensors.arrays import finite_array
from assoc.sensors.base import ANGLES

# noise may carry a range this many standard deviations below 0
_NOISE = 10.0
# metres, radians, m/s: larger values are no measurements, and later sums would lose all digits
_LENGTH, _ANGLE, _SPEED = 1e9, 1e3, 3e8


def checked_time(time: object, last: float | None) -> float:
    """The time as a float, checked to be finite and not before the last scan's."""
    if not is_number(time):
        raise InvalidInputError(f"time must be a finite number of seconds, got {time!r}")
    when = float(time)  # type: ignore[arg-type]
    if last is not None and when < last:
        raise InvalidInputError(f"time must not run backwards: got {moment(when)} after {moment(last)}")
    return when


def checked_measurements(measurements: Sequence[Any], sensors: Sequence[Sensor]) -> list[Array]:
    """Measurements as float64 arrays (n_s, d_s), checked against what their sensors can measure.

    Messages name the sensor and the measurement, and say what was expected.
    """
    known = isinstance(measurements, (list, tuple)) or (isinstance(measurements, np.ndarray) and measurements.ndim > 0)
    if not known:
        raise InvalidInputError(
            f"measurements must be one array for each of {len(sensors)} sensors, got {type(measurements).__name__}"
        )
    if len(measurements) != len(sensors):
        raise InvalidInputError(
            f"measurements of {len(measurements)} sensors, expected {len(sensors)} (one array for each)"
        )
    return [checked(z, s, sensor) for s, (z, sensor) in enumerate(zip(measurements, sensors, strict=True))]


def checked(z: Array, s: int, sensor: Sensor) -> Array:
    """Measurements (n, d) of sensor number s; see `checked_measurements`."""
    what = f"measurements of sensor {s}"
    if z is None:
        raise InvalidInputError(f"{what} must be an array of shape (n, {sensor.dim}), got None; n may be 0")
    try:
        empty, count = np.size(z) == 0, len(z) if np.ndim(z) else 0
    except ValueError:
        expected = f"{what} must be an array of shape (n, {sensor.dim})"
        raise InvalidInputError(f"{expected}, got rows of several lengths") from None
    array = finite_array(np.zeros((0, sensor.dim)) if empty else z, what, (0 if empty else count, sensor.dim))
    for axis in range(sensor.dim):
        low, high, expected = _limits(sensor, axis)
        wrong = (array[:, axis] < low) | (array[:, axis] > high)
        if wrong.any():
            row = int(np.argmax(wrong))
            name, value = sensor.components[axis], array[row, axis]
            raise InvalidInputError(f"measurement {row} of sensor {s}: {name} must be {expected}, got {value:g}")
    return array


def _limits(sensor: Sensor, axis: int) -> tuple[float, float, str]:
    """Smallest and largest value of a component, and their description for messages."""
    name = sensor.components[axis] if axis < len(sensor.components) else ""
    if name in ANGLES:
        return -_ANGLE, _ANGLE, f"radians within +-{_ANGLE:g}"
    if name == "range rate":
        return -_SPEED, _SPEED, f"m/s within +-{_SPEED:g}"
    if name == "range":
        low = -_NOISE * float(np.sqrt(sensor.covariance[axis, axis]))
        return low, _LENGTH, f"metres from 0 (less its noise: {low:g}) to {_LENGTH:g}"
    return -_LENGTH, _LENGTH, f"metres within +-{_LENGTH:g}"
