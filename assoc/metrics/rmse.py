"""Root mean square errors of positions."""

from __future__ import annotations

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.metrics.gospa import gospa_over_time
from assoc.metrics.ospa import distances, point_sets
from assoc.metrics.trajectories import Trajectories, epochs


@explains_wrong_types
def rmse(truth: Array, estimates: Array) -> float:
    """Root of the mean squared distance of points that belong together, row by row, metres.

    Parameters
    ----------
    truth, estimates : array_like (n, d)
        Metres.

    Returns
    -------
    float
        NaN if there are no points.
    """
    x, y = point_sets(truth, estimates)
    if len(x) != len(y):
        raise InvalidInputError(f"truth has {len(x)} points, estimates have {len(y)}, expected as many")
    return float(np.sqrt(((x - y) ** 2).sum(axis=1).mean())) if len(x) else float("nan")


@explains_wrong_types
def track_rmse(truth: Trajectories, tracks: Trajectories, cutoff: float) -> tuple[float, dict[int, float]]:
    """Root mean square position error of tracks that are closer than a cutoff to their target.

    Targets and tracks are paired at each instant as GOSPA of order 2 pairs them.

    Returns
    -------
    overall : float
        Metres; NaN if nothing was paired.
    by_target : dict of int to float
        For each target that was ever paired.
    """
    squared: dict[int, list[float]] = {}
    _, values = gospa_over_time(truth, tracks, cutoff)
    for (_, rows, columns), pairing in zip(epochs(truth, tracks), values, strict=True):
        between = distances(truth.positions[rows], tracks.positions[columns])
        i = np.searchsorted(truth.ids[rows], pairing.pairs[:, 0])
        j = np.searchsorted(tracks.ids[columns], pairing.pairs[:, 1])
        for target, distance in zip(pairing.pairs[:, 0].tolist(), between[i, j].tolist(), strict=True):
            squared.setdefault(target, []).append(distance**2)
    every = [value for values in squared.values() for value in values]
    by_target = {target: float(np.sqrt(np.mean(values))) for target, values in sorted(squared.items())}
    return float(np.sqrt(np.mean(every))) if every else float("nan"), by_target
