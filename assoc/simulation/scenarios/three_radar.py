"""Three targets, three radars, a hundred scans: the scene of the ant colony paper.

The trajectories, P_d, the false alarm rate and the number of scans are the paper's. It gives neither noise
nor region nor the positions of the radars. Chosen here: the region is the bounding box of the three trajectories
and 10 % more on each side; the radars stand on the ground, at equal angles around its middle, far enough out
to see every target from a different side and never to have one straight above. The paper's scene lasts 100 s. In a
longer one the targets end then, and three others fly the same ways: the radars stay where they are, and the targets
near them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assoc._parameters import Parameters, described
from assoc._types import Array
from assoc.scene.scene import Scene
from assoc.simulation.memory import MOST, require_scene_memory
from assoc.simulation.observation import observe
from assoc.simulation.radars import on_circle, radars_over
from assoc.simulation.trajectories import Manoeuvre, Trajectory

TRAJECTORIES = (
    Trajectory(np.array([30_000.0, 20_000.0, 2_000.0]), np.array([-450.0, -250.0, 100.0])),
    Trajectory(
        np.array([20_450.0, 11_250.0, 2_000.0]),
        np.array([-450.0, -250.0, 10.0]),
        (
            Manoeuvre(12.0, 23.0, (0.0, 50.0, 0.0)),
            Manoeuvre(23.0, float("inf"), (-20.0, -20.0, 0.0)),
        ),
    ),
    Trajectory(np.array([50_000.0, 20_000.0, 2_000.0]), np.array([-600.0, -250.0, 300.0])),
)
"""The paper's three targets: metres and m/s; target 2 turns at 12 s and again at 23 s."""


@dataclass(frozen=True)
class ThreeRadarParameters(Parameters):
    """Parameters of the three-radar scene."""

    scans: int = described(100, "number of scans")
    interval: float = described(1.0, "seconds from scan to scan")
    radars: int = described(3, "number of radars (range, azimuth, elevation)")
    radar_distance: float = described(60_000.0, "metres from the middle of the region to each radar")
    noise: float = described(50.0, "standard deviation of range, and across the line of sight at 50 km, metres")
    detection_probability: float = described(0.9, "P_d of each radar")
    false_alarms: float = described(1.0, "mean false alarms per radar and scan")
    margin: float = described(0.1, "how far the region reaches past the trajectories, as a share of them")
    range_rate_noise: float = described(0.0, "standard deviation of range rates, m/s; 0: the radars measure none")

    def __post_init__(self) -> None:
        self._whole("scans", "radars", most=MOST)
        self._number("interval", "noise", "false_alarms", above=0.0)
        self._number("radar_distance", "margin", "range_rate_noise", least=0.0)
        self._probability("detection_probability")


DURATION = 100.0
"""Seconds that the paper's targets fly."""

REFERENCE_RANGE = 50_000.0
"""Range (m) at which the angles' noise across the line of sight equals the range's noise."""


def simulate(p: ThreeRadarParameters, rng: np.random.Generator, name: str) -> Scene:
    """Simulate the scene; see `assoc.simulation.simulate`."""
    require_scene_memory(p.scans, p.radars, len(TRAJECTORIES), p.false_alarms, "scans radars targets false_alarms")
    times = p.interval * np.arange(p.scans)
    wave = np.floor(times / DURATION).astype(np.int64)
    since = times - DURATION * wave
    paths = np.stack([trajectory.positions(since) for trajectory in TRAJECTORIES], axis=1)
    speeds = np.stack([trajectory.velocities(since) for trajectory in TRAJECTORIES], axis=1)
    fastest = float(np.linalg.norm(speeds, axis=2).max())
    whole = since if not wave[-1] else np.arange(0.0, DURATION, 1.0)
    region = around(np.stack([trajectory.positions(whole) for trajectory in TRAJECTORIES], axis=1), p.margin)
    positions = on_circle(region.mean(axis=1), p.radar_distance, p.radars)
    sensors = radars_over(
        region,
        positions,
        range_noise=p.noise,
        angle_noise=p.noise / REFERENCE_RANGE,
        detection_probability=p.detection_probability,
        false_alarm_rate=p.false_alarms,
        range_rate_noise=p.range_rate_noise,
        fastest=fastest,
    )
    ids = [np.arange(len(TRAJECTORIES)) + len(TRAJECTORIES) * number for number in wave.tolist()]
    return observe(sensors, times, ids, list(paths), rng, region=region, name=name, velocities=list(speeds))


def around(positions: Array, margin: float) -> Array:
    """Bounding box (3, 2) of positions (..., 3), widened on each side by a share of its extent, metres.

    A direction without extent is widened by 1 km, so that the box always has a volume.
    """
    flat = positions.reshape(-1, 3)
    low, high = flat.min(axis=0), flat.max(axis=0)
    pad = margin * (high - low)
    pad[high - low == 0] = 1_000.0
    return np.stack([low - pad, high + pad], axis=1)
