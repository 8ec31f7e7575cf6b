"""Problems of which one open component has nearly all tuples: cameras in front of a volume, frames, records."""

from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from assoc._types import Floats, Ints
from assoc.problem import AssignmentProblem

# gates of pairs and of groups, in standard deviations
_GATE = 3.0


def cameras(particles: int, count: int, noise: float, seed: int) -> AssignmentProblem:
    """Cameras of 1,000 x 1,000 points on a circle around a cube of particles, seen with noise in points.

    Of two to all cameras, points within the gate of one place are a tuple; it costs its squared distances, and what is
    gained by a point less than by a false one. P_d 0.95, 2 % false points.
    """
    rng = np.random.default_rng(seed)
    places = rng.random((particles, 3)) - 0.5
    angles = np.linspace(-0.5, 0.5, count)
    # far away: a point is where the particle is, across and along the axis of the circle
    across = np.stack([np.cos(angles), np.sin(angles), np.zeros(count)], axis=1)
    sigma = noise / 1000.0
    lists = []
    for axis in across:
        exact = np.stack([places @ axis, places[:, 2]], axis=1)[rng.random(particles) < 0.95]
        false = rng.uniform(-0.5, 0.5, (rng.poisson(0.02 * particles), 2))
        lists.append(np.concatenate([exact + sigma * rng.normal(size=exact.shape), false]))
    return _grown(lists, lambda group, rows: _ray_misfit(across[list(group)], group, rows, lists, sigma), 5.0, sigma)


def _ray_misfit(across: Floats, group: tuple[int, ...], rows: Ints, lists: list[Floats], sigma: float) -> Floats:
    """Squared distances of points to the place that fits them best, in variances; of two, in height alone."""
    seen = np.stack([lists[s][rows[:, k]] for k, s in enumerate(group)], axis=1)
    height = seen[:, :, 1] - seen[:, :, 1].mean(axis=1, keepdims=True)
    design = across[:, :2]
    fitted = seen[:, :, 0] @ np.linalg.pinv(design).T @ design.T
    outside = np.abs(seen[:, :, 0] @ np.linalg.pinv(design).T).max(axis=1) > 0.5 + 3.0 * sigma
    misfit: Floats = ((seen[:, :, 0] - fitted) ** 2 + height**2).sum(axis=1) / sigma**2
    return np.where(outside, np.inf, misfit)


def frames(points: int, count: int, seed: int) -> AssignmentProblem:
    """Points of random walks in a square, in frames of which each is a list; a step is half their mean distance."""
    rng = np.random.default_rng(seed)
    side, step = np.sqrt(points), 0.5
    walk = rng.random((points, 2)) * side + np.cumsum(step * rng.normal(size=(count, points, 2)), axis=0)
    lists = [z[rng.random(points) < 0.95] for z in walk]
    # pieces of walks of two to four frames: longer ones have a solution made of these
    tuples: list[Ints] = []
    costs: list[Floats] = []
    pieces = {s: (np.arange(len(z))[:, None], np.zeros(len(z))) for s, z in enumerate(lists)}
    for length in (2, 3, 4):
        longer = {}
        for s in range(count - length + 1):
            rows, misfit = pieces[s]
            place = s + length - 1
            near = cKDTree(lists[place]).query_ball_point(lists[place - 1][rows[:, -1]], 2.0 * step)
            old = np.repeat(np.arange(len(rows)), [len(n) for n in near])
            new = np.concatenate([*near, []]).astype(np.int64)
            more = ((lists[place][new] - lists[place - 1][rows[old, -1]]) ** 2).sum(axis=1) / (2.0 * step**2)
            longer[s] = np.concatenate([rows[old], new[:, None]], axis=1), misfit[old] + more
            indices = np.zeros((len(new), count), dtype=np.int64)
            indices[:, s : place + 1] = longer[s][0] + 1
            tuples.append(indices)
            costs.append(longer[s][1] - 2.5 * (length - 1))
        pieces = longer
    return AssignmentProblem(np.concatenate(tuples), np.concatenate(costs), [len(z) for z in lists])


def records(entities: int, sources: int, seed: int) -> AssignmentProblem:
    """Records of entities in sources, compared within overlapping blocks; features in eight dimensions."""
    rng = np.random.default_rng(seed)
    # entities come in families that are alike
    centres = rng.normal(size=(entities // 5 + 1, 8))
    truth = centres[rng.integers(0, len(centres), entities)] + 0.45 * rng.normal(size=(entities, 8))
    sigma = 0.35
    lists = [truth[rng.random(entities) < 0.8] for _ in range(sources)]
    lists = [z + sigma * rng.normal(size=z.shape) for z in lists]

    def misfit(group: tuple[int, ...], rows: Ints) -> Floats:
        seen = np.stack([lists[s][rows[:, k]] for k, s in enumerate(group)], axis=1)
        found: Floats = ((seen - seen.mean(axis=1, keepdims=True)) ** 2).sum(axis=(1, 2)) / sigma**2 * 0.5
        return found

    return _grown(lists, misfit, 6.0, sigma, radius=1.35)


def _grown(lists, misfit, worth: float, sigma: float, radius: float | None = None) -> AssignmentProblem:  # type: ignore[no-untyped-def]
    """All groups of two lists and more whose pairs are near and whose misfit is below what their points are worth."""
    count = len(lists)
    if radius is None:
        # of two cameras heights alone can differ
        pairs = {(s, t): cKDTree(lists[s][:, 1:]).query_ball_tree(cKDTree(lists[t][:, 1:]), _GATE * sigma * 1.4)
                 for s, t in combinations(range(count), 2)}  # fmt: skip
    else:
        pairs = {(s, t): cKDTree(lists[s]).query_ball_tree(cKDTree(lists[t]), radius)
                 for s, t in combinations(range(count), 2)}  # fmt: skip
    groups: dict[tuple[int, ...], Ints] = {(s,): np.arange(len(z))[:, None] for s, z in enumerate(lists)}
    tuples, costs = [], []
    for size in range(2, count + 1):
        for group in combinations(range(count), size):
            rows = groups[group[:-1]]
            near = pairs[group[-2], group[-1]]
            old = np.repeat(np.arange(len(rows)), [len(near[r]) for r in rows[:, -1]])
            new = np.concatenate([*(near[r] for r in rows[:, -1]), []]).astype(np.int64)
            grown = np.concatenate([rows[old], new[:, None]], axis=1)
            cost = 0.5 * misfit(group, grown) - worth * (size - 1)
            kept = cost < 0.0
            groups[group] = grown[kept]
            indices = np.zeros((int(kept.sum()), count), dtype=np.int64)
            indices[:, list(group)] = grown[kept] + 1
            tuples.append(indices)
            costs.append(cost[kept])
    return AssignmentProblem(np.concatenate(tuples), np.concatenate(costs), [len(z) for z in lists])
