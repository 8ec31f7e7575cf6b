"""Scenes by which tests of what trackers learn are told more, or less, than the simulation knows."""

from dataclasses import replace

import numpy as np

from assoc.filters import ConstantVelocity, ExtendedKalmanFilter
from assoc.scene import Scene
from assoc.sensors import PositionSensor
from assoc.simulation.observation import observe
from assoc.simulation.radars import on_circle, radar_over
from assoc.tracking import TRACKERS
from tests.tracking.stepping import stepped

REGION = np.array([[-30e3, 30e3], [-30e3, 30e3], [0.0, 12e3]])
TARGETS = 8


def radars(noise=80.0, detection_probability=0.9, count=3):
    return [
        radar_over(
            REGION, place, range_noise=noise, angle_noise=noise / 50e3, detection_probability=detection_probability,
            false_alarm_rate=10.0, name=f"radar {s + 1}",
        )
        for s, place in enumerate(on_circle(np.zeros(3), 40e3, count))
    ]  # fmt: skip


def scene_of(sensors, seed, scans=30, turn=0.0):
    """Targets that fly straight, or turn for four of ten scans at a rate (rad/s)."""
    rng = np.random.default_rng(seed)
    times = 4.0 * np.arange(scans)
    rate = np.where(np.arange(scans) % 10 > 5, turn, 0.0)
    heading = rng.uniform(-np.pi, np.pi, TARGETS) + np.cumsum(rate * 4.0)[:, None]
    velocity = 200.0 * np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=-1)
    start = rng.uniform([-10e3, -10e3, 1e3], [10e3, 10e3, 2e3], (TARGETS, 3)) + 1e3 * np.arange(TARGETS)[:, None] * [
        0,
        0,
        1,
    ]
    paths = start + np.cumsum(4.0 * velocity, axis=0)
    return observe(sensors, times, [np.arange(TARGETS)] * scans, list(paths), rng, region=REGION)


def tracked(scene, sensors, name="nearest-neighbour", **options):
    """A tracker that adapts, after a scene of which it is told these sensors."""
    tracker = TRACKERS[name].for_scene(replace(scene, sensors=sensors), adapt=True, **options)
    stepped(tracker, scene, times=True)
    return tracker


def with_returns(scene, count, seed):
    """The scene with plots of each radar from one patch of 3 x 3 km in every scan."""
    rng, low = np.random.default_rng(seed), np.array([14e3, -17e3, 0.0])
    more = [
        [sensor.measure(rng.uniform(low, low + [3e3, 3e3, 200.0], (count, 3))) for sensor in scene.sensors]
        for _ in scene.times
    ]
    both = [
        [np.concatenate(pair) for pair in zip(scan, added, strict=True)]
        for scan, added in zip(scene.measurements, more, strict=True)
    ]
    return Scene(scene.sensors, scene.times, both, scene.region)


def planar(noise):
    """A filter of nearly constant velocity in the plane."""
    return ExtendedKalmanFilter(ConstantVelocity(noise, dimensions=2, kind="continuous"))


def group(seed, speed, spacing, noise, scans=25):
    """Twelve targets in rows of three, seen by one sensor each second: the sensor, and its measurements."""
    rng, view = np.random.default_rng(seed), [[-10e3, 10e3], [-10e3, 10e3]]
    sensor = PositionSensor(
        position=np.zeros(3), noise=[noise] * 2, detection_probability=0.9, false_alarm_rate=5.0, field_of_view=view
    )
    at, plots = spacing * np.stack([np.arange(12) % 3, np.arange(12) // 3], axis=1), []
    for k in range(scans):
        seen = at + [k * speed, 0.0] + rng.normal(0.0, noise, (12, 2))
        plots.append(np.concatenate([seen[rng.random(12) < 0.9], rng.uniform(-10e3, 10e3, (rng.poisson(5.0), 2))]))
    return sensor, plots
