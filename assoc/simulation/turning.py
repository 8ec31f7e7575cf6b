"""Radars with turning antennas: every plot has the time at which the antenna passed the target."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.scene.own_times import looked_at
from assoc.scene.scene import Scene
from assoc.scene.truth import Truth
from assoc.sensors.base import Sensor, wrap_angle
from assoc.simulation.antenna import dwells
from assoc.simulation.observation import resolved

FULL_TURN = 2.0 * math.pi


class Path(NamedTuple):
    """Where a target is while it is there, in steps much shorter than a turn."""

    target: int
    times: Array
    """(K,), ascending, seconds."""
    positions: Array
    """(K, 3), metres."""
    velocities: Array
    """(K, 3), m/s."""

    def at(self, times: Array) -> tuple[Array, Array]:
        """Positions and velocities at times (n,) within the path's."""
        columns = np.concatenate([self.positions, self.velocities], axis=1).T
        found = np.column_stack([np.interp(times, self.times, column) for column in columns])
        return found[:, :3], found[:, 3:]


def parse_turns(text: str | float, radars: int | None = None) -> list[float]:
    """Seconds for a turn of each radar, from a text with commas or one number; as many as there are radars."""
    try:
        turns = [float(part) for part in str(text).split(",")]
    except ValueError:
        turns = []
    if not turns or not all(0.0 < turn < math.inf for turn in turns):
        raise InvalidInputError(f"turns: expected seconds for a turn of each radar, like 4,5,5.5, got {text!r}")
    if radars is not None and len(turns) != radars:
        raise InvalidInputError(f"turns: expected as many as there are radars, {radars}, got {len(turns)}: {text!r}")
    return turns


def observe_in_turns(
    sensors: Sequence[Sensor],
    turns: Sequence[float],
    start: float,
    times: Array,
    paths: Sequence[Path],
    rng: np.random.Generator,
    *,
    region: Array | None = None,
    name: str = "",
) -> Scene:
    """Let turning radars observe targets.

    Antennas turn clockwise from a random azimuth. When one passes a target in the field of view, it is detected with
    probability P_d and measured with Gaussian noise; false alarms are those of `assoc.simulation.observation.observe`
    in each turn, at the time at which the antenna points at them. A scan holds the measurements since the one before.

    All sensors measure an azimuth; `turns` are seconds for a turn of each, none shorter than the time between two
    scans. The first scan begins at `start`, seconds, and `times` (K,) are the ends of all. The scene has the times of
    measurements, the sectors scanned, and the truth at the end of each scan.
    """
    if any(sensor.platform is not None for sensor in sensors):
        raise InvalidInputError("sensors: turning antennas on platforms are not simulated")
    edges = np.append(start, times)
    if np.diff(edges).max() > min(turns) * (1 + 1e-9):
        raise InvalidInputError(
            f"interval: expected at most the shortest turn, {min(turns):g} s, got {np.diff(edges).max():g} s"
        )
    rows: list[list[Array]] = [[] for _ in times]
    stamps: list[list[Array]] = [[] for _ in times]
    sources: list[list[Array]] = [[] for _ in times]
    sectors = np.empty((len(times), len(sensors), 2))
    for s, (sensor, turn) in enumerate(zip(sensors, turns, strict=True)):
        # the antenna pointed north so many seconds before time 0
        ahead = rng.uniform(0.0, turn)
        hits = _resolved(sensor, turn, [_hits(sensor, turn, ahead, path, edges, rng) for path in paths], rng)
        hits.append(_clutter(sensor, turn, ahead, edges, rng))
        when, values, source = (np.concatenate(part) for part in zip(*hits, strict=True))
        for axis in range(sensor.dim):
            if sensor.angular[axis]:
                values[:, axis] = wrap_angle(values[:, axis])
        values = sensor.folded(values)
        scan = np.searchsorted(times, when)
        for k in range(len(times)):
            mine = np.flatnonzero(scan == k)
            mine = mine[np.argsort(when[mine], kind="stable")]
            rows[k].append(values[mine])
            stamps[k].append(when[mine])
            sources[k].append(source[mine])
        # clockwise: a scan ends at the smaller azimuth
        sectors[:, s, 0] = wrap_angle(math.pi / 2 - FULL_TURN * (edges[1:] + ahead) / turn)
        sectors[:, s, 1] = sectors[:, s, 0] + np.minimum(FULL_TURN * np.diff(edges) / turn, FULL_TURN)
    truth = _truth(paths, times, sources)
    return Scene(sensors, times, rows, region, truth, name, stamps, sectors)  # type: ignore[arg-type]


def _hits(
    sensor: Sensor, turn: float, ahead: float, path: Path, edges: Array, rng: np.random.Generator
) -> tuple[Array, Array, Array, Array]:
    """Times, measurements and sources of the detections of one target, and the measurements without noise."""
    when = dwells(path.times + ahead, path.positions - sensor.position, turn) - ahead
    when = when[(when > edges[0]) & (when <= edges[-1])]
    positions, velocities = path.at(when)
    exact = sensor.measure(positions, velocities) if sensor.measures_velocity else sensor.measure(positions)
    seen = (rng.random(len(when)) < sensor.detection_probability) & sensor.sees(exact)
    noise = rng.standard_normal((int(seen.sum()), sensor.dim)) @ np.linalg.cholesky(sensor.covariance).T
    return when[seen], exact[seen] + noise, np.full(int(seen.sum()), path.target), exact[seen]


def _resolved(
    sensor: Sensor, turn: float, hits: list[tuple[Array, Array, Array, Array]], rng: np.random.Generator
) -> list[tuple[Array, Array, Array]]:
    """Detections of all targets with one in place of those that the sensor does not resolve."""
    if sensor.resolution is None or not hits:
        return [found[:3] for found in hits]
    when, values, source, exact = (np.concatenate(part) for part in zip(*hits, strict=True))
    kept, shift = resolved(sensor, exact, when, turn, rng)
    return [(when[kept], (values + shift)[kept], source[kept])]


def _clutter(
    sensor: Sensor, turn: float, ahead: float, edges: Array, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    low, high = sensor.field_of_view.T
    axis = sensor.components.index("azimuth")
    sector = np.array([low[axis], high[axis]])
    # as many in a turn in the field of view as the sensor has false alarms; the antenna turns on outside of it, too
    rate = sensor.false_alarm_rate * FULL_TURN / (sector[1] - sector[0]) / turn
    count = int(rng.poisson(rate * (edges[-1] - edges[0])))
    when = rng.uniform(edges[0], edges[-1], count)
    values = rng.uniform(low, high, (count, sensor.dim))
    values[:, axis] = math.pi / 2 - FULL_TURN * (when + ahead) / turn
    kept = looked_at(sector, values[:, axis])
    return when[kept], values[kept], np.full(int(kept.sum()), -1)


def _truth(paths: Sequence[Path], times: Array, sources: Sequence[Sequence[Array]]) -> Truth:
    ids: list[Array] = []
    positions: list[Array] = []
    for time in times.tolist():
        present = [path for path in paths if path.times[0] <= time <= path.times[-1]]
        ids.append(np.array([path.target for path in present], dtype=np.int64))
        positions.append(np.concatenate([path.at(np.array([time]))[0] for path in present] or [np.zeros((0, 3))]))
    return Truth(ids, positions, sources)
