"""Problems drawn as numbers, without a scene: axial, planted with dummies, and two-dimensional ones."""

import numpy as np
from scipy.spatial import cKDTree

from assoc._types import Floats, Ints
from assoc.problem import AssignmentProblem

_MAX_GRID = 30_000
_PLANTED_TARGETS = {2: 60, 3: 30, 4: 20, 5: 12, 6: 8}


def axial_random(n: int, seed: int) -> AssignmentProblem:
    """Return the axial problem n x n x n with integer costs uniform in 0..99."""
    costs = np.random.default_rng(seed).integers(0, 100, (n, n, n))
    return AssignmentProblem.from_dense(costs.astype(float), dummy=False)


def planar_random(n: int, seed: int) -> AssignmentProblem:
    """Return the two-dimensional assignment problem n x n with costs uniform in (0, 1)."""
    return AssignmentProblem.from_dense(np.random.default_rng(seed).random((n, n)), dummy=False)


def axial_known_optimum(n: int, seed: int) -> tuple[AssignmentProblem, float]:
    """Return an axial problem n x n x n whose only optimum is known, hard for heuristics from n = 30.

    Level i holds the tuples with first index i, one of which is optimal and costs a_i in U{1..9}. Built from
    the last level upwards, every other tuple x is given the value B(x) of the best completion through it
    that would still lose against L_i = a_i + ... + a_n, and costs B(x) less the best compatible B of the
    level below. Along any solution the sum telescopes to at least B(first tuple) >= L_1.

    Returns problem, optimum: The optimum is L_1.
    Grundel & Pardalos, "Test problem generator for the multidimensional assignment problem", Computational Optimization
        and Applications 30 (2005).
    """
    rng = np.random.default_rng(seed)
    optimal_costs = rng.integers(1, 10, n)
    suffix = np.cumsum(optimal_costs[::-1])[::-1].astype(float)
    second, third = rng.permutation(n), rng.permutation(n)
    rows, columns = np.indices((n, n))
    costs = np.empty((n, n, n))

    losing = suffix[n - 1] + 1.0 + rng.integers(0, 10, (n, n))
    compatible = (rows != second[n - 2]) & (columns != third[n - 2])
    best = np.where(compatible, losing, rng.integers(1, 10, (n, n)))
    best[second[n - 1], third[n - 1]] = suffix[n - 1]
    costs[n - 1] = best
    for level in range(n - 2, -1, -1):
        below = _least_compatible(best)
        best = suffix[level] + 1.0 + rng.integers(0, 15, (n, n))
        best[second[level], third[level]] = suffix[level]
        costs[level] = best - below
    # Levels in random order: a solver that goes by the first index must not profit from the construction.
    return AssignmentProblem.from_dense(costs[rng.permutation(n)], dummy=False), float(suffix[0])


def _least_compatible(values: Floats) -> Floats:
    """Return for every (j, k) the smallest value outside row j and column k."""
    n = len(values)
    index = np.arange(n)
    # Row j and column k hold 2 n - 1 values, so one of the 2 n smallest is outside both.
    order: Ints = np.argsort(values.ravel(), kind="stable")[: 2 * n]
    order_rows, order_columns = order // n, order % n
    outside = (index[:, None, None] != order_rows) & (index[None, :, None] != order_columns)
    first = np.argmax(outside, axis=-1)
    least: Floats = values[order_rows[first], order_columns[first]]
    return least


def planted(sensors: int, seed: int, targets: int | None = None) -> tuple[AssignmentProblem, float]:
    """Return a problem with dummies and a known optimum, for any number of sensors.

    Multipliers u_s(i) are drawn from U(-10, 5). Tuples of a planted partition cost the sum of their
    multipliers, all others that sum plus U(0.5, 20), so the multipliers are an optimal dual solution. Every
    singleton is listed (one missing would be added at cost 0, below its multipliers' sum).

    targets: Targets planted, each seen by each sensor with probability 0.85. By default as many as make about 20,000
        tuples.
    Returns problem, optimum: The optimum is the sum of all multipliers.
    """
    rng = np.random.default_rng(seed)
    seen = rng.random((targets or _PLANTED_TARGETS[sensors], sensors)) < 0.85
    seen = seen[seen.any(axis=1)]
    sizes = seen.sum(axis=0)
    partition = np.zeros(seen.shape, dtype=np.int64)
    for s, size in enumerate(sizes):
        partition[seen[:, s], s] = rng.permutation(size) + 1
    multipliers = [np.concatenate([[0.0], rng.uniform(-10.0, 5.0, size)]) for size in sizes]

    shape = tuple(sizes + 1)
    if np.prod(np.array(shape, dtype=float)) <= _MAX_GRID:
        keys = np.arange(1, np.prod(shape))
    else:
        drawn = rng.integers(1, np.prod(shape), 2 * _MAX_GRID // 3)
        strides = np.array([np.prod(shape[s + 1 :], dtype=np.int64) for s in range(sensors)])
        singletons = np.concatenate([strides[s] * np.arange(1, size + 1) for s, size in enumerate(sizes)])
        keys = np.concatenate([drawn, singletons])
    planted_keys = np.ravel_multi_index(tuple(partition.T), shape)
    keys = np.union1d(keys, planted_keys)
    tuples = np.stack(np.unravel_index(keys, shape), axis=1)
    costs = np.sum([multipliers[s][tuples[:, s]] for s in range(sensors)], axis=0)
    costs += np.where(np.isin(keys, planted_keys), 0.0, rng.uniform(0.5, 20.0, len(keys)))
    optimum = float(sum(u.sum() for u in multipliers))
    return AssignmentProblem(tuples.astype(np.int32), costs, sizes), optimum


def wide_gates(targets: int, seed: int, noise: float = 0.6) -> AssignmentProblem:
    """Three lists of points in the plane; tuples of points near each other, at the cost of the likelihood ratio.

    With a noise of 0.5 and more, in units of the targets' mean distance, one component has nearly all tuples.
    """
    rng = np.random.default_rng(seed)
    points = rng.random((targets, 2)) * np.sqrt(targets)
    lists = [points[rng.random(targets) < 0.95] for _ in range(3)]
    lists = [z + rng.normal(size=z.shape) * noise for z in lists]
    trees = [cKDTree(z) for z in lists]
    near = {(s, t): trees[s].query_ball_tree(trees[t], 2.3 * noise) for s, t in [(0, 1), (0, 2), (1, 2)]}
    tuples = [(i + 1, j + 1, 0) for i, js in enumerate(near[0, 1]) for j in js]
    tuples += [(i + 1, 0, k + 1) for i, ks in enumerate(near[0, 2]) for k in ks]
    tuples += [(0, j + 1, k + 1) for j, ks in enumerate(near[1, 2]) for k in ks]
    tuples += [
        (i + 1, j + 1, k + 1)
        for i, js in enumerate(near[0, 1])
        for j in js
        for k in set(near[0, 2][i]) & set(near[1, 2][j])
    ]
    rows = np.array(tuples)
    there = rows > 0
    z = np.stack([lists[s][rows[:, s] - 1] for s in range(3)], axis=1) * there[..., None]
    count = there.sum(axis=1)
    mean = z.sum(axis=1) / count[:, None]
    spread = (((z - mean[:, None]) * there[..., None]) ** 2).sum(axis=(1, 2)) / (2.0 * noise**2)
    costs = spread - 0.742 * count + 3.0 * (3 - count) - np.log(2.0 * np.pi * noise**2 / count)
    return AssignmentProblem(rows, costs, [len(z) for z in lists])
