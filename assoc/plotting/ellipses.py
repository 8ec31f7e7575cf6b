"""Ellipses of covariances in the plane."""

from __future__ import annotations

import math

import numpy as np

from assoc._types import Array

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
