"""The next hypotheses of all clusters by one sensor's measurements: Reid's generation, cluster by cluster."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from assoc._system import memory
from assoc._types import Array
from assoc.tracking.mht.children import Meanings, next_hypotheses
from assoc.tracking.mht.clusters import Cluster, cluster, doubted, grouped, linked, merged, odds_of
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
    members = grouped(label[: len(clusters)], parts)
    measurements = grouped(label[len(clusters) :], parts)
    by_measurement = np.lexsort((offers.branch, offers.measurement))
    near = [by_measurement[one] for one in grouped(label[own[offers.branch[by_measurement]]], parts)]
    birth, birth_row = np.full(count, -np.inf), np.zeros(count, dtype=np.int64)
    birth[born], birth_row[born] = offers.births.score, total + pairs + np.arange(len(born))
    # what a branch can add to a log-probability at most
    potential = offers.missed.copy()
    np.maximum.at(potential, offers.branch, offers.gain)
    found, alone, odds = [], [], []
    for there, z, pair in zip(members, measurements, near, strict=True):
        if not len(there):
            alone.append(birth_row[z[0]])
            odds.append(birth[z[0]])
            continue
        whole = merged([clusters[i] for i in there.tolist()], potential, most)
        if len(z):
            found.append(_children(whole, offers, z, pair, birth[z], birth_row[z], most, drop))
        elif len(whole.branches) == 1:
            alone.append(whole.branches[0])
            odds.append(odds_of(whole) + offers.missed[whole.branches[0]])
        else:
            weight = whole.weight + whole.holds @ offers.missed[whole.branches]
            found.append(cluster(whole.branches, whole.holds, weight, most, drop))
    return found + doubted(np.array(alone, dtype=np.int64), np.array(odds), most, drop)


def _children(
    whole: Cluster, offers: Offers, z: Array, pair: Array, birth: Array, birth_row: Array, most: int, drop: float
) -> Cluster:
    """The children of a cluster's hypotheses by the measurements z (their births: score and row) in its gates."""
    branch = offers.branch[pair]
    track = np.searchsorted(whole.branches, branch)
    if len(whole.branches) <= track.max() or (whole.branches[track] != branch).any():
        # merging has left out all hypotheses that believe in a branch
        there = np.isin(branch, whole.branches)
        pair, branch, track = pair[there], branch[there], track[there]
    first = np.searchsorted(offers.measurement[pair], np.append(z, z[-1] + 1))
    memory.require(
        whole.holds.nbytes + most * (4.0 * len(z) + 100.0),
        f"max_hypotheses = {most}: {len(whole.weight)} hypotheses",
        "keep fewer",
    )
    meanings = Meanings(first, track, offers.gain[pair] - offers.missed[branch], birth)
    used, holds, weight = next_hypotheses(
        whole.holds, whole.weight, offers.missed[whole.branches], meanings, most, drop
    )
    rows = np.concatenate([whole.branches, len(offers.missed) + pair, birth_row])
    return Cluster(rows[used], holds, weight)
