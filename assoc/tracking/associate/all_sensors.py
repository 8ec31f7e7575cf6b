"""Shared by trackers that associate all sensors of a scan together: update tracks, and start new ones, by tuples."""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc._types import Array
from assoc.costs.positions import tuple_costs
from assoc.costs.tracks.own_times import TimedScan, score_costs
from assoc.tracking.progress import Association, Progress
from assoc.tracking.stages.looks import looked
from assoc.tracking.track import owners
from assoc.tracking.track_batch import STARTED, TrackBatch


def associated(progress: Progress, states: Any, gain: Array, rows: Array, born: Array, missed: Array) -> Association:
    """Apply the chosen tuples of a scan of one instant to T tracks that are predicted to it.

    `states` are the updated ones, `gain` (T,) the gains of their scores, `rows` (T, S) their measurements, 1-based, 0
    missed, and `missed` (T, S) scores of a miss; see `assoc.tracking.stages.looks.misses`. Tuples in `born` (K, S)
    belong to no track.
    """
    tracks = progress.state.tracks.scored(states, gain, np.where(rows.any(axis=1), progress.scan.time, np.nan))
    return _joined(progress, tracks, rows, _begin(progress, born), missed)


def associated_in_order(progress: Progress, timed: TimedScan, missed: Array, rows: Array, born: Array) -> Association:
    """Like `associated`, for measurements with times of their own; `missed` is `TimedScan.misses`."""
    track, terms = np.arange(len(rows)), progress.settings.terms
    followed = timed.follow(track, rows)
    gain = -score_costs(timed, followed, rows, terms, missed[track])
    when = np.where(rows.any(axis=1), followed.when, np.nan)
    tracks = progress.state.tracks.scored(timed.at_end(followed, track), gain, when)
    return _joined(progress, tracks, rows, _begin_in_order(progress, timed, born, missed), missed[track])


def _joined(
    progress: Progress, tracks: TrackBatch, rows: Array, new: tuple[TrackBatch, Array], missed: Array
) -> Association:
    """Join tracks and new tracks; `missed`: scores of a miss of the tracks, (T, S)."""
    begun = np.ones(len(new[0]), dtype=np.bool_)
    at_all = np.concatenate([looked(progress, missed), begun])
    batch = TrackBatch.concatenate([tracks, new[0]]).counted(np.concatenate([rows.any(axis=1), begun]), at_all)
    return Association(batch, owners(np.concatenate([rows, new[1]]), batch.track_id, progress.scan.sizes))


def _begin(progress: Progress, born: Array) -> tuple[TrackBatch, Array]:
    """New tracks of tuples that determine a position, with ids in the order of positions."""
    settings, scan = progress.settings, progress.scan
    tuples = np.asarray(born, dtype=np.int32).reshape(-1, len(settings.sensors))
    if not len(tuples) or settings.nursery is not None:
        return progress.state.tracks[:0], tuples[:0]
    positions, covariances, fit = settings.births.fused(scan, tuples)
    order = np.flatnonzero(fit)
    order = order[np.lexsort(positions[order].T)]
    rows, positions, covariances = tuples[order], positions[order], covariances[order]
    states = settings.initiation.start(settings.filter, positions, covariances)
    costs = tuple_costs(settings.place, scan, rows, speed=settings.initiation.speed)
    costs -= settings.births.overlooked(rows, positions, covariances)
    score = settings.births.scores(rows, costs, positions, covariances) - scan.crowding(rows)
    return TrackBatch.new(states, progress.work.new_ids(len(order)), score, scan.time), rows


def _begin_in_order(progress: Progress, timed: TimedScan, born: Array, missed: Array) -> tuple[TrackBatch, Array]:
    """`_begin` where measurements have times of their own."""
    settings = progress.settings
    tuples = np.asarray(born, dtype=np.int32).reshape(-1, len(settings.sensors))
    fit = [np.append(mask, False)[tuples[:, s] - 1] for s, mask in enumerate(timed.places.fit)]
    rows = tuples[np.any(fit, axis=0)]
    if not len(rows):
        return progress.state.tracks[:0], rows
    fresh = np.full(len(rows), -1)
    followed = timed.follow(fresh, rows)
    states = timed.at_end(followed, fresh)
    anchors = timed.anchors(rows, followed.lead)
    score = -score_costs(timed, followed, rows, settings.terms, missed[anchors])
    order = np.lexsort(states.mean[:, list(settings.filter.motion.position)].T)
    batch = TrackBatch.new(states[order], progress.work.new_ids(len(order)), score[order], followed.when[order])
    batch.numbers[:, STARTED] = followed.first[order]
    return batch, rows[order]
