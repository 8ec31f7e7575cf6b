"""The joint probabilistic tracker: each track takes every measurement in its gate, each as far as it is its own.

Sensor after sensor, the joint events "these measurements are of these tracks, the others are false alarms" are the
matchings of a graph of tracks and measurements. `assoc.ranking.pairs` sums them cluster by cluster, exactly where a
cluster is not too wide, and with a bound on what was left out, so that each probability comes as an interval that
holds. A track may be none: with existence probability p the pair of a track and a measurement weighs

    p P_D N(z; expected, S) / beta_FA,    against    1 - p P_D    for a track without a measurement,

and what is left of p without a measurement is p (1 - P_D) / (1 - p P_D). A track's score is the logarithm of the odds
of its existence, which the events update as well.

References
----------
T. Fortmann, Y. Bar-Shalom, M. Scheffe, Sonar tracking of multiple targets using joint probabilistic data association,
IEEE J. Oceanic Engineering 8, 1983.
D. Musicki, R. Evans, Joint integrated probabilistic data association: JIPDA, IEEE Trans. Aerospace and Electronic
Systems 40, 2004.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from assoc._system.door import doors
from assoc._types import Array
from assoc.costs.tracks.own_times import PairEvidence
from assoc.costs.tracks.tuples import TrackPairs
from assoc.errors import InvalidInputError
from assoc.filters.base import predict_each
from assoc.filters.batches import concatenate
from assoc.filters.merging import merged
from assoc.ranking.pairs.events import pair_probabilities
from assoc.scene.scan import Scan
from assoc.tracking.gated_pairs import GatedPairs, gated_pairs
from assoc.tracking.nursing import NursingTracker
from assoc.tracking.track import Step, decision
from assoc.tracking.track_batch import TrackBatch

_SURE = 30.0
"""Scores beyond this are certainty: exp(-30) is below what probabilities are known to."""


@dataclass(frozen=True, eq=False)
class PairProbabilities:
    """Probabilities of one sensor's measurements in one scan to be of the tracks in whose gates they lie.

    Attributes
    ----------
    track_id : int64 array (K,)
    measurement : int64 array (K,)
        From 0.
    probability, lower, upper : arrays (K,)
        The probability, and the interval in which it lies for certain.
    """

    track_id: Array
    measurement: Array
    probability: Array
    lower: Array
    upper: Array


@doors
class JointProbabilisticTracker(NursingTracker):
    """Joint integrated probabilistic data association, with certified probabilities.

    Parameters
    ----------
    sensors, filter, ...
        As for `Tracker`; the filter's states must be Gaussian or mixtures of models. The `solver` is not used.
    max_events : int
        Joint events, as far as they are summed, that are kept apart at a time in a cluster of tracks and measurements.
        Where a cluster would need more, its least likely pairs are left out: more make the intervals narrower.
    **options
        As for `Tracker`.

    Attributes
    ----------
    probabilities : tuple over sensors of PairProbabilities
        Of the last step.
    """

    name = "joint-probabilistic"

    def __init__(self, *arguments: Any, max_events: int = 4096, **options: Any) -> None:
        super().__init__(*arguments, **options)
        if isinstance(max_events, bool) or not isinstance(max_events, (int, np.integer)) or max_events < 1:
            raise InvalidInputError(f"max_events must be a whole number above 0, got {max_events!r}")
        self.max_events = int(max_events)
        self.probabilities: tuple[PairProbabilities, ...] = ()
        # refuse a filter that cannot merge now, not in the first scan
        merged(self._batch.states, np.zeros(0, dtype=np.int64), np.zeros(0), 0)

    def _decide(self, scan: Scan) -> Step:
        time, times, batch = scan.time, scan.times, self._batch
        if scan.sectors is not None or (times is not None and len(self.sensors) > 1):
            raise InvalidInputError("times: measurements with own times need a tracker of a single sensor")
        before = time if self._time is None else self._time
        seen = np.zeros(len(batch), dtype=np.bool_)
        # identities come with times, and so from a single sensor: its tracks are those of the batch
        says = self._evidence(scan)
        assigned, found = [], []
        for s, (z, sensor) in enumerate(zip(scan.measurements, self.sensors, strict=True)):
            stamps = None if times is None else times[s]
            near = gated_pairs(
                self.filter, batch.states, before, time, z, stamps, sensor, self.gate_probability,
                None if says is None else _of_sensor(says, s),
            )  # fmt: skip
            before = time
            pairs = self._probabilities(batch, near.pairs, s, len(z))
            found.append(pairs)
            batch, hit = self._take_in(batch, near, pairs.probability, s)
            ids, taken = self._owners(pairs, len(z))
            new, numbers = self._begin(s, z, taken, time, stamps)
            ids[numbers] = new.track_id
            batch = TrackBatch.concatenate([batch, new])
            seen = np.concatenate([seen | hit, np.ones(len(new), dtype=np.bool_)])
            assigned.append(ids)
        batch = batch.counted(seen).confirm(self.life_cycle)
        now = decision(self._scan, time, assigned, batch.track_id[batch.confirmed])
        gone = self._to_delete(batch, time)
        self._batch, self.probabilities = batch[~gone], tuple(found)
        ended = np.sort(batch.track_id[gone & batch.confirmed])
        return Step(now.scan, now.time, now.assigned, now.confirmed, final=(now,), ended=ended)

    def _probabilities(self, batch: TrackBatch, pairs: TrackPairs, s: int, count: int) -> PairProbabilities:
        """Sum the joint events of one sensor's measurements and the tracks."""
        exists = _probability(batch.existence)
        absent = np.log1p(-exists * -np.expm1(self.terms.miss[s]))
        weight = np.log(exists)[pairs.track] + self.terms.detection[s] + pairs.log_likelihood - absent[pairs.track]
        known = pair_probabilities(pairs.track, pairs.measurement, weight, (len(batch), count), self.max_events)
        return PairProbabilities(batch.track_id[pairs.track], pairs.measurement, *known)

    def _take_in(self, batch: TrackBatch, gated: GatedPairs, share: Array, s: int) -> tuple[TrackBatch, Array]:
        """Tracks after a sensor's scan, and which of them were rather detected than not."""
        count, pairs = len(batch), gated.pairs
        if not count:
            return batch, np.zeros(0, dtype=np.bool_)
        exists = _probability(batch.existence)
        detected = np.bincount(pairs.track, share, count)
        silent = np.maximum(1.0 - detected, 0.0)
        missed = silent * exists * np.exp(self.terms.miss[s]) / (1.0 - exists * -np.expm1(self.terms.miss[s]))
        # what remains for "there is no target" as odds, without 1 - 1
        none = silent * (1.0 - exists) / (1.0 - exists * -np.expm1(self.terms.miss[s]))
        after = detected + missed
        odds = np.clip(np.log(np.maximum(after, 1e-300)) - np.log(np.maximum(none, 1e-300)), -_SURE, _SURE)
        target = np.concatenate([pairs.track, np.arange(count)])
        weights = np.concatenate([share, missed]) / np.maximum(after, 1e-300)[target]
        states = merged(concatenate([pairs.states, gated.predicted]), target, weights, count)
        hit = detected > 0.5
        # when a track was last seen: by the likeliest of its measurements
        when = np.full(count, np.nan)
        order = np.argsort(share, kind="stable")
        when[pairs.track[order]] = gated.when[order]
        return batch.scored(states, odds - batch.existence, np.where(hit, when, np.nan)), hit

    @staticmethod
    def _owners(pairs: PairProbabilities, count: int) -> tuple[Array, Array]:
        """The track that each measurement belongs to rather than not, 0 for none, and how surely it is some track's."""
        ids = np.zeros(count, dtype=np.int64)
        likely = pairs.probability > 0.5
        ids[pairs.measurement[likely]] = pairs.track_id[likely]
        return ids, np.minimum(np.bincount(pairs.measurement, pairs.probability, count), 1.0)

    def _begin(self, s: int, z: Array, taken: Array, time: float, stamps: Array | None) -> tuple[TrackBatch, Array]:
        """New tracks of measurements that are rather no track's, and their numbers."""
        free = np.flatnonzero(taken < 0.5)
        states, fit, positions, score = self._new_tracks.singles(s, z[free])
        free = free[fit]
        when = np.full(len(free), time) if stamps is None else stamps[free]
        order = np.lexsort((*positions.T, when))
        score = np.clip(score + np.log1p(-taken[free]), -_SURE, _SURE)
        aged = predict_each(self.filter, states[order], (time - when)[order])
        return TrackBatch.new(aged, self._new_ids(len(free)), score[order], when[order]), free[order]

    def _settings(self) -> dict[str, str]:
        return super()._settings() | {"max_events": repr(self.max_events)}


def _of_sensor(evidence: PairEvidence, s: int) -> Callable[[Array, Array], tuple[Array, Array]]:
    return lambda track, measurement: evidence(track, s, measurement)


def _probability(score: Array) -> Array:
    """That a track of this score is a target."""
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(score, -_SURE, _SURE))))
