"""Epochs: the measurements of a scene grouped for registration, with velocities where needed."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from assoc._types import Array
from assoc.registration.correction import pointed_at
from assoc.registration.pairing import Epoch
from assoc.scene.scene import Scene
from assoc.sensors import BearingSensor, Sensor
from assoc.sensors.base import ANGLES

FASTEST = 700.0
"""Largest speed of a target, m/s."""
_SIGMAS = 4.0
_NEIGHBOURS = ((-1, 1), (-1, 2), (1, -2), (1, 2), (-1, -2), (2, -2))
_ACCELERATION = 20.0
"""Largest acceleration, m/s^2."""


def scene_epochs(scene: Scene, *, moving: bool) -> list[Epoch]:
    """Epochs of a scene; with `moving` the velocities of targets too, which clocks' biases need.

    Where measurements have their own times an epoch holds as many scans as the slowest antenna needs for a turn, and of
    them the measurements whose target's velocity is known: these can be moved to the epoch's middle. Of a faster
    antenna those of one turn are taken, about the middle. Late measurements, from before the previous scan, are not.
    """
    groups = scan_groups(scene)
    if scene.measurement_times is None and len(groups) == scene.num_scans:
        velocities = scene_velocities(scene) if moving else None
        scans = [scene.scan(k) for k in range(scene.num_scans)]
        return [
            Epoch(scan.time, scan.measurements, scan.own_times(), None if velocities is None else velocities[k])
            for k, scan in enumerate(scans)
        ]
    velocities = scene_velocities(scene)
    epochs = []
    interval = float(np.median(np.diff(scene.times))) if scene.num_scans > 1 else math.inf
    turns = [interval * scans if scans > 1 else math.inf for scans in _scans_of_turns(scene)]
    for group in groups:
        parts = [(scene.measurements[k], scene.scan(k).own_times(), velocities[k]) for k in group]
        begin = float(scene.times[group[0] - 1]) if group[0] else -math.inf
        measured, times, speeds = (
            [np.concatenate([part[i][s] for part in parts]) for s in range(len(scene.sensors))] for i in range(3)
        )
        for s, stamps in enumerate(times):
            # a late one would move the middle back, before that of the previous epoch
            late = stamps < begin
            measured[s], times[s], speeds[s] = measured[s][~late], stamps[~late], speeds[s][~late]
        every = np.concatenate(times)
        middle = float(0.5 * (every.min() + every.max())) if len(every) else float(scene.times[group[0]])
        for s, sensor in enumerate(scene.sensors):
            # a bearing has no velocity: that of its tuple is used
            known = ~np.isnan(speeds[s][:, 0]) | isinstance(sensor, BearingSensor)
            # of two plots of a target the tuple would take the one that fits better, and residuals be too small
            known &= np.abs(times[s] - middle) <= 0.5 * turns[s]
            measured[s], times[s], speeds[s] = measured[s][known], times[s][known], speeds[s][known]
        epochs.append(Epoch(middle, measured, times, speeds))
    return epochs


def scan_groups(scene: Scene) -> list[list[int]]:
    """Groups of scans in which every sensor covers all directions: single, or as many as the slowest turn takes."""
    together = max((math.ceil(scans - 0.05) for scans in _scans_of_turns(scene)), default=1)
    return [list(range(k, min(k + together, scene.num_scans))) for k in range(0, scene.num_scans, together)]


def _scans_of_turns(scene: Scene) -> list[float]:
    """Scans that each sensor needs for all directions; 1 where no sectors are known."""
    if scene.sectors is None:
        return [1.0] * len(scene.sensors)
    widths = scene.sectors[..., 1] - scene.sectors[..., 0]
    return [2.0 * math.pi / float(width[width > 0].mean()) if (width > 0).any() else 1.0 for width in widths.T]


def scene_velocities(scene: Scene) -> list[list[Array]]:
    """Velocities of the targets of all measurements, by scan and sensor; see `target_velocities`."""
    groups = scan_groups(scene)
    found: list[list[Array]] = [[np.zeros((0, 3))] * len(scene.sensors) for _ in range(scene.num_scans)]
    for s, sensor in enumerate(scene.sensors):
        measured = [np.concatenate([scene.measurements[k][s] for k in group]) for group in groups]
        times = [np.concatenate([scene.scan(k).own_times()[s] for k in group]) for group in groups]
        for group, speeds in zip(groups, target_velocities(sensor, times, measured), strict=True):
            cuts = np.cumsum([len(scene.measurements[k][s]) for k in group])[:-1]
            for k, part in zip(group, np.split(speeds, cuts), strict=True):
                found[k][s] = part
    return found


def target_velocities(sensor: Sensor, times: Sequence[Array], measurements: Sequence[Array]) -> list[Array]:
    """Velocity of the target of each measurement of a sensor, (n, 3) for each epoch, m/s.

    It is that of three dwells in a row on a straight line: a sensor's bias moves all its plots alike, so that
    differences between them are nearly free of it. Measurements on no line, or on several, have none: most false alarms
    are such. NaN where unknown, as from a platform; the vertical speed is 0 for sensors that leave the height open.
    """
    unknown = [np.full((len(z), 3), np.nan) for z in measurements]
    if isinstance(sensor, BearingSensor) or sensor.platform is not None or len(measurements) < 2:
        return unknown
    located = sensor.position_part
    positions = [pointed_at(located, np.asarray(z)[:, : located.dim]) for z in measurements]
    sigma = _sigma(located, positions)
    found = unknown
    for k in range(len(positions)):
        here = (positions[k], times[k])
        # epochs before and after, nearer ones first: targets are missed at times, and scenes have ends
        for first, second in _NEIGHBOURS:
            unknown_yet = np.isnan(found[k][:, 0])
            if not unknown_yet.any():
                break
            near, far = k + first, k + second
            if not (0 <= min(near, far) and max(near, far) < len(positions)):
                continue
            fresh = np.full((len(positions[k]), 3), np.nan)
            _fill(fresh, here, (positions[near], times[near]), (positions[far], times[far]), sigma)
            found[k][unknown_yet] = fresh[unknown_yet]
    return found


def _sigma(sensor: Sensor, positions: Sequence[Array]) -> float:
    """Standard deviation of a position along its worst axis, at the farthest usual distance, metres."""
    every = np.concatenate(positions)
    if not len(every):
        return 0.0
    deviations = np.sqrt(np.diagonal(sensor.covariance))
    if "range" not in sensor.components:
        return float(deviations.max())
    distance = float(np.percentile(np.linalg.norm(every - sensor.position, axis=1), 90))
    scales = [distance if name in ANGLES else 1.0 for name in sensor.components[: sensor.dim]]
    return float((deviations * scales).max())


def _fill(
    velocity: Array, here: tuple[Array, Array], near: tuple[Array, Array], far: tuple[Array, Array], sigma: float
) -> None:
    """Write velocities of the measurements `here` from those in `near` and `far` on a line with them."""
    if not (len(here[0]) and len(near[0]) and len(far[0])):
        return
    longest = float(max(np.abs(near[1].max() - here[1].min()), np.abs(here[1].max() - near[1].min())))
    pairs = cKDTree(here[0]).sparse_distance_matrix(
        cKDTree(near[0]), FASTEST * longest + _SIGMAS * sigma, output_type="ndarray"
    )
    i, j = pairs["i"], pairs["j"]
    dt = near[1][j] - here[1][i]
    good = (np.abs(dt) > 1e-6) & (pairs["v"] <= FASTEST * np.abs(dt) + _SIGMAS * sigma)
    i, j, dt = i[good], j[good], dt[good]
    if not len(i):
        return
    rate = (near[0][j] - here[0][i]) / dt[:, None]
    # a first guess with the median time of the far epoch, then the time of the measurement found
    there = here[0][i] + rate * (np.median(far[1]) - here[1][i])[:, None]
    tree = cKDTree(far[0])
    for _ in range(2):
        m = np.asarray(tree.query(there)[1])
        ahead = far[1][m] - here[1][i]
        there = here[0][i] + rate * ahead[:, None]
    apart = np.linalg.norm(far[0][m] - there, axis=1)
    share = np.abs(ahead / dt)
    allowed = _SIGMAS * sigma * np.sqrt(1.0 + share**2 + (1.0 + share) ** 2)
    allowed += 0.5 * _ACCELERATION * np.abs(ahead * (ahead - dt))
    good = (apart <= allowed) & (np.abs(ahead - dt) > 1e-6)
    i, j, m, dt, apart = i[good], j[good], m[good], dt[good], apart[good]
    # of several lines through a measurement the straightest, if it is much straighter than the next
    order = np.lexsort((apart, i))
    i, j, m, dt, apart = (x[order] for x in (i, j, m, dt, apart))
    first = np.ones(len(i), dtype=np.bool_)
    first[1:] = i[1:] != i[:-1]
    rivalled = np.zeros(len(i), dtype=np.bool_)
    rivalled[:-1] = first[:-1] & (i[1:] == i[:-1]) & (apart[1:] < 2.0 * apart[:-1] + sigma)
    chosen = first & ~rivalled
    i, j, m = i[chosen], j[chosen], m[chosen]
    span = far[1][m] - near[1][j]
    velocity[i] = (far[0][m] - near[0][j]) / np.where(np.abs(span) > 1e-6, span, np.nan)[:, None]
