"""The next hypotheses of all clusters by one sensor's measurements: Reid's generation, cluster by cluster."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from assoc._system import memory
from assoc._types import Array
from assoc.tracking.mht.children import NEW, Meanings, Parents, best_children
from assoc.tracking.mht.clusters import Cluster, cluster, limited, linked, merged
from assoc.tracking.mht.growth import Offers


def generated(
    clusters: Sequence[Cluster], offers: Offers, born: Array, count: int, most: int, drop: float
) -> list[Cluster]:
    """Merge the clusters whose gates a measurement lies in together, and generate the children of their hypotheses.

    Parameters
    ----------
    clusters : sequence of Cluster
        Of B branches.
    offers : Offers
        K pairs of them and measurements, and N births.
    born : int array (N,)
        Measurement (0-based) of each birth.
    count : int
        Measurements of the sensor.
    most, drop
        The most hypotheses of a cluster, and how far below the best they may be.

    Returns
    -------
    list of Cluster
        Of rows among branches missed, pairs, births, in this order.
    """
    total, pairs = len(offers.missed), len(offers.branch)
    own = np.repeat(np.arange(len(clusters)), [len(one.branches) for one in clusters])
    label = linked(own[offers.branch], len(clusters) + offers.measurement, len(clusters) + count)
    parts = int(label.max(initial=-1)) + 1
    members = _grouped(label[: len(clusters)], parts)
    measurements = _grouped(label[len(clusters) :], parts)
    near = _grouped(label[own[offers.branch]], parts)
    birth, birth_row = np.full(count, -np.inf), np.zeros(count, dtype=np.int64)
    birth[born], birth_row[born] = offers.births.score, total + pairs + np.arange(len(born))
    # what a branch can add to a log-probability at most
    potential = offers.missed.copy()
    np.maximum.at(potential, offers.branch, offers.gain)
    found = []
    for group in range(parts):
        there = [clusters[i] for i in members[group].tolist()]
        z, pair = measurements[group], near[group]
        if not there:
            if birth[z[0]] > -np.inf:
                weight = np.array([birth[z[0]], 0.0])
                found.append(limited(cluster(birth_row[z], np.array([[True], [False]]), weight), most, drop))
            continue
        whole = merged(there, potential, most)
        weight = whole.weight + whole.holds @ offers.missed[whole.branches]
        if not len(z):
            found.append(limited(cluster(whole.branches, whole.holds, weight), most, drop))
            continue
        pair = pair[np.lexsort((offers.branch[pair], offers.measurement[pair]))]
        # merging may have left out all hypotheses that believe in a branch
        pair = pair[np.isin(offers.branch[pair], whole.branches)]
        track = np.searchsorted(whole.branches, offers.branch[pair])
        first = np.searchsorted(offers.measurement[pair], np.append(z, count))
        gain = offers.gain[pair] - offers.missed[offers.branch[pair]]
        memory.require(
            whole.holds.nbytes + most * (4.0 * len(z) + 100.0),
            f"max_hypotheses = {most}: {len(whole.weight)} hypotheses",
            "keep fewer",
        )
        parents = Parents(whole.holds, weight)
        parent, choice, weight = best_children(parents, Meanings(first, track, gain, birth[z]), most, drop)
        rows = np.concatenate([whole.branches, total + pair, birth_row[z]])
        found.append(cluster(rows, _held(whole.holds[parent], choice, track), weight))
    return found


def _held(holds: Array, choice: Array, track: Array) -> Array:
    """Which of the branches missed, the pairs and the births each child believes in, bool (C, B + K + n)."""
    count, branches = holds.shape
    all_held = np.zeros((count, branches + len(track) + choice.shape[1]), dtype=np.bool_)
    all_held[:, :branches] = holds
    child, measurement = np.nonzero(choice >= 0)
    pair = choice[child, measurement]
    all_held[child, track[pair]] = False
    all_held[child, branches + pair] = True
    child, measurement = np.nonzero(choice == NEW)
    all_held[child, branches + len(track) + measurement] = True
    return all_held


def _grouped(label: Array, parts: int) -> list[Array]:
    """Numbers of the things of each part, ascending."""
    order = np.argsort(label, kind="stable")
    return np.split(order, np.searchsorted(label[order], np.arange(1, parts)))
