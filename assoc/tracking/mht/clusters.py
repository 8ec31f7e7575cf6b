"""Reid's clusters: tracks that contend for measurements, with the hypotheses about them.

Clusters are independent: a hypothesis about the whole scene combines one hypothesis of each cluster, and their
log-probabilities add up. A measurement in the gates of several clusters merges them. A cluster is split into parts when
no branch of one part excludes a branch of another.

References
----------
D. B. Reid, An algorithm for tracking multiple targets, IEEE Trans. Automatic Control 24, 1979.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from assoc._types import Array

# the hypotheses about one branch: it exists, or not
_THERE_FIRST, _GONE_FIRST = np.array([[True], [False]]), np.array([[False], [True]])


class Cluster(NamedTuple):
    """Hypotheses about some tracks, the best first."""

    branches: Array
    """Rows of the batch, ascending, each in some hypothesis; int64 (B,)."""
    holds: Array
    """Which branches each hypothesis contains, bool (H, B)."""
    weight: Array
    """Log-probability of each, that of the best is 0; (H,)."""

    @property
    def best(self) -> Array:
        """Branches of the best hypothesis."""
        return self.branches[self.holds[0]]

    @property
    def probabilities(self) -> Array:
        """Probabilities of the hypotheses, (H,)."""
        p = np.exp(self.weight)
        return np.asarray(p / p.sum())


def cluster(branches: Array, holds: Array, weight: Array, most: int | None = None, drop: float = np.inf) -> Cluster:
    """Make a cluster of hypotheses in any order.

    At most the `most` best are kept, none more than `drop` below the best; branches in no hypothesis are removed.
    """
    if (weight[1:] > weight[:-1]).any():
        order = np.argsort(-weight, kind="stable")
        holds, weight = holds[order], weight[order]
    last = int(np.searchsorted(-weight, drop - weight[0], side="right"))
    last = last if most is None else min(last, most)
    if last < len(weight):
        holds, weight = holds[:last], weight[:last]
    used = holds.any(axis=0)
    if not used.all():
        branches, holds = branches[used], holds[:, used]
    # one memory layout: numpy's sums are then bit for bit the same, however the array was made
    return Cluster(branches, np.ascontiguousarray(holds), weight - weight[0])


def doubted(branches: Array, odds: Array, most: int, drop: float) -> list[Cluster]:
    """Clusters of one branch each, which exists or not, by its log odds (N,), infinite if certain."""
    found = []
    drop = drop if most > 1 else 0.0
    for i, value in enumerate(odds.tolist()):
        if value > drop or value == np.inf:
            found.append(Cluster(branches[i : i + 1], _THERE_FIRST[:1], np.zeros(1)))
        elif value >= -drop and most > 1:
            holds = _THERE_FIRST if value >= 0.0 else _GONE_FIRST
            found.append(Cluster(branches[i : i + 1], holds, np.array([0.0, -abs(value)])))
    return found


def odds_of(group: Cluster) -> float:
    """Log odds of a cluster of group branch, see `doubted`."""
    if len(group.weight) == 1:
        return np.inf
    return float(group.weight[0] - group.weight[1]) * (1.0 if group.holds[0, 0] else -1.0)


def linked(first: Array, second: Array, count: int) -> Array:
    """Label of the connected part of each of `count` elements, given pairs; parts in order of first elements."""
    links = coo_array((np.ones(len(first), dtype=np.int8), (first, second)), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


def grouped(label: Array, parts: int) -> list[Array]:
    """Elements of each of `parts` parts, ascending."""
    order = np.argsort(label, kind="stable")
    bounds = np.searchsorted(label[order], np.arange(parts + 1)).tolist()
    return [order[first:last] for first, last in pairwise(bounds)]


def merged(clusters: Sequence[Cluster], potential: Array, most: int) -> Cluster:
    """Merge clusters, at least one: all combinations of their hypotheses.

    `potential` is, for each row of the batch, the most that the coming measurements can add to the log-probability. Of
    more than `most` combinations those are kept that can still become the best: a new track is unlikely until its
    second detection.
    """
    if len(clusters) == 1:
        return clusters[0]
    total, picked = np.zeros(1), np.zeros((1, 0), dtype=np.int64)
    for group in clusters:
        bound = group.weight + group.holds @ potential[group.branches]
        both = (total[:, None] + bound).ravel()
        order = np.argsort(-both, kind="stable")[:most]
        before, added = np.divmod(order, len(group.weight))
        total, picked = both[order], np.column_stack([picked[before], added])
    holds = np.concatenate([group.holds[picked[:, i]] for i, group in enumerate(clusters)], axis=1)
    weight = np.sum([group.weight[picked[:, i]] for i, group in enumerate(clusters)], axis=0)
    return cluster(np.concatenate([group.branches for group in clusters]), holds, weight)


def parts(whole: Cluster, label: Array, score: Array) -> list[Cluster]:
    """Split a cluster into independent parts: `label` (B,) of each branch; branches of different parts do not exclude.

    The log-probability of a hypothesis is, up to a constant, the sum of the scores (B,) of its branches and a remainder
    from deleted tracks. Combinations of the parts that had been dropped for their rank alone exist again.
    """
    left_behind = whole.weight - whole.holds @ score
    found = []
    for number in np.unique(label):
        members = np.flatnonzero(label == number)
        holds, which = np.unique(whole.holds[:, members], axis=0, return_inverse=True)
        rest = np.full(len(holds), -np.inf)
        np.maximum.at(rest, which.ravel(), left_behind)
        found.append(cluster(whole.branches[members], holds, holds @ score[members] + rest))
    return found


def without(whole: Cluster, gone: Array) -> Cluster:
    """Remove branches from a cluster; hypotheses that differ only in these are merged."""
    if not gone.any():
        return whole
    holds, which = np.unique(whole.holds[:, ~gone], axis=0, return_inverse=True)
    weight = np.full(len(holds), -np.inf)
    np.logaddexp.at(weight, which.ravel(), whole.weight)
    return cluster(whole.branches[~gone], holds, weight)


def agreeing(whole: Cluster, owner: Array) -> Cluster:
    """Keep the hypotheses that agree with the best one about some measurements.

    `owner` (B, M) is, for each branch and each of M sensors, a number for track and measurement; 0: missed.
    """
    if len(whole.weight) == 1:
        return whole
    decided = np.sort(whole.holds[:, :, None] * owner, axis=1)
    same = (decided == decided[0]).all(axis=(1, 2))
    return cluster(whole.branches, whole.holds[same], whole.weight[same])
