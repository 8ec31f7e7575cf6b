"""Parts of tracks within a scan whose measurements have times of their own; they are merged at the scan's end.

Sensors are processed one after the other, but their measurements interleave in time, so that a track cannot be merged
and predicted between sensors. Each part of a track has at most one measurement of each sensor and is filtered through
them in time order (`assoc.costs.tracks.own_times`). Its share is the probability that exactly these measurements are
the track's, given that the target exists.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.own_times import TimedScan, score_costs
from assoc.costs.tracks.scores import ScoreTerms
from assoc.filters.merging import merged

_LEAST_SHARE = 1e-5
"""Parts with a smaller share of their track are dropped."""


class ScoredPairs(NamedTuple):
    """K pairs of a track and a measurement of one sensor."""

    track: Array
    """Row of the track, (K,)."""
    measurement: Array
    """From 0, (K,)."""
    gain: Array
    """Gain of the track's score by the measurement, (K,)."""


class GrownParts(NamedTuple):
    """Parts with one more measurement, and the pairs of a track and a measurement that they make."""

    parent: Array
    """Row of the part without that measurement, (N,)."""
    rows: Array
    """Measurements, (N, S)."""
    gain: Array
    """Gain of the part's score by the measurement, (N,)."""
    pair: Array
    """Row in `pairs` of each part's pair, (N,)."""
    pairs: ScoredPairs
    """Their gains use the density averaged over the track's parts."""


class TrackParts(NamedTuple):
    """P parts of T tracks, old tracks first, then those that begin in this scan."""

    owner: Array
    """Track of each part, (P,)."""
    anchor: Array
    """The track, or the measurement that began it, as `TimedScan` counts them, (P,)."""
    track: Array
    """Row of the track, -1 if it begins in this scan, (P,)."""
    rows: Array
    """1-based measurement of each sensor, 0 for none, int32 (P, S)."""
    share: Array
    """(P,); those of one track sum to 1."""
    score: Array
    """Gain of the track's score in this scan if these are its measurements, (P,)."""

    @staticmethod
    def of_tracks(count: int, sensors: int) -> TrackParts:
        """Tracks before their first measurement of the scan, one part each."""
        row = np.arange(count)
        return TrackParts(row, row, row, np.zeros((count, sensors), dtype=np.int32), np.ones(count), np.zeros(count))

    def grown(self, timed: TimedScan, s: int, done: Sequence[int], terms: ScoreTerms, past: Array) -> GrownParts:
        """Extend all parts by all measurements of sensor s in their gates; sensors in `done` were processed before.

        `past` (A, S): score of a miss of each anchor by the sensors processed before and this one, 0 by others.
        """
        found = timed.grown(s, done, self.anchor, self.track, self.rows)
        score = -score_costs(timed, found.followed, found.rows, terms, past[self.anchor[found.parent]])
        gain = score - self.score[found.parent]
        count = len(timed.times[s])
        keys, pair = np.unique(self.owner[found.parent] * max(count, 1) + found.measurement, return_inverse=True)
        mean = np.full(len(keys), -np.inf)
        np.logaddexp.at(mean, pair, np.log(self.share[found.parent]) + gain)
        track, measurement = np.divmod(keys, max(count, 1))
        return GrownParts(found.parent, found.rows, gain, pair, ScoredPairs(track, measurement, mean))

    def after(self, grown: GrownParts, of_pair: Array, of_miss: Array, missed: Array) -> TrackParts:
        """Weigh the parts with and without a measurement of this sensor.

        `of_pair` (K,) and `of_miss` (T,) are probabilities of each pair, and of no measurement, given that the target
        exists; `missed` (T,) the score of a miss.
        """
        parent = grown.parent
        within = self.share[parent] * np.exp(grown.gain - grown.pairs.gain[grown.pair])
        share = np.concatenate([self.share * of_miss[self.owner], within * of_pair[grown.pair]])
        score = np.concatenate([self.score + missed[self.owner], self.score[parent] + grown.gain])
        rows = np.concatenate([self.rows, grown.rows])
        whose = np.concatenate([np.arange(len(self.owner)), parent])
        most = np.zeros(len(missed))
        np.maximum.at(most, self.owner[whose], share)
        kept = np.flatnonzero(share >= np.minimum(_LEAST_SHARE, most[self.owner[whose]]))
        whose, share = whose[kept], share[kept]
        owner = self.owner[whose]
        share = share / np.bincount(owner, share, len(missed))[owner]
        return TrackParts(owner, self.anchor[whose], self.track[whose], rows[kept], share, score[kept])

    def begun(self, count: int, anchor: Array, s: int, measurement: Array, score: Array) -> TrackParts:
        """Add new tracks of measurements (from 0) of sensor s to these parts of `count` tracks."""
        new = len(anchor)
        rows = np.zeros((new, self.rows.shape[1]), dtype=np.int32)
        rows[:, s] = measurement + 1
        added = TrackParts(count + np.arange(new), anchor, np.full(new, -1), rows, np.ones(new), score)
        return TrackParts(*(np.concatenate(both) for both in zip(self, added, strict=True)))

    def merged(self, timed: TimedScan, count: int) -> tuple[Any, Array, Array]:
        """Merge the parts of each of `count` tracks to their states at the scan's end.

        Also the times (s) of the last and first measurement of each track's likeliest part with any; NaN if none has
        any.
        """
        followed = timed.follow(self.track, self.rows)
        states = merged(timed.at_end(followed, self.track), self.owner, self.share, count)
        order = np.argsort(self.share, kind="stable")
        order = order[self.rows[order].any(axis=1)]
        last, first = np.full((2, count), np.nan)
        last[self.owner[order]], first[self.owner[order]] = followed.when[order], followed.first[order]
        return states, last, first
