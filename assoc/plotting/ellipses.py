"""Ellipses of covariances in the plane, and covariances of measured positions."""

from __future__ import annotations

import math

import numpy as np

from assoc._types import Array
from assoc.plotting.measured import positions_of
from assoc.sensors import Sensor

_CORNERS = 49


def ellipses(centres: Array, covariances: Array, probability: float) -> tuple[Array, Array]:
    """Ellipses that contain normal distributions with a probability, as one line x, y (n * 50,) with NaN between them.

    Of centres (n, 2 or more) and covariances (n, 2 or more, 2 or more) the first two count.
    """
    values, vectors = np.linalg.eigh(covariances[:, :2, :2])
    # the chi-square distribution of two degrees of freedom has a closed form
    reach = np.sqrt(np.maximum(values, 0.0) * -2.0 * math.log1p(-probability))
    angle = np.linspace(0.0, 2.0 * math.pi, _CORNERS)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    outline = centres[:, :2, None] + np.einsum("nij,nj,jk->nik", vectors, reach, circle)
    gaps = np.concatenate([outline, np.full((len(centres), 2, 1), np.nan)], axis=2)
    return gaps[:, 0].ravel(), gaps[:, 1].ravel()


def position_covariances(sensor: Sensor, measurements: Array, heights: Array | float) -> Array:
    """Covariances (n, 2, 2) of x and y of measured positions, to first order, m^2."""
    z = np.asarray(measurements, dtype=np.float64)
    sigma = np.sqrt(np.diagonal(sensor.covariance))
    slopes = np.zeros((len(z), 2, sensor.dim))
    for c in range(sensor.dim):
        step = np.zeros(sensor.dim)
        step[c] = 1e-3 * sigma[c]
        ahead, behind = (positions_of(sensor, z + sign * step, heights, 1.0)[:, :2] for sign in (1.0, -1.0))
        slopes[:, :, c] = (ahead - behind) / (2.0 * step[c])
    return slopes @ sensor.covariance @ np.swapaxes(slopes, 1, 2)
