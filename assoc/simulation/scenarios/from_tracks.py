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

from assoc._parameters import Parameters, described
from assoc._types import Array
from assoc.errors import LimitExceededError
from assoc.recordings.flights.cleaning import clean
from assoc.recordings.flights.reports import ALTITUDE_UNITS, COLUMNS, SPEED_UNITS, Reports, read_flight_reports
from assoc.scene.geodesy import east_north_up
from assoc.scene.scene import Scene
from assoc.simulation.flights import STEP
from assoc.simulation.memory import MOST, require_scene_memory
from assoc.simulation.observation import observe, velocities_from
from assoc.simulation.radars import on_circle, radars_over
from assoc.simulation.scenarios.three_radar import REFERENCE_RANGE, around
from assoc.simulation.turning import Path, observe_in_turns, parse_turns

EARTH_RADIUS = 6_371_000.0
MAX_SCANS = 1_000_000
# m/s: a velocity that differs by more from that of the positions is not believed
_STRANGE = 60.0


def _column(meaning: str, unit: str) -> Any:
    names = ", ".join(COLUMNS[meaning])
    return described(None, f"column of the {meaning}{unit} (else the first of: {names})")


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
    altitude_unit: Literal["m", "ft"] = described("m", "unit of the altitudes")
    speed_unit: Literal["m/s", "kt"] = described(
        "m/s", "unit of velocity and vertrate; with kt the latter is in feet per minute"
    )
    interval: float = described(10.0, "seconds from scan to scan (positions are interpolated)")
    max_gap: float = described(60.0, "no target where its reports are further apart than this, seconds")
    clean: bool = described(True, "leave out repeated positions, mend altitudes that cannot be right")
    scans: int | None = described(None, "number of scans (without: the whole recording)")
    radars: int = described(3, "number of radars (range, azimuth, elevation)")
    turns: str | None = described(
        None,
        "seconds for a turn of each radar, with commas: each plot then has its own time (without: all measure at once)",
    )
    spread: float = described(0.25, "distance of the radars from the middle, as a share of the traffic's diagonal")
    noise: float = described(50.0, "standard deviation of range, and across the line of sight at 50 km, metres")
    detection_probability: float = described(0.9, "P_d of each radar")
    false_alarms: float = described(1.0, "mean false alarms per radar and scan")
    range_rate_noise: float = described(0.0, "standard deviation of range rates, m/s; 0: the radars measure none")

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


def frame_velocities(reports: Reports, points: Array, origin: tuple[float, float, float]) -> Array:
    """Velocities in a scene's frame from those east, north and up at each target, (n, 3), m/s; NaN where not known.

    `points` (n, 3), metres, are where the targets are in the frame, whose plane touches the ellipsoid at `origin`.
    """
    velocity = np.full((len(reports), 3), np.nan)
    known = ~np.isnan(reports.velocity).any(axis=1)
    lat, lon, height = reports.latitude[known], reports.longitude[known], reports.height[known]
    east, north, up = reports.velocity[known].T
    # a second later, by the radii of curvature that the frame's own formula gives
    tiny = 1e-6
    metres_north = np.linalg.norm(east_north_up(lat + tiny, lon, height, origin) - points[known], axis=1) / tiny
    metres_east = np.linalg.norm(east_north_up(lat, lon + tiny, height, origin) - points[known], axis=1) / tiny
    later = east_north_up(lat + north / metres_north, lon + east / np.maximum(metres_east, 1.0), height + up, origin)
    velocity[known] = later - points[known]
    return velocity


def resample(
    reports: Reports, points: Array, times: Array, max_gap: float, velocities: Array | None = None
) -> tuple[list[Array], list[Array]]:
    """Ids (T_k,) and positions (T_k, 3) of the targets at each of the times, on curves through neighbouring reports.

    Between two reports a target follows the cubic (Hermite) curve of their positions and velocities. A velocity that is
    unknown (NaN), or does not fit the positions, is that of the parabola through the neighbouring reports; where these
    are missing, or the curve would leave the straight line by more than a fourth of its length, the target flies
    straight. Between reports further apart than `max_gap`, s, it is absent. `points` and `velocities`, (n, 3), are in
    the scene's frame.
    """
    ids: list[list[int]] = [[] for _ in times]
    positions: list[list[Array]] = [[] for _ in times]
    bounds = np.flatnonzero(np.diff(reports.target)) + 1
    for rows in np.split(np.arange(len(reports)), bounds):
        stamps, target = reports.time[rows], int(reports.target[rows[0]])
        flown = None if velocities is None else velocities[rows]
        after = np.clip(np.searchsorted(stamps, times), 0, len(stamps) - 1)
        before = np.where(stamps[after] == times, after, np.maximum(after - 1, 0))
        gap = stamps[after] - stamps[before]
        present = np.flatnonzero((times >= stamps[0]) & (times <= stamps[-1]) & (gap <= max_gap))
        found = along(stamps, points[rows], times[present], max_gap, flown)
        for k, point in zip(present.tolist(), found, strict=True):
            ids[k].append(target)
            positions[k].append(point)
    return (
        [np.array(targets, dtype=np.int64) for targets in ids],
        [np.array(found, dtype=np.float64).reshape(-1, 3) for found in positions],
    )


def along(stamps: Array, points: Array, times: Array, max_gap: float, velocities: Array | None = None) -> Array:
    """Positions of one target at times (k,) within its reports' stamps; see `resample`."""
    slopes = _slopes(stamps, points, max_gap, velocities)
    j = np.clip(np.searchsorted(stamps, times), 0, len(stamps) - 1)
    i = np.where(stamps[j] == times, j, np.maximum(j - 1, 0))
    gap = stamps[j] - stamps[i]
    share = np.divide(times - stamps[i], gap, out=np.zeros(len(times)), where=gap > 0)
    return _on_curve(points[i], points[j], slopes[i], slopes[j], gap, share)


def _slopes(time: Array, point: Array, max_gap: float, given: Array | None) -> Array:
    """Velocities at the reports of one target, (n, 3)."""
    count = len(time)
    if count < 2:
        return np.zeros((count, 3))
    step = np.diff(time)
    rate = np.diff(point, axis=0) / step[:, None]
    near = step <= max_gap
    slope = np.zeros((count, 3))
    slope[:-1], slope[-1] = rate, rate[-1]
    slope[1:][~np.append(near[1:], False)] = rate[~np.append(near[1:], False)]
    inner = near[:-1] & near[1:]
    share = (step[:-1] / (step[:-1] + step[1:]))[inner, None]
    # the parabola through three reports: the nearer rate counts more
    slope[1:-1][inner] = (1.0 - share) * rate[:-1][inner] + share * rate[1:][inner]
    if given is not None:
        fits = ~np.isnan(given).any(axis=1) & (np.linalg.norm(np.nan_to_num(given) - slope, axis=1) < _STRANGE)
        slope[fits] = given[fits]
    return slope


def _on_curve(start: Array, end: Array, v: Array, w: Array, gap: Array, share: Array) -> Array:
    """Points of cubic curves at shares of their way; straight where the curve would bulge too far."""
    t = share[:, None]
    chord = end - start
    straight = start + t * chord
    # deviation from the chord by the velocities' deviation from the mean velocity
    a, b = gap[:, None] * v - chord, gap[:, None] * w - chord
    bulge = t * (1.0 - t) * ((1.0 - t) * a - t * b)
    length = np.linalg.norm(chord, axis=1)
    bent = np.maximum(np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)) > length
    bulge[bent] = 0.0
    return straight + bulge
