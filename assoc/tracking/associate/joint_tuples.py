"""The joint probabilistic tracker with all sensors of a scan at once.

A joint event is a set of tuples, each of a track and a measurement or none of every sensor, without common members; all
other measurements are false alarms. Its weight is the product of those of its tuples (`existence_gain`). The events are
summed as `assoc.marginals` does: exactly where clusters are narrow, else with bounds that hold, and estimates. Each
track is merged of its states by each tuple. Measurements that probably belong to no track start new ones, as in the
multi-sensor tracker.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.own_times import TimedScan, grow_timed_tuples
from assoc.costs.tracks.scores import existence_gain
from assoc.costs.tracks.tuples import corrected, grow_track_tuples
from assoc.filters.merging import merged
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.ranking.estimates.swept import swept_where
from assoc.ranking.marginals import without_listing
from assoc.ranking.pairs.tuple_permutations import without_tuple_permutations
from assoc.tracking.associate.all_sensors import begin, begin_in_order
from assoc.tracking.associate.multi_sensor import new_targets
from assoc.tracking.progress import Association, Progress
from assoc.tracking.records.track import owners
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.stages.coverage import covered, misses

MARGIN = 7.0
"""Tuples whose weight is below exp(-MARGIN) of that of their track without measurements are left out."""
_SURE = 30.0
"""Scores are clipped here, as those of the tracker that takes sensor by sensor."""
_COUNTS = 1e-5
"""Share below which a tuple does not count in a track's state."""
_WIDE, _STATES = 0.1, 0.125
"""Where intervals are wider than this, probabilities are swept, with this share of the states."""
_FREE = 0.5
"""A measurement with a lower probability to be a track's may start one."""
_New = tuple[TrackBatch, Array]
"""New tracks and their measurements, (K, S)."""


class _Joint(NamedTuple):
    """Sums over the joint events for T tracks and M tuples."""

    used: Array
    """The tuples that count in states, (K,)."""
    weight: Array
    """Their weights; those of a track sum to 1, (K,)."""
    odds: Array
    """Log odds of existence, (T,)."""
    hit: Array
    """Whether the track was detected with probability above 0.5, bool (T,)."""
    pairs: tuple[tuple[Array, ...], ...]
    """The fields of `PairProbabilities` of each sensor, in their order."""
    owner: list[Array]
    """Row of the track that has more than half of each measurement, -1: none."""
    taken: list[Array]
    """Probability that each measurement is a track's."""


def at_once(progress: Progress, permutations: str, max_events: int) -> Association:
    """Associate a scan of one instant; `own` are the fields of each sensor's `PairProbabilities`."""
    settings, scan, tracks = progress.settings, progress.scan, progress.state.tracks
    missed = misses(progress, tracks.states)
    track, rows, costs = grow_track_tuples(
        settings.filter, tracks.states, list(scan.measurements), settings.sensors, settings.terms, missed,
        gate_probability=settings.gate_probability, max_tuples=settings.max_tuples, margin=MARGIN,
    )  # fmt: skip
    joint = _joint(progress, track, rows, -costs - scan.crowding(rows), permutations, max_events)
    used = joint.used
    states = corrected(settings.filter, tracks.states[track[used]], scan.measurements, settings.sensors, rows[used])
    when = np.where(joint.hit, scan.time, np.nan)
    new = _begun(progress, joint.taken, *new_targets(progress), lambda born: begin(progress, born))
    return _associated(progress, joint, track[used], states, when, new, missed)


def in_order(progress: Progress, timed: TimedScan, permutations: str, max_events: int) -> Association:
    """The same where measurements have times of their own."""
    settings, tracks = progress.settings, progress.state.tracks
    missed = timed.misses(settings.terms)
    grown = grow_timed_tuples(timed, settings.terms, missed, settings.max_tuples, MARGIN)
    known, fresh = np.flatnonzero(grown.track >= 0), np.flatnonzero((grown.track < 0) & (grown.costs < 0.0))
    track, rows = grown.track[known], grown.rows[known]
    joint = _joint(progress, track, rows, -grown.costs[known], permutations, max_events)
    used = joint.used
    followed = timed.follow(track[used], rows[used])
    states = timed.at_end(followed, track[used])
    # a detection is as late as the last measurement of the likeliest tuple
    when, seen = np.full(len(tracks), np.nan), rows[used].any(axis=1)
    order = np.flatnonzero(seen)[np.argsort(joint.weight[seen], kind="stable")]
    when[track[used][order]] = followed.when[order]
    when[~joint.hit] = np.nan
    new = _begun(
        progress, joint.taken, grown.rows[fresh], grown.costs[fresh],
        lambda born: begin_in_order(progress, timed, born, missed),
    )  # fmt: skip
    return _associated(progress, joint, track[used], states, when, new, missed[: len(tracks)])


def _joint(progress: Progress, track: Array, rows: Array, gain: Array, permutations: str, max_events: int) -> _Joint:
    """Sum the joint events of tuples of tracks, ordered by track; every track has one without measurements."""
    tracks, sizes = progress.state.tracks, progress.scan.sizes
    count, seen = len(tracks), np.asarray(rows.any(axis=1))
    existence = np.clip(tracks.existence, -_SURE, _SURE)
    value, alone = existence_gain(existence[track], gain, seen), np.flatnonzero(~seen)
    estimate, lower, upper = _summed(track, rows, value, np.concatenate([[count], sizes]), max_events)
    share = estimate
    if permutations == "best":
        relative = value - value[alone][track]
        share = without_tuple_permutations(track, rows, relative, sizes, estimate)
    detected = np.bincount(track[seen], estimate[seen], count)
    # that the target exists and all sensors missed it
    there = np.exp(gain[alone] - np.logaddexp(0.0, -existence) - value[alone]) * np.maximum(1.0 - detected, 0.0)
    odds = existence + gain[alone] + np.log1p(detected / np.maximum(there, 1e-300))
    share = np.where(seen, share, np.maximum(there, 1e-300)[track])
    used = np.flatnonzero(~seen | (share > _COUNTS))
    weight = share[used] / np.bincount(track[used], share[used], count)[track[used]]
    pairs, owner, taken = [], [], []
    for s, size in enumerate(sizes.tolist()):
        here = np.flatnonzero(rows[:, s])
        key, number = np.unique(track[here] * (size + 1) + rows[here, s], return_inverse=True)
        index, measurement = key // (size + 1), key % (size + 1) - 1
        sums = [np.bincount(number, values[here], len(key)) for values in (estimate, lower, upper, share)]
        pairs.append((tracks.track_id[index], measurement, *(np.minimum(each, 1.0) for each in sums)))
        likely = sums[3] > 0.5
        owner.append(np.full(size, -1))
        owner[-1][measurement[likely]] = index[likely]
        taken.append(np.minimum(np.bincount(measurement, sums[0], size), 1.0))
    return _Joint(used, weight, np.clip(odds, -_SURE, _SURE), detected > 0.5, tuple(pairs), owner, taken)


def _summed(track: Array, rows: Array, value: Array, sizes: Array, max_events: int) -> Array:
    """Estimates and bounds of the probabilities of M tuples, (3, M)."""
    if not len(track):
        return np.zeros((3, 0))
    problem = AssignmentProblem(np.column_stack([track + 1, rows]), -value, sizes)
    widest = int(max_events).bit_length() - 1
    found = without_listing(problem, np.arange(problem.num_tuples), problem.num_tuples, Run(0), widest, True)
    assert found is not None  # there is no time limit
    wide = found[2] - found[1] > _WIDE
    if wide.any():
        found[0] = np.clip(swept_where(problem, wide, found[0], _STATES), found[1], found[2])
    return found[:, : len(track)]


def _begun(progress: Progress, taken: list[Array], tuples: Array, costs: Array, begin: Callable[[Array], _New]) -> _New:
    """New tracks of measurements that probably belong to no track, by the best of these tuples of new targets."""

    def most(rows: Array) -> Array:
        shares = [np.append(0.0, probability)[rows[:, s]] for s, probability in enumerate(taken)]
        return np.asarray(np.max(shares, axis=0, initial=0.0))

    good = most(tuples) < _FREE
    solution = progress.work.assign(AssignmentProblem(tuples[good], costs[good], progress.scan.sizes))
    batch, rows = begin(solution.tuples[most(solution.tuples) < _FREE])
    return batch.scored(batch.states, np.log1p(-most(rows)), batch.last_detection), rows


def _associated(
    progress: Progress, joint: _Joint, track: Array, states: Any, when: Array, new: _New, missed: Array
) -> Association:
    """Merge the states (K,) of tracks, and add new tracks; `missed`: scores of a miss of the tracks, (T, S)."""
    tracks, (begun, rows) = progress.state.tracks, new
    if len(tracks):
        states = merged(states, track, joint.weight, len(tracks))
        tracks = tracks.scored(states, joint.odds - tracks.existence, when)
    fresh = np.ones(len(begun), dtype=np.bool_)
    at_all = np.concatenate([covered(progress, missed), fresh])
    batch = TrackBatch.concatenate([tracks, begun]).counted(np.concatenate([joint.hit, fresh]), at_all)
    assigned = owners(rows, begun.track_id, progress.scan.sizes)
    for ids, own in zip(assigned, joint.owner, strict=True):
        ids[own >= 0] = tracks.track_id[own[own >= 0]]
    return Association(batch, assigned, joint.pairs)
