"""The nearest-neighbour tracker: sensor after sensor, each measurement to the track that is nearest."""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.scores import doubted_gain
from assoc.errors import InvalidInputError
from assoc.filters.batches import concatenate, predict_each
from assoc.problem import AssignmentProblem
from assoc.tracking.gated_pairs import GatedPairs, gated_pairs
from assoc.tracking.track import Step, decision
from assoc.tracking.track_batch import TrackBatch
from assoc.tracking.tracker import Tracker

Rule = Literal["greedy", "assignment"]


class NearestNeighbourTracker(Tracker):
    """The plain tracker that others are measured against.

    The sensors of a scan are taken in one after the other. Pairs of tracks and measurements within the gate
    are taken by falling likelihood, averaged over whether the track is a target at all; what is left over starts
    a track at once, which the next sensor may confirm.

    Parameters
    ----------
    sensors, filter, ...
        As for `Tracker`; with a single sensor each measurement may have its own time.
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

    def _step(self, time: float, measurements: list[Array], times: list[Array] | None) -> Step:
        if times is not None and len(self.sensors) > 1:
            raise InvalidInputError("times: measurements with own times need a tracker of a single sensor")
        batch, before = self._batch, time if self._time is None else self._time
        seen = np.zeros(len(batch), dtype=np.bool_)
        assigned = []
        for s, (z, sensor) in enumerate(zip(measurements, self.sensors, strict=True)):
            stamps = None if times is None else times[s]
            gated = gated_pairs(self.filter, batch.states, before, time, z, stamps, sensor, self.gate_probability)
            before = time
            chosen = self._choose(gated, s, batch.score, len(z))
            batch, hit, ids = self._take_in(batch, gated, chosen, s, len(z))
            free = np.flatnonzero(ids == 0)
            states, fit, positions, score = self._singles(s, z[free])
            free = free[fit]
            when = np.full(len(free), time) if stamps is None else stamps[free]
            order = np.lexsort((*positions.T, when))
            new = self._new_ids(len(free))
            ids[free[order]] = new
            aged = predict_each(self.filter, states[order], (time - when)[order])
            batch = TrackBatch.concatenate([batch, TrackBatch.new(aged, new, score[order], when[order])])
            seen = np.concatenate([seen | hit, np.ones(len(free), dtype=np.bool_)])
            assigned.append(ids)
        if times is None:
            crossed = self._crossed(self._scan_of(time, measurements), assigned)
            batch = TrackBatch.concatenate([batch, crossed])
            seen = np.concatenate([seen, np.ones(len(crossed), dtype=np.bool_)])
        batch = batch.counted(seen).confirm(self.life_cycle)
        now = decision(self._scan, time, assigned, batch.track_id[batch.confirmed])
        gone = self._to_delete(batch, time)
        self._batch = batch[~gone]
        ended = np.sort(batch.track_id[gone & batch.confirmed])
        return Step(now.scan, now.time, now.assigned, now.confirmed, final=(now,), ended=ended)

    def _choose(self, gated: GatedPairs, s: int, scores: Array, count: int) -> Array:
        """Rows of the pairs that are taken."""
        pairs, tracks = gated.pairs, len(scores)
        own = scores[pairs.track]
        seen = doubted_gain(own, self.terms.detection[s] + pairs.log_likelihood)
        if self.rule == "assignment":
            costs = doubted_gain(own, self.terms.miss[s]) - seen
            both = np.stack([pairs.track, pairs.measurement], axis=1) + 1
            solution = self._assign(AssignmentProblem(both, costs, [tracks, count]))
            return np.asarray(solution.indices[solution.indices < len(both)])
        free_track, free = np.ones(tracks, dtype=np.bool_), np.ones(count, dtype=np.bool_)
        taken = []
        for row in np.argsort(-seen, kind="stable").tolist():
            t, m = pairs.track[row], pairs.measurement[row]
            if free_track[t] and free[m]:
                free_track[t] = free[m] = False
                taken.append(row)
        return np.array(taken, dtype=np.int64)

    def _take_in(
        self, batch: TrackBatch, gated: GatedPairs, chosen: Array, s: int, count: int
    ) -> tuple[TrackBatch, Array, Array]:
        """Tracks after a sensor's scan, which were detected, and each measurement's track."""
        pairs = gated.pairs
        track = pairs.track[chosen]
        hit = np.zeros(len(batch), dtype=np.bool_)
        hit[track] = True
        gain, when = np.full(len(batch), self.terms.miss[s]), np.full(len(batch), np.nan)
        gain[track] = self.terms.detection[s] + pairs.log_likelihood[chosen]
        when[track] = gated.when[chosen]
        rest = np.flatnonzero(~hit)
        back = np.argsort(np.concatenate([track, rest]), kind="stable")
        states = concatenate([pairs.states[chosen], gated.predicted[rest]])[back] if len(batch) else gated.predicted
        ids = np.zeros(count, dtype=np.int64)
        ids[pairs.measurement[chosen]] = batch.track_id[track]
        return batch.scored(states, gain, when), hit, ids

    def _settings(self) -> dict[str, str]:
        return super()._settings() | {"rule": self.rule}
