"""The measurements of a scene as registration takes them: scan by scan, with velocities where these are needed."""

from __future__ import annotations

import numpy as np

from assoc._types import Array
from assoc.registration.pairing import Looks
from assoc.registration.velocities import look_velocities
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene


def scene_looks(scene: Scene, *, moving: bool) -> list[Looks]:
    """Looks of a scene; with `moving` the velocities of targets too, which clocks' biases need."""
    velocities = scene_velocities(scene) if moving else None
    return [one_look(scene.scan(k), None if velocities is None else velocities[k]) for k in range(scene.num_scans)]


def one_look(scan: Scan, velocities: list[Array] | None = None) -> Looks:
    """Looks of one scan."""
    times = [np.full(len(z), scan.time) for z in scan.measurements]
    return Looks(scan.time, scan.measurements, times, velocities)


def scene_velocities(scene: Scene) -> list[list[Array]]:
    """Velocities of the targets of all measurements, by scan and sensor; see `look_velocities`."""
    by_sensor = []
    for s, sensor in enumerate(scene.sensors):
        measured = [scan[s] for scan in scene.measurements]
        times = [np.full(len(z), time) for z, time in zip(measured, scene.times, strict=True)]
        by_sensor.append(look_velocities(sensor, times, measured))
    return [[own[k] for own in by_sensor] for k in range(scene.num_scans)]
