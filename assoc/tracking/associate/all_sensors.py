"""Shared by trackers that associate all sensors of a scan together: update tracks, and start new ones, by tuples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.costs.positions import tuple_costs
from assoc.costs.tracks.own_times import TimedScan, score_costs
from assoc.filters.base import predict_each
from assoc.tracking.progress import Association, Progress
from assoc.tracking.records.track import owners
from assoc.tracking.records.track_batch import ID, STARTED, TrackBatch
from assoc.tracking.stages.coverage import covered


def associated(progress: Progress, states: Any, gain: Array, rows: Array, born: Array, missed: Array) -> Association:
    """Apply the chosen tuples of a scan of one instant.

    Parameters
    ----------
    progress : Progress
        Its T tracks are predicted to the scan.
    states
        The tracks' updated states, in their order.
    gain : array (T,)
        Gains of their scores.
    rows : int array (T, S)
        Their measurements, 1-based, 0 missed.
    born : int array (K, S)
        Tuples that belong to no track.
    missed : array (T, S)
        Scores of a miss of the tracks; see `assoc.tracking.stages.coverage.misses`.
    """
    tracks = progress.state.tracks.scored(states, gain, np.where(rows.any(axis=1), progress.scan.time, np.nan))
    old, anew = _begun_anew(progress, tracks, rows, lambda tuples: _fresh(progress, tuples))
    return _joined(progress, tracks, rows, missed, (old, anew), begin(progress, born))


def associated_in_order(progress: Progress, timed: TimedScan, missed: Array, rows: Array, born: Array) -> Association:
    """Like `associated`, for measurements with times of their own; `missed` is `TimedScan.misses`."""
    track, terms = np.arange(len(rows)), progress.settings.terms
    followed = timed.follow(track, rows)
    gain = -score_costs(timed, followed, rows, terms, missed[track])
    when = np.where(rows.any(axis=1), followed.when, np.nan)
    tracks = progress.state.tracks.scored(timed.at_end(followed, track), gain, when)
    old, anew = _begun_anew(progress, tracks, rows, lambda tuples: _fresh_in_order(progress, timed, tuples, missed))
    return _joined(progress, tracks, rows, missed[track], (old, anew), begin_in_order(progress, timed, born, missed))


def _joined(
    progress: Progress, tracks: TrackBatch, rows: Array, missed: Array, anew: tuple[Array, TrackBatch],
    born: tuple[TrackBatch, Array],
) -> Association:  # fmt: skip
    """Join tracks, those that begin anew and which they replace, and new ones; `missed`: scores of a miss, (T, S)."""
    old, begun = anew
    stay = np.setdiff1d(np.arange(len(tracks)), old) if len(old) else slice(None)
    fresh = np.ones(len(begun) + len(born[0]), dtype=np.bool_)
    hit = np.concatenate([rows[stay].any(axis=1), fresh])
    at_all = np.concatenate([covered(progress, missed[stay]), fresh])
    batch = TrackBatch.concatenate([tracks[stay], begun, born[0]]).counted(hit, at_all)
    taken = np.concatenate([rows[stay], rows[old], born[1]])
    return Association(batch, owners(taken, batch.track_id, progress.scan.sizes))


def _begun_anew(
    progress: Progress, tracks: TrackBatch, rows: Array, fresh: Callable[[Array], tuple[TrackBatch, Array]]
) -> tuple[Array, TrackBatch]:
    """Tentative tracks (K,) that begin anew, since new ones of their measurements promise more, and these new ones.

    So a track that began with a false alarm does not hold back the target whose measurements it takes (as in Page's
    test, whose sum begins anew). It gets a new id: what was before is not of the target. A new track does not know its
    velocity yet: at its next measurement it wins less, by the share of the areas in which the two expect it.

    Parameters
    ----------
    progress : Progress
    tracks : TrackBatch
        T tracks after the scan.
    rows : int array (T, S)
        Their measurements.
    fresh : callable
        Makes tracks of tuples (K, S); returns them and which tuples they are.
    """
    weak = np.flatnonzero(~tracks.confirmed & (tracks.score < 0.0) & rows.any(axis=1))
    if not len(weak):
        return weak, tracks[:0]
    new, which = fresh(np.asarray(rows[weak], dtype=np.int32))
    old = weak[which]
    better = np.flatnonzero(new.score > tracks.score[old])
    old, new = old[better], new[better]
    if len(old):
        # a track that has its second detection knows its velocity by it, if that was its target's
        lead = np.where(tracks.hits[old] == 1, _lead(progress, tracks.states[old], new.states), 0.0)
        better = np.flatnonzero(new.score - lead > tracks.score[old])
        old, new = old[better], new[better]
    new.counts[:, ID] = progress.work.new_ids(len(old))
    return old, new


def _lead(progress: Progress, states: Any, new: Any) -> Array:
    """How much more the next measurement of tracks is worth than that of new ones at the same places, (K,)."""
    filter, when = progress.settings.filter, np.full(len(new), progress.state.pace)
    axes = list(filter.motion.position)
    noise, areas = new.covariance[:, axes][:, :, axes], []
    for kind in (new, states):
        spread = predict_each(filter, kind, when).covariance[:, axes][:, :, axes]
        areas.append(0.5 * np.linalg.slogdet(spread + noise)[1])
    return np.asarray(np.maximum(areas[0] - areas[1], 0.0))


def begin(progress: Progress, born: Array) -> tuple[TrackBatch, Array]:
    """New tracks of tuples that determine a position, with ids in the order of positions."""
    settings = progress.settings
    tuples = np.asarray(born, dtype=np.int32).reshape(-1, len(settings.sensors))
    if not len(tuples) or settings.starter is not None:
        return progress.state.tracks[:0], tuples[:0]
    batch, order = _fresh(progress, tuples)
    batch.counts[:, ID] = progress.work.new_ids(len(order))
    return batch, tuples[order]


def _fresh(progress: Progress, tuples: Array) -> tuple[TrackBatch, Array]:
    """Tracks of tuples that determine a position, without ids, in the order of positions, and which tuples."""
    settings, scan = progress.settings, progress.scan
    positions, covariances, fit = settings.births.fused(scan, tuples)
    order = np.flatnonzero(fit)
    order = order[np.lexsort(positions[order].T)]
    rows, positions, covariances = tuples[order], positions[order], covariances[order]
    states = settings.initiation.start(settings.filter, positions, covariances)
    costs = tuple_costs(settings.scene, scan, rows, speed=settings.initiation.speed)
    costs -= settings.births.overlooked(rows, positions, covariances)
    score = settings.births.scores(rows, costs, positions, covariances) - scan.crowding(rows)
    return TrackBatch.new(states, np.zeros(len(order), dtype=np.int64), score, scan.time), order


def begin_in_order(progress: Progress, timed: TimedScan, born: Array, missed: Array) -> tuple[TrackBatch, Array]:
    """`begin` where measurements have times of their own."""
    tuples = np.asarray(born, dtype=np.int32).reshape(-1, len(progress.settings.sensors))
    batch, order = _fresh_in_order(progress, timed, tuples, missed)
    batch.counts[:, ID] = progress.work.new_ids(len(order))
    return batch, tuples[order]


def _fresh_in_order(progress: Progress, timed: TimedScan, tuples: Array, missed: Array) -> tuple[TrackBatch, Array]:
    """`_fresh` where measurements have times of their own."""
    settings = progress.settings
    fit = [np.append(mask, False)[tuples[:, s] - 1] for s, mask in enumerate(timed.places.fit)]
    good = np.flatnonzero(np.any(fit, axis=0))
    if not len(good):
        return progress.state.tracks[:0], good
    rows = tuples[good]
    fresh = np.full(len(rows), -1)
    followed = timed.follow(fresh, rows)
    states = timed.at_end(followed, fresh)
    anchors = timed.anchors(rows, followed.lead)
    score = -score_costs(timed, followed, rows, settings.terms, missed[anchors])
    order = np.lexsort(states.mean[:, list(settings.filter.motion.position)].T)
    batch = TrackBatch.new(states[order], np.zeros(len(order), dtype=np.int64), score[order], followed.when[order])
    batch.numbers[:, STARTED] = followed.first[order]
    return batch, good[order]
