"""The static variant: first the sensors of a scan are fused, then the fused tuples go to tracks."""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc._system.door import doors
from assoc._types import Array
from assoc.costs.gating import chi_square_quantiles
from assoc.costs.tracks.gating import near_pairs
from assoc.costs.tracks.own_times import TimedScan, score_costs
from assoc.costs.tracks.scores import doubted_gain
from assoc.costs.tracks.tuples import gate_of, require_states
from assoc.filters.batches import concatenate
from assoc.problem import AssignmentProblem
from assoc.scene.scan import Scan
from assoc.tracking.single_scan.base import ScanOutcome, SingleScanTracker


@doors
class StaticFusionTracker(SingleScanTracker):
    """S-D fusion of each scan by itself, then a 2-D assignment of the fused tuples to the tracks.

    The S-D problem knows nothing of the tracks: what it puts together stays together. Single measurements go
    to the tracks as tuples of one. A tuple's cost for a track is that of all its measurements under the
    track's predicted density, misses included, averaged over whether the track is a target at all.

    Parameters
    ----------
    sensors, filter, **options
        As for `Tracker`.
    """

    name = "static"

    def _associate(self, scan: Scan, states: Any, scores: Array) -> ScanOutcome:
        fused = self._assign(self._problem(scan)).tuples
        track, which, costs, corrected = self._pairs(scan, states, fused)
        count, alone = len(states), -float(self.terms.miss.sum())
        # every track may be missed: (track, 0), with the state as predicted
        pairs = np.stack([np.append(track, np.arange(count)), np.append(which + 1, np.zeros(count, np.int64))], axis=1)
        pairs[:, 0] += 1
        gain = -np.append(costs, np.full(count, alone))
        value = doubted_gain(scores[pairs[:, 0] - 1], gain)
        solution = self._assign(AssignmentProblem(pairs, -value, [count, len(fused)]))
        kept = solution.indices[solution.indices < len(pairs)]
        kept = kept[np.argsort(pairs[kept, 0])]
        chosen = pairs[kept, 1]
        rows = np.zeros((count, len(self.sensors)), dtype=np.int32)
        rows[chosen > 0] = fused[chosen[chosen > 0] - 1]
        free = np.ones(len(fused) + 1, dtype=np.bool_)
        free[chosen] = False
        after = concatenate([corrected, states])[kept]
        return ScanOutcome(after, gain[kept], rows, fused[free[1:]])

    def _associate_timed(self, scan: Scan, timed: TimedScan, scores: Array) -> ScanOutcome:
        looked = timed.looked()
        fused = np.asarray(self._assign(self._problem(scan)).tuples, dtype=np.int32)
        count = len(scores)
        track, which = [np.arange(count)], [np.full(count, -1)]
        lead = np.argmax(fused > 0, axis=1)
        for s in range(len(self.sensors)):
            mine = np.flatnonzero(lead == s)
            owner = np.full(len(scan.measurements[s]), -1)
            owner[fused[mine, s] - 1] = mine
            near, found = timed.near(s)
            track.append(near[owner[found] >= 0])
            which.append(owner[found][owner[found] >= 0])
        pairs, fused_of = np.concatenate(track), np.concatenate(which)
        rows = np.concatenate([fused, np.zeros((1, fused.shape[1]), dtype=np.int32)])[fused_of]
        followed = timed.follow(pairs, rows)
        gain = -score_costs(timed, followed, rows, self.terms, looked[pairs])
        good = np.flatnonzero(followed.inside)
        value = doubted_gain(scores[pairs[good]], gain[good])
        columns = np.stack([pairs[good] + 1, fused_of[good] + 1], axis=1)
        solution = self._assign(AssignmentProblem(columns, -value, [count, len(fused)]))
        mine = good[solution.indices[solution.indices < len(good)]]
        mine = mine[np.argsort(pairs[mine])]
        free = np.ones(len(fused) + 1, dtype=np.bool_)
        free[fused_of[mine]] = False
        return self._outcome(scan, timed, looked, rows[mine], fused[free[:-1]])

    def _pairs(self, scan: Scan, states: Any, fused: Array) -> tuple[Array, Array, Array, Any]:
        """Tracks and tuples within the gates: rows of both, costs, and the corrected states."""
        track, which = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        lead = np.argmax(fused > 0, axis=1)
        for s, (z, sensor) in enumerate(zip(scan.measurements, self.sensors, strict=True)):
            mine = np.flatnonzero(lead == s) if len(fused) else np.zeros(0, dtype=np.int64)
            gate = gate_of(sensor, self.gate_probability)
            near = near_pairs(
                self.filter.expected(states, sensor), z[fused[mine, s] - 1], sensor.angular[: sensor.dim], gate
            )
            track, which = np.append(track, near[0]), np.append(which, mine[near[1]])
        order = np.lexsort((which, track))
        track, which = track[order], which[order]
        require_states(states, len(track))
        corrected, costs = states[track], np.full(len(track), 0.0)
        nis, freedom = np.zeros(len(track)), np.zeros(len(track), dtype=np.int64)
        for s, (z, sensor) in enumerate(zip(scan.measurements, self.sensors, strict=True)):
            seen = np.flatnonzero(fused[which, s] > 0)
            costs -= self.terms.miss[s]
            if not len(seen):
                continue
            done = self.filter.update(corrected[seen], np.ascontiguousarray(z[fused[which[seen], s] - 1]), sensor)
            costs[seen] -= done.log_likelihood + self.terms.detection[s] - self.terms.miss[s]
            nis[seen] += done.nis
            freedom[seen] += sensor.dim
            rest = np.setdiff1d(np.arange(len(track)), seen)
            back = np.argsort(np.concatenate([seen, rest]), kind="stable")
            corrected = concatenate([done.state, corrected[rest]])[back]
        largest = int(sum(sensor.dim for sensor in self.sensors))
        inside = nis <= chi_square_quantiles(self.gate_probability, largest)[freedom]
        inside &= costs < -float(self.terms.miss.sum())
        return track[inside], which[inside], costs[inside], corrected[inside]
