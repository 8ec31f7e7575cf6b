"""Sensors, states and plain numpy filters that the tests of filters share."""

import math

import numpy as np

from assoc.filters import ConstantVelocity, Gaussian
from assoc.sensors import BearingSensor, DirectionSensor, PositionSensor, Radar2D, Radar3D

CIRCLE = [-math.pi, math.pi]
RADAR = Radar3D(
    position=[100.0, -200.0, 10.0],
    noise=[30.0, 2e-3, 3e-3],
    field_of_view=[[0.0, 1e6], CIRCLE, [-math.pi / 2, math.pi / 2]],
)
FLAT = Radar2D(position=[100.0, -200.0, 10.0], noise=[30.0, 2e-3], field_of_view=[[0.0, 1e6], CIRCLE])
BEARING = BearingSensor(position=[100.0, -200.0, 10.0], noise=[2e-3])
DIRECTION = DirectionSensor(position=[100.0, -200.0, 10.0], noise=[2e-3, 3e-3])
PLACE = PositionSensor(position=np.zeros(3), noise=[50.0, 40.0, 30.0], field_of_view=[[-1e6, 1e6]] * 3)
MODE_C = Radar2D(
    position=[100.0, -200.0, 10.0], noise=[30.0, 2e-3, 40.0], field_of_view=[[0.0, 1e6], CIRCLE, [0.0, 1e5]]
)
SENSORS = [RADAR, FLAT, MODE_C, BEARING, DIRECTION, PLACE]

MOTION = ConstantVelocity(2.0)


def random_state(count: int, rng: np.random.Generator, n: int = 6) -> Gaussian:
    """Positions some 30 km away in any direction, full covariances."""
    angle = rng.uniform(-math.pi, math.pi, count)
    mean = np.zeros((count, n))
    mean[:, 0], mean[:, 1] = 30e3 * np.cos(angle), 30e3 * np.sin(angle)
    mean[:, 2] = rng.uniform(1e3, 9e3, count)
    mean[:, 3:6] = rng.normal(0, 100, (count, 3))
    scale = np.array([100.0, 100.0, 100.0, 10.0, 10.0, 10.0, 0.02, 1.0, 1.0])[:n]
    A = rng.standard_normal((count, n, 2 * n)) * scale[:, None]
    return Gaussian(mean, A @ A.transpose(0, 2, 1) / (2 * n))


def kalman_update(mean, P, z, h, H, R, residual=np.subtract):
    """One target, straight from the textbook."""
    v = residual(z, h)
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    return mean + K @ v, (np.eye(len(mean)) - K @ H) @ P, v, S
