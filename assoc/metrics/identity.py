"""Which track follows which target over time: identity switches, fragmentation, CLEAR MOT, IDF1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.metrics.ospa import check_cutoff, distances
from assoc.metrics.trajectories import Trajectories, columns_of_rows, epochs


@dataclass(frozen=True)
class Identity:
    """How well tracks keep to their targets.

    Attributes
    ----------
    switches : int
        How often a target got another track than its last (also after a gap).
    fragmentations : int
        How often a lost target was tracked again.
    matches, missed, false : int
        Instants of targets with a track, of targets without, of tracks without a target.
    mota : float
        1 - (missed + false + switches) / instants of targets; 1 is best, it may be negative. NaN without truth.
    motp : float
        Mean distance of the matches, metres; NaN without any.
    idf1 : float
        Share of instants that agree when each target goes with one track throughout (0 to 1); NaN without both.
    mostly_tracked, mostly_lost : int
        Targets with a track at 80 % and more, and at 20 % and less, of their instants.
    targets : int
    """

    switches: int
    fragmentations: int
    matches: int
    missed: int
    false: int
    mota: float
    motp: float
    idf1: float
    mostly_tracked: int
    mostly_lost: int
    targets: int


@explains_wrong_types
def identity(truth: Trajectories, tracks: Trajectories, cutoff: float) -> Identity:
    """Follow targets through tracks.

    At each instant a target keeps its last track as long as that is within the cutoff; the others are
    paired so that as many as possible pair up, and among those pairings so that distances are small.

    Parameters
    ----------
    truth, tracks : Trajectories
    cutoff : float
        Metres: a track further away than this is not the target's.

    References
    ----------
    Bernardin & Stiefelhagen, Evaluating multiple object tracking performance: the CLEAR MOT metrics, EURASIP
    J. Image and Video Processing (2008). Ristani et al., Performance measures and a data set for
    multi-target, multi-camera tracking, ECCV workshops (2016), for IDF1.
    """
    check_cutoff(cutoff, 1.0)
    last: dict[int, int] = {}
    lost: set[int] = set()
    present: dict[int, int] = {}
    tracked: dict[int, int] = {}
    together: dict[tuple[int, int], int] = {}
    switches = fragmentations = false = 0
    errors: list[float] = []
    for _, rows, columns in epochs(truth, tracks):
        targets, candidates = truth.ids[rows].tolist(), tracks.ids[columns].tolist()
        between = distances(truth.positions[rows], tracks.positions[columns])
        for i, j in np.argwhere(between <= cutoff).tolist():
            key = (targets[i], candidates[j])
            together[key] = together.get(key, 0) + 1
        pairs = _pair(between, cutoff, [last.get(target) for target in targets], candidates)
        for target in targets:
            present[target] = present.get(target, 0) + 1
        matched = set()
        for i, j in pairs:
            target, track = targets[i], candidates[j]
            matched.add(target)
            switches += last.get(target, track) != track
            fragmentations += target in lost
            lost.discard(target)
            last[target] = track
            tracked[target] = tracked.get(target, 0) + 1
            errors.append(float(between[i, j]))
        lost.update(target for target in targets if target in last and target not in matched)
        false += len(candidates) - len(pairs)
    missed = len(truth) - len(errors)
    shares = np.array([tracked.get(target, 0) / count for target, count in present.items()])
    return Identity(
        switches=switches,
        fragmentations=fragmentations,
        matches=len(errors),
        missed=missed,
        false=false,
        mota=1.0 - (missed + false + switches) / len(truth) if len(truth) else float("nan"),
        motp=float(np.mean(errors)) if errors else float("nan"),
        idf1=_idf1(together, len(truth), len(tracks)),
        mostly_tracked=int((shares >= 0.8).sum()),
        mostly_lost=int((shares <= 0.2).sum()),
        targets=len(present),
    )


def _pair(between: Array, cutoff: float, last: list[int | None], tracks: list[int]) -> list[tuple[int, int]]:
    """Pairs (target, track) of one instant: those that stay, then the best of the rest."""
    column = {track: j for j, track in enumerate(tracks)}
    pairs = [
        (i, column[track])
        for i, track in enumerate(last)
        if track is not None and track in column and between[i, column[track]] <= cutoff
    ]
    # two targets may share their last track, one after the other: the nearer keeps it
    pairs.sort(key=lambda pair: between[pair])
    kept: dict[int, int] = {}
    for i, j in pairs:
        kept.setdefault(j, i)
    staying = set(kept.values())
    free_i = [i for i in range(len(last)) if i not in staying]
    free_j = [j for j in range(len(tracks)) if j not in kept]
    rest = between[np.ix_(free_i, free_j)]
    # one pair more is worth more than all distances together
    cost = np.where(rest <= cutoff, rest / cutoff, 2.0 + 2.0 * min(between.shape, default=0))
    chosen = [(free_i[a], free_j[b]) for a, b in np.transpose(linear_sum_assignment(cost)) if rest[a, b] <= cutoff]
    return sorted([(i, j) for j, i in kept.items()] + chosen)


def _idf1(together: dict[tuple[int, int], int], targets: int, tracks: int) -> float:
    if targets + tracks == 0:
        return float("nan")
    if not together:
        return 0.0
    pairs = np.array(list(together), dtype=np.int64)
    rows, columns = (np.unique(side, return_inverse=True)[1] for side in pairs.T)
    times = np.array(list(together.values()), dtype=np.float64)
    # each of many identities met only few others: one matrix of all would be too large
    nodes = int(rows.max()) + 1 + int(columns.max()) + 1
    graph = coo_array((np.ones(len(times), np.int8), (rows, int(rows.max()) + 1 + columns)), shape=(nodes, nodes))
    label = connected_components(graph, directed=False)[1][rows]
    order = np.argsort(label, kind="stable")
    agreed = 0.0
    for group in np.split(order, np.flatnonzero(np.diff(label[order])) + 1):
        (targets_here, i), (tracks_here, j) = (np.unique(side[group], return_inverse=True) for side in (rows, columns))
        count = np.zeros((len(targets_here), len(tracks_here)))
        count[i, j] = times[group]
        agreed += float(count[linear_sum_assignment(-count)].sum())
    return 2.0 * agreed / (targets + tracks)


@explains_wrong_types
def label_switches(sources: Array, labels: Array) -> int:
    """Identity switches where the source of each measurement is known: changes of label along each source.

    Parameters
    ----------
    sources : array_like of int (n,)
        The target behind each measurement, -1 for a false alarm; measurements in the order of time.
    labels : array_like of int (n,)
        The track that took it, negative if none did: a gap is no switch, another track after it is one.
    """
    source, label = columns_of_rows(sources=sources, labels=labels)
    known = (source >= 0) & (label >= 0)
    source, label = source[known], label[known]
    order = np.argsort(source, kind="stable")
    source, label = source[order], label[order]
    return int(((np.diff(source) == 0) & (np.diff(label) != 0)).sum())
