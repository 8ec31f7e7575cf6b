"""A scan whose sensors are associated together: candidate tuples, tracks corrected by tuples, new tracks of tuples.

Measurements have times of their own (`_InOrder`); one instant for all is the fast case (`_AtOnce`), and trackers need
not know which it is.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.gating import chi_square_quantiles
from assoc.costs.tracks.gating import near_pairs
from assoc.costs.tracks.own_times import TimedScan, grow_timed_tuples, score_costs
from assoc.costs.tracks.tuples import corrected, gate_of, grow_track_tuples, require_states
from assoc.filters.base import predict_each
from assoc.filters.measurement import periods_of
from assoc.tracking.progress import Association, Progress
from assoc.tracking.records.track import owners
from assoc.tracking.records.track_batch import ID, STARTED, TrackBatch
from assoc.tracking.stages.coverage import covered, misses


class Corrected(NamedTuple):
    """M tracks, each corrected by a tuple of measurements, at the end of the scan."""

    states: Any
    gain: Array
    """Gain of the score, (M,)."""
    when: Array
    """Time of the last measurement, seconds; NaN where there is none; (M,)."""
    inside: Callable[[], Array]
    """Whether the tuple passed its gate, bool (M,)."""

    def of(self, rows: Array) -> Corrected:
        """Select tracks."""
        return Corrected(self.states[rows], self.gain[rows], self.when[rows], lambda: self.inside()[rows])


class WholeScan(ABC):
    """T tracks and a scan.

    `missed` (T, S) is the score of a miss of each track by each sensor.
    """

    missed: Array

    def __init__(self, progress: Progress) -> None:
        self._progress, self._tracks = progress, progress.state.tracks

    @abstractmethod
    def candidates(self) -> tuple[Array, Array, Array]:
        """Tuples that may be of one target, ordered by track.

        Returns
        -------
        int array (M,)
            Row of the track, -1 for a new target. Every track has a tuple in which all sensors missed it.
        int32 array (M, S)
            1-based measurement of each sensor, 0 where it missed.
        array (M,)
            Gain of the track's score, or score of the new target.
        """

    def near(self, tuples: Array) -> tuple[Array, Array]:
        """Tracks, and which of the tuples (K, S) may be theirs by the first sensor in it."""
        lead = np.argmax(tuples > 0, axis=1) if len(tuples) else np.zeros(0, dtype=np.int64)
        tracks, found = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
        for s in range(tuples.shape[1]):
            led = np.flatnonzero(lead == s)
            track, which = self._near(s, tuples[led, s] - 1)
            tracks.append(track)
            found.append(led[which])
        return np.concatenate(tracks), np.concatenate(found)

    @abstractmethod
    def _near(self, s: int, numbers: Array) -> tuple[Array, Array]:
        """Tracks, and which of these measurements (from 0) of sensor s may be in their gates."""

    @abstractmethod
    def follow(self, track: Array, rows: Array) -> Corrected:
        """Tracks of these rows (M,), each corrected by a tuple, rows (M, S)."""

    @abstractmethod
    def begun(self, tuples: Array) -> tuple[TrackBatch, Array]:
        """Tracks of those tuples (K, S) that determine a position, without ids, by position; and which tuples."""

    def begin(self, born: Array) -> tuple[TrackBatch, Array]:
        """New tracks of those tuples (K, S) that determine a position, with ids by position; and their tuples."""
        tuples = np.asarray(born, dtype=np.int32).reshape(-1, len(self._progress.settings.sensors))
        if not len(tuples) or self._progress.settings.starter is not None:
            return self._tracks[:0], tuples[:0]
        new, which = self.begun(tuples)
        new.counts[:, ID] = self._progress.work.new_ids(len(new))
        return new, tuples[which]

    def associated(self, after: Corrected, rows: Array, born: Array) -> Association:
        """Apply the chosen tuples: `rows` (T, S) of the tracks, corrected by them, and `born` (K, S) of none."""
        tracks = self._tracks.scored(after.states, after.gain, after.when)
        old, anew = _begun_anew(self, self._progress, tracks, rows)
        new, of_new = self.begin(born)
        stay = np.setdiff1d(np.arange(len(tracks)), old) if len(old) else slice(None)
        fresh = np.ones(len(anew) + len(new), dtype=np.bool_)
        hit = np.concatenate([rows[stay].any(axis=1), fresh])
        at_all = np.concatenate([covered(self._progress, self.missed[stay]), fresh])
        batch = TrackBatch.concatenate([tracks[stay], anew, new]).counted(hit, at_all)
        taken = np.concatenate([rows[stay], rows[old], of_new])
        return Association(batch, owners(taken, batch.track_id, self._progress.scan.sizes))


class _AtOnce(WholeScan):
    """All sensors covered everything at one instant, to which the tracks are predicted."""

    def __init__(self, progress: Progress) -> None:
        super().__init__(progress)
        self.missed = misses(progress, self._tracks.states)

    def candidates(self) -> tuple[Array, Array, Array]:
        """Tuples of tracks by their kernel, and those of the scan's problem that are better than false alarms."""
        settings, scan = self._progress.settings, self._progress.scan
        known = grow_track_tuples(
            settings.filter, self._tracks.states, list(scan.measurements), settings.sensors, settings.terms,
            self.missed, gate_probability=settings.gate_probability, max_tuples=settings.max_tuples,
        )  # fmt: skip
        rows, scores = new_targets(self._progress)
        track = np.append(known.track, np.full(len(rows), -1))
        gain = np.append(-known.costs - scan.crowding(known.rows), scores)
        return track, np.concatenate([known.rows, rows]), gain

    def _near(self, s: int, numbers: Array) -> tuple[Array, Array]:
        """By the gates of the predicted tracks."""
        settings, z = self._progress.settings, self._progress.scan.measurements[s]
        expected = settings.filter.expected(self._tracks.states, settings.sensors[s])
        gate = gate_of(settings.sensors[s], settings.gate_probability)
        return near_pairs(expected, z[numbers], periods_of(settings.sensors[s]), gate)

    def follow(self, track: Array, rows: Array) -> Corrected:
        """Sensor after sensor; inside by the distances of all measurements together."""
        settings, scan = self._progress.settings, self._progress.scan
        require_states(self._tracks.states, len(track))
        whole = len(track) == len(self._tracks) and bool((track == np.arange(len(track))).all())
        states = self._tracks.states if whole else self._tracks.states[track]
        missed = self.missed if whole else self.missed[track]
        alone = missed.sum(axis=1)
        states, log_likelihood, squares = corrected(settings.filter, states, scan.measurements, settings.sensors, rows)
        gain = alone - scan.crowding(rows)
        for s, detection in enumerate(settings.terms.detection):
            gain += np.where(rows[:, s] > 0, log_likelihood[:, s] + detection - missed[:, s], 0.0)
        any_seen = rows.any(axis=1)

        def inside() -> Array:
            dims = np.array([sensor.dim for sensor in settings.sensors])
            gates = chi_square_quantiles(settings.gate_probability, int(dims.sum()))[(rows > 0) @ dims]
            return np.asarray((squares() <= gates) & ((gain > alone) | ~any_seen))

        return Corrected(states, gain, np.where(any_seen, scan.time, np.nan), inside)

    def begun(self, tuples: Array) -> tuple[TrackBatch, Array]:
        """At the fused positions."""
        settings, scan = self._progress.settings, self._progress.scan
        costs, positions, covariances, fit = settings.births.weighed(scan, tuples)
        order = np.flatnonzero(fit)
        order = order[np.lexsort(positions[order].T)]
        rows, positions, covariances = tuples[order], positions[order], covariances[order]
        states = settings.initiation.start(settings.filter, positions, covariances)
        costs = costs[order] - settings.births.overlooked(rows, positions, covariances)
        score = settings.births.scores(rows, costs, positions, covariances) - scan.crowding(rows)
        return TrackBatch.new(states, np.zeros(len(order), dtype=np.int64), score, scan.time), order


class _InOrder(WholeScan):
    """Measurements have times of their own: tracks and new targets are filtered in their order."""

    def __init__(self, progress: Progress, timed: TimedScan) -> None:
        super().__init__(progress)
        self._timed, self._misses = timed, timed.misses(progress.settings.terms)
        self.missed = self._misses[: len(self._tracks)]

    def candidates(self) -> tuple[Array, Array, Array]:
        """Tuples of tracks and of new targets; of these only those that are better than false alarms."""
        settings = self._progress.settings
        found = grow_timed_tuples(self._timed, settings.terms, self._misses, settings.max_tuples)
        good = np.flatnonzero((found.track >= 0) | (found.costs < 0))
        return found.track[good], found.rows[good], -found.costs[good]

    def _near(self, s: int, numbers: Array) -> tuple[Array, Array]:
        """By the gates of the tracks at any time of the scan."""
        which = np.full(len(self._progress.scan.measurements[s]), -1)
        which[numbers] = np.arange(len(numbers))
        track, measurement = self._timed.near(s)
        there = which[measurement] >= 0
        return track[there], which[measurement][there]

    def follow(self, track: Array, rows: Array) -> Corrected:
        """From measurement to measurement, each within its gate."""
        timed, terms = self._timed, self._progress.settings.terms
        followed = timed.follow(track, rows)
        gain = -score_costs(timed, followed, rows, terms, self.missed[track])
        when = np.where(rows.any(axis=1), followed.when, np.nan)
        return Corrected(timed.at_end(followed, track), gain, when, lambda: followed.inside)

    def begun(self, tuples: Array) -> tuple[TrackBatch, Array]:
        """From the first measurement that determines a position."""
        settings, timed = self._progress.settings, self._timed
        fit = [np.append(mask, False)[tuples[:, s] - 1] for s, mask in enumerate(timed.places.fit)]
        good = np.flatnonzero(np.any(fit, axis=0))
        if not len(good):
            return self._tracks[:0], good
        rows, fresh = tuples[good], np.full(len(good), -1)
        followed = timed.follow(fresh, rows)
        states = timed.at_end(followed, fresh)
        anchors = timed.anchors(rows, followed.lead)
        score = -score_costs(timed, followed, rows, settings.terms, self._misses[anchors])
        order = np.lexsort(states.mean[:, list(settings.filter.motion.position)].T)
        batch = TrackBatch.new(states[order], np.zeros(len(order), dtype=np.int64), score[order], followed.when[order])
        batch.numbers[:, STARTED] = followed.first[order]
        return batch, good[order]


def whole_scan(progress: Progress) -> WholeScan:
    """The scan of a step and its tracks."""
    return _AtOnce(progress) if progress.timed is None else _InOrder(progress, progress.timed)


def new_targets(progress: Progress) -> tuple[Array, Array]:
    """Tuples without a track in a scan of one instant that are better than false alarms, and their scores."""
    births = progress.settings.births
    problem = births.problem(progress.scan)
    if not problem.num_tuples:
        return problem.tuples, problem.costs
    # where new targets are more frequent than false alarms, single measurements may be new targets, too
    scores = births.scores(problem.tuples, problem.costs, *births.fused(progress.scan, problem.tuples)[:2])
    good = scores > 0
    return problem.tuples[good], scores[good]


def _begun_anew(scan: WholeScan, progress: Progress, tracks: TrackBatch, rows: Array) -> tuple[Array, TrackBatch]:
    """Tentative tracks (K,) that begin anew, since new ones of their measurements promise more, and these new ones.

    So a track that began with a false alarm does not hold back the target whose measurements it takes (as in Page's
    test, whose sum begins anew). It gets a new id: what was before is not of the target. A new track does not know its
    velocity yet: at its next measurement it wins less, by the share of the areas in which the two expect it.

    `tracks` are those (T,) after the scan, `rows` (T, S) their measurements.
    """
    weak = np.flatnonzero(~tracks.confirmed & (tracks.score < 0.0) & rows.any(axis=1))
    if not len(weak):
        return weak, tracks[:0]
    new, which = scan.begun(np.asarray(rows[weak], dtype=np.int32))
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
