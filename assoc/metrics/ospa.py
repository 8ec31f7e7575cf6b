"""OSPA: how far apart two sets of points are, errors in number included."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from assoc._system import memory
from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.metrics.trajectories import Trajectories, epochs
from assoc.sensors.arrays import numbers


class Ospa(NamedTuple):
    """OSPA of two sets of points, metres.

    ``distance ** order == localisation ** order + cardinality ** order``.
    """

    distance: float
    localisation: float
    cardinality: float


@explains_wrong_types
def ospa(truth: Array, estimates: Array, cutoff: float, order: float = 1.0) -> Ospa:
    """Optimal subpattern assignment metric.

    Parameters
    ----------
    truth, estimates : array_like (m, d) and (n, d)
        Points, metres.
    cutoff : float
        c: distances count at most this, and so does each point too many or too few, metres.
    order : float, default 1
        p, at least 1: larger orders punish outliers more.

    Returns
    -------
    Ospa

    References
    ----------
    Schuhmacher, Vo & Vo, A consistent metric for performance evaluation of multi-object filters, IEEE
    Trans. Signal Processing 56 (2008), eq. 3 and 4.
    """
    x, y = point_sets(truth, estimates)
    check_cutoff(cutoff, order)
    return ospa_of_distances(distances(x, y), cutoff, order)


def ospa_of_distances(between: Array, cutoff: float, order: float) -> Ospa:
    """OSPA from all distances (m, n) between two sets; see `ospa`."""
    few, many = sorted(between.shape)
    if many == 0:
        return Ospa(0.0, 0.0, 0.0)
    # in units of the cutoff: no power overflows
    cost = (np.minimum(between, cutoff) / cutoff) ** order
    near = float(cost[linear_sum_assignment(cost)].sum())
    root = 1.0 / order
    return Ospa(
        cutoff * ((near + many - few) / many) ** root,
        cutoff * (near / many) ** root,
        cutoff * ((many - few) / many) ** root,
    )


@explains_wrong_types
def ospa_over_time(
    truth: Trajectories, tracks: Trajectories, cutoff: float, order: float = 1.0
) -> tuple[Array, list[Ospa]]:
    """OSPA at every instant of the truth or the tracks; see `ospa`.

    Returns
    -------
    times : array (K,)
        Seconds.
    values : list of Ospa
    """
    check_cutoff(cutoff, order)
    times, values = [], []
    for time, rows, columns in epochs(truth, tracks):
        between = distances(truth.positions[rows], tracks.positions[columns])
        times.append(time)
        values.append(ospa_of_distances(between, cutoff, order))
    return np.array(times), values


def distances(x: Array, y: Array) -> Array:
    """All distances (m, n) between two sets of points, of which either may be empty."""
    if not len(x) or not len(y):
        return np.zeros((len(x), len(y)))
    # the distances, their powers, and the assignment's own copies
    memory.require(
        40.0 * len(x) * len(y), f"all distances of {len(x)} and {len(y)} points", "compare fewer points at a time"
    )
    return cdist(x, y)


def point_sets(truth: Array, estimates: Array) -> tuple[Array, Array]:
    """Two sets of points as checked arrays (m, d) and (n, d)."""
    sets = []
    for name, points in (("truth", truth), ("estimates", estimates)):
        array = numbers(points, name)
        if array.size == 0:
            array = array.reshape(0, array.shape[1] if array.ndim == 2 else 0)
        if array.ndim != 2 or not np.isfinite(array).all():
            raise InvalidInputError(f"{name} must be finite, of shape (n, d), got shape {array.shape}")
        sets.append(array)
    x, y = sets
    if len(x) and len(y) and x.shape[1] != y.shape[1]:
        raise InvalidInputError(f"truth has {x.shape[1]} dimensions, estimates have {y.shape[1]}")
    return x, y


def check_cutoff(cutoff: float, order: float) -> None:
    """Refuse a cutoff or an order that makes no metric."""
    if not 0 < cutoff < math.inf:
        raise InvalidInputError(f"cutoff: expected metres > 0, got {cutoff!r}")
    if not 1 <= order < math.inf:
        raise InvalidInputError(f"order: expected a number >= 1, got {order!r}")
