"""Joint events without their permutations: JPDA*.

Joint events that detect the same tracks by the same measurements differ in who has which measurement. Averaged over
these permutations, the states of targets side by side come together in the middle (coalescence). So of each such set
of events only the best counts, and it gets the probability of the whole set: the probability that a track is
detected, and that a measurement is a target's, stay as they are.

References
----------
H. Blom, E. Bloem, Probabilistic data association avoiding track coalescence, IEEE Trans. Automatic Control 45, 2000:
JPDA*, which leaves the other permutations out instead of giving their probability to the best.
"""

from __future__ import annotations

import numpy as np

from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.sorting import order_of
from assoc._types import Array, Floats, Ints
from assoc.ranking.pairs.events import reduced
from assoc.ranking.pairs.graph import PairGraph, pair_graph
from assoc.ranking.sweep import cluster

_LEAST, _STEP = 1e-4, 4.0
"""Less likely pairs keep their probability; where a cluster is too large, this limit rises by that factor."""
_BITS = 62
"""Most vertices of a cluster: a set is a number with a bit for each."""
_DEARER = 8
"""A set costs so many times what a sum over joint events does."""


def without_permutations(
    first: Array, second: Array, log_weight: Array, sizes: tuple[int, int], probability: Array, states: int
) -> Floats:
    """Probability of each pair when each set of detected tracks and used measurements has only its best permutation.

    Pairs are as for `pair_probabilities`, ``probability`` (K,) theirs among all joint events. Of a cluster's sets the
    likeliest count, of ``states`` an eighth, after each track.
    """
    share = np.array(probability, dtype=np.float64)
    likely = np.flatnonzero(share >= _LEAST)
    # without a measurement in the gates of two tracks nothing can be permuted
    if len(likely) and np.bincount(second[likely]).max() > 1:
        graph, weight = pair_graph(first[likely], second[likely], sizes), np.asarray(log_weight, np.float64)[likely]
        weights = reduced(graph, weight, np.ones(len(likely), np.bool_), np.zeros(sum(sizes)), sizes[0])
        shares = share[likely]
        _permuted(graph, *weights, sizes[0], max(1, int(states) // _DEARER), shares)
        share[likely] = shares
    return share


@njit
def _permuted(graph: PairGraph, weights: Floats, free: Floats, rows: int, most: int, share: Floats) -> None:
    """Replace the probabilities of the pairs; the first `rows` vertices are tracks."""
    kept, bit, found = np.ones(share.size, np.bool_), np.zeros(free.size, np.int64), np.zeros(share.size)
    label, members = np.full(free.size, -1, np.int64), np.empty(free.size, np.int64)
    limit = np.full(free.size, _LEAST)
    for v in range(rows):
        while label[v] < 0:
            inside = members[: cluster(graph.graph, kept, v, v, label, members)]
            if inside.size <= _BITS:
                for i in range(inside.size):
                    bit[inside[i]] = 1 << i
                _permute(graph, (weights, free), kept, inside, rows, most, share, (bit, found))
                break
            level = 0.0
            for u in inside:
                level = max(level, _STEP * limit[u])
            for u in inside:
                label[u] = -1
                limit[u] = level
                for x in range(graph.ptr[u], graph.ptr[u + 1]):
                    if share[graph.edge[x]] < level:
                        kept[graph.edge[x]] = False


@inner_njit
def _permute(
    graph: PairGraph, reduced: tuple[Floats, Floats], kept: Array, members: Ints, rows: int, most: int,
    share: Floats, work: tuple[Ints, Floats],
) -> None:  # fmt: skip
    """Replace the probabilities of a cluster's pairs.

    ``members`` are its vertices, those below ``rows`` tracks, neighbours near each other; ``reduced`` are weights of
    edges and of unmatched vertices; ``work`` is the bit of each vertex, and zeros, a number for each pair.

    Sets of detected tracks and used measurements grow track by track; of each the sum over all permutations is known,
    and the best one, by the set it grew from and its last pair.
    """
    tracks = members[members < rows]
    if tracks.size < 2 or members.size - tracks.size < 2:
        return
    weights, free = reduced
    bit, found = work
    origin, pair = np.empty((tracks.size, most), np.int64), np.empty((tracks.size, most), np.int64)
    sets, total, best = np.zeros(1, np.int64), np.ones(1), np.ones(1)
    for i in range(tracks.size):
        v = tracks[i]
        room = sets.size * (1 + graph.ptr[v + 1] - graph.ptr[v])
        grown, where, by = np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room, np.int64)
        count = 0
        for k in range(sets.size):
            grown[count], where[count], by[count] = sets[k], k, -1
            count += 1
            for x in range(graph.ptr[v], graph.ptr[v + 1]):
                e = graph.edge[x]
                here = bit[graph.ends[e, 1]]
                if kept[e] and not sets[k] & here:
                    grown[count], where[count], by[count] = sets[k] | here | bit[v], k, e
                    count += 1
        order = order_of(grown[:count])
        sums, tops, last, held = np.zeros(count), np.zeros(count), np.empty(count, np.int64), -1
        for n in range(count):
            k = order[n]
            if n == 0 or grown[k] != grown[order[n - 1]]:
                held += 1
            weight = free[v] if by[k] < 0 else weights[by[k]]
            sums[held] += weight * total[where[k]]
            if weight * best[where[k]] >= tops[held]:
                tops[held], last[held] = weight * best[where[k]], k
        likeliest = order_of(-sums[: held + 1])[:most]
        total, best, sets = sums[likeliest], tops[likeliest], grown[last[likeliest]]
        for n in range(likeliest.size):
            origin[i, n], pair[i, n] = where[last[likeliest[n]]], by[last[likeliest[n]]]
    for k in range(sets.size):
        weight, at = total[k], k
        for v in members[members >= rows]:
            if not sets[k] & bit[v]:
                weight *= free[v]
        for i in range(tracks.size - 1, -1, -1):
            if pair[i, at] >= 0:
                found[pair[i, at]] += weight
            at = origin[i, at]
    # pairs that were left out do not change the probability that a track is detected
    for v in tracks:
        old = new = 0.0
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            if kept[graph.edge[x]]:
                old += share[graph.edge[x]]
                new += found[graph.edge[x]]
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            if kept[graph.edge[x]] and new > 0.0:
                share[graph.edge[x]] = found[graph.edge[x]] * old / new
            found[graph.edge[x]] = 0.0
