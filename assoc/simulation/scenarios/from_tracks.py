"""Recorded trajectories (time, id, latitude, longitude, altitude in a CSV file), seen by simulated radars.

The scene's frame is the plane that touches the WGS-84 ellipsoid in the middle of the traffic: x east,
y north, z up. The radars stand on the ground around that middle. Terrain and the radio horizon are left out:
every radar sees all traffic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from assoc._parameters import Parameters
from assoc._types import Array
from assoc.errors import InvalidInputError, LimitExceededError
from assoc.scene.scene import Scene
from assoc.simulation.flights import STEP
from assoc.simulation.geodesy import east_north_up
from assoc.simulation.memory import MOST, require_scene_memory
from assoc.simulation.observation import observe, velocities_from
from assoc.simulation.radars import on_circle, radar_over
from assoc.simulation.scenarios.three_radar import REFERENCE_RANGE, around
from assoc.simulation.turning import Path, observe_in_turns, parse_turns

COLUMNS = {
    "time": ("time", "timestamp"),
    "id": ("id", "track_id", "icao24"),
    "latitude": ("lat", "latitude"),
    "longitude": ("lon", "longitude"),
    "altitude": ("altitude", "geoaltitude", "baroaltitude"),
}
"""Where no column is named, the first of these that the file has is taken."""

EARTH_RADIUS = 6_371_000.0
MAX_SCANS = 1_000_000


def _column(meaning: str, unit: str) -> Any:
    names = ", ".join(COLUMNS[meaning])
    return field(
        default=None, metadata={"help": f"column of the {meaning}{unit} (else the first of: {names})"}
    )


@dataclass(frozen=True)
class FromTracksParameters(Parameters):
    """Parameters of recorded trajectories observed by simulated radars."""

    file: str = field(
        metadata={"help": "CSV file of the trajectories", "positional": True, "in_title": False}
    )
    time_column: str | None = _column("time", ", seconds")
    id_column: str | None = _column("id", "")
    latitude_column: str | None = _column("latitude", ", degrees")
    longitude_column: str | None = _column("longitude", ", degrees")
    altitude_column: str | None = _column("altitude", ", metres")
    interval: float = field(
        default=10.0, metadata={"help": "seconds from scan to scan (positions are interpolated)"}
    )
    max_gap: float = field(
        default=60.0, metadata={"help": "no target where its reports are further apart than this, seconds"}
    )
    scans: int | None = field(
        default=None, metadata={"help": "number of scans (without: the whole recording)"}
    )
    radars: int = field(default=3, metadata={"help": "number of radars (range, azimuth, elevation)"})
    turns: str | None = field(
        default=None,
        metadata={
            "help": "seconds for a turn of each radar, with commas: each plot then has its own time "
            "(without: all radars look at once)"
        },
    )
    spread: float = field(
        default=0.25,
        metadata={"help": "distance of the radars from the middle, as a share of the traffic's diagonal"},
    )
    noise: float = field(
        default=50.0,
        metadata={"help": "standard deviation of range, and across the line of sight at 50 km, metres"},
    )
    detection_probability: float = field(default=0.9, metadata={"help": "P_d of each radar"})
    false_alarms: float = field(default=1.0, metadata={"help": "mean false alarms per radar and scan"})
    range_rate_noise: float = field(
        default=0.0, metadata={"help": "standard deviation of range rates, m/s; 0: the radars measure none"}
    )

    def __post_init__(self) -> None:
        self._whole("radars", most=MOST)
        if self.scans is not None:
            self._whole("scans", most=MAX_SCANS)
        self._number("interval", "max_gap", "noise", "false_alarms", above=0.0)
        self._number("spread", "range_rate_noise", least=0.0)
        if self.turns is not None:
            parse_turns(self.turns, self.radars)
        self._probability("detection_probability")


@dataclass(frozen=True, eq=False)
class Recording:
    """Reports of a file: time (s), number of the target, place (rad, rad, m), sorted by target and time."""

    time: Array
    target: Array
    latitude: Array
    longitude: Array
    height: Array


def simulate(parameters: FromTracksParameters, rng: np.random.Generator, name: str) -> Scene:
    """Simulate the scene; see `assoc.simulation.simulate`."""
    p = parameters
    recording = read(p)
    origin = (_middle(recording.latitude), _middle(recording.longitude), 0.0)
    reports = east_north_up(recording.latitude, recording.longitude, recording.height, origin)
    times = _epochs(p, recording)
    targets = len(np.unique(recording.target))
    require_scene_memory(len(times), p.radars, targets, p.false_alarms, "scans radars targets false_alarms")
    ids, positions = resample(recording, reports, times, p.max_gap)
    velocities = velocities_from(times, ids, positions)
    fastest = max(float(np.linalg.norm(one, axis=1).max(initial=0.0)) for one in velocities)
    region = around(reports, 0.01)
    diagonal = float(np.hypot(*(region[:2, 1] - region[:2, 0])))
    places = on_circle(np.zeros(3), p.spread * diagonal, p.radars)
    # the ground falls away from the tangent plane: 1 km at 113 km
    places[:, 2] = np.sqrt(np.maximum(EARTH_RADIUS**2 - (places[:, :2] ** 2).sum(axis=1), 0.0)) - EARTH_RADIUS
    sensors = [
        radar_over(
            region,
            place,
            range_noise=p.noise,
            angle_noise=p.noise / REFERENCE_RANGE,
            detection_probability=p.detection_probability,
            false_alarm_rate=p.false_alarms,
            name=f"radar {number}",
            range_rate_noise=p.range_rate_noise,
            fastest=fastest,
        )
        for number, place in enumerate(places, start=1)
    ]
    if p.turns is not None:
        turns, start = parse_turns(p.turns, p.radars), float(times[0]) - p.interval
        paths = _paths(recording, reports, p.max_gap)
        return observe_in_turns(sensors, turns, start, times, paths, rng, region=region, name=name)
    return observe(sensors, times, ids, positions, rng, region=region, name=name, velocities=velocities)


def _paths(recording: Recording, reports: Array, max_gap: float) -> list[Path]:
    """The flights in fine steps, one path for each part without a gap."""
    new = (np.diff(recording.target) != 0) | (np.diff(recording.time) > max_gap)
    paths = []
    for rows in np.split(np.arange(len(recording.time)), np.flatnonzero(new) + 1):
        own, places = recording.time[rows], reports[rows]
        count = max(math.ceil((own[-1] - own[0]) / STEP), 1)
        if len(rows) > 1:
            times = np.linspace(own[0], own[-1], count + 1)
            fine = np.column_stack([np.interp(times, own, axis) for axis in places.T])
            paths.append(Path(int(recording.target[rows[0]]), times, fine, np.gradient(fine, times, axis=0)))
    return paths


def read(parameters: FromTracksParameters) -> Recording:
    """Read the CSV file; rows without a time, an identity or a place are left out.

    Raises
    ------
    InvalidInputError
        The file or a column is missing, or holds what is not a number; the message begins with the file.
    """
    import pandas as pd

    path = parameters.file
    try:
        header = list(pd.read_csv(path, nrows=0).columns)
        chosen = {meaning: _choose(path, header, meaning, parameters) for meaning in COLUMNS}
        if len(set(chosen.values())) < len(chosen):
            raise InvalidInputError(
                f"{path}: the columns must be different, got {', '.join(chosen.values())}"
            )
        table = pd.read_csv(path, usecols=list(chosen.values()), dtype={chosen["id"]: str}, low_memory=False)
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except InvalidInputError:
        raise
    except ValueError as error:  # pandas' parser errors and UnicodeDecodeError are ValueErrors
        reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise InvalidInputError(f"{path}: is not a CSV file ({reason})") from None
    columns = {}
    for meaning in ("time", "latitude", "longitude", "altitude"):
        text = table[chosen[meaning]]
        values = pd.to_numeric(text, errors="coerce").to_numpy(dtype=np.float64)
        wrong = np.isinf(values) | (np.isnan(values) & text.notna().to_numpy())
        if wrong.any():
            row = int(np.argmax(wrong))
            raise InvalidInputError(
                f"{path}: line {row + 2}, column {chosen[meaning]!r}: "
                f"expected a number, got {text.iloc[row]!r}"
            )
        columns[meaning] = values
    known = table[chosen["id"]].notna().to_numpy() & ~np.isnan(np.stack(list(columns.values()))).any(axis=0)
    if not known.any():
        raise InvalidInputError(f"{path}: no row has a time, an identity and a place")
    limits = {"latitude": 90.0, "longitude": 360.0, "altitude": 1e6, "time": 1e12}
    for meaning, limit in limits.items():
        wrong = known & (np.abs(columns[meaning]) > limit)
        if wrong.any():
            row = int(np.argmax(wrong))
            raise InvalidInputError(
                f"{path}: line {row + 2}, column {chosen[meaning]!r}: "
                f"expected at most {limit:g} in size, got {columns[meaning][row]:g}"
            )
    _, target = np.unique(table[chosen["id"]].to_numpy(dtype=str)[known], return_inverse=True)
    time, lat, lon, height = (
        columns[meaning][known] for meaning in ("time", "latitude", "longitude", "altitude")
    )
    order = np.lexsort((time, target))
    # of two reports at one instant the first stays
    first = np.ones(len(order), dtype=bool)
    first[1:] = (np.diff(time[order]) > 0) | (np.diff(target[order]) != 0)
    order = order[first]
    return Recording(
        time[order], target[order], np.radians(lat[order]), np.radians(lon[order]), height[order]
    )


def _choose(path: str, header: list[str], meaning: str, parameters: FromTracksParameters) -> str:
    named = getattr(parameters, f"{meaning}_column")
    candidates = COLUMNS[meaning] if named is None else (named,)
    for candidate in candidates:
        if candidate in header:
            return str(candidate)
    have = ", ".join(str(column)[:30] for column in header[:12])
    raise InvalidInputError(f"{path}: no column {' or '.join(candidates)} for the {meaning}; it has: {have}")


def _middle(angles: Array) -> float:
    """Middle of the smallest interval around angles that do not go around the earth (rad)."""
    reference = float(angles[0])
    away = np.remainder(angles - reference + math.pi, 2 * math.pi) - math.pi
    return reference + float(away.min() + away.max()) / 2


def _epochs(parameters: FromTracksParameters, recording: Recording) -> Array:
    start, end = float(recording.time.min()), float(recording.time.max())
    available = math.floor((end - start) / parameters.interval + 1e-9) + 1
    count = available if parameters.scans is None else min(parameters.scans, available)
    if count > MAX_SCANS:
        raise LimitExceededError(f"{count} scans exceed {MAX_SCANS}: raise --interval or give --scans")
    return start + parameters.interval * np.arange(count)


def resample(
    recording: Recording, reports: Array, times: Array, max_gap: float
) -> tuple[list[Array], list[Array]]:
    """Positions of the targets at given times, interpolated linearly between neighbouring reports.

    Parameters
    ----------
    recording : Recording
    reports : array (n, 3)
        Its positions in the scene's frame, metres.
    times : array (K,)
        Seconds.
    max_gap : float
        Between reports further apart than this (s) a target is absent.

    Returns
    -------
    ids, positions : lists over times of arrays (T_k,) and (T_k, 3)
    """
    ids: list[list[int]] = [[] for _ in times]
    positions: list[list[Array]] = [[] for _ in times]
    bounds = np.flatnonzero(np.diff(recording.target)) + 1
    for rows in np.split(np.arange(len(recording.time)), bounds):
        own, target = recording.time[rows], int(recording.target[rows[0]])
        after = np.clip(np.searchsorted(own, times), 0, len(own) - 1)
        exact = own[after] == times
        before = np.where(exact, after, np.maximum(after - 1, 0))
        gap = own[after] - own[before]
        present = (times >= own[0]) & (times <= own[-1]) & (gap <= max_gap)
        share = np.divide(times - own[before], gap, out=np.zeros(len(times)), where=gap > 0)
        places = reports[rows][before] + share[:, None] * (reports[rows][after] - reports[rows][before])
        for k in np.flatnonzero(present):
            ids[k].append(target)
            positions[k].append(places[k])
    return (
        [np.array(one, dtype=np.int64) for one in ids],
        [np.array(one, dtype=np.float64).reshape(-1, 3) for one in positions],
    )


parameters = FromTracksParameters
