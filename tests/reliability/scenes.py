"""Scenes at the edges: sensors on one spot, targets on sensors, a millimetre and a million kilometres."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from assoc.scene import Scene
from assoc.sensors import BearingSensor, PositionSensor, Radar2D, Radar3D, Sensor

Floats = NDArray[np.float64]
CIRCLE = [-math.pi, math.pi]
KINDS = "RrbPp"


def _sensor(kind: str, place: Floats, scale: float, noise: float, detection: float, rate: float) -> Sensor:
    """Make a sensor that sees ``scale`` metres far and measures with ``noise`` (share of that, and rad)."""
    common = {"position": place, "detection_probability": detection, "false_alarm_rate": rate}
    far = max(4.0 * scale, 1e-11)
    if kind == "R":
        view = [[0.0, far], CIRCLE, [-math.pi / 2, math.pi / 2]]
        return Radar3D(noise=[max(noise * scale, 1e-11), noise, noise], field_of_view=view, **common)
    if kind == "r":
        return Radar2D(noise=[max(noise * scale, 1e-11), noise], field_of_view=[[0.0, far], CIRCLE], **common)
    if kind == "b":
        return BearingSensor(noise=[noise], **common)
    dims = 3 if kind == "P" else 2
    size = max(noise * scale, 1e-11)
    return PositionSensor(noise=[size] * dims, field_of_view=[[-far, far]] * dims, **common)


def _places(rng: np.random.Generator, count: int, scale: float) -> Floats:
    """Draw places of sensors: scattered, all on one spot, or on one line."""
    style = rng.integers(4)
    if style == 0:
        return np.repeat(rng.uniform(-scale, scale, (1, 3)), count, axis=0)
    if style == 1:
        return np.outer(rng.uniform(-scale, scale, count), [1.0, 0.0, 0.0])
    if style == 2:
        return np.zeros((count, 3))
    return rng.uniform(-scale, scale, (count, 3))


def _targets(rng: np.random.Generator, places: Floats, count: int, scale: float) -> Floats:
    """Draw targets: anywhere, on a sensor, a hair beside it, straight above, behind (-pi), far away."""
    truth = rng.uniform(-scale, scale, (count, 3))
    for i in range(count):
        spot = places[rng.integers(len(places))]
        style = rng.integers(7)
        if style == 0:
            truth[i] = spot
        elif style == 1:
            truth[i] = spot + rng.normal(0.0, 1e-9 * scale, 3)
        elif style == 2:
            truth[i] = spot + [0.0, 0.0, rng.uniform(-scale, scale)]
        elif style == 3:
            truth[i] = spot + [-abs(rng.uniform(0.0, scale)), rng.choice([0.0, -0.0, 1e-300, -1e-300]), 0.0]
        elif style == 4:
            truth[i] = spot + scale * 3.0 * rng.normal(size=3)
        elif style == 5 and i:
            truth[i] = truth[i - 1]
    return truth


def draw(seed: int, number: int) -> tuple[Scene, Floats, float]:
    """Draw a scene of one scan, where its targets are, and how wide it is (metres)."""
    rng = np.random.default_rng([seed, number])
    scale = float(rng.choice([1e-3, 1.0, 1e3, 1e5, 1e7, 1e9]))
    noise = float(rng.choice([1e-9, 1e-6, 1e-3, 1e-2, 0.3]))
    detection = float(rng.choice([0.9, 0.5, 1e-6, 1.0 - 1e-12]))
    rate = float(rng.choice([1.0, 1e-6, 1e3]))
    kinds = [str(kind) for kind in rng.choice(list(KINDS), int(rng.integers(1, 5)))]
    places = _places(rng, len(kinds), scale)
    sensors = [_sensor(k, p, scale, noise, detection, rate) for k, p in zip(kinds, places, strict=True)]
    truth = _targets(rng, places, int(rng.integers(1, 4)), scale)
    measured = []
    for sensor in sensors:
        exact = sensor.measure(truth)
        style = rng.integers(3)
        if style:
            exact = exact + rng.standard_normal(exact.shape) * np.sqrt(np.diag(sensor.covariance))
        low, high = sensor.field_of_view.T
        clutter = low + (high - low) * rng.random((int(rng.integers(0, 2)), sensor.dim))
        z = np.vstack([exact, clutter])
        if sensor.kind != "position" and rng.random() < 0.3:
            z = _odd_angles(rng, sensor, z)
        measured.append(z)
    height = max(scale, 1e-6)
    regions: list[Callable[[], Floats | None]] = [
        lambda: None,
        lambda: np.array([[-height, height]] * 3),
        lambda: np.array([[-height, height], [-height, height], [0.0, 0.0]]),
    ]
    region = regions[rng.integers(3)]()
    return Scene(sensors, [0.0], [measured], region=region), truth, scale


def _odd_angles(rng: np.random.Generator, sensor: Sensor, z: Floats) -> Floats:
    """Put angles where they turn over: azimuth at +-pi and whole turns away, elevation at +-pi/2."""
    z = z.copy()
    azimuth = 0 if sensor.kind == "bearing" else 1
    z[:, azimuth] = rng.choice([math.pi, -math.pi, np.nextafter(math.pi, 4.0), 0.0, -0.0, 3.0 * math.pi, 1e6], len(z))
    if sensor.kind == "radar3d":
        z[:, 2] = rng.choice([math.pi / 2, -math.pi / 2, 0.0], len(z))
    return z
