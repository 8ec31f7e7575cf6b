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

Where measurements have times of their own, a track is merged at the end of the scan, not after each sensor: they
interleave in time. Until then it consists of parts, each with at most one measurement of each sensor and filtered
through them in time order, and the density in a pair's weight is the average over the parts.

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
from assoc.errors import InvalidInputError
from assoc.filters.merging import merged
from assoc.ranking.pairs.events import pair_probabilities
from assoc.ranking.pairs.permutations import without_permutations
from assoc.tracking.associate.mht import TrackTrees
from assoc.tracking.growth import AtOnce, Grown, InOrder, Offers, Scores, growth_of
from assoc.tracking.method import Method
from assoc.tracking.progress import Association, Progress
from assoc.tracking.records.track import Step
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.state import TrackerState
from assoc.tracking.tracker import Tracker

Permutations = Literal["best", "all"]

_SURE = 30.0
"""Scores are clipped here: exp(-30) is below the accuracy of the probabilities."""
_LEAST_SHARE = 1e-10
"""For pairs with a smaller share a track's state counts as predicted, not as corrected: most pairs of a wide gate. With
n pairs in the gate, a squared distance g, this moves the mean of a track that exists with probability p by at most
n sqrt(g) / p times this, in its deviations as predicted."""
_LEAST_PART = 1e-5
"""Parts with a smaller share of their track are dropped."""


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

    def associate(self, progress: Progress) -> Association:
        """Process sensor after sensor; measurements that probably belong to no track start new ones."""
        tracks, sizes = progress.state.tracks, progress.scan.sizes
        growth, scores, parts = growth_of(progress), Scores(progress), _Parts.of(len(tracks))
        # log odds of existence, and what they are ahead of the scores
        odds, ahead = tracks.existence, tracks.existence - tracks.score
        seen = np.zeros(len(tracks), dtype=np.bool_)
        assigned, found = [np.zeros(size, dtype=np.int64) for size in sizes], {}
        for s in growth.order:
            offers, count = growth.pairs(s), int(sizes[s])
            pairs, pair = parts.averaged(offers, count)
            missed = offers.missed[parts.first]
            known, update = self._probabilities(scores.track_id, odds, missed, pairs, count)
            ids, taken = _owners(known, count)
            offers = growth.with_births(s, offers, np.flatnonzero(taken < 0.5))
            numbers = offers.births.rows[:, s] - 1
            begun = np.clip(offers.births.score + np.log1p(-taken[numbers]), -_SURE, _SURE)
            order = scores.after(update.odds - ahead, offers.births, begun)
            ids[numbers] = offers.births.ids
            share = known.share[pair] * np.exp(offers.gain - pairs.gain[pair])
            parts = parts.weighed(growth, s, offers, order, share, update)
            odds, ahead = np.append(update.odds, begun[order]), np.append(ahead, np.zeros(len(order)))
            seen = np.append(seen | (update.detected > 0.5), np.ones(len(order), dtype=np.bool_))
            found[s], assigned[s] = known, ids
        grown = growth.finished(seen[parts.owner])
        states, first, last = parts.merged(grown, growth.rows, seen)
        batch = scores.batch(states, first, last).counted(seen, grown.covered[parts.first])
        return Association(batch, assigned, tuple(found[s] for s in range(len(sizes))))

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


class ScoredPairs(NamedTuple):
    """K pairs of a track and a measurement of one sensor."""

    track: Array
    """Row of the track, (K,)."""
    measurement: Array
    """From 0, (K,)."""
    gain: Array
    """Gain of the track's score by the measurement, (K,)."""


class _Parts(NamedTuple):
    """P parts of T tracks: the branches of a growth, each with its own measurements."""

    owner: Array
    """Track of each part, (P,)."""
    first: Array
    """A part of each track, (T,)."""
    share: Array
    """Probability that exactly these measurements are the track's if the target exists; those of one track sum to 1."""

    @staticmethod
    def of(count: int) -> _Parts:
        """Tracks of one part each."""
        return _Parts(np.arange(count), np.arange(count), np.ones(count))

    @property
    def single(self) -> bool:
        """Whether the parts are the tracks."""
        return np.array_equal(self.owner, np.arange(len(self.first)))

    def averaged(self, offers: Offers, count: int) -> tuple[ScoredPairs, Array]:
        """Pairs of a track and one of `count` measurements, with gains averaged over parts; the pair of each offer."""
        if self.single:
            return ScoredPairs(offers.branch, offers.measurement, offers.gain), np.arange(len(offers.branch))
        keys = self.owner[offers.branch] * max(count, 1) + offers.measurement
        keys, pair = np.unique(keys, return_inverse=True)
        mean = np.full(len(keys), -np.inf)
        np.logaddexp.at(mean, pair, np.log(self.share[offers.branch]) + offers.gain)
        return ScoredPairs(*np.divmod(keys, max(count, 1)), mean), pair

    def weighed(
        self, growth: AtOnce | InOrder, s: int, offers: Offers, order: Array, share: Array, update: _Update
    ) -> _Parts:
        """Weigh the parts with and without a measurement of sensor s, and add those of births, in this order.

        `share` (K,) are those of the pairs' measurements in their tracks' states.
        """
        stays, weight = update.missed / update.after, share / update.after[self.owner[offers.branch]]
        tracks, new = len(stays), len(order)
        if isinstance(growth, AtOnce):
            # all of one instant: parts are merged at once
            counts = share >= _LEAST_SHARE
            used, faint = np.flatnonzero(counts), np.flatnonzero(~counts)
            stays = stays + np.bincount(offers.branch[faint], weight[faint], tracks)
            growth.merge(offers, used, weight[used], stays, order)
            return _Parts.of(tracks + new)
        share = np.concatenate([self.share * stays[self.owner], self.share[offers.branch] * weight])
        whose = np.concatenate([np.arange(len(self.owner)), offers.branch])
        most = np.zeros(tracks)
        np.maximum.at(most, self.owner[whose], share)
        kept = np.flatnonzero(share >= np.minimum(_LEAST_PART, most[self.owner[whose]]))
        owner, born = self.owner[whose[kept]], len(whose) + order
        share = share[kept] / np.bincount(owner, share[kept], tracks)[owner]
        growth.take(s, offers, np.append(kept, born))
        owner = np.append(owner, np.arange(tracks, tracks + new))
        first = np.zeros(tracks + new, dtype=np.int64)
        first[owner[::-1]] = np.arange(len(owner))[::-1]
        return _Parts(owner, first, np.append(share, np.ones(new)))

    def merged(self, grown: Grown, rows: Array, seen: Array) -> tuple[Any, Array, Array]:
        """States of the tracks, and times of the first and last measurement of each one's likeliest part with any."""
        count = len(self.first)
        first, last = np.full((2, count), np.nan)
        if self.single:
            return grown.states, grown.first, np.where(seen, grown.last, np.nan)
        order = np.argsort(self.share, kind="stable")
        order = order[rows[order].any(axis=1)]
        first[self.owner[order]], last[self.owner[order]] = grown.first[order], grown.last[order]
        return merged(grown.states, self.owner, self.share, count), first, np.where(seen, last, np.nan)


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
