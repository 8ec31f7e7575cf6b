"""Hypothesis-oriented multiple hypothesis tracking: Reid's clusters and generation, Murty's m best, n-scan pruning.

A hypothesis says of every measurement so far: false alarm, one of the existing targets, or a new target. Its
probability is equation 2.1 of the thesis on clustering time windows,

    p = 1/c  P_D^N_d  (1 - P_D)^(N_t - N_d)  P_FA^N_fa  P_NT^N_nt  prod p(z | t)  p_parent,

with N_d the targets that were detected, densities for P_FA and P_NT. Relative to "all false alarms" its
logarithm is the sum of the scores of the hypothesis' tracks (`assoc.costs.tracks.scores`), so that both forms
of the tracker count alike. Tracks that contend for no measurement stand in clusters of their own, each with its own m
best hypotheses (`assoc.tracking.mht.clusters`).

References
----------
D. B. Reid, An algorithm for tracking multiple targets, IEEE Trans. Automatic Control 24, 1979.
I. J. Cox, S. L. Hingorani, An efficient implementation of Reid's multiple hypothesis tracking algorithm,
IEEE Trans. Pattern Analysis and Machine Intelligence 18, 1996.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc._system.door import doors
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.scene.scan import Scan
from assoc.tracking.checkpoint import PREFIX, check_window, require_field
from assoc.tracking.mht.clusters import Cluster, agreeing, cluster, linked, parts, without
from assoc.tracking.mht.crossed_births import with_births
from assoc.tracking.mht.generation import generated
from assoc.tracking.mht.growth import AtOnce, Births, Growth, InOrder
from assoc.tracking.mht.pruning import MOST_SCANS
from assoc.tracking.track import Decision, Step, decision
from assoc.tracking.track_batch import TrackBatch
from assoc.tracking.tracker import Tracker

_MOST_CROSSINGS = 100
"""The most new targets in a scan where several sensors together tell a position."""


@doors
class HypothesisOrientedMHT(Tracker):
    """Multiple hypothesis tracker that keeps the m best hypotheses about each cluster of tracks.

    Parameters
    ----------
    sensors, filter, ...
        As for `Tracker`. Sensors of a scan are taken in one after the other. The `solver` is not used: the ranking is
        Murty's.
    max_hypotheses : int
        m.
    depth : int
        Scans after which a decision is final, n; at most 1000.
    hypothesis_drop : float
        A hypothesis whose log-probability is this far below the best of its cluster is dropped.
    **options
        As for `Tracker`.
    """

    name = "mht-hypothesis"

    def __init__(
        self, *arguments: Any, max_hypotheses: int = 50, depth: int = 3, hypothesis_drop: float = 15.0, **options: Any
    ) -> None:
        super().__init__(*arguments, **options)
        for value, what in ((depth, "depth"), (max_hypotheses, "max_hypotheses")):
            if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
                raise InvalidInputError(f"{what} must be a whole number above 0, got {value!r}")
        if depth > MOST_SCANS:
            raise InvalidInputError(f"depth must be at most {MOST_SCANS} scans, got {depth}")
        if not isinstance(hypothesis_drop, (int, float)) or not hypothesis_drop > 0:
            raise InvalidInputError(f"hypothesis_drop must be a number above 0, got {hypothesis_drop!r}")
        self.max_hypotheses, self.depth = int(max_hypotheses), int(depth)
        self.hypothesis_drop = float(hypothesis_drop)
        self._clusters: list[Cluster] = []
        """Their branches are all rows of the batch, cluster after cluster."""
        self._history = np.zeros((0, self.depth * len(self.sensors)), dtype=np.int32)
        """Measurements of each branch (1-based, 0 missed): the sensors of this scan, of the last, ..."""
        self._window: list[tuple[float, Array]] = []
        """Times and sizes of the scans that are not yet final, the last one first."""

    @property
    def probabilities(self) -> Array:
        """Probabilities of the best hypotheses about everything, the best first; at most `max_hypotheses` of them."""
        logarithms = np.zeros(1)
        for one in self._clusters:
            both = (logarithms[:, None] + np.log(one.probabilities)).ravel()
            logarithms = -np.sort(-both)[: self.max_hypotheses]
        return np.exp(logarithms)

    @property
    def _best(self) -> Array:
        """Branches of the best hypothesis."""
        return np.concatenate([np.zeros(0, dtype=np.int64), *(one.best for one in self._clusters)])

    def _current(self) -> TrackBatch:
        rows = self._best
        return self._batch[rows[np.argsort(self._batch.track_id[rows], kind="stable")]]

    def _adopt(self, batch: TrackBatch) -> None:
        super()._adopt(batch)
        self._history = np.zeros((len(batch), self._history.shape[1]), dtype=np.int32)
        self._clusters = [
            cluster(np.array([row]), np.ones((1, 1), dtype=np.bool_), np.zeros(1)) for row in range(len(batch))
        ]

    def _step(self, scan: Scan) -> Step:
        # hypotheses of equal weight are kept by number: measurements are numbered by value, so that the order in which
        # they are given does not matter
        times = scan.times or [None] * len(scan.measurements)
        pairs = zip(scan.measurements, times, strict=True)
        orders = [np.lexsort((*z.T[::-1], *(() if stamps is None else (stamps,)))) for z, stamps in pairs]
        known = self._batch.track_id[self._batch.confirmed]
        growth = self._grown(self._sorted(scan, orders))
        batch, looked = growth.finished()
        given = [np.append(0, order + 1) for order in orders]
        rows = np.stack([one[growth.rows[:, s]] for s, one in enumerate(given)], axis=1)
        nothing = np.zeros((1, self._history.shape[1]), dtype=np.int32)
        older = np.concatenate([self._history, nothing])[growth.origin]
        self._history = np.concatenate([rows.astype(np.int32), older], axis=1)[:, : older.shape[1]]
        self._batch = batch.counted(np.asarray(rows.any(axis=1)), looked)
        self._window.insert(0, (scan.time, scan.sizes.astype(np.int64)))
        self._confirm()
        now = self._decision(0)
        known = np.union1d(known, self._batch.track_id[self._batch.confirmed])
        final: tuple[Decision, ...] = ()
        if len(self._window) == self.depth:
            self._prune()
            final = (self._decision(self.depth - 1),)
            self._window.pop()
        self._delete_tracks(scan.time)
        self._split()
        ended = np.setdiff1d(known, self._batch.track_id)
        return Step(now.scan, now.time, now.assigned, now.confirmed, final=final, ended=ended)

    @staticmethod
    def _sorted(scan: Scan, orders: list[Array]) -> Scan:
        ordered = [z[order] for z, order in zip(scan.measurements, orders, strict=True)]
        stamps = None if scan.times is None else tuple(t[order] for t, order in zip(scan.times, orders, strict=True))
        told = scan.identities
        codes = None if told is None else tuple(one[order] for one, order in zip(told, orders, strict=True))
        return Scan(scan.index, scan.time, tuple(ordered), times=stamps, sectors=scan.sectors, identities=codes)

    def _grown(self, scan: Scan) -> Growth:
        """Branches and clusters after the scan's sensors, one after the other."""
        growth: AtOnce | InOrder
        if scan.at_once:
            predicted = self._predicted(self._batch, self._elapsed(scan.time)).states
            growth = AtOnce(
                self._batch, scan, predicted, self.filter, self.sensors, self.terms, self._new_tracks,
                self.gate_probability,
            )  # fmt: skip
        else:
            growth = InOrder(self._batch, self._timed(scan), self.terms)
        for s in growth.order:
            offers = growth.offers(s)
            new_ids = self._ids_of(offers.births)
            limits = self.max_hypotheses, self.hypothesis_drop
            born, count = offers.births.rows[:, s] - 1, len(scan.measurements[s])
            self._clusters = generated(self._clusters, offers, born, count, *limits)
            growth.take(s, offers, self._renumber(), new_ids)
        if isinstance(growth, AtOnce):
            self._begin_crossed(scan, growth)
        return growth

    def _begin_crossed(self, scan: Scan, growth: AtOnce) -> None:
        """New targets of what the best hypothesis' confirmed tracks leave of sensors that start none alone."""
        rows = self._best
        sure = np.append(self._batch.confirmed, False)[growth.origin[rows]]
        taken = growth.rows[rows[sure]]
        free = [np.isin(np.arange(1, size + 1), taken[:, s], invert=True) for s, size in enumerate(scan.sizes.tolist())]
        found = self._crossings(scan, free)
        if found is None:
            return
        several, scores = found
        # by far the most are ghosts
        best = np.argsort(-scores, kind="stable")[:_MOST_CROSSINGS]
        births = Births(several.rows[best], scores[best], np.lexsort(several.positions[best].T))
        states = self.initiation.start(self.filter, several.positions[best], several.covariances[best])
        most, drop = self.max_hypotheses, self.hypothesis_drop
        self._clusters = with_births(self._clusters, growth.rows, births, scan.sizes, most, drop)
        growth.take_crossings(births, states, self._renumber(), self._ids_of(births))

    def _ids_of(self, births: Births) -> Array:
        ids = np.empty(len(births.turn), dtype=np.int64)
        ids[births.turn] = self._new_ids(len(births.turn))
        return ids

    def _renumber(self) -> Array:
        """Give the branches of the clusters new rows, cluster after cluster; their rows before."""
        clusters = [one for one in self._clusters if len(one.branches)]
        kept = np.concatenate([np.zeros(0, dtype=np.int64), *(one.branches for one in clusters)])
        rows, end = np.arange(len(kept)), 0
        self._clusters = []
        for branches, holds, weight in clusters:
            begin, end = end, end + len(branches)
            self._clusters.append(Cluster(rows[begin:end], holds, weight))
        return kept

    def _keep(self, clusters: list[Cluster]) -> None:
        """Go on with these clusters."""
        self._clusters = clusters
        kept = self._renumber()
        self._batch, self._history = self._batch[kept], self._history[kept]

    def _prune(self) -> None:
        """End the hypotheses that disagree with the best of their cluster about the oldest scan of the window."""
        said = self._history[:, -len(self.sensors) :].astype(np.int64)
        owner = np.where(said > 0, self._batch.track_id[:, None] * (said.max(initial=0) + 1) + said, 0)
        decided = np.asarray(owner.any(axis=1))
        self._keep(
            [agreeing(one, owner[one.branches]) if decided[one.branches].any() else one for one in self._clusters]
        )

    def _delete_tracks(self, time: float) -> None:
        """Delete the tracks all of whose branches say so."""
        ids = self._batch.track_id
        gone = ~np.isin(ids, ids[~self._to_delete(self._batch, time)])
        if gone.any():
            left = (one for one in self._clusters if not gone[one.branches].all())
            self._keep([without(one, gone[one.branches]) for one in left])

    def _split(self) -> None:
        """Let clusters fall apart: branches hang together that are of one track or want the same measurement."""
        count = len(self._batch)
        tracks, track = np.unique(self._batch.track_id, return_inverse=True)
        branch, column = np.nonzero(self._history)
        wanted = column * (self._history.max(initial=0) + np.int64(1)) + self._history[branch, column]
        wants, want = np.unique(wanted, return_inverse=True)
        first, second = np.append(np.arange(count), branch), np.append(count + track, count + len(tracks) + want)
        label = linked(first, second, count + len(tracks) + len(wants))
        found = []
        for one in self._clusters:
            own = label[one.branches]
            together = len(own) == 1 or bool((own == own[0]).all())
            found += [one] if together else parts(one, own, self._batch.score[one.branches])
        self._keep(found)

    def _confirm(self) -> None:
        batch, rows = self._batch, self._best
        good = batch.track_id[rows[batch.confirm(self.life_cycle).confirmed[rows]]]
        self._batch = batch.with_confirmed(batch.confirmed | np.isin(batch.track_id, good))

    def _decision(self, age: int) -> Decision:
        count = len(self.sensors)
        time, sizes = self._window[age]
        rows = self._best
        assigned = []
        for s in range(count):
            ids = np.zeros(int(sizes[s]) + 1, dtype=np.int64)
            ids[self._history[rows, age * count + s]] = self._batch.track_id[rows]
            assigned.append(ids[1:])
        batch = self._batch[rows]
        return decision(self._scan - age, time, assigned, batch.track_id[batch.confirmed])

    def flush(self) -> tuple[Decision, ...]:
        """What the best hypothesis says of the scans that are not final yet, oldest first; for the end."""
        self._scan -= 1
        try:
            return tuple(self._decision(age) for age in reversed(range(len(self._window))))
        finally:
            self._scan += 1

    def _settings(self) -> dict[str, str]:
        own = {"depth": self.depth, "max_hypotheses": self.max_hypotheses, "hypothesis_drop": self.hypothesis_drop}
        return super()._settings() | {name: repr(value) for name, value in own.items()}

    def _arrays(self) -> dict[str, Array]:
        times = np.array([time for time, _ in self._window], dtype=np.float64)
        sizes = np.array([sizes for _, sizes in self._window], dtype=np.int64).reshape(-1, len(self.sensors))
        own: dict[str, Array] = {"history": self._history, "window_times": times, "window_sizes": sizes}
        shapes = [one.holds.shape for one in self._clusters]
        own["cluster_hypotheses"] = np.array([hypotheses for hypotheses, _ in shapes], dtype=np.int64)
        own["cluster_branches"] = np.array([branches for _, branches in shapes], dtype=np.int64)
        own["holds"] = np.concatenate([np.zeros(0, np.bool_), *(one.holds.ravel() for one in self._clusters)])
        own["weight"] = np.concatenate([np.zeros(0), *(one.weight for one in self._clusters)])
        return super()._arrays() | own

    def _check(self, arrays: dict[str, Array]) -> None:
        super()._check(arrays)
        count = len(arrays[f"{PREFIX}track_id"])
        check_window(arrays, count, len(self.sensors), self.depth)
        hypotheses, branches = arrays["cluster_hypotheses"], arrays["cluster_branches"]
        some = ((hypotheses >= 1) & (hypotheses <= self.max_hypotheses)).all()
        require_field(some, "cluster_hypotheses", f"1 to {self.max_hypotheses} hypotheses of each cluster")
        all_of_them = branches.shape == hypotheses.shape and ((branches >= 1) & (branches <= count)).all()
        all_of_them = all_of_them and int(branches.sum()) == count
        require_field(all_of_them, "cluster_branches", "how many branches each cluster has")
        size = int((hypotheses * branches).sum())
        require_field(len(arrays["holds"]) == size, "holds", "whether each hypothesis holds each branch")
        weight = arrays["weight"]
        weighed = len(weight) == int(hypotheses.sum()) and np.isfinite(weight).all()
        require_field(weighed, "weight", "a number for each hypothesis")

    def _take(self, arrays: dict[str, Array]) -> None:
        super()._take(arrays)
        self._history = arrays["history"].astype(np.int32)
        self._window = [(float(t), n) for t, n in zip(arrays["window_times"], arrays["window_sizes"], strict=True)]
        self._clusters = []
        weight, holds, row = arrays["weight"], arrays["holds"], 0
        for h, b in zip(arrays["cluster_hypotheses"].tolist(), arrays["cluster_branches"].tolist(), strict=True):
            self._clusters.append(Cluster(np.arange(row, row + b), holds[: h * b].reshape(h, b), weight[:h]))
            weight, holds, row = weight[h:], holds[h * b :], row + b
