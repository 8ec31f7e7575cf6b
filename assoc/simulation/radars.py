"""Positions of simulated sensors, and fields of view that just cover a region."""

from __future__ import annotations

import math

import numpy as np

from assoc._types import Array
from assoc.sensors.base import Sensor, wrap_angle
from assoc.sensors.radar import Radar3D

# noise may carry a measurement this many standard deviations past the region and still be in view
MARGIN = 5.0


def on_circle(center: Array, radius: float, count: int) -> Array:
    """Positions (count, 3), metres, at equal angles on a circle on the ground, the first north (+y)."""
    angle = math.pi / 2 + 2 * math.pi * np.arange(count) / count
    x, y = center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle)
    return np.stack([x, y, np.zeros(count)], axis=1) + 0.0


def azimuth_interval(position: Array, region: Array) -> tuple[float, float]:
    """Smallest interval of azimuths (rad) under which a box (3, 2) is seen; its end may lie beyond pi."""
    low, high = region[:2, 0], region[:2, 1]
    here = position[:2]
    if ((low < here) & (here < high)).all():
        return -math.pi, math.pi
    corners = np.array([[x, y] for x in region[0] for y in region[1]]) - here
    corners = corners[(corners != 0).any(axis=1)]
    middle = (low + high) / 2 - here
    if not len(corners) or not middle.any():
        return -math.pi, math.pi
    center = math.atan2(middle[1], middle[0])
    # seen from outside a convex box spans at most a half circle, so offsets from its middle do not wrap
    offset = wrap_angle(np.arctan2(corners[:, 1], corners[:, 0]) - center)
    return center + float(offset.min()), center + float(offset.max())


def range_interval(position: Array, region: Array) -> tuple[float, float]:
    """Smallest and largest distance (m) from a position to a box."""
    nearest = np.clip(position, region[:, 0], region[:, 1])
    farthest = np.maximum(np.abs(region[:, 0] - position), np.abs(region[:, 1] - position))
    return float(np.linalg.norm(nearest - position)), float(np.linalg.norm(farthest))


def elevation_interval(position: Array, region: Array) -> tuple[float, float]:
    """Smallest and largest elevation (rad) under which a box is seen."""
    near, far = range_interval(position[:2], region[:2])
    bottom, top = float(region[2, 0] - position[2]), float(region[2, 1] - position[2])
    return (
        math.atan2(bottom, near if bottom < 0 else far),
        math.atan2(top, near if top > 0 else far),
    )


def padded(interval: tuple[float, float], noise: float, least: float, most: float) -> tuple[float, float]:
    """Widen an interval by the margin for noise, within [least, most]."""
    return max(least, interval[0] - MARGIN * noise), min(most, interval[1] + MARGIN * noise)


def padded_azimuth(interval: tuple[float, float], noise: float) -> tuple[float, float]:
    """Widen an interval of azimuths by the margin for noise, to a full circle at most."""
    low, high = interval[0] - MARGIN * noise, interval[1] + MARGIN * noise
    return (low, high) if high - low < 2 * math.pi else (-math.pi, math.pi)


def radar_over(
    region: Array,
    position: Array,
    *,
    range_noise: float,
    angle_noise: float,
    detection_probability: float,
    false_alarm_rate: float,
    name: str,
    range_rate_noise: float = 0.0,
    fastest: float = 0.0,
) -> Sensor:
    """Make a radar (range, azimuth, elevation, range rate on request) whose field of view just covers a region.

    Noises are standard deviations: of range in metres, of both angles in radians, of range rate in m/s (0: none is
    measured). `fastest` is the largest speed of a target, m/s.
    """
    noise = [range_noise, angle_noise, angle_noise]
    view = [
        padded(range_interval(position, region), range_noise, 0.0, math.inf),
        padded_azimuth(azimuth_interval(position, region), angle_noise),
        padded(elevation_interval(position, region), angle_noise, -math.pi / 2, math.pi / 2),
    ]
    if range_rate_noise > 0:
        noise.append(range_rate_noise)
        view.append(padded((-fastest, fastest), range_rate_noise, -math.inf, math.inf))
    return Radar3D(
        position=position,
        noise=np.array(noise),
        detection_probability=detection_probability,
        false_alarm_rate=false_alarm_rate,
        field_of_view=np.array(view),
        name=name,
    )


def radars_over(region: Array, positions: Array, **values: float) -> list[Sensor]:
    """Make a radar at each position (n, 3), numbered from 1; `values` are those of `radar_over`."""
    return [radar_over(region, position, name=f"radar {n}", **values) for n, position in enumerate(positions, start=1)]
