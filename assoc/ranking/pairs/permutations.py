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
from assoc._types import Array, Floats, Ints
from assoc.ranking.pairs.events import reduced
from assoc.ranking.pairs.graph import PairGraph, pair_graph
from assoc.ranking.sweep import cluster

_LEAST, _STEP = 1e-4, 4.0
"""Less likely pairs keep their probability; where a cluster is too large, this limit rises by that factor."""


def without_permutations(
    first: Array, second: Array, log_weight: Array, sizes: tuple[int, int], probability: Array, states: int
) -> Floats:
    """Probability of each pair when each set of detected tracks and used measurements has only its best permutation.

    Pairs are as for `pair_probabilities`, ``probability`` (K,) theirs among all joint events. Where a cluster would
    have more than ``states`` sets, the least likely pairs are left as they are.
    """
    share = np.array(probability, dtype=np.float64)
    likely = np.flatnonzero(share >= _LEAST)
    # without a measurement in the gates of two tracks nothing can be permuted
    if len(likely) and np.bincount(second[likely]).max() > 1:
        graph, weight = pair_graph(first[likely], second[likely], sizes), np.asarray(log_weight, np.float64)[likely]
        weights = reduced(graph, weight, np.ones(len(likely), np.bool_), np.zeros(sum(sizes)), sizes[0])
        shares = share[likely]
        _permuted(graph, *weights, sizes[0], max(4, int(states).bit_length() - 1), shares)
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
            if inside.size <= most:
                _permute(graph, (weights, free), kept, np.sort(inside), rows, share, (bit, found))
                break
            level = _STEP * limit[inside].max()
            for u in inside:
                label[u] = -1
                limit[u] = level
                for x in range(graph.ptr[u], graph.ptr[u + 1]):
                    if share[graph.edge[x]] < level:
                        kept[graph.edge[x]] = False


@inner_njit
def _permute(
    graph: PairGraph, reduced: tuple[Floats, Floats], kept: Array, members: Ints, rows: int, share: Floats,
    work: tuple[Ints, Floats],
) -> None:  # fmt: skip
    """Replace the probabilities of a cluster's pairs; `members` are its vertices, sorted.

    ``reduced`` are weights of edges and of unmatched vertices; ``work`` is room for as many numbers of each, the
    latter zeros.

    A set of vertices is a number with a bit for each, those of tracks above. Its best permutation, and the sum over
    all, follow from the sets without its last track.
    """
    size, tracks = members.size, np.searchsorted(members, rows)
    if tracks < 2 or size - tracks < 2:
        return
    weights, free = reduced
    bit, found = work
    for i in range(size):
        bit[members[i]] = 1 << ((i - tracks) % size)
    best, total, last = np.zeros(1 << size), np.zeros(1 << size), np.empty(1 << size, np.int64)
    best[0] = total[0] = 1.0
    for v in members[:tracks]:
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            e = graph.edge[x]
            here = bit[graph.ends[e, 1]]
            for s in range(bit[v] if kept[e] else 0):
                if total[s] > 0.0 and not s & here:
                    n = s | here | bit[v]
                    total[n] += weights[e] * total[s]
                    if weights[e] * best[s] > best[n]:
                        best[n], last[n] = weights[e] * best[s], e
    for s in range(best.size):
        if best[s] > 0.0:
            weight, left = total[s], s
            for v in members:
                if not s & bit[v]:
                    weight *= free[v]
            while left:
                found[last[left]] += weight
                left &= ~(bit[graph.ends[last[left], 0]] | bit[graph.ends[last[left], 1]])
    # pairs that were left out do not change the probability that a track is detected
    for v in members[:tracks]:
        old = new = 0.0
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            if kept[graph.edge[x]]:
                old += share[graph.edge[x]]
                new += found[graph.edge[x]]
        for x in range(graph.ptr[v], graph.ptr[v + 1]):
            if kept[graph.edge[x]] and new > 0.0:
                share[graph.edge[x]] = found[graph.edge[x]] * old / new
            found[graph.edge[x]] = 0.0
