"""Positions of targets between their reports, on cubic curves through positions and known velocities."""

from __future__ import annotations

import numpy as np

from assoc._types import Array
from assoc.recordings.flights.reports import Reports
from assoc.scene.geodesy import east_north_up

_SECOND = 1.0
_STRANGE = 60.0


def frame_velocities(reports: Reports, points: Array, origin: tuple[float, float, float]) -> Array:
    """Velocities in a scene's frame from those east, north and up at each target, (n, 3), m/s; NaN where not known.

    `points` (n, 3), metres, are where the targets are in the frame, whose plane touches the ellipsoid at `origin`.
    """
    velocity = np.full((len(reports), 3), np.nan)
    known = ~np.isnan(reports.velocity).any(axis=1)
    lat, lon, height = reports.latitude[known], reports.longitude[known], reports.height[known]
    east, north, up = (_SECOND * reports.velocity[known]).T
    # a second later, by the radii of curvature that the frame's own formula gives
    tiny = 1e-6
    metres_north = np.linalg.norm(east_north_up(lat + tiny, lon, height, origin) - points[known], axis=1) / tiny
    metres_east = np.linalg.norm(east_north_up(lat, lon + tiny, height, origin) - points[known], axis=1) / tiny
    later = east_north_up(lat + north / metres_north, lon + east / np.maximum(metres_east, 1.0), height + up, origin)
    velocity[known] = (later - points[known]) / _SECOND
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
