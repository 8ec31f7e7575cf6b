"""Checks of measurements' own times, and of the sectors that sensors covered in a scan."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from assoc._text.times import moment
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.sensors.arrays import finite_array

FULL_TURN = 2.0 * math.pi
# an antenna that takes exactly a scan for a turn may come out a rounding error above it
_SLACK = 1e-9


def checked_times(times: object, measurements: Sequence[Array], end: float, where: str) -> tuple[Array, ...]:
    """Times of a scan's measurements, read-only arrays (n_s,), finite, and none of them after the time of the scan.

    `where` is the beginning of messages.
    """
    count = len(measurements)
    known = isinstance(times, (list, tuple)) or (isinstance(times, np.ndarray) and times.ndim > 0)
    if not known or len(times) != count:  # type: ignore[arg-type]
        raise InvalidInputError(f"{where} must be one array for each of {count} sensors")
    result = []
    for s, (stamps, z) in enumerate(zip(times, measurements, strict=True)):  # type: ignore[call-overload]
        what = f"{where} of sensor {s}"
        array = finite_array(np.zeros(0) if np.size(stamps) == 0 else stamps, what, (len(z),))
        if len(array) and array.max() > end:
            late = moment(array.max())
            raise InvalidInputError(f"{what} must not be after the scan's time, {moment(end)}, got {late}")
        result.append(array)
    return tuple(result)


def checked_sectors(sectors: object, sensors: int, where: str) -> Array:
    """The sectors that sensors covered in a scan, read-only (S, 2), finite, and none wider than a turn."""
    array = finite_array(sectors, where, (sensors, 2))
    width = array[:, 1] - array[:, 0]
    wrong = (width < 0) | (width > FULL_TURN * (1 + _SLACK))
    if wrong.any():
        s = int(np.argmax(wrong))
        raise InvalidInputError(
            f"{where}: that of sensor {s} must be from an azimuth to one 0 to 2 pi above it, got "
            f"{array[s, 0]:g} to {array[s, 1]:g} rad"
        )
    return array


def looked_at(sector: Array, azimuths: Array) -> Array:
    """Which azimuths (n,), rad, lie in a sector (2,); none if it has no width."""
    width = sector[1] - sector[0]
    if width >= FULL_TURN * (1 - _SLACK):
        return np.ones(len(azimuths), dtype=np.bool_)
    return np.asarray((np.mod(azimuths - sector[0], FULL_TURN) <= width) & (width > 0.0))
