"""The multi-sensor tracker: each scan is one assignment problem over tracks and all sensors."""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc._system.door import doors
from assoc._types import Array
from assoc.costs.tracks.own_times import TimedScan, grow_timed_tuples
from assoc.costs.tracks.scores import doubted_gain
from assoc.costs.tracks.tuples import grow_track_tuples
from assoc.problem import AssignmentProblem
from assoc.scene.scan import Scan
from assoc.tracking.single_scan.base import ScanOutcome, SingleScanTracker


@doors
class MultiSensorTracker(SingleScanTracker):
    """Tracks and S sensors in one (S+1)-D assignment problem for each scan.

    Tracks are the first list. A tuple (track, z_1, ..., z_S) costs the negative log likelihood ratio of its
    measurements under the track's predicted density, misses included, averaged over whether the track is a target
    at all, which its score tells; a tuple without a track is a new target
    and costs what `assoc.build_problem` says, with the birth density in it. Measurements in no tuple are false
    alarms, and begin tentative tracks.

    Parameters
    ----------
    sensors, filter, **options
        As for `Tracker`.

    References
    ----------
    Y. Bar-Shalom, P. Willett, X. Tian, Tracking and Data Fusion, 2011, chapter 9.
    """

    name = "multi-sensor"

    def _associate(self, scan: Scan, states: Any, scores: Array) -> ScanOutcome:
        measurements = list(scan.measurements)
        tuples = grow_track_tuples(
            self.filter, states, measurements, self.sensors, self.terms,
            gate_probability=self.gate_probability, max_tuples=self.max_tuples,
        )  # fmt: skip
        gain = -tuples.costs
        value = doubted_gain(scores[tuples.track], gain)
        rows, costs = self._new_targets(scan)
        known = np.column_stack([tuples.track + 1, tuples.rows])
        fresh = np.column_stack([np.zeros(len(rows), dtype=np.int64), rows])
        sizes = np.concatenate([[len(states)], scan.sizes])
        problem = AssignmentProblem(np.concatenate([known, fresh]), np.concatenate([-value, costs]), sizes)
        solution = self._assign(problem)
        kept = np.sort(solution.indices[solution.indices < len(known)])
        born = solution.tuples[solution.tuples[:, 0] == 0][:, 1:]
        return ScanOutcome(tuples.states[kept], gain[kept], tuples.rows[kept], born)

    def _associate_timed(self, scan: Scan, timed: TimedScan, scores: Array) -> ScanOutcome:
        looked = timed.looked()
        tuples = grow_timed_tuples(timed, self.terms, looked, self.max_tuples)
        known = tuples.track >= 0
        value = -tuples.costs
        value[known] = doubted_gain(scores[tuples.track[known]], value[known])
        # where false alarms are rarer than new targets a single measurement is one, too
        # a track without measurements is missed, and has no part in the problem
        wooed = np.append(np.bincount(tuples.track[known], minlength=len(scores)) > 1, False)
        number = np.cumsum(wooed) * wooed
        good = np.flatnonzero(np.where(known, wooed[tuples.track], value > 0))
        columns = np.column_stack([number[tuples.track], tuples.rows])[good]
        problem = AssignmentProblem(columns, -value[good], np.concatenate([[int(wooed.sum())], scan.sizes]))
        solution = self._assign(problem)
        mine = solution.tuples[solution.tuples[:, 0] > 0]
        rows = np.zeros((len(scores), scan.sizes.size), dtype=np.int32)
        rows[np.flatnonzero(wooed)[mine[:, 0] - 1]] = mine[:, 1:]
        return self._outcome(scan, timed, looked, rows, solution.tuples[solution.tuples[:, 0] == 0][:, 1:])

    def _new_targets(self, scan: Scan) -> tuple[Array, Array]:
        """Tuples without a track that are better than false alarms, and their costs with the birth density."""
        problem = self._problem(scan)
        if not problem.num_tuples:
            return problem.tuples, problem.costs
        # where false alarms are rarer than new targets a single measurement is one, too
        scores = self._new_tracks.scores(problem.tuples, problem.costs, self._new_tracks.fused(scan, problem.tuples)[1])
        good = scores > 0
        return problem.tuples[good], -scores[good]
