"""The nearest-neighbour tracker: sensor after sensor, each measurement to the track that is nearest."""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np

from assoc._system.door import doors
from assoc._types import Array
from assoc.costs.tracks.own_times import score_costs
from assoc.costs.tracks.scores import doubted_gain
from assoc.costs.tracks.tuples import TrackPairs, gate_of, track_pairs
from assoc.errors import InvalidInputError
from assoc.filters.batches import concatenate
from assoc.problem import AssignmentProblem
from assoc.scene.scan import Scan
from assoc.tracking.nursing import NursingTracker
from assoc.tracking.track import Step, decision
from assoc.tracking.track_batch import STARTED, TrackBatch

Rule = Literal["greedy", "assignment"]


@doors
class NearestNeighbourTracker(NursingTracker):
    """The plain tracker that others are measured against.

    The sensors of a scan are taken in one after the other, whatever the measurements' times. Pairs of tracks and
    measurements within the gate are taken by falling likelihood, averaged over whether the track is a target at all;
    what is left over starts a track at once, which the next sensor may confirm.

    Parameters
    ----------
    sensors, filter, ...
        As for `Tracker`.
    rule : "greedy" or "assignment"
        "assignment" takes the best 2-D assignment instead (global nearest neighbour), by the tracker's solver.
    **options
        As for `Tracker`.
    """

    name = "nearest-neighbour"

    def __init__(self, *arguments: Any, rule: Rule = "greedy", **options: Any) -> None:
        super().__init__(*arguments, **options)
        if rule not in get_args(Rule):
            raise InvalidInputError(f"rule must be 'greedy' or 'assignment', got {rule!r}")
        self.rule = rule

    def _decide(self, scan: Scan) -> Step:
        batch, assigned, seen, looked = self._at_once(scan) if scan.at_once else self._in_order(scan)
        batch = batch.counted(seen, looked).confirm(self.life_cycle)
        now = decision(scan.index, scan.time, assigned, batch.track_id[batch.confirmed])
        gone = self._to_delete(batch, scan.time)
        self._batch = batch[~gone]
        ended = np.sort(batch.track_id[gone & batch.confirmed])
        return Step(now.scan, now.time, now.assigned, now.confirmed, final=(now,), ended=ended)

    def _at_once(self, scan: Scan) -> tuple[TrackBatch, list[Array], Array, None]:
        """Take in a scan of one instant: tracks, each measurement's track, and which were detected."""
        time, batch = scan.time, self._predicted(self._batch, self._elapsed(scan.time))
        seen = np.zeros(len(batch), dtype=np.bool_)
        assigned = []
        for s, (z, sensor) in enumerate(zip(scan.measurements, self.sensors, strict=True)):
            pairs = track_pairs(self.filter, batch.states, z, sensor, gate_of(sensor, self.gate_probability))
            gain = self.terms.detection[s] + pairs.log_likelihood
            missed = np.full(len(batch), self.terms.miss[s])
            chosen = self._choose(pairs.track, pairs.measurement, gain, missed, batch.score, len(z))
            batch, hit, ids = self._take_in(batch, pairs, chosen, s, len(z), time)
            free = np.flatnonzero(ids == 0)
            states, fit, positions, score = self._new_tracks.singles(s, z[free])
            free = free[fit]
            order = np.lexsort(positions.T)
            new = self._new_ids(len(free))
            ids[free[order]] = new
            batch = TrackBatch.concatenate([batch, TrackBatch.new(states[order], new, score[order], time)])
            seen = np.concatenate([seen | hit, np.ones(len(free), dtype=np.bool_)])
            assigned.append(ids)
        return batch, assigned, seen, None

    def _in_order(self, scan: Scan) -> tuple[TrackBatch, list[Array], Array, Array]:
        """Take in a scan whose measurements have times of their own; as `_at_once`, and which were looked at."""
        timed, old = self._timed(scan), len(self._batch)
        looked = timed.looked()
        # the sensors that have been taken in: only they can have missed a track
        past = np.zeros_like(looked)
        anchor = track = np.arange(old)
        rows, score = np.zeros((old, len(self.sensors)), dtype=np.int32), self._batch.score
        gain = np.zeros(old)
        done: list[int] = []
        for s in timed.order:
            past[:, s] = looked[:, s]
            grown = timed.grown(s, done, anchor, track, rows)
            parent = grown.parent
            value = -score_costs(timed, grown.followed, grown.rows, self.terms, past[anchor[parent]]) - gain[parent]
            missed = looked[anchor, s] * self.terms.miss[s]
            count = len(timed.times[s])
            chosen = self._choose(parent, grown.measurement, value, missed, score + gain, count)
            hit = np.zeros(len(rows), dtype=np.bool_)
            hit[parent[chosen]] = True
            gain = np.where(hit, gain, gain + missed)
            gain[parent[chosen]] += value[chosen]
            rows[parent[chosen]] = grown.rows[chosen]
            free = timed.places.fit[s].copy()
            free[grown.measurement[chosen]] = False
            own = np.flatnonzero(free)
            single = np.zeros((len(own), rows.shape[1]), dtype=np.int32)
            single[:, s] = own + 1
            begun = timed.places.births[s][own] + past[timed.offsets[s] + own] @ self.terms.miss - self.terms.miss[s]
            anchor, track = np.append(anchor, timed.offsets[s] + own), np.append(track, np.full(len(own), -1))
            rows, gain = np.concatenate([rows, single]), np.append(gain, begun)
            score = np.append(score, np.zeros(len(own)))
            done.append(s)
        followed = timed.follow(track, rows)
        states = timed.at_end(followed, track)
        seen = rows.any(axis=1)
        when = np.where(seen, followed.when, np.nan)
        order = old + np.lexsort((*states.mean[old:, list(self.filter.motion.position)].T, followed.first[old:]))
        new = TrackBatch.new(states[order], self._new_ids(len(order)), gain[order], when[order])
        new.numbers[:, STARTED] = followed.first[order]
        batch = TrackBatch.concatenate([self._batch.scored(states[:old], gain[:old], when[:old]), new])
        rows = np.concatenate([rows[:old], rows[order]])
        assigned = []
        for s, times in enumerate(timed.times):
            ids = np.zeros(len(times) + 1, dtype=np.int64)
            ids[rows[:, s]] = batch.track_id
            assigned.append(ids[1:])
        at_all = np.concatenate([looked[:old].any(axis=1), np.ones(len(order), dtype=np.bool_)])
        return batch, assigned, np.asarray(seen), at_all

    def _choose(self, track: Array, measurement: Array, gain: Array, missed: Array, scores: Array, count: int) -> Array:
        """Rows of the pairs that are taken, given what each and a miss of each track adds to the score."""
        tracks, own = len(scores), scores[track]
        seen = doubted_gain(own, gain)
        if self.rule == "assignment":
            costs = doubted_gain(own, missed[track]) - seen
            both = np.stack([track, measurement], axis=1) + 1
            solution = self._assign(AssignmentProblem(both, costs, [tracks, count]))
            return np.asarray(solution.indices[solution.indices < len(both)])
        free_track, free = np.ones(tracks, dtype=np.bool_), np.ones(count, dtype=np.bool_)
        taken = []
        for row in np.argsort(-seen, kind="stable").tolist():
            t, m = track[row], measurement[row]
            if free_track[t] and free[m]:
                free_track[t] = free[m] = False
                taken.append(row)
        return np.array(taken, dtype=np.int64)

    def _take_in(
        self, batch: TrackBatch, pairs: TrackPairs, chosen: Array, s: int, count: int, time: float
    ) -> tuple[TrackBatch, Array, Array]:
        """Tracks after a sensor's scan, which were detected, and each measurement's track."""
        track = pairs.track[chosen]
        hit = np.zeros(len(batch), dtype=np.bool_)
        hit[track] = True
        gain = np.full(len(batch), self.terms.miss[s])
        gain[track] = self.terms.detection[s] + pairs.log_likelihood[chosen]
        rest = np.flatnonzero(~hit)
        back = np.argsort(np.concatenate([track, rest]), kind="stable")
        states = concatenate([pairs.states[chosen], batch.states[rest]])[back] if len(batch) else batch.states
        ids = np.zeros(count, dtype=np.int64)
        ids[pairs.measurement[chosen]] = batch.track_id[track]
        return batch.scored(states, gain, np.where(hit, time, np.nan)), hit, ids

    def _settings(self) -> dict[str, str]:
        return super()._settings() | {"rule": self.rule}
