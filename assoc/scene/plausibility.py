"""Plausibility checks of a scene: other units than metres and radians.

Sound measurements pass each check in every scene: it regards what most of a sensor's measurements, over all scans, have
in common. Noise, clutter or a wide field of view must not break it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from assoc._types import Array
from assoc.sensors import PositionSensor, Sensor
from assoc.sensors.base import ANGLES

# with fewer measurements of a sensor nothing is checked
_ENOUGH = 10
# a share of measurements that neither noise nor the edge of a field of view explains
_MANY = 0.25
# all measurements of a sensor, targets and false alarms, differ by at least their noise: with 10 of them a spread
# below a fifth of it comes once in 100,000 times even if there is a single target that does not move
_WITHIN = 0.2


def implausible(sensors: Sequence[Sensor], measurements: Sequence[Sequence[Array]]) -> tuple[str, ...]:
    """Return one line for each sensor and component whose measurements do not fit the sensor's parameters.

    Parameters
    ----------
    sensors : sequence of Sensor
    measurements : sequence over scans of sequences over sensors of arrays (n, d_s)
    """
    found = []
    for s, sensor in enumerate(sensors):
        if sum(len(scan[s]) for scan in measurements) < _ENOUGH:
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
    seen = f"{values.min():.4g} to {values.max():.4g}"
    if name == "azimuth":
        share = float((np.abs(values) > 2 * math.pi * (1 + 1e-6)).mean())
        if share > _MANY:
            return f"azimuths from {seen} rad: degrees? radians are expected"
        outside = np.mod(values - low, 2 * math.pi) > high - low
    elif name == "elevation" and float((np.abs(values) > math.pi / 2).mean()) > _MANY:
        return f"elevations from {seen} rad, but nothing is seen beyond pi/2: degrees? radians are expected"
    else:
        outside = (values < low) | (values > high)
    share = float(outside.mean())
    plural = name if isinstance(sensor, PositionSensor) else f"{name}s"
    unit = "rad" if name in ANGLES else "m/s" if name == "range rate" else "m"
    if share > _MANY:
        return (
            f"{100 * share:.0f} % of its {plural} ({seen} {unit}) lie outside of its field of view "
            f"({low:.4g} to {high:.4g} {unit}): another unit?"
        )
    # a constant, as the height of targets set on the ground, has no unit to doubt
    if 0.0 < float(np.std(values)) < _WITHIN * sigma:
        return (
            f"its {plural} ({seen} {unit}) all lie closer together than their noise ({sigma:.4g} {unit}): another unit?"
        )
    return ""
