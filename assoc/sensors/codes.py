"""Numbers of the kinds of sensors in kernels."""

from __future__ import annotations

from assoc.sensors.base import Sensor
from assoc.sensors.bearing import BearingSensor, DirectionSensor
from assoc.sensors.position import PositionSensor
from assoc.sensors.radar import Radar2D, Radar3D

POSITION, RADAR3D, RADAR2D, BEARING = 0, 1, 2, 3
OWN = 9
"""A user's own class, which no kernel knows."""

CODES: dict[type[Sensor], int] = {
    PositionSensor: POSITION,
    Radar3D: RADAR3D,
    Radar2D: RADAR2D,
    BearingSensor: BEARING,
    DirectionSensor: BEARING,
}
"""Class of a sensor -> its number; with two components a bearing has an elevation; a user's own class has none."""
