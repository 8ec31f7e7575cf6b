"""Recorded trajectories (time, id, latitude, longitude, altitude in a file), seen by simulated radars.

The scene's frame is the plane that touches the WGS-84 ellipsoid in the middle of the traffic: x east,
y north, z up. The radars stand on the ground around that middle. Terrain and the radio horizon are left out:
every radar sees all traffic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from assoc._parameters import Parameters
from assoc._types import Array
from assoc.errors import LimitExceededError
from assoc.recordings.flights.cleaning import clean
from assoc.recordings.flights.reports import ALTITUDE_UNITS, COLUMNS, SPEED_UNITS, Reports, read_flight_reports
from assoc.scene.geodesy import east_north_up
from assoc.scene.scene import Scene
from assoc.simulation.flights import STEP
from assoc.simulation.interpolation import along, frame_velocities, resample
from assoc.simulation.memory import MOST, option, require_scene_memory
from assoc.simulation.observation import observe, velocities_from
from assoc.simulation.radars import on_circle, radars_over
from assoc.simulation.scenarios.three_radar import REFERENCE_RANGE, around
from assoc.simulation.turning import Path, observe_in_turns, parse_turns

EARTH_RADIUS = 6_371_000.0
MAX_SCANS = 1_000_000


def _column(meaning: str, unit: str) -> Any:
    names = ", ".join(COLUMNS[meaning])
    return option(None, f"column of the {meaning}{unit} (else the first of: {names})")


@dataclass(frozen=True)
class FromTracksParameters(Parameters):
    """Parameters of recorded trajectories observed by simulated radars."""

    file: str = field(
        metadata={"help": "CSV or Parquet file of the trajectories", "positional": True, "in_title": False}
    )
    time_column: str | None = _column("time", ", seconds or dates (ISO 8601)")
    id_column: str | None = _column("id", "")
    latitude_column: str | None = _column("latitude", ", degrees")
    longitude_column: str | None = _column("longitude", ", degrees")
    altitude_column: str | None = _column("altitude", "")
    name_column: str | None = _column("name", ", as call signs, if there is one")
    altitude_unit: Literal["m", "ft"] = option("m", "unit of the altitudes")
    speed_unit: Literal["m/s", "kt"] = option(
        "m/s", "unit of velocity and vertrate; with kt the latter is in feet per minute"
    )
    interval: float = option(10.0, "seconds from scan to scan (positions are interpolated)")
    max_gap: float = option(60.0, "no target where its reports are further apart than this, seconds")
    clean: bool = option(True, "leave out repeated positions, mend altitudes that cannot be right")
    scans: int | None = option(None, "number of scans (without: the whole recording)")
    radars: int = option(3, "number of radars (range, azimuth, elevation)")
    turns: str | None = option(
        None,
        "seconds for a turn of each radar, with commas: each plot then has its own time (without: all measure at once)",
    )
    spread: float = option(0.25, "distance of the radars from the middle, as a share of the traffic's diagonal")
    noise: float = option(50.0, "standard deviation of range, and across the line of sight at 50 km, metres")
    detection_probability: float = option(0.9, "P_d of each radar")
    false_alarms: float = option(1.0, "mean false alarms per radar and scan")
    range_rate_noise: float = option(0.0, "standard deviation of range rates, m/s; 0: the radars measure none")

    def __post_init__(self) -> None:
        self._whole("radars", most=MOST)
        if self.scans is not None:
            self._whole("scans", most=MAX_SCANS)
        self._require(self.altitude_unit in ALTITUDE_UNITS, "altitude_unit", "'m' or 'ft'")
        self._require(self.speed_unit in SPEED_UNITS, "speed_unit", "'m/s' or 'kt'")
        self._number("interval", "max_gap", "noise", "false_alarms", above=0.0)
        self._number("spread", "range_rate_noise", least=0.0)
        if self.turns is not None:
            parse_turns(self.turns, self.radars)
        self._probability("detection_probability")


def simulate(p: FromTracksParameters, rng: np.random.Generator, name: str) -> Scene:
    """Simulate the scene; see `assoc.simulation.simulate`."""
    named = {meaning: getattr(p, f"{meaning}_column") for meaning in COLUMNS}
    recording, names, notes = read_flight_reports(p.file, named, p.altitude_unit, p.speed_unit)
    flown, cleaned = clean(recording) if p.clean else (recording, {})
    origin = (_middle(flown.latitude), _middle(flown.longitude), 0.0)
    reports = east_north_up(flown.latitude, flown.longitude, flown.height, origin)
    speeds = frame_velocities(flown, reports, origin)
    times = _epochs(p, recording)
    targets = len(np.unique(flown.target))
    require_scene_memory(len(times), p.radars, targets, p.false_alarms, "scans radars targets false_alarms")
    ids, positions = resample(flown, reports, times, p.max_gap, speeds)
    velocities = velocities_from(times, ids, positions)
    fastest = max(float(np.linalg.norm(velocity, axis=1).max(initial=0.0)) for velocity in velocities)
    region = around(reports, 0.01)
    diagonal = float(np.hypot(*(region[:2, 1] - region[:2, 0])))
    sites = on_circle(np.zeros(3), p.spread * diagonal, p.radars)
    # the ground falls away from the tangent plane: 1 km at 113 km
    sites[:, 2] = np.sqrt(np.maximum(EARTH_RADIUS**2 - (sites[:, :2] ** 2).sum(axis=1), 0.0)) - EARTH_RADIUS
    sensors = radars_over(
        region,
        sites,
        range_noise=p.noise,
        angle_noise=p.noise / REFERENCE_RANGE,
        detection_probability=p.detection_probability,
        false_alarm_rate=p.false_alarms,
        range_rate_noise=p.range_rate_noise,
        fastest=fastest,
    )
    if p.turns is not None:
        turns, start = parse_turns(p.turns, p.radars), float(times[0]) - p.interval
        paths = _paths(flown, reports, speeds, p.max_gap)
        scene = observe_in_turns(sensors, turns, start, times, paths, rng, region=region, name=name)
    else:
        scene = observe(sensors, times, ids, positions, rng, region=region, name=name, velocities=velocities)
    truth = replace(scene.truth, names=names) if scene.truth is not None else None
    return replace(scene, truth=truth, origin=origin, notes={**notes, **cleaned})


def _paths(recording: Reports, reports: Array, speeds: Array, max_gap: float) -> list[Path]:
    """The flights in fine steps, one path for each part without a gap."""
    new = (np.diff(recording.target) != 0) | (np.diff(recording.time) > max_gap)
    paths = []
    for rows in np.split(np.arange(len(recording.time)), np.flatnonzero(new) + 1):
        stamps, points = recording.time[rows], reports[rows]
        count = max(math.ceil((stamps[-1] - stamps[0]) / STEP), 1)
        if len(rows) > 1:
            times = np.linspace(stamps[0], stamps[-1], count + 1)
            fine = along(stamps, points, times, max_gap, speeds[rows])
            paths.append(Path(int(recording.target[rows[0]]), times, fine, np.gradient(fine, times, axis=0)))
    return paths


def _middle(angles: Array) -> float:
    """Middle of the smallest interval around angles that do not go around the earth (rad)."""
    reference = float(angles[0])
    away = np.remainder(angles - reference + math.pi, 2 * math.pi) - math.pi
    return reference + float(away.min() + away.max()) / 2


def _epochs(parameters: FromTracksParameters, recording: Reports) -> Array:
    start, end = float(recording.time.min()), float(recording.time.max())
    available = math.floor((end - start) / parameters.interval + 1e-9) + 1
    count = available if parameters.scans is None else min(parameters.scans, available)
    if count > MAX_SCANS:
        raise LimitExceededError(f"{count} scans exceed {MAX_SCANS}: raise --interval or give --scans")
    return start + parameters.interval * np.arange(count)
