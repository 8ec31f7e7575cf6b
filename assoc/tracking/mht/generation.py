"""Generate the next hypotheses of all clusters: by one sensor's measurements (Reid), and by crossing bearings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from assoc._system import memory
from assoc._types import Array
from assoc.problem import AssignmentProblem
from assoc.ranking.kbest import kbest
from assoc.tracking.growth import Births, Offers
from assoc.tracking.mht.children import Meanings, next_hypotheses
from assoc.tracking.mht.clusters import Cluster, cluster, doubted, grouped, linked, merged, odds_of


def generated(
    clusters: Sequence[Cluster], offers: Offers, born: Array, count: int, most: int, drop: float
) -> list[Cluster]:
    """Merge the clusters whose gates a measurement lies in together, and generate the children of their hypotheses.

    The clusters are about B branches; `offers` are K pairs of a branch and a measurement, and N births, of the
    measurements in `born` (N,), 0-based, of `count`. A cluster has `most` hypotheses, at most `drop` below the best.
    The new clusters are about rows of the missed branches, the pairs, and the births, in this order.
    """
    total, pairs = len(offers.missed), len(offers.branch)
    cluster_of = np.repeat(np.arange(len(clusters)), [len(group.branches) for group in clusters])
    label = linked(cluster_of[offers.branch], len(clusters) + offers.measurement, len(clusters) + count)
    parts = int(label.max(initial=-1)) + 1
    members = grouped(label[: len(clusters)], parts)
    measurements = grouped(label[len(clusters) :], parts)
    by_measurement = np.lexsort((offers.branch, offers.measurement))
    near = [by_measurement[pairs] for pairs in grouped(label[cluster_of[offers.branch[by_measurement]]], parts)]
    birth, birth_row = np.full(count, -np.inf), np.zeros(count, dtype=np.int64)
    birth[born], birth_row[born] = offers.births.score, total + pairs + np.arange(len(born))
    # the most that a branch can add to a log-probability
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
    """Children of a cluster's hypotheses by the measurements z (births: score and row) in its gates."""
    branch = offers.branch[pair]
    track = np.searchsorted(whole.branches, branch)
    if len(whole.branches) <= track.max() or (whole.branches[track] != branch).any():
        # merging may have dropped all hypotheses that contain a branch
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


def with_births(
    clusters: Sequence[Cluster], rows: Array, births: Births, sizes: Array, most: int, drop: float
) -> list[Cluster]:
    """Merge the clusters that contend with births for measurements, and add every set of births that is possible.

    `rows` (B, S) are the 1-based measurements of this scan that each branch has taken, 0: none, of `sizes` (S,). A
    cluster has `most` hypotheses, at most `drop` below the best. The new clusters are about rows of the branches and
    the births, in this order.
    """
    width = int(sizes.max(initial=0)) + 1
    places = width * np.arange(len(sizes))
    cluster_of = np.repeat(np.arange(len(clusters)), [len(group.branches) for group in clusters])
    branch, taken = np.nonzero(rows)
    birth, wanted = np.nonzero(births.rows)
    begin = len(clusters) + len(births.score)
    first = np.append(cluster_of[branch], len(clusters) + birth)
    second = np.append((places[taken] + rows[branch, taken]), (places + births.rows)[birth, wanted])
    label = linked(first, begin + second, begin + width * len(sizes))
    parts = int(label[:begin].max(initial=-1)) + 1
    members, born = grouped(label[: len(clusters)], parts), grouped(label[len(clusters) : begin], parts)
    found = []
    for there, new in zip(members, born, strict=True):
        if not len(new):
            found += [clusters[i] for i in there.tolist()]
            continue
        nobody = Cluster(np.zeros(0, dtype=np.int64), np.zeros((1, 0), dtype=np.bool_), np.zeros(1))
        whole = merged([nobody, *(clusters[i] for i in there.tolist())], np.zeros(len(rows)), most)
        found.append(_with_sets(whole, rows, new, births, sizes, most, drop))
    return found


def _with_sets(
    whole: Cluster, rows: Array, new: Array, births: Births, sizes: Array, most: int, drop: float
) -> Cluster:
    """Children of a cluster's hypotheses by these births."""
    # births whose measurements each hypothesis has not taken
    used = rows[whole.branches]
    wants = births.rows[new]
    excluded = ((used[:, None] == wants) & (wants > 0)).any(axis=2)
    open_births = whole.holds.astype(np.int64) @ excluded == 0
    known: dict[bytes, tuple[Array, Array]] = {}
    holds, weight = [], []
    for held, before, able in zip(whole.holds, whole.weight, open_births, strict=True):
        key = able.tobytes()
        if key not in known:
            known[key] = _sets(births, new, able, sizes, most)
        sets, score = known[key]
        holds.append(np.concatenate([np.broadcast_to(held, (len(sets), len(held))), sets], axis=1))
        weight.append(before + score)
    branches = np.append(whole.branches, len(rows) + new)
    return cluster(branches, np.concatenate(holds), np.concatenate(weight), most, drop)


def _sets(births: Births, new: Array, able: Array, sizes: Array, most: int) -> tuple[Array, Array]:
    """The best compatible sets of births, as masks over `new` (K, N), and the sum of scores of each."""
    numbers = np.flatnonzero(able)
    if not len(numbers):
        return np.zeros((1, len(new)), dtype=np.bool_), np.zeros(1)
    chosen = new[numbers]
    solutions = kbest(AssignmentProblem(births.rows[chosen], -births.score[chosen], sizes), most)
    sets = np.zeros((len(solutions), len(new)), dtype=np.bool_)
    for one, solution in zip(sets, solutions, strict=True):
        one[numbers[solution.indices[solution.indices < len(numbers)]]] = True
    return sets, np.array([-solution.cost for solution in solutions])
