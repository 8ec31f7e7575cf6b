"""JPDA* for several sensors at once: joint events of tracks and tuples of measurements, without their permutations.

Of the events that detect the same tracks by the same measurements, whoever has which, only the best counts, with the
probability of all of them; see `assoc.ranking.pairs.permutations`.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from assoc._types import Array, Floats, Ints

_LEAST, _STEP = 1e-4, 4.0
"""Less likely tuples keep their probability; where a cluster is too large, this limit rises by that factor."""
_BITS = 62
"""Tracks and measurements of a cluster."""
_SETS = 512
"""Sets kept at a time: the heaviest."""


def without_tuple_permutations(
    track: Array, rows: Array, log_weight: Array, sizes: Array, probability: Array
) -> Floats:
    """Probability of each tuple when each set of detected tracks and used measurements has only its best permutation.

    Parameters
    ----------
    track : int array (M,)
        Track of each tuple, ascending.
    rows : int array (M, S)
        Its measurements, 1-based, 0: none.
    log_weight : array (M,)
        Factor of an event's weight, relative to that of the track without measurements, as a logarithm.
    sizes : int array (S,)
        Measurements of each sensor.
    probability : array (M,)
        Among all joint events. What all tuples of a track with measurements have together is kept.
    """
    share = np.array(probability, dtype=np.float64)
    members = np.column_stack([track + 1, rows])
    offset = np.concatenate([[0], np.cumsum(np.concatenate([[int(track.max(initial=-1)) + 1], sizes]))[:-1]])
    limit, waiting = _LEAST, np.flatnonzero(rows.any(axis=1) & (share >= _LEAST))
    while len(waiting):
        large = [np.zeros(0, dtype=np.int64)]
        for together in _clusters(members[waiting] > 0, offset + members[waiting]):
            which = waiting[together]
            bits, width = _as_sets(members[which] > 0, offset + members[which])
            if width > _BITS:
                large.append(which)
            elif np.ptp(track[which]):
                found = _permuted(track[which], bits, log_weight[which])
                new, old = (np.bincount(track[which], each)[track[which]] for each in (found, share[which]))
                # what was left out does not change the probability that a track is detected
                share[which] = np.where(new > 0.0, found * old / np.maximum(new, 1e-300), share[which])
        limit *= _STEP
        waiting = np.concatenate(large)
        waiting = waiting[probability[waiting] >= limit]
    return share


def _clusters(used: Array, vertices: Array) -> list[Array]:
    """Tuples by cluster: those that share vertices, directly or by others."""
    tuples, _ = np.nonzero(used)
    count = int(vertices.max()) + 1
    edges = np.ones(len(tuples)), (vertices[tuples, 0], vertices[used])
    label = connected_components(coo_array(edges, shape=(count, count)), directed=False)[1][vertices[:, 0]]
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def _as_sets(used: Array, vertices: Array) -> tuple[Ints, int]:
    """The vertices of each tuple as bits of a number, and how many there are."""
    known, number = np.unique(vertices[used], return_inverse=True)
    bits = np.zeros(used.shape, dtype=np.int64)
    if len(known) <= _BITS:
        bits[used] = np.int64(1) << number.reshape(-1)
    return bits.sum(axis=1), len(known)


def _permuted(track: Array, bits: Array, log_weight: Array) -> Floats:
    """Probability of each tuple of a cluster, where the best event of each set has the probability of all.

    A set of vertices is a number. The best event of a set, and the sum over all, follow from the sets without its last
    track.
    """
    found = np.zeros(len(track))
    sets, total, best = np.zeros(1, dtype=np.int64), np.zeros(1), np.zeros(1)
    steps: list[tuple[Array, Array]] = []
    for t in np.unique(track):
        of_track = np.flatnonzero(track == t)
        before, tuples = np.nonzero((sets[:, None] & bits[of_track]) == 0)
        before = np.concatenate([np.arange(len(sets)), before])
        tuples = np.concatenate([np.full(len(sets), -1), of_track[tuples]])
        weight = np.append(log_weight, 0.0)[tuples]
        after = sets[before] | np.append(bits, 0)[tuples]
        order = np.lexsort((-(best[before] + weight), after))
        begin = np.flatnonzero(np.diff(after[order], prepend=-1))
        sums = np.logaddexp.reduceat((total[before] + weight)[order], begin)
        first = order[begin]
        if len(first) > _SETS:
            kept = np.sort(np.argpartition(-sums, _SETS)[:_SETS])
            first, sums = first[kept], sums[kept]
        steps.append((before[first], tuples[first]))
        sets, total, best = after[first], sums, (best[before] + weight)[first]
    weight = np.exp(total - np.logaddexp.reduce(total))
    at = np.arange(len(sets))
    for before, tuples in reversed(steps):
        used = tuples[at] >= 0
        np.add.at(found, tuples[at][used], weight[used])
        at = before[at]
    return found
