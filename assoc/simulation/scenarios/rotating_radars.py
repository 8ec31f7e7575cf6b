"""Airliners under several turning radars, each with its own pace: every plot has its own time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assoc._parameters import Parameters, described
from assoc.scene.scene import Scene
from assoc.simulation.flights import random_flight
from assoc.simulation.memory import MOST, require_scene_memory
from assoc.simulation.radars import on_circle, radars_over
from assoc.simulation.scenarios.three_radar import REFERENCE_RANGE, around
from assoc.simulation.turning import Path, observe_in_turns, parse_turns


@dataclass(frozen=True)
class RotatingRadarsParameters(Parameters):
    """Parameters of the rotating radars."""

    turns: str = described("4,5,5.5", "seconds for a turn of each radar, with commas")
    aircraft: int = described(30, "number of aircraft")
    duration: float = described(240.0, "seconds")
    interval: float = described(2.0, "seconds from scan to scan, at most the shortest turn")
    reach: float = described(60_000.0, "aircraft begin within this distance, metres")
    radar_distance: float = described(40_000.0, "metres from the middle to each radar")
    noise: float = described(80.0, "standard deviation of range, and across the line of sight at 50 km, metres")
    detection_probability: float = described(0.9, "P_d of a dwell")
    false_alarms: float = described(10.0, "mean false alarms per radar and turn")

    def __post_init__(self) -> None:
        parse_turns(self.turns)
        self._whole("aircraft", most=MOST)
        self._number("duration", "interval", "reach", "noise", "false_alarms", above=0.0)
        self._number("radar_distance", least=0.0)
        self._probability("detection_probability")


def simulate(p: RotatingRadarsParameters, rng: np.random.Generator, name: str) -> Scene:
    """Simulate the scene; see `assoc.simulation.simulate`."""
    turns = parse_turns(p.turns)
    times = p.interval * np.arange(1, max(int(p.duration / p.interval + 1e-9), 1) + 1)
    require_scene_memory(len(times), len(turns), p.aircraft, p.false_alarms, "duration turns aircraft false_alarms")
    flights = [random_flight(rng, 0.0, p.reach, p.duration) for _ in range(p.aircraft)]
    paths = [Path(target, *flight.path(float(times[-1]))) for target, flight in enumerate(flights)]
    region = around(np.concatenate([path.positions for path in paths]), 0.05)
    sensors = radars_over(
        region,
        on_circle(np.zeros(3), p.radar_distance, len(turns)),
        range_noise=p.noise,
        angle_noise=p.noise / REFERENCE_RANGE,
        detection_probability=p.detection_probability,
        false_alarm_rate=p.false_alarms,
    )
    return observe_in_turns(sensors, turns, 0.0, times, paths, rng, region=region, name=name)
