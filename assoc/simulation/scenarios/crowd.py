"""A crowd: many targets at random positions in a box, seen by position sensors or radars around it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from assoc._parameters import Parameters, described
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.scene.scene import Scene
from assoc.sensors.base import Sensor
from assoc.sensors.position import PositionSensor
from assoc.simulation.memory import MOST, require_scene_memory
from assoc.simulation.observation import observe
from assoc.simulation.radars import MARGIN, on_circle, radars_over

REFERENCE_TARGETS = 100
"""With constant density the box is as given for this many targets."""


@dataclass(frozen=True)
class CrowdParameters(Parameters):
    """Parameters of the crowd."""

    targets: int = described(100, "number of targets")
    scans: int = described(1, "number of scans")
    interval: float = described(1.0, "seconds from scan to scan")
    sensors: int = described(3, "number of sensors")
    sensor: Literal["position", "radar"] = described(
        "position", "x, y, z at once, or radars (range, azimuth, elevation) around the box"
    )
    width: float = described(5_000.0, "side of the square box, metres")
    height: float = described(2_000.0, "height of the box, metres")
    constant_density: bool = described(
        False, f"grow the ground area with the targets; as given for {REFERENCE_TARGETS}"
    )
    speed: float = described(200.0, "largest horizontal speed, m/s; speeds are uniform from half of it")
    noise: float = described(100.0, "standard deviation of a position (radar: of range, and across at the box), metres")
    detection_probability: float = described(0.9, "P_d of each sensor")
    false_alarms_per_target: float = described(0.1, "mean false alarms per sensor and scan, for each target")
    range_rate_noise: float = described(0.0, "standard deviation of range rates, m/s; 0: radars measure none")

    def __post_init__(self) -> None:
        self._whole("targets", "scans", "sensors", most=MOST)
        self._number("interval", "width", "height", "noise", "false_alarms_per_target", above=0.0)
        self._number("speed", "range_rate_noise", least=0.0)
        self._probability("detection_probability")
        if self.sensor not in ("position", "radar"):
            raise InvalidInputError(f"sensor: expected 'position' or 'radar', got {self.sensor!r}")
        if self.range_rate_noise > 0 and self.sensor != "radar":
            raise InvalidInputError("range_rate_noise: only radars measure range rate, set sensor to 'radar'")


def simulate(p: CrowdParameters, rng: np.random.Generator, name: str) -> Scene:
    """Simulate the scene; see `assoc.simulation.simulate`."""
    rate = p.false_alarms_per_target * p.targets
    require_scene_memory(p.scans, p.sensors, p.targets, rate, "scans sensors targets false_alarms_per_target")
    width = p.width * (np.sqrt(p.targets / REFERENCE_TARGETS) if p.constant_density else 1.0)
    box = np.array([[0.0, width], [0.0, width], [0.0, p.height]])
    start = rng.uniform(box[:, 0], box[:, 1], size=(p.targets, 3))
    velocity = horizontal_velocities(p.targets, p.speed, rng)
    times = p.interval * np.arange(p.scans)
    paths = [start + t * velocity for t in times]
    # no target leaves the region, however long the scene lasts
    region = box + p.speed * times[-1] * np.array([[-1.0, 1.0], [-1.0, 1.0], [0.0, 0.0]])
    ids = [np.arange(p.targets)] * p.scans
    return observe(
        _sensors(p, region), times, ids, paths, rng, region=region, name=name, velocities=[velocity] * p.scans
    )


def _sensors(p: CrowdParameters, region: Array) -> list[Sensor]:
    rate = p.false_alarms_per_target * p.targets
    center = region.mean(axis=1)
    distance = float(np.hypot(*(region[:2, 1] - region[:2, 0])))
    positions = on_circle(center, distance, p.sensors)
    if p.sensor == "radar":
        return radars_over(
            region,
            positions,
            range_noise=p.noise,
            angle_noise=p.noise / distance,
            detection_probability=p.detection_probability,
            false_alarm_rate=rate,
            range_rate_noise=p.range_rate_noise,
            fastest=p.speed,
        )
    view = region + MARGIN * p.noise * np.array([-1.0, 1.0])
    return [
        PositionSensor(
            position=position,
            noise=np.full(3, p.noise),
            detection_probability=p.detection_probability,
            false_alarm_rate=rate,
            field_of_view=view,
            name=f"sensor {number}",
        )
        for number, position in enumerate(positions, start=1)
    ]


def horizontal_velocities(count: int, speed: float, rng: np.random.Generator) -> Array:
    """Random horizontal velocities (count, 3): any heading, speeds uniform from half of the largest, m/s."""
    heading = rng.uniform(-np.pi, np.pi, count)
    size = rng.uniform(0.5 * speed, speed, count)
    return np.stack([size * np.cos(heading), size * np.sin(heading), np.zeros(count)], axis=1)
