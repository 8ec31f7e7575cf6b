"""Hypothesis-oriented multiple hypothesis tracking: Reid's clusters and generation, Murty's m best, n-scan pruning.

A hypothesis assigns every measurement so far to a false alarm, an existing target, or a new target. Its
probability is equation 2.1 of the thesis on clustering time windows,

    p = 1/c  P_D^N_d  (1 - P_D)^(N_t - N_d)  P_FA^N_fa  P_NT^N_nt  prod p(z | t)  p_parent,

with N_d detected targets, and densities for P_FA and P_NT. Relative to "all false alarms" its logarithm is the
sum of the scores of the hypothesis' tracks (`assoc.costs.tracks.scores`), the score of the track-oriented form.
Tracks that share no measurement are in separate clusters, each with its own m best hypotheses
(`assoc.tracking.mht.clusters`).

References
----------
D. B. Reid, An algorithm for tracking multiple targets, IEEE Trans. Automatic Control 24, 1979.
I. J. Cox, S. L. Hingorani, An efficient implementation of Reid's multiple hypothesis tracking algorithm,
IEEE Trans. Pattern Analysis and Machine Intelligence 18, 1996.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.scene.scan import Scan
from assoc.tracking.file import Saved
from assoc.tracking.growth import Grown, Growth, Offers, growth_of
from assoc.tracking.mht.clusters import Cluster, agreeing, cluster, linked, parts, without
from assoc.tracking.mht.generation import generated, with_births
from assoc.tracking.mht.window import DeferringMethod, Window
from assoc.tracking.progress import Association, Progress
from assoc.tracking.records.track import Decision, Step
from assoc.tracking.records.track_batch import STARTED, TrackBatch
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.stages.coverage import new_targets_at
from assoc.tracking.stages.ending import to_delete
from assoc.tracking.state import TrackerState
from assoc.tracking.tracker import Tracker

_MANY = 0.25
"""Share of new targets, see `ClusteredHypotheses._seldom`."""


class Hypotheses(NamedTuple):
    """Clusters and window of B branches, without their scores and states."""

    window: Window
    clusters: tuple[Cluster, ...]
    """Their branches are all rows of the tracks, cluster after cluster."""

    @property
    def best(self) -> Array:
        """Rows of the best hypothesis."""
        return np.concatenate([np.zeros(0, dtype=np.int64), *(group.best for group in self.clusters)])


@dataclass(frozen=True)
class ClusteredHypotheses(DeferringMethod):
    """The method of `HypothesisOrientedMHT`."""

    max_hypotheses: int = 50
    hypothesis_drop: float = 15.0

    def __post_init__(self) -> None:
        self._check("max_hypotheses", "hypothesis_drop")

    def begun(self, settings: TrackerSettings, tracks: TrackBatch) -> Hypotheses:
        """Each track in a cluster of its own, and certain."""
        there = np.ones((1, 1), dtype=np.bool_)
        clusters = tuple(cluster(np.array([row]), there, np.zeros(1)) for row in range(len(tracks)))
        return Hypotheses(Window.empty(len(tracks), self.depth, len(settings.sensors)), clusters)

    def current(self, state: TrackerState) -> TrackBatch:
        """The branches of the best hypothesis, by their ids."""
        rows = state.method_state.best
        return state.tracks[rows[np.argsort(state.tracks.track_id[rows], kind="stable")]]

    def probabilities(self, hypotheses: Hypotheses) -> Array:
        """Probabilities of the best hypotheses about everything, the best first."""
        logarithms = np.zeros(1)
        for group in hypotheses.clusters:
            both = (logarithms[:, None] + np.log(group.probabilities)).ravel()
            logarithms = -np.sort(-both)[: self.max_hypotheses]
        return np.exp(logarithms)

    def arranged(self, scan: Scan) -> Scan:
        """The scan with measurements sorted by value: ties between hypotheses are broken by their numbers."""
        return _by_value(scan, _orders(scan))

    def associate(self, progress: Progress) -> Association:
        """Generate the hypotheses about the scan, sensor by sensor."""
        tracks, hypotheses = progress.state.tracks, progress.state.method_state
        orders = _orders(progress.scan)
        growth = growth_of(progress._replace(scan=_by_value(progress.scan, orders)))
        clusters = list(hypotheses.clusters)
        ids, gained = tracks.track_id, np.zeros(len(tracks))
        limits = self.max_hypotheses, self.hypothesis_drop

        def taken(s: int, offers: Offers, grown: Iterable[Cluster]) -> None:
            nonlocal clusters, ids, gained
            clusters, kept = _renumbered(grown)
            ids = np.concatenate([ids, ids[offers.branch], offers.births.ids])[kept]
            hit = gained[offers.branch] + offers.gain
            gained = np.concatenate([gained + offers.missed, hit, offers.births.score])[kept]
            growth.take(s, offers, kept)

        for s in growth.order:
            offers = growth.offers(s)
            born, count = offers.births.rows[:, s] - 1, len(progress.scan.measurements[s])
            taken(s, offers, generated(clusters, offers, born, count, *limits))
        if progress.settings.angles_alone:
            rows = Hypotheses(hypotheses.window, tuple(clusters)).best
            sure = np.append(tracks.confirmed, False)[growth.origin[rows]]
            crossed = growth.crossings(growth.rows[rows[sure]], by_place=False)
            if crossed is not None:
                taken(0, crossed, with_births(clusters, growth.rows, crossed.births, progress.scan.sizes, *limits))
        grown = growth.finished()
        batch = _batch(tracks, growth, grown, ids, gained)
        batch = batch.counted(np.asarray(growth.rows.any(axis=1)), grown.covered)
        older = np.concatenate(
            [hypotheses.window.history, np.zeros((1, hypotheses.window.history.shape[1]), dtype=np.int32)]
        )
        older = older[growth.origin]
        given = [np.append(0, order + 1) for order in orders]
        rows = np.stack([number[growth.rows[:, s]] for s, number in enumerate(given)], axis=1).astype(np.int32)
        history = np.concatenate([rows, older], axis=1)[:, : older.shape[1]]
        return Association(batch, (), Hypotheses(hypotheses.window.opened(progress.scan, history), tuple(clusters)))

    def life_cycle(self, progress: Progress, association: Association) -> Progress:
        """Confirm tracks, decide the oldest scan of the window, delete tracks, split clusters."""
        before, scan = progress.state.tracks, progress.state.scan
        tracks, hypotheses = association.tracks, association.method_state
        known = before.track_id[before.confirmed]
        sure = tracks.confirm(progress.settings.life_cycle, new_targets_at(progress, tracks)).confirmed
        good = hypotheses.best[sure[hypotheses.best]]
        tracks = tracks.with_confirmed(tracks.confirmed | np.isin(tracks.track_id, tracks.track_id[good]))
        now = hypotheses.window.decision(0, scan, tracks, hypotheses.best)
        known = np.union1d(known, tracks.track_id[tracks.confirmed])
        final: tuple[Decision, ...] = ()
        if len(hypotheses.window.times) == self.depth:
            tracks, hypotheses = _kept(tracks, hypotheses, _agreeing(tracks, hypotheses, self._seldom(progress)))
            final = (hypotheses.window.decision(self.depth - 1, scan, tracks, hypotheses.best),)
            hypotheses = hypotheses._replace(window=hypotheses.window.closed())
        # a track is deleted if all its branches are to be deleted, or that of the best hypothesis
        ids, late = tracks.track_id, to_delete(progress, tracks)
        best = hypotheses.best[(late & tracks.confirmed)[hypotheses.best]]
        gone = ~np.isin(ids, ids[~late]) | np.isin(ids, ids[best])
        tracks, hypotheses = _without(tracks, hypotheses, gone)
        tracks, hypotheses = _kept(tracks, hypotheses, _split(tracks, hypotheses))
        ended = np.setdiff1d(known, tracks.track_id)
        step = Step(now.scan, now.time, now.assigned, now.confirmed, final=final, ended=ended)
        return progress.with_state(tracks=tracks, method_state=hypotheses)._replace(step=step)

    def _seldom(self, progress: Progress) -> bool:
        """Whether many new targets are detected less than twice in the window: it says nothing of them."""
        P = np.array([sensor.detection_probability for sensor in progress.settings.sensors])
        once = 1.0 + self.depth * (P / (1.0 - P)).sum()
        return bool(once * np.prod(1.0 - P) ** self.depth > _MANY)

    def renamed(self, state: TrackerState, ids: Array, names: Array) -> TrackerState:
        """The state with these names (K,) in place of ids (K,); tracks that had these names end."""
        tracks, hypotheses = _without(state.tracks, state.method_state, np.isin(state.tracks.track_id, names))
        return state._replace(tracks=tracks.renamed(ids, names), method_state=hypotheses)

    def open_decisions(self, state: TrackerState) -> tuple[Decision, ...]:
        """Decisions of the best hypothesis about the scans that are not final yet, oldest first."""
        return state.method_state.window.decisions(state.scan - 1, state.tracks, state.method_state.best)

    def arrays(self, hypotheses: Hypotheses) -> Mapping[str, Array]:
        """The hypotheses for a file."""
        shapes = np.array([group.holds.shape for group in hypotheses.clusters], dtype=np.int64).reshape(-1, 2)
        return {
            **hypotheses.window.arrays(),
            "cluster_hypotheses": shapes[:, 0],
            "cluster_branches": shapes[:, 1],
            "holds": np.concatenate([np.zeros(0, np.bool_), *(group.holds.ravel() for group in hypotheses.clusters)]),
            "weight": np.concatenate([np.zeros(0), *(group.weight for group in hypotheses.clusters)]),
        }

    def restored(self, settings: TrackerSettings, saved: Saved, state: TrackerState) -> Hypotheses:
        """The hypotheses that a file holds, checked."""
        count = len(state.tracks)
        window = Window.restored(saved, count, self.depth, len(settings.sensors))
        hypotheses, branches = saved["cluster_hypotheses"], saved["cluster_branches"]
        some = ((hypotheses >= 1) & (hypotheses <= self.max_hypotheses)).all()
        saved.require(some, "cluster_hypotheses", f"1 to {self.max_hypotheses} hypotheses of each cluster")
        good = branches.shape == hypotheses.shape and ((branches >= 1) & (branches <= count)).all()
        good = good and int(branches.sum()) == count
        saved.require(good, "cluster_branches", "how many branches each cluster has")
        holds, weight, row = saved["holds"], saved["weight"], 0
        saved.require(len(holds) == int((hypotheses * branches).sum()), "holds", "which hypothesis holds which branch")
        weighed = len(weight) == int(hypotheses.sum()) and np.isfinite(weight).all()
        saved.require(weighed, "weight", "a number for each hypothesis")
        clusters = []
        for h, b in zip(hypotheses.tolist(), branches.tolist(), strict=True):
            clusters.append(Cluster(np.arange(row, row + b), holds[: h * b].reshape(h, b), weight[:h]))
            weight, holds, row = weight[h:], holds[h * b :], row + b
        return Hypotheses(window, tuple(clusters))


def _orders(scan: Scan) -> list[Array]:
    """Order of each sensor's measurements by value, then by time."""
    times = scan.times or [None] * len(scan.measurements)
    pairs = zip(scan.measurements, times, strict=True)
    return [np.lexsort((*z.T[::-1], *(() if stamps is None else (stamps,)))) for z, stamps in pairs]


def _by_value(scan: Scan, orders: list[Array]) -> Scan:
    """The scan with its measurements in these orders."""

    def sort(arrays: tuple[Array, ...] | None) -> tuple[Array, ...] | None:
        return None if arrays is None else tuple(array[order] for array, order in zip(arrays, orders, strict=True))

    measurements = sort(scan.measurements)
    assert measurements is not None
    return replace(
        scan, measurements=measurements, times=sort(scan.times), identities=sort(scan.identities),
        clutter=sort(scan.clutter),
    )  # fmt: skip


def _batch(before: TrackBatch, growth: Growth, grown: Grown, ids: Array, gained: Array) -> TrackBatch:
    """The branches as tracks, with the scores they gained in the scan."""
    fresh = growth.origin < 0
    old, new = np.flatnonzero(~fresh), np.flatnonzero(fresh)
    known = before[growth.origin[old]].scored(grown.states[old], gained[old], grown.last[old])
    begun = TrackBatch.new(grown.states[new], ids[new], gained[new], grown.last[new])
    begun.numbers[:, STARTED] = grown.first[new]
    return TrackBatch.concatenate([known, begun])[np.argsort(np.concatenate([old, new]), kind="stable")]


def _renumbered(clusters: Iterable[Cluster]) -> tuple[list[Cluster], Array]:
    """Renumber branches, cluster after cluster; also return their old rows."""
    clusters = [group for group in clusters if len(group.branches)]
    kept = np.concatenate([np.zeros(0, dtype=np.int64), *(group.branches for group in clusters)])
    rows, end, found = np.arange(len(kept)), 0, []
    for branches, holds, weight in clusters:
        begin, end = end, end + len(branches)
        found.append(Cluster(rows[begin:end], holds, weight))
    return found, kept


def _kept(tracks: TrackBatch, hypotheses: Hypotheses, clusters: Iterable[Cluster]) -> tuple[TrackBatch, Hypotheses]:
    """Keep only these clusters."""
    found, kept = _renumbered(clusters)
    return tracks[kept], Hypotheses(hypotheses.window.of(kept), tuple(found))


def _without(tracks: TrackBatch, hypotheses: Hypotheses, gone: Array) -> tuple[TrackBatch, Hypotheses]:
    """Take out branches, bool (B,): all those of their tracks."""
    if not gone.any():
        return tracks, hypotheses
    left = [group for group in hypotheses.clusters if not gone[group.branches].all()]
    return _kept(tracks, hypotheses, [without(group, gone[group.branches]) for group in left])


def _agreeing(tracks: TrackBatch, hypotheses: Hypotheses, seldom: bool) -> list[Cluster]:
    """Clusters without the hypotheses that disagree with the best one about the oldest scan of the window.

    What the best one leaves to false alarms may yet be of a target that is `seldom` detected, if no confirmed track of
    the cluster has to do with it: nothing is decided then.
    """
    ids, history = tracks.track_id, hypotheses.window.history[:, -hypotheses.window.sizes.shape[1] :].astype(np.int64)
    owner = np.where(history > 0, ids[:, None] * (history.max(initial=0) + 1) + history, 0)
    best = np.isin(ids, ids[hypotheses.best])
    for group in hypotheses.clusters:
        if seldom and not tracks.confirmed[group.branches].any():
            owner[group.branches[~best[group.branches]]] = 0
    decided = np.asarray(owner.any(axis=1))
    return [
        agreeing(group, owner[group.branches]) if decided[group.branches].any() else group
        for group in hypotheses.clusters
    ]


def _split(tracks: TrackBatch, hypotheses: Hypotheses) -> list[Cluster]:
    """Split clusters: branches of one track, or with a common measurement, stay together."""
    count, history = len(tracks), hypotheses.window.history
    ids, track = np.unique(tracks.track_id, return_inverse=True)
    branch, column = np.nonzero(history)
    wanted = column * (history.max(initial=0) + np.int64(1)) + history[branch, column]
    wants, want = np.unique(wanted, return_inverse=True)
    first, second = np.append(np.arange(count), branch), np.append(count + track, count + len(ids) + want)
    label = linked(first, second, count + len(ids) + len(wants))
    found: list[Cluster] = []
    for group in hypotheses.clusters:
        labels = label[group.branches]
        together = len(labels) == 1 or bool((labels == labels[0]).all())
        found += [group] if together else parts(group, labels, tracks.score[group.branches])
    return found


class HypothesisOrientedMHT(Tracker):
    """Multiple hypothesis tracker that keeps the m best hypotheses about each cluster of tracks.

    Parameters
    ----------
    sensors, filter, ...
        As for `Tracker`. The sensors of a scan are processed one after the other. The `solver` is not used: Murty's
        algorithm ranks.
    max_hypotheses : int
        m (50).
    depth : int
        Scans after which a decision is final, n (3); at most 1000.
    hypothesis_drop : float
        A hypothesis whose log-probability is this far below the best of its cluster is dropped (15).
    **options
        As for `Tracker`.
    """

    name = "mht-hypothesis"
    method = ClusteredHypotheses

    @property
    def probabilities(self) -> Array:
        """Probabilities of the best hypotheses about everything, the best first; at most `max_hypotheses` of them."""
        found: Array = self.settings.method.probabilities(self.state.method_state)
        return found
