"""Measurement models, one a file: radars, bearings, positions, arrival times; platforms that carry sensors."""

from __future__ import annotations

from assoc.sensors.arrival_time import ArrivalTimeSensor
from assoc.sensors.base import Sensor
from assoc.sensors.bearing import BearingSensor, DirectionSensor
from assoc.sensors.platform import Platform
from assoc.sensors.position import PositionSensor
from assoc.sensors.radar import Radar2D, Radar3D

KINDS: dict[str, type[Sensor]] = {
    cls.kind: cls for cls in (Radar3D, Radar2D, BearingSensor, DirectionSensor, PositionSensor, ArrivalTimeSensor)
}
"""Registry of measurement models: the name in a scene file -> the class."""

__all__ = [
    "KINDS", "ArrivalTimeSensor", "BearingSensor", "DirectionSensor", "Platform", "PositionSensor", "Radar2D",
    "Radar3D", "Sensor",
]  # fmt: skip
