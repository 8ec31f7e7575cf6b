"""The nearest-neighbour tracker: sensor after sensor, each measurement to the track that is nearest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.own_times import TimedScan, score_costs
from assoc.costs.tracks.scores import doubted_gain
from assoc.costs.tracks.tuples import TrackPairs, gate_of, track_pairs
from assoc.errors import InvalidInputError
from assoc.filters.batches import concatenate
from assoc.problem import AssignmentProblem
from assoc.tracking.associate.mht import TrackTrees
from assoc.tracking.method import Method
from assoc.tracking.progress import Association, Progress
from assoc.tracking.records.track import owners
from assoc.tracking.records.track_batch import STARTED, TrackBatch
from assoc.tracking.stages.coverage import covered, detected_or_in_view, misses_of
from assoc.tracking.tracker import Tracker

Rule = Literal["greedy", "assignment"]


@dataclass(frozen=True)
class NearestNeighbour(Method):
    """The method of `NearestNeighbourTracker`."""

    starter = TrackTrees()

    rule: Rule = "greedy"

    def __post_init__(self) -> None:
        if self.rule not in get_args(Rule):
            raise InvalidInputError(f"rule must be 'greedy' or 'assignment', got {self.rule!r}")

    def at_once(self, progress: Progress) -> Association:
        """Process sensor after sensor; unused measurements of one start tracks that the next may confirm."""
        settings, time, tracks = progress.settings, progress.scan.time, progress.state.tracks
        seen = np.zeros(len(tracks), dtype=np.bool_)
        assigned = []
        for s, (z, sensor) in enumerate(zip(progress.scan.measurements, settings.sensors, strict=True)):
            gate = gate_of(sensor, settings.gate_probability)
            pairs = track_pairs(settings.filter, tracks.states, z, sensor, gate)
            gain = settings.terms.detection[s] + pairs.log_likelihood - progress.scan.crowd(s, pairs.measurement)
            missed = misses_of(progress, tracks.states, s)
            chosen = self._choose(progress, pairs.track, pairs.measurement, gain, missed, tracks.score, len(z))
            hit = np.zeros(len(tracks), dtype=np.bool_)
            hit[pairs.track[chosen]] = True
            ids = np.zeros(len(z), dtype=np.int64)
            ids[pairs.measurement[chosen]] = tracks.track_id[pairs.track[chosen]]
            missed[pairs.track[chosen]] = gain[chosen]
            states = _corrected(tracks, pairs, chosen, hit)
            tracks = tracks.scored(states, missed, np.where(hit, time, np.nan))
            free = np.flatnonzero(ids == 0)
            states, fit, positions, score = settings.births.singles(s, progress.scan, free)
            free = free[fit]
            order = np.lexsort(positions.T)
            ids[free[order]] = new = progress.work.new_ids(len(free))
            tracks = TrackBatch.concatenate([tracks, TrackBatch.new(states[order], new, score[order], time)])
            seen = np.concatenate([seen | hit, np.ones(len(free), dtype=np.bool_)])
            assigned.append(ids)
        return Association(tracks.counted(seen, detected_or_in_view(progress, tracks.states, seen)), assigned)

    def in_order(self, progress: Progress, timed: TimedScan) -> Association:
        """The same where measurements have times of their own."""
        settings, terms, tracks = progress.settings, progress.settings.terms, progress.state.tracks
        misses, old = timed.misses(terms), len(tracks)
        # the sensors processed so far: only they can have missed a track
        past = np.zeros_like(misses)
        anchor = track = np.arange(old)
        rows, score = np.zeros((old, len(settings.sensors)), dtype=np.int32), tracks.score
        gain = np.zeros(old)
        done: list[int] = []
        for s in timed.order:
            past[:, s] = misses[:, s]
            grown = timed.grown(s, done, anchor, track, rows)
            parent = grown.parent
            value = -score_costs(timed, grown.followed, grown.rows, terms, past[anchor[parent]]) - gain[parent]
            missed = misses[anchor, s]
            count = len(timed.times[s])
            chosen = self._choose(progress, parent, grown.measurement, value, missed, score + gain, count)
            hit = np.zeros(len(rows), dtype=np.bool_)
            hit[parent[chosen]] = True
            gain = np.where(hit, gain, gain + missed)
            gain[parent[chosen]] += value[chosen]
            rows[parent[chosen]] = grown.rows[chosen]
            free = timed.places.fit[s].copy()
            free[grown.measurement[chosen]] = False
            unused = np.flatnonzero(free)
            single = np.zeros((len(unused), rows.shape[1]), dtype=np.int32)
            single[:, s] = unused + 1
            begun = timed.places.births[s][unused] + past[timed.offsets[s] + unused].sum(axis=1) - terms.miss[s]
            anchor, track = np.append(anchor, timed.offsets[s] + unused), np.append(track, np.full(len(unused), -1))
            rows, gain = np.concatenate([rows, single]), np.append(gain, begun)
            score = np.append(score, np.zeros(len(unused)))
            done.append(s)
        followed = timed.follow(track, rows)
        states = timed.at_end(followed, track)
        seen = rows.any(axis=1)
        when = np.where(seen, followed.when, np.nan)
        order = old + np.lexsort((*states.mean[old:, list(settings.filter.motion.position)].T, followed.first[old:]))
        new = TrackBatch.new(states[order], progress.work.new_ids(len(order)), gain[order], when[order])
        new.numbers[:, STARTED] = followed.first[order]
        batch = TrackBatch.concatenate([tracks.scored(states[:old], gain[:old], when[:old]), new])
        at_all = np.concatenate([covered(progress, misses[:old]), np.ones(len(order), dtype=np.bool_)])
        assigned = owners(np.concatenate([rows[:old], rows[order]]), batch.track_id, progress.scan.sizes)
        return Association(batch.counted(np.asarray(seen), at_all), assigned)

    def _choose(
        self,
        progress: Progress,
        track: Array,
        measurement: Array,
        gain: Array,
        missed: Array,
        scores: Array,
        count: int,
    ) -> Array:
        """Rows of the chosen pairs, by their gains and the scores of a miss."""
        tracks, own = len(scores), scores[track]
        seen = doubted_gain(own, gain)
        if self.rule == "assignment":
            costs = doubted_gain(own, missed[track]) - seen
            both = np.stack([track, measurement], axis=1) + 1
            solution = progress.work.assign(AssignmentProblem(both, costs, [tracks, count]))
            return np.asarray(solution.indices[solution.indices < len(both)])
        free_track, free = np.ones(tracks, dtype=np.bool_), np.ones(count, dtype=np.bool_)
        taken = []
        for row in np.argsort(-seen, kind="stable").tolist():
            t, m = track[row], measurement[row]
            if free_track[t] and free[m]:
                free_track[t] = free[m] = False
                taken.append(row)
        return np.array(taken, dtype=np.int64)


def _corrected(tracks: TrackBatch, pairs: TrackPairs, chosen: Array, hit: Array) -> object:
    """States of the tracks, updated by the chosen pairs."""
    if not len(tracks):
        return tracks.states
    rest = np.flatnonzero(~hit)
    back = np.argsort(np.concatenate([pairs.track[chosen], rest]), kind="stable")
    return concatenate([pairs.correct(chosen), tracks.states[rest]])[back]


class NearestNeighbourTracker(Tracker):
    """The plain tracker that others are compared with.

    The sensors of a scan are processed one after the other, whatever the measurements' times. Pairs of tracks and
    measurements within the gate are chosen by decreasing likelihood, averaged over whether the track is a target;
    each unused measurement starts a track at once, which the next sensor may confirm.

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
    method = NearestNeighbour


Tracker.plain = NearestNeighbourTracker
