"""Plausibility checks of a scene: other units than metres and radians.

Sound measurements pass each check in every scene: it regards what most of a sensor's measurements, over all scans, have
in common, or what a single one cannot be. Noise, clutter or a wide field of view must not break it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from assoc._types import Array
from assoc.sensors import PositionSensor, Sensor
from assoc.sensors.base import ANGLES

# with fewer measurements of a sensor only impossible values are reported
_ENOUGH = 10
# a measurement is off by less than so many standard deviations
_FAR = 6.0
# nothing is measured at so many times a field of view's far end
_BEYOND = 3.0
# kilometres taken for metres lie within a thousandth of the field of view; that all of so many ranges do is no chance
_SHARE, _SOME = 0.0011, 3
# a share of measurements that neither noise nor the edge of a field of view explains
_MANY = 0.25
# all measurements of a sensor, targets and false alarms, differ by at least their noise: with 10 of them a spread
# below a fifth of it comes once in 100,000 times even if there is a single target that does not move
_WITHIN = 0.2


def implausible(sensors: Sequence[Sensor], measurements: Sequence[Sequence[Array]]) -> tuple[str, ...]:
    """Return one line for each sensor and component whose measurements do not fit the sensor's parameters."""
    found = []
    for s, sensor in enumerate(sensors):
        if not any(len(scan[s]) for scan in measurements):
            continue
        z = np.concatenate([scan[s] for scan in measurements])
        sigma = np.sqrt(np.diagonal(sensor.covariance))
        for axis in range(sensor.dim):
            complaint = _complaint(sensor, axis, z[:, axis], float(sigma[axis]))
            if complaint:
                found.append(f"{sensor.label(s)}: {complaint}")
    return tuple(found)


def _complaint(sensor: Sensor, axis: int, values: Array, sigma: float) -> str:
    name = sensor.components[axis]
    low, high = sensor.field_of_view[axis]
    enough = len(values) >= _ENOUGH
    seen = f"{values.min():.4g} to {values.max():.4g}"
    if name == "azimuth":
        if _is_seen(np.abs(values), 2 * math.pi * (1 + 1e-6), sigma):
            return f"azimuths from {seen} rad: degrees? radians are expected"
        outside = np.mod(values - low, 2 * math.pi) > high - low
    elif name == "elevation" and _is_seen(np.abs(values), math.pi / 2, sigma):
        return f"elevations from {seen} rad, but nothing is seen beyond pi/2: degrees? radians are expected"
    else:
        outside = (values < low) | (values > high)
    share = float(outside.mean())
    plural = name if isinstance(sensor, PositionSensor) else f"{name}s"
    unit = "rad" if name in ANGLES else {"range rate": "m/s", "arrival time": "s"}.get(name, "m")
    if (enough and share > _MANY) or (name == "range" and _is_seen(values, _BEYOND * high, sigma)):
        return (
            f"{100 * share:.0f} % of its {plural} ({seen} {unit}) lie outside of its field of view "
            f"({low:.4g} to {high:.4g} {unit}): another unit?"
        )
    if name == "range" and len(values) >= _SOME and values.max() < _SHARE * high:
        return f"its ranges end at {values.max():.4g} m, its reach is {high:.4g} m: kilometres? metres are expected"
    # a constant, as the height of targets set on the ground, has no unit to doubt
    if enough and 0.0 < float(np.std(values)) < _WITHIN * sigma:
        return (
            f"its {plural} ({seen} {unit}) all lie closer together than their noise ({sigma:.4g} {unit}): another unit?"
        )
    return ""


def _is_seen(values: Array, most: float, sigma: float) -> bool:
    """Whether many values are above `most`, or one by more than noise."""
    return float((values > most).mean()) > _MANY and len(values) >= _ENOUGH or bool(values.max() > most + _FAR * sigma)
