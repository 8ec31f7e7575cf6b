"""Scenes with biases that are known."""

import numpy as np

from assoc.registration import with_biases
from assoc.scene import Scene
from assoc.simulation.observation import observe
from assoc.simulation.radars import on_circle, radar_over

REGION = np.array([[-75e3, 75e3], [-75e3, 75e3], [0.0, 12e3]])


def radars(count=3, noise=50.0, false_alarms=5.0, places=None):
    places = on_circle(np.zeros(3), 60e3, count) if places is None else places
    return [
        radar_over(
            REGION, place, range_noise=noise, angle_noise=noise / 50e3, detection_probability=0.9,
            false_alarm_rate=false_alarms, name=f"radar {number}",
        )
        for number, place in enumerate(places, start=1)
    ]  # fmt: skip


def paths(seed, scans, aircraft=20, interval=4.0):
    """Times, positions (K, T, 3), velocities (T, 3) of straight flights."""
    rng = np.random.default_rng(seed)
    times = interval * np.arange(scans)
    start = rng.uniform([-45e3, -45e3, 3e3], [45e3, 45e3, 11e3], (aircraft, 3))
    heading, speed = rng.uniform(-np.pi, np.pi, aircraft), rng.uniform(120.0, 250.0, aircraft)
    velocity = np.stack([speed * np.cos(heading), speed * np.sin(heading), np.zeros(aircraft)], axis=1)
    return times, start[None] + (times - times.mean())[:, None, None] * velocity[None], velocity


def scene_of(sensors, seed=0, scans=15, aircraft=20):
    times, where, _ = paths(seed, scans, aircraft)
    rng = np.random.default_rng(seed + 1000)
    return observe(sensors, times, [np.arange(aircraft)] * scans, list(where), rng, region=REGION)


def late_scene(sensors, clocks, seed=0, scans=15, aircraft=20):
    """Each sensor's stamps are late by its clock: what it measures was earlier."""
    times, where, velocity = paths(seed, scans, aircraft)
    ids = [np.arange(aircraft)] * scans
    each = [
        observe([sensor], times, ids, list(where - clock * velocity), np.random.default_rng(seed + s), region=REGION)
        for s, (sensor, clock) in enumerate(zip(sensors, clocks, strict=True))
    ]
    measurements = [[one.measurements[k][0] for one in each] for k in range(scans)]
    return Scene(sensors, times, measurements, REGION)


BIASES = (
    {"range": 300.0, "azimuth": np.radians(-0.3), "elevation": np.radians(0.05)},
    {"range": -250.0, "azimuth": np.radians(0.3)},
    {"range": 280.0, "azimuth": np.radians(0.2), "elevation": np.radians(-0.1)},
)


def biased_scene(seed=0, scans=15):
    return with_biases(scene_of(radars(), seed, scans), BIASES)
