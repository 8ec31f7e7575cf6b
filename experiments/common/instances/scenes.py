"""Scenes of one scan whose associations are the benchmark's sensor families.

Units are the library's: metres and radians. Problems are made from scenes by ``assoc.build_problem``.
"""

import math

import numpy as np

from assoc._types import Floats
from assoc.scene import Scene, Truth
from assoc.sensors import BearingSensor, PositionSensor, Radar3D, Sensor

KM = 1000.0


def single_scan(sensors: list[Sensor], positions: Floats, region: Floats, rng: np.random.Generator, name: str) -> Scene:
    """Let sensors see targets once: detections with noise, Poisson false alarms, all in random order."""
    measurements, sources = [], []
    for sensor in sensors:
        exact = sensor.measure(positions)
        # The target must be in view, not its noisy measurement: noise may carry that over the edge.
        seen = np.flatnonzero(sensor.in_view(exact) & (rng.random(len(positions)) < sensor.detection_probability))
        noisy = exact[seen] + rng.multivariate_normal(np.zeros(sensor.dim), sensor.covariance, len(seen))
        low, high = sensor.field_of_view.T
        alarms = low + (high - low) * rng.random((rng.poisson(sensor.false_alarm_rate), sensor.dim))
        order = rng.permutation(len(seen) + len(alarms))
        measurements.append(np.concatenate([noisy, alarms])[order])
        sources.append(np.concatenate([seen, np.full(len(alarms), -1)])[order])
    truth = Truth([np.arange(len(positions))], [positions], [sources])
    return Scene(sensors, np.zeros(1), [measurements], region=region, truth=truth, name=name)


def gated(sensors: int, targets: int, seed: int) -> Scene:
    """Position sensors over a box, the standard test of sparse solvers.

    Sensors measure x, y, z with 0.1 km, P_d 0.9, and see the whole box; targets are uniform in
    5 x 5 x 2 km (up to 300) or 10 x 10 x 5 km; false alarms are Poisson with mean 0.1 T a sensor.
    """
    rng = np.random.default_rng(seed)
    extent = np.array([5.0, 5.0, 2.0] if targets <= 300 else [10.0, 10.0, 5.0]) * KM
    region = np.stack([np.zeros(3), extent], axis=1)
    group: list[Sensor] = [
        PositionSensor(
            name=f"position {s + 1}",
            position=extent / 2,
            noise=np.full(3, 0.1 * KM),
            detection_probability=0.9,
            false_alarm_rate=0.1 * targets,
            field_of_view=region,
        )
        for s in range(sensors)
    ]
    return single_scan(group, rng.random((targets, 3)) * extent, region, rng, f"gated {sensors} x {targets}")


def ghost(targets: int, seed: int) -> Scene:
    """Three bearing-only sensors whose lines cross in many places where nothing is.

    Sensors at (0, 0), (50, -10), (100, 0) km measure azimuth with 5 mrad, P_d 0.95, one false alarm per
    scan in the half circle towards the field, which is 100 x 100 km with targets uniform in it.
    """
    rng = np.random.default_rng(seed)
    places = np.array([[0.0, 0.0, 0.0], [50.0, -10.0, 0.0], [100.0, 0.0, 0.0]]) * KM
    sensors: list[Sensor] = [
        BearingSensor(
            name=f"bearing {s + 1}",
            position=place,
            noise=np.array([5e-3]),
            detection_probability=0.95,
            false_alarm_rate=1.0,
            field_of_view=np.array([[0.0, math.pi]]),
        )
        for s, place in enumerate(places)
    ]
    region = np.array([[0.0, 100.0], [0.0, 100.0], [-0.001, 0.001]]) * KM
    positions = np.zeros((targets, 3))
    positions[:, :2] = rng.random((targets, 2)) * 100.0 * KM
    return single_scan(sensors, positions, region, rng, f"ghost {targets}")


def radar_field(targets: int, seed: int) -> Scene:
    """Three radars over a square whose area grows with the number of targets: 0.1 per square kilometre.

    Range noise 50 m, azimuth and elevation 0.5 mrad, P_d 0.9, false alarms 2 % of the targets, heights
    0.5 to 12 km. The radars stand around the middle, so angles grow worse towards the edge.
    """
    rng = np.random.default_rng(seed)
    side = math.sqrt(targets / 0.1) * KM
    region = np.array([[-side / 2, side / 2], [-side / 2, side / 2], [0.5 * KM, 12.0 * KM]])
    reach = 1.2 * side
    sensors: list[Sensor] = [
        Radar3D(
            name=f"radar {s + 1}",
            position=np.array([math.cos(angle), math.sin(angle), 0.0]) * 0.3 * side,
            noise=np.array([50.0, 5e-4, 5e-4]),
            detection_probability=0.9,
            false_alarm_rate=0.02 * targets,
            field_of_view=np.array([[0.0, reach], [-math.pi, math.pi], [0.0, math.pi / 2]]),
        )
        for s, angle in enumerate(2 * math.pi * np.arange(3) / 3)
    ]
    positions = region[:, 0] + (region[:, 1] - region[:, 0]) * rng.random((targets, 3))
    return single_scan(sensors, positions, region, rng, f"radar field {targets}")


def three_radar(seed: int) -> Scene:
    """Return the scene of the ant colony paper: three targets, three radars, 100 scans."""
    from assoc.simulation import simulate

    return simulate("three-radar", seed=seed)
