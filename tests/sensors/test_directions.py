"""Sensors of azimuth and elevation: fused positions, costs and tracks."""

import math

import numpy as np
import pytest
from scipy.optimize import least_squares

from assoc import Scene
from assoc.costs import positions_and_covariances, tuple_costs
from assoc.sensors import DirectionSensor

SITES = [[0, 0, 0], [900, 0, 50], [200, 1000, 20]]
NOISE = np.array([[4e-6, 1e-6], [1e-6, 2e-6]])
CAMERAS = [DirectionSensor(position=site, noise=NOISE, detection_probability=0.9) for site in SITES]
REGION = [[0, 1000], [0, 1000], [0, 600]]


def scene_of(scans=8, targets=3, seed=1):
    rng = np.random.default_rng(seed)
    begin, velocity = rng.uniform(200, 800, (targets, 3)) * [1, 1, 0.5], rng.uniform(-20, 20, (targets, 3))
    times = np.arange(float(scans))
    paths = [begin + t * velocity for t in times]
    measurements = [
        [c.measure(path) + rng.multivariate_normal([0, 0], NOISE, targets) for c in CAMERAS] for path in paths
    ]
    return Scene(CAMERAS, times, measurements, REGION), paths


def test_positions_and_costs_are_those_of_least_squares():
    scene, paths = scene_of(1)
    rows = np.array([[1, 1, 1], [2, 2, 0]])
    weight = np.linalg.cholesky(np.linalg.inv(NOISE)).T

    def residuals(x, row):
        pairs = [(c, z[i - 1]) for c, z, i in zip(CAMERAS, scene.measurements[0], row, strict=True) if i]
        return np.concatenate([weight @ c.residual(z, c.measure(x[None])[0]) for c, z in pairs])

    where, spread = positions_and_covariances(scene, 0, rows)
    costs = tuple_costs(scene, 0, rows)
    hit = math.log(0.9 * 2 * math.pi * math.pi) - 0.5 * np.linalg.slogdet(2 * math.pi * NOISE)[1]
    for k, row in enumerate(rows):
        best = least_squares(residuals, paths[0][k], args=(row,), x_scale=100.0, xtol=1e-12)
        np.testing.assert_allclose(where[k], best.x, atol=0.05)
        np.testing.assert_allclose(spread[k], np.linalg.inv(best.jac.T @ best.jac), rtol=0.02, atol=0.01)
        expected = best.cost - hit * np.count_nonzero(row) - math.log(0.1) * np.count_nonzero(row == 0)
        assert costs[k] == pytest.approx(expected, abs=0.01)
