"""Sensor by sensor, one two-dimensional assignment each: what most trackers do."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from assoc._types import Floats, Ints
from assoc.problem import AssignmentProblem


def assign_in_turn(problem: AssignmentProblem, time_limit: float) -> tuple[Ints | None, float | None, bool]:
    """Assign sensor after sensor to the clusters so far; a cluster's cost is its tuple over the sensors seen.

    With dummies a cluster costs what its tuple with all later sensors missed costs, and one that is not
    listed cannot be formed: this is what a tracker knows when it goes from sensor to sensor. An axial
    problem has no such tuples; there a cluster is scored by its best completion.
    """
    tuples, costs = problem.tuples, problem.costs
    num_sensors = problem.num_sensors
    group = np.arange(problem.sizes[0]) + 1
    clusters = group[:, None].astype(np.int32)
    for sensor in range(1, num_sensors):
        size = int(problem.sizes[sensor])
        whole = ~tuples[:, sensor + 1 :].any(axis=1) if problem.dummy else np.ones(len(tuples), dtype=bool)
        price = _prefix_costs(tuples[whole, : sensor + 1], costs[whole])
        now = np.array([price.get((*row, 0), np.inf) for row in clusters.tolist()])
        alone = np.array([price.get((*([0] * sensor), j + 1), np.inf) for j in range(size)])
        matrix = np.full((len(clusters), size), np.inf)
        where = {tuple(row): i for i, row in enumerate(clusters.tolist())}
        for key, cost in price.items():
            i = where.get(key[:-1])
            if i is not None and key[-1]:
                matrix[i, key[-1] - 1] = cost
        clusters = _extend(clusters, matrix, now, alone, must_pair=not problem.dummy)
    listed: dict[tuple[int, ...], int] = {}
    for i in np.argsort(-costs, kind="stable"):
        listed[tuple(tuples[i].tolist())] = int(i)
    chosen: list[int] = []
    for row in clusters.tolist():
        if tuple(row) in listed:
            chosen.append(listed[tuple(row)])
        elif all(row) or problem.dummy:
            return None, None, False
    return np.array(chosen, dtype=np.intp), None, False


def _prefix_costs(prefixes: Ints, costs: Floats) -> dict[tuple[int, ...], float]:
    """Return the least cost of any listed tuple that begins with each prefix."""
    keys, inverse = np.unique(prefixes, axis=0, return_inverse=True)
    least = np.full(len(keys), np.inf)
    np.minimum.at(least, inverse.ravel(), costs)
    return {tuple(key): cost for key, cost in zip(keys.tolist(), least.tolist(), strict=True)}


def _extend(clusters: Ints, matrix: Floats, now: Floats, alone: Floats, *, must_pair: bool) -> Ints:
    """Solve one 2-D assignment of clusters to measurements and append its column."""
    num, size = matrix.shape
    large = 1e6
    if must_pair:
        square = np.where(np.isfinite(matrix), matrix, large)
    else:
        # What pairing gains over leaving both apart; each cluster has a private "missed" column.
        apart = np.where(np.isfinite(now), now, 0.0)[:, None] + np.where(np.isfinite(alone), alone, 0.0)
        square = np.full((num, size + num), large)
        square[:, :size] = np.where(np.isfinite(matrix), matrix - apart, large)
        square[np.arange(num), size + np.arange(num)] = 0.0
    row, column = linear_sum_assignment(square)
    paired = (column < size) & (square[row, column] < large / 2)
    extended = np.concatenate([clusters, np.zeros((num, 1), dtype=np.int32)], axis=1)
    extended[row[paired], -1] = column[paired] + 1
    if must_pair:
        return extended
    left = np.setdiff1d(np.arange(size), column[paired])
    new = np.zeros((len(left), extended.shape[1]), dtype=np.int32)
    new[:, -1] = left + 1
    return np.concatenate([extended, new])
