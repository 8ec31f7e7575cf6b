"""The static variant: first the sensors of a scan are fused, then the fused tuples go to tracks."""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc._types import Array
from assoc.costs.gating import chi_square_quantiles
from assoc.costs.tracks.gating import near_pairs
from assoc.costs.tracks.own_times import TimedScan, score_costs
from assoc.costs.tracks.scores import doubted_gain
from assoc.costs.tracks.tuples import gate_of, require_states
from assoc.filters.batches import concatenate
from assoc.problem import AssignmentProblem
from assoc.tracking.associate.all_sensors import associated, associated_in_order
from assoc.tracking.associate.mht import TrackTrees
from assoc.tracking.method import Method
from assoc.tracking.progress import Association, Progress
from assoc.tracking.stages.coverage import misses
from assoc.tracking.tracker import Tracker


class StaticFusion(Method):
    """The method of `StaticFusionTracker`."""

    starter = TrackTrees()

    def at_once(self, progress: Progress) -> Association:
        """Fuse the scan, then assign the fused tuples to tracks."""
        tracks = progress.state.tracks
        fused = progress.work.assign(progress.settings.births.problem(progress.scan)).tuples
        missed = misses(progress, tracks.states)
        track, which, costs, corrected = _pairs(progress, fused, missed)
        count = len(tracks)
        # every track may be missed: (track, 0), with the state as predicted
        pairs = np.stack([np.append(track, np.arange(count)), np.append(which + 1, np.zeros(count, np.int64))], axis=1)
        pairs[:, 0] += 1
        gain = -np.append(costs, -missed.sum(axis=1))
        value = doubted_gain(tracks.score[pairs[:, 0] - 1], gain)
        solution = progress.work.assign(AssignmentProblem(pairs, -value, [count, len(fused)]))
        kept = solution.indices[solution.indices < len(pairs)]
        kept = kept[np.argsort(pairs[kept, 0])]
        chosen = pairs[kept, 1]
        rows = np.zeros(missed.shape, dtype=np.int32)
        rows[chosen > 0] = fused[chosen[chosen > 0] - 1]
        free = np.ones(len(fused) + 1, dtype=np.bool_)
        free[chosen] = False
        after = concatenate([corrected, tracks.states])[kept]
        return associated(progress, after, gain[kept], rows, fused[free[1:]], missed)

    def in_order(self, progress: Progress, timed: TimedScan) -> Association:
        """The same where measurements have times of their own."""
        scores, terms = progress.state.tracks.score, progress.settings.terms
        missed = timed.misses(terms)
        fused = np.asarray(progress.work.assign(progress.settings.births.problem(progress.scan)).tuples, dtype=np.int32)
        count = len(scores)
        track, which = [np.arange(count)], [np.full(count, -1)]
        lead = np.argmax(fused > 0, axis=1)
        for s, z in enumerate(progress.scan.measurements):
            led = np.flatnonzero(lead == s)
            owner = np.full(len(z), -1)
            owner[fused[led, s] - 1] = led
            near, found = timed.near(s)
            track.append(near[owner[found] >= 0])
            which.append(owner[found][owner[found] >= 0])
        pairs, fused_of = np.concatenate(track), np.concatenate(which)
        rows = np.concatenate([fused, np.zeros((1, fused.shape[1]), dtype=np.int32)])[fused_of]
        followed = timed.follow(pairs, rows)
        gain = -score_costs(timed, followed, rows, terms, missed[pairs])
        good = np.flatnonzero(followed.inside)
        value = doubted_gain(scores[pairs[good]], gain[good])
        columns = np.stack([pairs[good] + 1, fused_of[good] + 1], axis=1)
        solution = progress.work.assign(AssignmentProblem(columns, -value, [count, len(fused)]))
        kept = good[solution.indices[solution.indices < len(good)]]
        kept = kept[np.argsort(pairs[kept])]
        free = np.ones(len(fused) + 1, dtype=np.bool_)
        free[fused_of[kept]] = False
        return associated_in_order(progress, timed, missed, rows[kept], fused[free[:-1]])


def _pairs(progress: Progress, fused: Array, missed: Array) -> tuple[Array, Array, Array, Any]:
    """Tracks and tuples within the gates: rows of both, costs, and the corrected states; `missed` as of `misses`."""
    settings, states = progress.settings, progress.state.tracks.states
    filter, terms, probability = settings.filter, settings.terms, settings.gate_probability
    seen_by = list(enumerate(zip(progress.scan.measurements, settings.sensors, strict=True)))
    track, which = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    lead = np.argmax(fused > 0, axis=1)
    for s, (z, sensor) in seen_by:
        led = np.flatnonzero(lead == s) if len(fused) else np.zeros(0, dtype=np.int64)
        expected, gate = filter.expected(states, sensor), gate_of(sensor, probability)
        near = near_pairs(expected, z[fused[led, s] - 1], sensor.angular[: sensor.dim], gate)
        track, which = np.append(track, near[0]), np.append(which, led[near[1]])
    order = np.lexsort((which, track))
    track, which = track[order], which[order]
    require_states(states, len(track))
    corrected, costs = states[track], np.full(len(track), 0.0)
    costs += progress.scan.crowding(fused[which])
    nis, freedom = np.zeros(len(track)), np.zeros(len(track), dtype=np.int64)
    for s, (z, sensor) in seen_by:
        seen = np.flatnonzero(fused[which, s] > 0)
        costs -= missed[track, s]
        if not len(seen):
            continue
        done = filter.update(corrected[seen], np.ascontiguousarray(z[fused[which[seen], s] - 1]), sensor)
        costs[seen] -= done.log_likelihood + terms.detection[s] - missed[track[seen], s]
        nis[seen] += done.nis
        freedom[seen] += sensor.dim
        rest = np.setdiff1d(np.arange(len(track)), seen)
        back = np.argsort(np.concatenate([seen, rest]), kind="stable")
        corrected = concatenate([done.state, corrected[rest]])[back]
    largest = int(sum(sensor.dim for sensor in settings.sensors))
    inside = nis <= chi_square_quantiles(probability, largest)[freedom]
    inside &= costs < -missed.sum(axis=1)[track]
    return track[inside], which[inside], costs[inside], corrected[inside]


class StaticFusionTracker(Tracker):
    """S-D fusion of each scan by itself, then a 2-D assignment of the fused tuples to the tracks.

    The S-D problem does not use the tracks, and its tuples are not revised. Single measurements are tuples of one. A
    tuple's cost for a track is that of all its measurements under the track's predicted density, misses included,
    averaged over whether the track is a target.

    Parameters
    ----------
    sensors, filter, **options
        As for `Tracker`.
    """

    name = "static"
    method = StaticFusion
