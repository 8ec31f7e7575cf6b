"""Probability of each pair of two lists among all joint events, as a guaranteed interval.

Clusters of pairs are summed exactly (`assoc.ranking.sweep`) as long as few of their vertices are open at a time.
Where too many would be, the least likely pairs are left out until the rest can be summed. The error is bounded. Let D
be the left-out pairs that touch a remaining cluster. In events without pairs of D the cluster is independent, hence

    | P(pair) - P(pair among the pairs that remain) |  <=  P(any of D)  <=  sum over D of bounds on their probabilities,

with the bounds of `assoc.ranking.pairs.messages`. The estimate between the bounds also accounts for the left-out pairs:
each is replaced at its two vertices by a pair that ends there, weighted by belief propagation. This moves probabilities
by at most the probability of the replacements, which is added to the width of the interval. Pairs below `FAINT` are
left out first, without replacement: they would be most of what belief propagation has to do.

References
----------
T. Fortmann, Y. Bar-Shalom, M. Scheffe, Sonar tracking of multiple targets using joint probabilistic data association,
IEEE J. Oceanic Engineering 8, 1983.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from assoc._types import Array, Floats
from assoc.packing.kernels.matching import match
from assoc.ranking.pairs.graph import PairGraph, pair_graph
from assoc.ranking.pairs.messages import bound_pairs, log_beliefs, log_dropped
from assoc.ranking.sums import plan_clusters, sum_clusters

FAINT = 1e-10
"""Pairs less likely are left out where a cluster cannot be summed with all of them."""
_NARROWEST = 2
"""Open vertices needed for a star, a vertex and its neighbours."""
_ROUNDING = 1e-12
_LOSSY, _GRID = 42, 50
"""Binary exponent of sums that lose a thousandth, and the digits that are left to them."""


class PairIntervals(NamedTuple):
    """Probabilities of K pairs, with guaranteed bounds."""

    probability: Floats
    lower: Floats
    upper: Floats


def pair_probabilities(
    first: Array, second: Array, log_weight: Floats, sizes: tuple[int, int], states: int
) -> PairIntervals:
    """Sum over all joint events: sets of pairs that use each member of either list at most once.

    ``first`` and ``second`` (K,) are the members of each pair, counted from 0; pairs are distinct, and ``sizes`` the
    lengths of the lists. ``log_weight`` (K,), finite, is the logarithm of the factor that a pair contributes to an
    event's weight. ``states`` limits the table of partial events; where a cluster would need more, pairs are left out.
    """
    if not len(first):
        return PairIntervals(*np.zeros((3, 0)))
    graph = pair_graph(first, second, sizes)
    weight = np.ascontiguousarray(log_weight, dtype=np.float64)
    most = max(_NARROWEST, int(states).bit_length() - 1)
    plan = plan_clusters(graph.graph, np.zeros(len(first)), most, False)
    rounding = _ROUNDING + 8.0 * np.finfo(float).eps * sum(sizes) * float(np.abs(weight).max())
    weights, free = reduced(graph, weight, plan.kept, np.zeros(sum(sizes)), sizes[0])
    wide = plan.label < 0
    if not wide.any():
        probability, alone = np.zeros(len(first)), np.ones(sum(sizes))
        sum_clusters(plan, weights, free, np.inf, probability, alone)
        low, high = probability - rounding, probability + rounding
        return PairIntervals(probability, np.maximum(low, 0.0), np.minimum(high, 1.0))
    # bounds are only of the clusters that are too wide
    bounds = np.zeros((2, len(first)))
    bounds[1] = 1.0
    bound_pairs(graph, weights, free, np.flatnonzero(wide), np.empty((3, 2 * len(first))), bounds)
    faint = bounds[1] < FAINT
    rest = np.flatnonzero(~faint)
    part = pair_graph(first[rest], second[rest], sizes)
    parted = _without_some(part, weight[rest], bounds[:, rest], sizes[0], most)
    lost = _touching(parted.label, graph.ends[faint], bounds[1, faint], len(parted.width))
    around = np.full(len(first), np.inf)
    around[rest] = np.where(parted.kept, (parted.width + lost)[parted.label[part.ends[:, 0]]], np.inf)
    # of a faint pair, as if its ends were apart
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        by_end = parted.unpaired / free
        probability = np.nan_to_num(weights * by_end[graph.ends[:, 0]] * by_end[graph.ends[:, 1]])
    probability[rest] = parted.probability
    lower = np.maximum(probability - around, bounds[0]) - rounding
    upper = np.minimum(probability + around, bounds[1]) + rounding
    return PairIntervals(np.clip(probability, lower, upper), np.maximum(lower, 0.0), np.minimum(upper, 1.0))


class _Parted(NamedTuple):
    """Estimates for E edges and V vertices where clusters are summed without some edges."""

    probability: Floats
    """(E,)."""
    unpaired: Floats
    """(V,)."""
    kept: Array
    """Edges that are summed, (E,)."""
    label: Array
    """Cluster of each vertex, (V,)."""
    width: Floats
    """How far the edges left out move the probabilities of each cluster at most."""


def _without_some(graph: PairGraph, weight: Floats, bounds: Floats, rows: int, most: int) -> _Parted:
    """Leave out the least likely edges until all clusters can be summed, and sum."""
    count, vertices = len(weight), graph.ptr.size - 1
    with np.errstate(divide="ignore"):
        plan = plan_clusters(graph.graph, np.log(bounds[1]), most, True)
    log_free, log_part = log_dropped(graph, weight, plan.kept, log_beliefs(graph, weight, ~plan.kept))
    weights, left = reduced(graph, weight, plan.kept, log_free, rows)
    probability, alone = np.zeros(count), np.ones(vertices)
    sum_clusters(plan, weights, left, np.inf, probability, alone)
    paired = np.bincount(graph.ends.T.reshape(-1), np.tile(probability, 2), vertices)
    unpaired = np.clip(1.0 - paired, 0.0, 1.0)
    # edges left out, by their replacements at the first list's end
    out = np.flatnonzero(~plan.kept)
    first = graph.ends[out, 0]
    index = np.empty(count, dtype=np.int64)
    index[graph.edge[: graph.ptr[rows]]] = np.arange(graph.ptr[rows])
    share = np.exp(log_part[index[out]] - log_free[first])
    # beside huge logarithms the sum of alike ones is each of them
    share /= np.maximum(np.bincount(first, share, vertices), 1.0)[first]
    probability[out] = unpaired[first] * share
    width = np.asarray(np.bincount(plan.label, -unpaired * np.expm1(-log_free)), dtype=np.float64)
    width += _touching(plan.label, graph.ends[out], bounds[1, out], len(width))
    return _Parted(probability, unpaired * np.exp(-log_free), plan.kept, plan.label, width)


def _touching(label: Array, ends: Array, upper: Floats, clusters: int) -> Floats:
    """Sum of these edges' values at each cluster that they touch."""
    first, second = label[ends].T
    apart = first != second
    return np.asarray(
        np.bincount(first, upper, clusters) + np.bincount(second[apart], upper[apart], clusters), dtype=np.float64
    )


def reduced(graph: PairGraph, log_weight: Floats, kept: Array, log_free: Floats, rows: int) -> tuple[Floats, Floats]:
    """Weights of edges and of unmatched vertices, reduced by the multipliers of the best event.

    The first ``rows`` vertices are those of the first list. Where rounding of their sums would change weights by a
    thousandth and more, numbers are first rounded to a grid on which all sums of the matching are exact: the best event
    weighs 1 then, and none more.
    """
    largest = float(np.abs(np.concatenate([log_weight, log_free])).max())
    if (exponent := math.frexp(largest * len(log_free))[1]) > _LOSSY:
        grid = math.ldexp(1.0, exponent - _GRID)
        log_weight, log_free = np.rint(log_weight / grid) * grid, np.rint(log_free / grid) * grid
    edge = graph.edge[: graph.ptr[rows]]
    costs = np.where(kept, -log_weight, np.inf)
    best = match(graph.ptr[: rows + 1], graph.ends[edge, 1] - rows, costs[edge], -log_free[:rows], -log_free[rows:])
    assert best is not None
    dual = np.concatenate([best.row_duals, best.column_duals])
    return np.exp(dual[graph.ends].sum(axis=1) - costs), np.exp(dual + log_free)
