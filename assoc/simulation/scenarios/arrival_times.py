"""Waves that stations hear at times of which the emission is not known: earthquakes, shots, transponders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assoc._parameters import Parameters, described
from assoc._types import Array
from assoc.scene.scene import Scene
from assoc.sensors.arrival_time import ArrivalTimeSensor
from assoc.simulation.memory import MOST, require_scene_memory
from assoc.simulation.observation import observe
from assoc.simulation.radars import MARGIN, range_interval


@dataclass(frozen=True)
class ArrivalTimesParameters(Parameters):
    """Parameters of the scene of arrival times; the defaults are P waves of small earthquakes."""

    stations: int = described(20, "number of stations, 3 or more")
    events: int = described(3, "number of emissions in each scan")
    scans: int = described(5, "number of scans")
    listening: float = described(60.0, "seconds of a scan in which waves are emitted")
    width: float = described(100_000.0, "side of the square field, metres")
    depth: float = described(20_000.0, "how deep below the field waves are emitted, metres; 0: in its plane")
    wave_speed: float = described(6_000.0, "speed of the wave, m/s")
    noise: float = described(0.1, "standard deviation of an arrival time, seconds")
    detection_probability: float = described(0.9, "P_d of each station")
    false_alarms: float = described(1.0, "mean false alarms per station and scan")

    def __post_init__(self) -> None:
        self._whole("events", "scans", most=MOST)
        self._whole("stations", least=3, most=MOST)
        self._number("listening", "width", "wave_speed", "noise", "false_alarms", above=0.0)
        self._number("depth", least=0.0)
        self._probability("detection_probability")


def simulate(p: ArrivalTimesParameters, rng: np.random.Generator, name: str) -> Scene:
    """Simulate the scene; see `assoc.simulation.simulate`."""
    require_scene_memory(p.scans, p.stations, p.events, p.false_alarms, "scans stations events false_alarms")
    region = np.array([[0.0, p.width], [0.0, p.width], [-p.depth, 0.0]])
    sites = np.column_stack([rng.uniform(0.0, p.width, (p.stations, 2)), np.zeros(p.stations)])
    sensors = [_station(p, site, region, f"station {number}") for number, site in enumerate(sites, start=1)]
    ids = list(np.arange(p.scans * p.events).reshape(p.scans, p.events))
    places = list(rng.uniform(region[:, 0], region[:, 1], size=(p.scans, p.events, 3)))
    emitted = list(rng.uniform(0.0, p.listening, size=(p.scans, p.events)))
    latest = max(float(sensor.field_of_view[0, 1]) for sensor in sensors)
    times = latest * np.arange(p.scans)
    return observe(sensors, times, ids, places, rng, region=region, name=name, emission_times=emitted)


def _station(p: ArrivalTimesParameters, site: Array, region: Array, name: str) -> ArrivalTimeSensor:
    """A station that listens until it has heard what was emitted last."""
    heard = p.listening + range_interval(site, region)[1] / p.wave_speed + MARGIN * p.noise
    return ArrivalTimeSensor(
        position=site,
        noise=np.array([p.noise]),
        detection_probability=p.detection_probability,
        false_alarm_rate=p.false_alarms,
        field_of_view=np.array([[-MARGIN * p.noise, heard]]),
        wave_speed=p.wave_speed,
        name=name,
    )
