"""Chi-square gates: how far measurements of one target may lie apart."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.arrays import SensorArrays
from assoc.errors import InvalidInputError

# room for the prior's small influence on chi-square values that otherwise could only grow with a tuple
SLACK = 1.0


class Gates(NamedTuple):
    """Limits on chi-square values."""

    joint: Array
    """By degrees of freedom."""
    pair: Array
    """For each pair of sensors, (S, S); also below the largest of any tuple with a negative cost."""
    future: Array
    """The most that detections by sensors t, t + 1, ... can take off the cost, (S + 1,)."""


@lru_cache(maxsize=64)
def chi_square_quantiles(probability: float, largest: int) -> Array:
    """Quantiles of the chi-square distribution for 0 .. `largest` degrees of freedom; 0 counts as 1."""
    if not (isinstance(probability, float) and 0.0 < probability <= 1.0):
        raise InvalidInputError(f"gate_probability must be above 0 and at most 1, got {probability!r}")
    from scipy.special import gammaincinv

    freedom = np.maximum(np.arange(largest + 1), 1)
    quantiles = np.full(largest + 1, np.inf) if probability == 1.0 else 2.0 * gammaincinv(freedom / 2.0, probability)
    quantiles.setflags(write=False)
    return quantiles


def degrees_of_freedom(sensors: SensorArrays, detected: Array) -> Array:
    """Degrees of freedom (K,) of the residuals of tuples, of the sensors that `detected`, bool (K, S), a target.

    Components measured, less the coordinates found from them: three if a sensor of the tuple measures full positions,
    else two (a height found from slant ranges alone is not counted, which widens the gate).
    """
    measured, full = np.zeros(len(detected), dtype=np.int64), np.zeros(len(detected), dtype=np.bool_)
    # sensor by sensor: products of truth values and selected columns take longer
    for s, (dim, whole) in enumerate(zip(sensors.dim.tolist(), sensors.full.tolist(), strict=True)):
        measured += dim * detected[:, s]
        if whole:
            full |= detected[:, s]
    return np.maximum(measured - (2 + full), 0)


def make_gates(sensors: SensorArrays, probability: float) -> Gates:
    """Gates for a scene's sensors; with probability 1 only the sign of the cost limits the tuples."""
    joint = chi_square_quantiles(float(probability), int(sensors.dim.sum()))
    count = len(sensors.dim)
    gain = np.maximum(sensors.gain, 0.0)
    future = np.zeros(count + 1)
    future[:count] = np.cumsum(gain[::-1])[::-1]
    # two at a time: arrays of all pairs times all sensors would be too large for thousands of sensors
    first, second = np.triu_indices(count)
    full = sensors.full[first] | sensors.full[second]
    measured = sensors.dim[first] + np.where(first == second, 0, sensors.dim[second])
    freedom = np.zeros((count, count), dtype=np.int64)
    freedom[first, second] = np.maximum(measured - np.where(full, 3, 2), 0)
    freedom[second, first] = freedom[first, second]
    # a tuple with these two costs at least chi / 2 + base - all gains that it can have
    most = gain.sum() - (gain - sensors.gain)[:, None] - (gain - sensors.gain)[None, :] - sensors.base
    return Gates(joint, np.minimum(joint[freedom], 2.0 * np.maximum(most, 0.0) + SLACK), future)
