"""Unmanned aircraft on Dubins paths around no-fly zones, seen by radars.

Each aircraft flies at constant speed and height the shortest path it can turn, from one side of the region to
the other, around circular zones; starts, goals and headings are random. At its goal it leaves the scene.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from assoc._parameters import Parameters, described
from assoc._types import Array
from assoc.errors import InfeasibleError, InvalidInputError
from assoc.scene.scene import Scene
from assoc.simulation.dubins.obstacles import around
from assoc.simulation.dubins.paths import Path, Pose
from assoc.simulation.memory import require_scene_memory
from assoc.simulation.observation import observe
from assoc.simulation.radars import on_circle, radars_over

_TRIES = 200


@dataclass(frozen=True)
class DubinsUavParameters(Parameters):
    """Parameters of the Dubins scene."""

    targets: int = described(4, "number of aircraft")
    interval: float = described(1.0, "seconds from scan to scan")
    speed: float = described(20.0, "speed of the aircraft, m/s")
    turning_radius: float = described(100.0, "turning radius, metres")
    obstacles: int = described(5, "number of circular no-fly zones")
    obstacle_radius: float = described(120.0, "largest radius of a zone, metres; radii are uniform from a third of it")
    margin: float = described(20.0, "distance to keep from the zones, metres")
    width: float = described(2_000.0, "side of the square region, metres")
    height: float = described(300.0, "largest height; heights are uniform from a third of it")
    radars: int = described(3, "number of radars (range, azimuth, elevation)")
    noise: float = described(5.0, "standard deviation of range, and across at the region's middle, metres")
    detection_probability: float = described(0.9, "P_d of each radar")
    false_alarms: float = described(1.0, "mean false alarms per radar and scan")
    range_rate_noise: float = described(0.0, "standard deviation of range rates, m/s; 0: the radars measure none")

    def __post_init__(self) -> None:
        self._whole("targets", "radars", most=10_000)
        self._whole("obstacles", least=0, most=40)
        self._number(
            "interval", "speed", "turning_radius", "obstacle_radius", "width", "height", "noise", "false_alarms",
            above=0.0,
        )  # fmt: skip
        self._number("margin", "range_rate_noise", least=0.0)
        self._probability("detection_probability")
        if self.width < 4 * self.turning_radius:
            raise InvalidInputError(f"width: expected at least four turning radii, got {self.width!r}")


def simulate(p: DubinsUavParameters, rng: np.random.Generator, name: str) -> Scene:
    """Simulate the scene; see `assoc.simulation.simulate`."""
    zones = no_fly_zones(p, rng)
    flights = [_flight(p, zones, rng) for _ in range(p.targets)]
    beats = max(path.length for path in flights) / p.speed / p.interval + 1
    names = "1/interval radars targets false_alarms"
    require_scene_memory(beats, p.radars, p.targets, p.false_alarms, names)
    heights = rng.uniform(p.height / 3, p.height, p.targets)
    tracks = [path.sample(p.speed, p.interval)[1] for path in flights]
    scans = max(len(track) for track in tracks)
    times = p.interval * np.arange(scans)
    ids, positions = [], []
    for k in range(scans):
        # the last sample of a path falls between scans and is not flown on the beat
        flying = [i for i, path in enumerate(flights) if times[k] * p.speed <= path.length]
        ids.append(np.array(flying, dtype=np.int64))
        here = [[*tracks[i][k][:2], heights[i]] for i in flying]
        positions.append(np.array(here, dtype=np.float64).reshape(-1, 3))
    beyond = 4 * p.turning_radius
    region = np.array([[-beyond, p.width + beyond], [-beyond, p.width + beyond], [0.0, 1.5 * p.height]])
    distance = 1.2 * p.width
    sensors = radars_over(
        region,
        on_circle(region.mean(axis=1), distance, p.radars),
        range_noise=p.noise,
        angle_noise=p.noise / distance,
        detection_probability=p.detection_probability,
        false_alarm_rate=p.false_alarms,
        range_rate_noise=p.range_rate_noise,
        fastest=p.speed,
    )
    return observe(sensors, times, ids, positions, rng, region=region, name=name)


def no_fly_zones(p: DubinsUavParameters, rng: np.random.Generator) -> Array:
    """Circles (x, y, radius), metres, in the middle half of the region; they may overlap."""
    centre = rng.uniform(0.25 * p.width, 0.75 * p.width, (p.obstacles, 2))
    radius = rng.uniform(p.obstacle_radius / 3, p.obstacle_radius, (p.obstacles, 1))
    return np.concatenate([centre, radius], axis=1)


def _flight(p: DubinsUavParameters, zones: Array, rng: np.random.Generator) -> Path:
    """Draw a start and a goal on opposite sides until a path is found; nearly always the first."""
    for _ in range(_TRIES):
        side = rng.integers(4)
        ends = []
        for across in (0.0, p.width):
            along = rng.uniform(0.0, p.width)
            x, y = (across, along) if side % 2 == 0 else (along, across)
            ends.append((x, y) if side < 2 else (p.width - x, p.width - y))
        (x0, y0), (x1, y1) = ends
        line = math.atan2(y1 - y0, x1 - x0)
        turns = rng.uniform(-1.2, 1.2, 2)
        try:
            return around(
                Pose(x0, y0, line + turns[0]),
                Pose(x1, y1, line + turns[1]),
                p.turning_radius,
                [tuple(zone) for zone in zones],
                margin=p.margin,
                points=12,
            )
        except (InfeasibleError, InvalidInputError):
            continue
    raise InfeasibleError(f"obstacles: no paths between the sides of the region found in {_TRIES} tries")
