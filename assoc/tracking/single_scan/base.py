"""What trackers have in common that decide each scan, all sensors together, at once and for good."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.build import build_problem
from assoc.costs.positions import tuple_costs
from assoc.problem import AssignmentProblem
from assoc.scene.scan import Scan
from assoc.tracking.track import Decision, Step, decision
from assoc.tracking.track_batch import TrackBatch
from assoc.tracking.tracker import Tracker


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


class SingleScanTracker(Tracker):
    """Predict, associate (which the children do), start tracks, confirm, delete."""

    def _step(self, time: float, measurements: list[Array], times: list[Array] | None) -> Step:
        self._instant(times)
        scan = self._scan_of(time, measurements)
        batch = self._predicted(self._batch, self._elapsed(time))
        outcome = self._associate(scan, batch.states, batch.score)
        seen = outcome.rows.any(axis=1)
        batch = batch.scored(outcome.states, outcome.gain, np.where(seen, time, np.nan))
        new, rows = self._begin(scan, outcome.born)
        batch = TrackBatch.concatenate([batch, new]).counted(np.concatenate([seen, np.ones(len(new), dtype=np.bool_)]))
        rows = np.concatenate([outcome.rows, rows])
        batch = batch.confirm(self.life_cycle)
        now = self._decision(scan, batch, rows)
        gone = self._to_delete(batch, time)
        self._batch = batch[~gone]
        ended = np.sort(batch.track_id[gone & batch.confirmed])
        return Step(now.scan, now.time, now.assigned, now.confirmed, final=(now,), ended=ended)

    @abstractmethod
    def _associate(self, scan: Scan, states: Any, scores: Array) -> ScanOutcome:
        """Associate a scan with predicted tracks of these scores."""

    def _problem(self, scan: Scan) -> AssignmentProblem:
        """Which measurements of a scan may be a target, whether there is a track of it or not."""
        return build_problem(
            self._place, scan, gate_probability=self.gate_probability, max_tuples=self.max_tuples,
            speed=self.initiation.speed,
        )  # fmt: skip

    def _begin(self, scan: Scan, tuples: Array) -> tuple[TrackBatch, Array]:
        """New tracks of tuples that tell a position, numbered by place."""
        tuples = np.asarray(tuples, dtype=np.int32).reshape(-1, len(self.sensors))
        if not len(tuples):
            return self._batch[:0], tuples
        positions, covariances, fit = self._fused(scan, tuples)
        order = np.flatnonzero(fit)
        order = order[np.lexsort(positions[order].T)]
        rows, positions, covariances = tuples[order], positions[order], covariances[order]
        states = self.initiation.start(self.filter, positions, covariances)
        costs = tuple_costs(self._place, scan, rows, speed=self.initiation.speed)
        score = self._new_scores(rows, costs, covariances)
        return TrackBatch.new(states, self._new_ids(len(order)), score, scan.time), rows

    def _decision(self, scan: Scan, batch: TrackBatch, rows: Array) -> Decision:
        assigned = []
        for s, size in enumerate(scan.sizes.tolist()):
            ids = np.zeros(size + 1, dtype=np.int64)
            ids[rows[:, s]] = batch.track_id
            assigned.append(ids[1:])
        return decision(scan.index, scan.time, assigned, batch.track_id[batch.confirmed])
