"""Epochs: the measurements of a scene grouped for registration, with velocities where needed."""

from __future__ import annotations

import math

import numpy as np

from assoc._types import Array
from assoc.registration.pairing import Epoch
from assoc.registration.velocities import target_velocities
from assoc.scene.scene import Scene
from assoc.sensors import BearingSensor


def scene_epochs(scene: Scene, *, moving: bool) -> list[Epoch]:
    """Epochs of a scene; with `moving` the velocities of targets too, which clocks' biases need.

    Where measurements have their own times an epoch holds as many scans as the slowest antenna needs for a turn, and of
    them the measurements whose target's velocity is known: these can be moved to the epoch's middle. Late measurements,
    from before the previous scan, are left out.
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
            measured[s], times[s], speeds[s] = measured[s][known], times[s][known], speeds[s][known]
        epochs.append(Epoch(middle, measured, times, speeds))
    return epochs


def scan_groups(scene: Scene) -> list[list[int]]:
    """Groups of scans in which every sensor covers all directions: single, or as many as the slowest turn takes."""
    together = 1
    if scene.sectors is not None:
        widths = scene.sectors[..., 1] - scene.sectors[..., 0]
        turning = [float(width[width > 0].mean()) for width in widths.T if (width > 0).any()]
        together = max((math.ceil(2.0 * math.pi / width - 0.05) for width in turning), default=1)
    return [list(range(k, min(k + together, scene.num_scans))) for k in range(0, scene.num_scans, together)]


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
