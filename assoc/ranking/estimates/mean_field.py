"""First estimates of the probability of each tuple: as if the rows of a tuple were free independently of each other."""

from __future__ import annotations

import numpy as np

from assoc._types import Floats, Ints

_SWEEPS, _LEAST = 60, 1e-9


def mean_field(cols: Ints, weights: Floats, alone: Floats) -> tuple[Floats, Floats]:
    """Estimate the probabilities of the K tuples, and those of the R rows to be in none of them.

    ``cols`` (K, S) are the rows of each tuple, -1 where it has fewer. ``weights`` (K,) and ``alone`` (R,) are the
    weights of the tuples, and of leaving each row alone. The equations are damped.
    """
    # of many sensors, whose rows must hardly be left alone, products may overflow before sums grow
    alone = np.maximum(alone, _LEAST)
    column, sensor = np.nonzero(cols >= 0)
    row = cols[column, sensor]
    free: Floats = np.full(alone.size, 0.5)
    product = weights
    with np.errstate(over="ignore"):
        for _ in range(_SWEEPS):
            product = weights.copy()
            for s in range(cols.shape[1]):
                used = cols[:, s] >= 0
                product[used] *= free[cols[used, s]]
            sums = alone + np.bincount(row, product[column] / free[row], alone.size)
            free[:] = np.maximum(np.sqrt(free / sums), 1e-300)
    return np.minimum(product, 1.0), alone * free
