"""Radars of which nobody said whether their range rates fold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from assoc.scene.scene import Scene
from assoc.sensors import Radar3D, Sensor
from assoc.tracking.settings import TrackerSettings


def assumed_folding(sensor: Sensor, speed: float | Sequence[float]) -> float | None:
    """Interval, m/s, at which range rates may fold; None where that was said or is not likely.

    A radar that gives rates in a field of view narrower than targets are usually fast folds them, or sees few of them.
    If it does not fold them this is still true, rates are only known less well: so nothing has to be tried.
    """
    if not isinstance(sensor, Radar3D) or sensor.folding is not None or not sensor.measures_velocity:
        return None
    low, high = sensor.field_of_view[3].tolist()
    fastest = max(speed) if isinstance(speed, Sequence) else speed
    return float(high - low) if low < 0.0 < high and high - low < fastest else None


@lru_cache(maxsize=16)
def with_folding(settings: TrackerSettings) -> TrackerSettings:
    """The settings with `assumed_folding` of each radar; the same object where there is none."""
    sensors = []
    for sensor in settings.sensors:
        folding = assumed_folding(sensor, settings.initiation.speed)
        sensors.append(replace(sensor, folding=folding) if folding and isinstance(sensor, Radar3D) else sensor)
    if all(one is other for one, other in zip(sensors, settings.sensors, strict=True)):
        return settings
    empty = [[sensor.covariance[:0] for sensor in sensors]]
    region = settings.scene.region
    return settings.with_scene(Scene(sensors=sensors, times=np.zeros(1), measurements=empty, region=region))
