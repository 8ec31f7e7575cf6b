"""The joint probabilistic tracker: each track uses every measurement in its gate, weighted by its probability.

Sensor after sensor, the joint events "these measurements are of these tracks, the others are false alarms" are the
matchings of a graph of tracks and measurements. `assoc.ranking.pairs` sums them cluster by cluster, exactly where a
cluster is not too wide, and otherwise with a bound on the terms left out, so that each probability comes with an
interval that certainly contains it. A track may be false: with existence probability p the weight of a pair is

    p P_D N(z; expected, S) / beta_FA,    against    1 - p P_D    for a track without a measurement,

and without a measurement the existence probability becomes p (1 - P_D) / (1 - p P_D). A track's score is the log odds
of its existence, which the events update as well.

States use the joint events without their permutations (JPDA*, `assoc.ranking.pairs.permutations`), or tracks side by
side would be drawn together.

Where measurements have times of their own, a track is merged at the end of the scan, not after each sensor. Until then
it consists of parts, each with its own measurements, filtered in time order (`assoc.tracking.associate.track_parts`),
and the density in a pair's weight is the average over the parts.

References
----------
T. Fortmann, Y. Bar-Shalom, M. Scheffe, Sonar tracking of multiple targets using joint probabilistic data association,
IEEE J. Oceanic Engineering 8, 1983.
D. Musicki, R. Evans, Joint integrated probabilistic data association: JIPDA, IEEE Trans. Aerospace and Electronic
Systems 40, 2004.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from assoc._parameters import is_whole
from assoc._types import Array
from assoc.costs.tracks.own_times import TimedScan
from assoc.costs.tracks.tuples import TrackPairs, gate_of, track_pairs
from assoc.errors import InvalidInputError
from assoc.filters.batches import concatenate, placed
from assoc.filters.merging import merged
from assoc.ranking.pairs.events import pair_probabilities
from assoc.ranking.pairs.permutations import without_permutations
from assoc.tracking.associate.mht import TrackTrees
from assoc.tracking.associate.track_parts import ScoredPairs, TrackParts
from assoc.tracking.method import Method
from assoc.tracking.progress import Association, Progress
from assoc.tracking.records.track import Step
from assoc.tracking.records.track_batch import STARTED, TrackBatch
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.stages.coverage import covered, detected_or_in_view, misses_of
from assoc.tracking.state import TrackerState
from assoc.tracking.tracker import Tracker

Permutations = Literal["best", "all"]

_SURE = 30.0
"""Scores are clipped here: exp(-30) is below the accuracy of the probabilities."""
_LEAST_SHARE = 1e-10
"""For pairs with a smaller share a track's state counts as predicted, not as corrected: most pairs of a wide gate. With
n pairs in the gate, a squared distance g, this moves the mean of a track that exists with probability p by at most
n sqrt(g) / p times this, in its deviations as predicted."""


@dataclass(frozen=True, eq=False)
class PairProbabilities:
    """Probabilities that one sensor's measurements of one scan belong to the tracks in whose gates they lie.

    Attributes
    ----------
    track_id : int64 array (K,)
    measurement : int64 array (K,)
        From 0.
    probability, lower, upper : arrays (K,)
        The probability, and an interval that certainly contains it.
    share : array (K,)
        The weight with which the track's state uses the measurement; see `permutations`.
    """

    track_id: Array
    measurement: Array
    probability: Array
    lower: Array
    upper: Array
    share: Array


class _Update(NamedTuple):
    """Update of T tracks by one sensor's measurements."""

    detected: Array
    """Probability that some measurement is the track's, (T,)."""
    missed: Array
    """Probability that the target exists and was missed, (T,)."""
    odds: Array
    """Log odds of existence, (T,)."""

    @property
    def after(self) -> Array:
        """Probability of existence, above 0."""
        return np.maximum(self.detected + self.missed, 1e-300)


@dataclass(frozen=True)
class JointProbabilistic(Method):
    """The method of `JointProbabilisticTracker`.

    Its own part of a state: the `PairProbabilities` of each sensor in the last scan.
    """

    starter = TrackTrees()

    max_events: int = 4096
    permutations: Permutations = "best"

    def __post_init__(self) -> None:
        if self.permutations not in get_args(Permutations):
            raise InvalidInputError(f"permutations must be 'best' or 'all', got {self.permutations!r}")
        if not is_whole(self.max_events, 1):
            raise InvalidInputError(f"max_events must be a whole number above 0, got {self.max_events!r}")
        object.__setattr__(self, "max_events", int(self.max_events))

    def begun(self, settings: TrackerSettings, tracks: TrackBatch) -> tuple[PairProbabilities, ...]:
        """No probabilities."""
        # a filter that cannot merge is refused here, not in the first scan
        merged(tracks.states[:0], np.zeros(0, dtype=np.int64), np.zeros(0), 0)
        return ()

    def arrays(self, method_state: Any) -> Mapping[str, Array]:
        """Nothing: later scans do not depend on them."""
        return {}

    def detected(self, state: TrackerState, step: Step) -> Array:
        """Probability with which each sensor has detected each track, (T, S)."""
        order = np.argsort(state.tracks.track_id)
        ids, shares = state.tracks.track_id[order], np.zeros((len(order), len(state.method_state)))
        for s, pairs in enumerate(state.method_state):
            known = np.isin(pairs.track_id, ids)
            at = np.searchsorted(ids, pairs.track_id[known])
            np.add.at(shares[:, s], order[at], pairs.probability[known])
        return np.minimum(shares, 1.0)

    def at_once(self, progress: Progress) -> Association:
        """Process sensor after sensor; measurements that probably belong to no track start new ones."""
        settings, time, tracks = progress.settings, progress.scan.time, progress.state.tracks
        terms = settings.terms
        seen = np.zeros(len(tracks), dtype=np.bool_)
        assigned, found = [], []
        for s, (z, sensor) in enumerate(zip(progress.scan.measurements, settings.sensors, strict=True)):
            gate = gate_of(sensor, settings.gate_probability)
            pairs = track_pairs(settings.filter, tracks.states, z, sensor, gate)
            missed = misses_of(progress, tracks.states, s)
            gain = terms.detection[s] + pairs.log_likelihood - progress.scan.crowd(s, pairs.measurement)
            scored = ScoredPairs(pairs.track, pairs.measurement, gain)
            known, update = self._probabilities(tracks.track_id, tracks.existence, missed, scored, len(z))
            tracks, hit = _take_in(tracks, pairs, known.share, update, time)
            ids, taken = _owners(known, len(z))
            free = np.flatnonzero(taken < 0.5)
            states, fit, positions, score = settings.births.singles(s, progress.scan, free)
            free = free[fit]
            order = np.lexsort(positions.T)
            score = np.clip(score + np.log1p(-taken[free]), -_SURE, _SURE)
            ids[free[order]] = new = progress.work.new_ids(len(free))
            tracks = TrackBatch.concatenate([tracks, TrackBatch.new(states[order], new, score[order], time)])
            seen = np.concatenate([seen | hit, np.ones(len(free), dtype=np.bool_)])
            found.append(known)
            assigned.append(ids)
        at_all = detected_or_in_view(progress, tracks.states, seen)
        return Association(tracks.counted(seen, at_all), assigned, tuple(found))

    def in_order(self, progress: Progress, timed: TimedScan) -> Association:
        """The same where measurements have times of their own."""
        terms, tracks = progress.settings.terms, progress.state.tracks
        misses = timed.misses(terms)
        # the sensors processed so far: only they can have missed a track
        past, old, sensors = np.zeros_like(misses), len(tracks), range(misses.shape[1])
        parts = TrackParts.of_tracks(old, len(sensors))
        track_id, odds = tracks.track_id, tracks.existence
        seen, anchor = np.zeros(old, dtype=np.bool_), np.arange(old)
        assigned, found, done = {}, {}, list[int]()
        for s in timed.order:
            past[:, s] = misses[:, s]
            grown = parts.grown(timed, s, done, terms, past)
            missed = misses[anchor, s]
            count = len(timed.times[s])
            known, update = self._probabilities(track_id, odds, missed, grown.pairs, count)
            of_pair = known.share / update.after[grown.pairs.track]
            parts = parts.after(grown, of_pair, update.missed / update.after, missed)
            ids, taken = _owners(known, count)
            free = np.flatnonzero((taken < 0.5) & timed.places.fit[s])
            free = free[np.lexsort((*timed.places.positions[s][free].T, timed.times[s][free]))]
            first = timed.offsets[s] + free
            begun = timed.places.births[s][free] + past[first].sum(axis=1) - terms.miss[s]
            ids[free] = progress.work.new_ids(len(free))
            parts = parts.begun(len(odds), first, s, free, begun)
            anchor, track_id = np.append(anchor, first), np.append(track_id, ids[free])
            odds = np.append(update.odds, np.clip(begun + np.log1p(-taken[free]), -_SURE, _SURE))
            seen = np.append(seen | (update.detected > 0.5), np.ones(len(free), dtype=np.bool_))
            found[s], assigned[s] = known, ids
            done.append(s)
        states, when, started = parts.merged(timed, len(odds))
        when = np.where(seen, when, np.nan)
        new = TrackBatch.new(states[old:], track_id[old:], odds[old:], when[old:])
        new.numbers[:, STARTED] = started[old:]
        known_before = tracks.scored(states[:old], odds[:old] - tracks.existence, when[:old])
        at_all = np.concatenate([covered(progress, misses[:old]), np.ones(len(new), dtype=np.bool_)])
        batch = TrackBatch.concatenate([known_before, new]).counted(seen, at_all)
        return Association(batch, [assigned[s] for s in sensors], tuple(found[s] for s in sensors))

    def _probabilities(
        self, track_id: Array, existence: Array, missed: Array, pairs: ScoredPairs, count: int
    ) -> tuple[PairProbabilities, _Update]:
        """Sum the joint events of T tracks and `count` measurements of one sensor.

        Of the tracks, (T,): ids, log odds of existence, and the log-probability that an existing target is missed.
        """
        track, measurement, gain = pairs
        exists = 1.0 / (1.0 + np.exp(-np.clip(existence, -_SURE, _SURE)))
        unseen = 1.0 - exists * -np.expm1(missed)
        weight = (np.log(exists) - np.log(unseen))[track] + gain
        sizes = len(exists), count
        known = pair_probabilities(track, measurement, weight, sizes, self.max_events)
        share = known.probability
        if self.permutations == "best":
            share = without_permutations(track, measurement, weight, sizes, share, self.max_events)
        detected = np.bincount(track, known.probability, len(exists))
        there = np.maximum(1.0 - detected, 0.0) * exists * np.exp(missed) / unseen
        # without detections this is existence + missed, exactly: no cancellation in 1 - (1 - probability)
        odds = existence + missed + np.log1p(detected / np.maximum(there, 1e-300))
        update = _Update(detected, there, np.clip(odds, -_SURE, _SURE))
        return PairProbabilities(track_id[track], measurement, *known, share), update


def _take_in(
    tracks: TrackBatch, pairs: TrackPairs, share: Array, update: _Update, time: float
) -> tuple[TrackBatch, Array]:
    """Tracks after a sensor's scan, and which of them were detected with probability above 0.5."""
    if not len(tracks):
        return tracks, np.zeros(0, dtype=np.bool_)
    # given that the target exists
    weight = share / update.after[pairs.track]
    counts = share >= _LEAST_SHARE
    used, faint = np.flatnonzero(counts), np.flatnonzero(~counts)
    changed = np.bincount(pairs.track[used], minlength=len(tracks)) > 0
    old, same = np.flatnonzero(changed), np.flatnonzero(~changed)
    stays = update.missed / update.after + np.bincount(pairs.track[faint], weight[faint], len(tracks))
    row = np.concatenate([np.searchsorted(old, pairs.track[used]), np.arange(len(old))])
    weights = np.concatenate([weight[used], stays[old]])
    states = merged(concatenate([pairs.correct(used), tracks.states[old]]), row, weights, len(old))
    states = placed(len(tracks), [(old, states), (same, tracks.states[same])])
    hit = update.detected > 0.5
    return tracks.scored(states, update.odds - tracks.existence, np.where(hit, time, np.nan)), hit


def _owners(pairs: PairProbabilities, count: int) -> tuple[Array, Array]:
    """The track with a share above 0.5 of each measurement, 0 for none, and the probability that it has any."""
    ids = np.zeros(count, dtype=np.int64)
    likely = pairs.share > 0.5
    ids[pairs.measurement[likely]] = pairs.track_id[likely]
    return ids, np.minimum(np.bincount(pairs.measurement, pairs.probability, count), 1.0)


class JointProbabilisticTracker(Tracker):
    """Joint integrated probabilistic data association, with certified probabilities.

    Parameters
    ----------
    sensors, filter, ...
        As for `Tracker`; the filter's states must be Gaussian or mixtures of models. The `solver` is not used.
    max_events : int
        Largest table of partially summed joint events for a cluster of tracks and measurements (4096). Where a cluster
        would need more entries, its least likely pairs are left out: larger tables give narrower intervals.
    permutations : "best" or "all"
        Which joint events that detect the same tracks by the same measurements determine the states: the best one
        (JPDA*), or all (JPDA, which draws tracks side by side together). Existence and `probabilities` always come
        from all.
    **options
        As for `Tracker`.
    """

    name = "joint-probabilistic"
    method = JointProbabilistic

    @property
    def probabilities(self) -> tuple[PairProbabilities, ...]:
        """Probabilities of the last step's pairs, for each sensor."""
        found: tuple[PairProbabilities, ...] = self.state.method_state
        return found
