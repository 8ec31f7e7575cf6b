"""What trackers have in common that decide each scan, all sensors together, at once and for good."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.build import build_problem
from assoc.costs.positions import tuple_costs
from assoc.costs.tracks.own_times import TimedScan, score_costs
from assoc.problem import AssignmentProblem
from assoc.scene.scan import Scan
from assoc.tracking.nursing import NursingTracker
from assoc.tracking.track import Decision, Step, decision
from assoc.tracking.track_batch import STARTED, TrackBatch


class ScanOutcome(NamedTuple):
    """How a scan was associated with T tracks."""

    states: Any
    """The tracks' states after it, in their order."""
    gain: Array
    """What their scores gain, (T,)."""
    rows: Array
    """Their measurements, 1-based, 0 missed, (T, S)."""
    born: Array
    """Tuples of the measurements that no track took, (K, S)."""
    when: Array | None = None
    """Time of each track's last detection, NaN where it was missed, (T,); None: all at the scan's time."""
    looked: Array | None = None
    """Whether any sensor looked at each track, bool (T,); None: all did."""


class SingleScanTracker(NursingTracker):
    """Predict, associate (which the children do), start tracks, confirm, delete."""

    def _decide(self, scan: Scan) -> Step:
        if scan.at_once:
            predicted = self._predicted(self._batch, self._elapsed(scan.time))
            outcome = self._associate(scan, predicted.states, predicted.score)
            new, rows = self._begin(scan, outcome.born)
        else:
            timed = self._timed(scan)
            outcome = self._associate_timed(scan, timed, self._batch.score)
            new, rows = self._begin_timed(scan, timed, outcome.born)
        seen = outcome.rows.any(axis=1)
        when = np.where(seen, scan.time, np.nan) if outcome.when is None else outcome.when
        batch = TrackBatch.concatenate([self._batch.scored(outcome.states, outcome.gain, when), new])
        looked = None
        if outcome.looked is not None:
            looked = np.concatenate([outcome.looked, np.ones(len(new), dtype=np.bool_)])
        batch = batch.counted(np.concatenate([seen, np.ones(len(new), dtype=np.bool_)]), looked)
        rows = np.concatenate([outcome.rows, rows])
        batch = batch.confirm(self.life_cycle)
        now = self._decision(scan, batch, rows)
        gone = self._to_delete(batch, scan.time)
        self._batch = batch[~gone]
        ended = np.sort(batch.track_id[gone & batch.confirmed])
        return Step(now.scan, now.time, now.assigned, now.confirmed, final=(now,), ended=ended)

    @abstractmethod
    def _associate(self, scan: Scan, states: Any, scores: Array) -> ScanOutcome:
        """Associate a scan with predicted tracks of these scores."""

    @abstractmethod
    def _associate_timed(self, scan: Scan, timed: TimedScan, scores: Array) -> ScanOutcome:
        """Associate a scan whose measurements have times of their own with tracks of these scores."""

    def _outcome(self, scan: Scan, timed: TimedScan, looked: Array, rows: Array, born: Array) -> ScanOutcome:
        """What becomes of the tracks when they take these measurements (T, S)."""
        track = np.arange(len(rows))
        followed = timed.follow(track, rows)
        gain = -score_costs(timed, followed, rows, self.terms, looked[track])
        when = np.where(rows.any(axis=1), followed.when, np.nan)
        at_all = np.asarray(looked[track].any(axis=1))
        return ScanOutcome(timed.at_end(followed, track), gain, rows, born, when, at_all)

    def _begin_timed(self, scan: Scan, timed: TimedScan, tuples: Array) -> tuple[TrackBatch, Array]:
        """New tracks of tuples that tell a position, numbered by place."""
        tuples = np.asarray(tuples, dtype=np.int32).reshape(-1, len(self.sensors))
        fit = [np.append(one, False)[tuples[:, s] - 1] for s, one in enumerate(timed.places.fit)]
        rows = tuples[np.any(fit, axis=0)]
        if not len(rows):
            return self._batch[:0], rows
        followed = timed.follow(np.full(len(rows), -1), rows)
        states = timed.at_end(followed, np.full(len(rows), -1))
        looked = timed.looked()[timed.anchors(rows, followed.lead)]
        score = -score_costs(timed, followed, rows, self.terms, looked)
        order = np.lexsort(states.mean[:, list(self.filter.motion.position)].T)
        batch = TrackBatch.new(states[order], self._new_ids(len(order)), score[order], followed.when[order])
        batch.numbers[:, STARTED] = followed.first[order]
        return batch, rows[order]

    def _problem(self, scan: Scan) -> AssignmentProblem:
        """Which measurements of a scan may be a target, whether there is a track of it or not."""
        return build_problem(
            self._place, scan, gate_probability=self.gate_probability, max_tuples=self.max_tuples,
            speed=self.initiation.speed,
        )  # fmt: skip

    def _begin(self, scan: Scan, tuples: Array) -> tuple[TrackBatch, Array]:
        """New tracks of tuples that tell a position, numbered by place."""
        tuples = np.asarray(tuples, dtype=np.int32).reshape(-1, len(self.sensors))
        if not len(tuples) or self.has_nursery:
            return self._batch[:0], tuples[:0]
        positions, covariances, fit = self._new_tracks.fused(scan, tuples)
        order = np.flatnonzero(fit)
        order = order[np.lexsort(positions[order].T)]
        rows, positions, covariances = tuples[order], positions[order], covariances[order]
        states = self.initiation.start(self.filter, positions, covariances)
        costs = tuple_costs(self._place, scan, rows, speed=self.initiation.speed)
        score = self._new_tracks.scores(rows, costs, covariances)
        return TrackBatch.new(states, self._new_ids(len(order)), score, scan.time), rows

    def _decision(self, scan: Scan, batch: TrackBatch, rows: Array) -> Decision:
        assigned = []
        for s, size in enumerate(scan.sizes.tolist()):
            ids = np.zeros(size + 1, dtype=np.int64)
            ids[rows[:, s]] = batch.track_id
            assigned.append(ids[1:])
        return decision(scan.index, scan.time, assigned, batch.track_id[batch.confirmed])
