"""Bearing-only sensors over a field of targets: lines of sight that cross where no target is (ghosts)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assoc._parameters import Parameters, described
from assoc._types import Array
from assoc.scene.scene import Scene
from assoc.sensors.bearing import BearingSensor
from assoc.simulation.memory import MOST, require_scene_memory
from assoc.simulation.observation import observe
from assoc.simulation.radars import azimuth_interval, padded_azimuth
from assoc.simulation.scenarios.crowd import horizontal_velocities

HEIGHT = 10_000.0
"""Targets fly up to here (m); bearings do not depend on it."""


@dataclass(frozen=True)
class BearingOnlyParameters(Parameters):
    """Parameters of the bearing-only scene."""

    targets: int = described(20, "number of targets")
    sensors: int = described(3, "number of sensors, 2 or more")
    scans: int = described(10, "number of scans")
    interval: float = described(10.0, "seconds from scan to scan")
    width: float = described(100_000.0, "side of the square field, metres")
    depth: float = described(10_000.0, "how far every second sensor stands behind the edge, metres")
    speed: float = described(200.0, "largest horizontal speed, m/s; speeds are uniform from half of it")
    noise: float = described(0.005, "standard deviation of a bearing, radians")
    detection_probability: float = described(0.95, "P_d of each sensor")
    false_alarms: float = described(1.0, "mean false alarms per sensor and scan")

    def __post_init__(self) -> None:
        self._whole("targets", "scans", most=MOST)
        self._whole("sensors", least=2, most=MOST)
        self._number("interval", "width", "noise", "false_alarms", above=0.0)
        self._number("depth", "speed", least=0.0)
        self._probability("detection_probability")


def sensor_positions(parameters: BearingOnlyParameters) -> Array:
    """Positions of the sensors (n, 3), metres: along the southern edge, every second one set back.

    With the default parameters they are (0, 0), (50, -10) and (100, 0) km.
    """
    number = np.arange(parameters.sensors)
    along = parameters.width * number / (parameters.sensors - 1)
    return np.stack([along, 0.0 - parameters.depth * (number % 2), np.zeros(parameters.sensors)], axis=1)


def simulate(p: BearingOnlyParameters, rng: np.random.Generator, name: str) -> Scene:
    """Simulate the scene; see `assoc.simulation.simulate`."""
    require_scene_memory(p.scans, p.sensors, p.targets, p.false_alarms, "scans sensors targets false_alarms")
    region = np.array([[0.0, p.width], [0.0, p.width], [0.0, HEIGHT]])
    start = rng.uniform(region[:, 0], region[:, 1], size=(p.targets, 3))
    velocity = horizontal_velocities(p.targets, p.speed, rng)
    times = p.interval * np.arange(p.scans)
    paths = [start + t * velocity for t in times]
    # targets that have left the field are gone: the fields of view end there
    inside = [((path >= region[:, 0]) & (path <= region[:, 1])).all(axis=1) for path in paths]
    sensors = [
        BearingSensor(
            position=position,
            noise=np.array([p.noise]),
            detection_probability=p.detection_probability,
            false_alarm_rate=p.false_alarms,
            field_of_view=np.array([padded_azimuth(azimuth_interval(position, region), p.noise)]),
            name=f"bearing sensor {number}",
        )
        for number, position in enumerate(sensor_positions(p), start=1)
    ]
    ids = [np.flatnonzero(here) for here in inside]
    present = [path[here] for path, here in zip(paths, inside, strict=True)]
    return observe(sensors, times, ids, present, rng, region=region, name=name)
