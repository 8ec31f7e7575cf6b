"""Reid's clusters: tracks that contend for measurements, with the hypotheses about them.

What is outside of a cluster does not matter to it: the hypotheses about the whole scene are all combinations of one
hypothesis of each cluster, and their log-probabilities add up. Clusters are merged when a measurement lies in gates of
several, and fall apart when no two of their branches exclude each other across the parts.

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

# the hypotheses about one branch: it is there, or not
_THERE_FIRST, _GONE_FIRST = np.array([[True], [False]]), np.array([[False], [True]])


class Cluster(NamedTuple):
    """Hypotheses about some tracks, the best first."""

    branches: Array
    """Rows of the batch, ascending, each in some hypothesis; int64 (B,)."""
    holds: Array
    """Which branches each hypothesis believes in, bool (H, B)."""
    weight: Array
    """Log-probability of each, that of the best is 0; (H,)."""

    @property
    def best(self) -> Array:
        """Branches of the best hypothesis."""
        return self.branches[self.holds[0]]

    @property
    def probabilities(self) -> Array:
        """Of the hypotheses, (H,)."""
        p = np.exp(self.weight)
        return np.asarray(p / p.sum())


def cluster(branches: Array, holds: Array, weight: Array, most: int | None = None, drop: float = np.inf) -> Cluster:
    """Make a cluster of hypotheses in any order.

    At most `most` of them stay, none of a log-probability `drop` below the best; branches that none believes in do not.
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
    # in one layout, so that sums are the same to the last bit wherever it comes from
    return Cluster(branches, np.ascontiguousarray(holds), weight - weight[0])


def doubted(branches: Array, odds: Array, most: int, drop: float) -> list[Cluster]:
    """Clusters of one branch each, which may be or not: logarithms of the odds (N,), infinite where it is certain."""
    found = []
    drop = drop if most > 1 else 0.0
    for i, value in enumerate(odds.tolist()):
        if value > drop or value == np.inf:
            found.append(Cluster(branches[i : i + 1], _THERE_FIRST[:1], np.zeros(1)))
        elif value >= -drop and most > 1:
            holds = _THERE_FIRST if value >= 0.0 else _GONE_FIRST
            found.append(Cluster(branches[i : i + 1], holds, np.array([0.0, -abs(value)])))
    return found


def odds_of(one: Cluster) -> float:
    """Logarithm of the odds of a cluster of one branch, see `doubted`."""
    if len(one.weight) == 1:
        return np.inf
    return float(one.weight[0] - one.weight[1]) * (1.0 if one.holds[0, 0] else -1.0)


def linked(first: Array, second: Array, count: int) -> Array:
    """Number of the connected part of each of `count` things, given pairs of them; parts by their first thing."""
    links = coo_array((np.ones(len(first), dtype=np.int8), (first, second)), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


def grouped(label: Array, parts: int) -> list[Array]:
    """Numbers of the things of each of so many parts, ascending."""
    order = np.argsort(label, kind="stable")
    bounds = np.searchsorted(label[order], np.arange(parts + 1)).tolist()
    return [order[first:last] for first, last in pairwise(bounds)]


def merged(clusters: Sequence[Cluster], potential: Array, most: int) -> Cluster:
    """One cluster with the combinations of the hypotheses of several, clusters that share nothing.

    Parameters
    ----------
    clusters : sequence of Cluster
        At least one.
    potential : array
        What the coming measurements add at most to the log-probability for each row of the batch that a hypothesis
        believes in. Of more than `most` combinations those stay that may become the best: a track in the making is less
        likely than not until its second detection.
    most : int
        The most combinations.
    """
    if len(clusters) == 1:
        return clusters[0]
    total, picked = np.zeros(1), np.zeros((1, 0), dtype=np.int64)
    for one in clusters:
        promise = one.weight + one.holds @ potential[one.branches]
        both = (total[:, None] + promise).ravel()
        order = np.argsort(-both, kind="stable")[:most]
        before, own = np.divmod(order, len(one.weight))
        total, picked = both[order], np.column_stack([picked[before], own])
    holds = np.concatenate([one.holds[picked[:, i]] for i, one in enumerate(clusters)], axis=1)
    weight = np.sum([one.weight[picked[:, i]] for i, one in enumerate(clusters)], axis=0)
    return cluster(np.concatenate([one.branches for one in clusters]), holds, weight)


def parts(whole: Cluster, label: Array, score: Array) -> list[Cluster]:
    """The clusters that a cluster falls apart into.

    A hypothesis' log-probability is, up to a constant, the sum of the scores of its branches, and of what tracks that
    are deleted have left behind. The parts of the hypotheses that are kept may be combined in more ways than are kept:
    what was left out for its rank alone comes back.

    Parameters
    ----------
    whole : Cluster
    label : int array (B,)
        The part of each branch; no two branches of different parts exclude each other.
    score : array (B,)
        Scores of the branches.
    """
    left_behind = whole.weight - whole.holds @ score
    found = []
    for number in np.unique(label):
        own = np.flatnonzero(label == number)
        holds, which = np.unique(whole.holds[:, own], axis=0, return_inverse=True)
        rest = np.full(len(holds), -np.inf)
        np.maximum.at(rest, which.ravel(), left_behind)
        found.append(cluster(whole.branches[own], holds, holds @ score[own] + rest))
    return found


def without(whole: Cluster, gone: Array) -> Cluster:
    """A cluster without some of its branches; hypotheses that differed in them alone are one."""
    if not gone.any():
        return whole
    holds, which = np.unique(whole.holds[:, ~gone], axis=0, return_inverse=True)
    weight = np.full(len(holds), -np.inf)
    np.logaddexp.at(weight, which.ravel(), whole.weight)
    return cluster(whole.branches[~gone], holds, weight)


def agreeing(whole: Cluster, owner: Array) -> Cluster:
    """The hypotheses that say of some measurements what the best one says.

    Parameters
    ----------
    whole : Cluster
    owner : int array (B, M)
        What each branch says of M sensors: a number for the track and its measurement, 0: it was missed.
    """
    if len(whole.weight) == 1:
        return whole
    said = np.sort(whole.holds[:, :, None] * owner, axis=1)
    same = (said == said[0]).all(axis=(1, 2))
    return cluster(whole.branches, whole.holds[same], whole.weight[same])
