"""How tracks, or the branches of their trees, grow by a scan, sensor by sensor.

At each sensor the candidates are, in this order: the old branches with a miss, the pairs of a branch and a measurement,
and new targets. The tracker chooses the rows to keep. Measurements have times of their own (`InOrder`); one instant for
all is the fast case (`AtOnce`), and trackers need not know which it is.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.limits import refuse_of_tracks
from assoc.costs.tracks.own_times import TimedScan, score_costs
from assoc.costs.tracks.tuples import gate_of, require_states, track_pairs
from assoc.filters.batches import concatenate, placed
from assoc.filters.merging import merged
from assoc.tracking.progress import Progress
from assoc.tracking.records.track_batch import BEST, STARTED, TrackBatch
from assoc.tracking.stages.coverage import covered, detected_or_in_view, misses_of

_MOST_CROSSINGS = 100
"""The most new targets in a scan that start from crossings of several sensors."""
_BLOCK = 2_000
"""Branches that are corrected at a time."""


class Births(NamedTuple):
    """N possible new targets."""

    ids: Array
    """Assigned by time and position, so that the order of the measurements does not matter; int64 (N,)."""
    rows: Array
    """1-based measurement of each sensor, int32 (N, S)."""
    when: Array
    """Seconds, (N,)."""
    score: Array
    """(N,)."""


class Offers(NamedTuple):
    """Misses, pairs and births by the measurements of one sensor, for B branches."""

    missed: Array
    """Score of a miss, for each branch, (B,)."""
    branch: Array
    """Row of the branch of each pair of a branch and a measurement in its gate, (K,)."""
    measurement: Array
    """0-based, (K,)."""
    gain: Array
    """Gain of the branch's score, (K,)."""
    when: Array
    """Time of the measurement, seconds, (K,)."""
    births: Births


class Grown(NamedTuple):
    """B branches at the end of a scan."""

    states: Any
    first: Array
    """Time of the first measurement in the scan, seconds; not finite where there is none; (B,)."""
    last: Array
    """Time of the last measurement in the scan, seconds; NaN where there is none; (B,)."""
    covered: Array
    """Whether a dwell of a sensor covered it, bool (B,)."""


class Growth(ABC):
    """B branches within a scan.

    `order` is that in which sensors are processed, `origin` (B,) the row before the scan, -1 for new targets, and
    `rows` (B, S) the 1-based measurement of each sensor in this scan, 0: none.
    """

    order: Sequence[int]

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._before: TrackBatch = progress.state.tracks
        self.origin = np.arange(len(self._before))
        self.rows = np.zeros((len(self._before), len(progress.settings.sensors)), dtype=np.int32)

    def offers(self, s: int) -> Offers:
        """All candidates by the measurements of sensor s."""
        return self.with_births(s, self.pairs(s), np.arange(len(self._progress.scan.measurements[s])))

    @abstractmethod
    def pairs(self, s: int) -> Offers:
        """Candidates by the measurements of sensor s that start no target."""

    @abstractmethod
    def with_births(self, s: int, offers: Offers, numbers: Array) -> Offers:
        """These candidates, and new targets of those of the measurements (from 0) that determine a position."""

    def crossings(self, taken: Array, by_place: bool) -> Offers | None:
        """New targets from crossings of measurements that are not in `taken` (T, S), of sensors that start none alone.

        They are sorted by position, or the most likely first.
        """
        return None

    def take(self, s: int, offers: Offers, kept: Array) -> None:
        """Keep these rows of the candidates."""
        require_states(self._before.states, len(kept))
        hit = self.rows[offers.branch]
        hit[:, s] = offers.measurement + 1
        self.rows = np.concatenate([self.rows, hit, offers.births.rows])[kept]
        new = np.full(len(offers.births.ids), -1)
        self.origin = np.concatenate([self.origin, self.origin[offers.branch], new])[kept]
        self._take_states(s, offers, kept)

    @abstractmethod
    def _take_states(self, s: int, offers: Offers, kept: Array) -> None:
        """Select the states of the rows that are kept."""

    @abstractmethod
    def finished(self, seen: Array | None = None) -> Grown:
        """The branches at the end of the scan; `seen`, bool (B,), counts as detected, else what has a measurement."""

    def _no_births(self) -> Births:
        nothing = np.zeros(0, dtype=np.int64)
        return Births(nothing, np.zeros((0, self.rows.shape[1]), dtype=np.int32), np.zeros(0), np.zeros(0))

    def _births(self, numbers: Array, s: int, turn: Array, when: Array, score: Array) -> Births:
        """Single measurements (numbers from 0) of sensor s; `turn` is the order in which they are given ids."""
        ids = np.empty(len(numbers), dtype=np.int64)
        ids[turn] = self._progress.work.new_ids(len(numbers))
        rows = np.zeros((len(numbers), self.rows.shape[1]), dtype=np.int32)
        rows[:, s] = numbers + 1
        return Births(ids, rows, when, score)


class AtOnce(Growth):
    """All sensors covered everything at one instant: predicted branches are updated sensor by sensor."""

    def __init__(self, progress: Progress) -> None:
        super().__init__(progress)
        self.order = range(self.rows.shape[1])
        self._states = self._before.states
        self._corrected: Callable[[Array], Any] = self._states.__getitem__
        self._begun: Any = None

    def pairs(self, s: int) -> Offers:
        """Pairs of the predicted branches and the measurements of sensor s."""
        settings, scan = self._progress.settings, self._progress.scan
        sensor, terms = settings.sensors[s], settings.terms
        gate = gate_of(sensor, settings.gate_probability)
        pairs = track_pairs(settings.filter, self._states, scan.measurements[s], sensor, gate)
        count, most = len(pairs.track) + len(self._states), settings.max_tuples
        if count > most:
            raise refuse_of_tracks(count, most)
        self._corrected = pairs.correct
        missed = misses_of(self._progress, self._states, s)
        gain = pairs.log_likelihood + terms.detection[s] - scan.crowd(s, pairs.measurement)
        when = np.full(len(gain), scan.time)
        return Offers(missed, pairs.track, pairs.measurement, gain, when, self._no_births())

    def with_births(self, s: int, offers: Offers, numbers: Array) -> Offers:
        """New targets, each with the state of its measurement."""
        if not len(numbers):
            self._begun = self._states[:0]
            return offers
        self._begun, fit, positions, score = self._progress.settings.births.singles(s, self._progress.scan, numbers)
        when = np.full(len(score), self._progress.scan.time)
        return offers._replace(births=self._births(numbers[fit], s, np.lexsort(positions.T), when, score))

    def _take_states(self, s: int, offers: Offers, kept: Array) -> None:
        sources = self._states.__getitem__, self._corrected, self._begun.__getitem__
        lengths = len(self._states), len(offers.branch), len(self._begun)
        self._states = _in_blocks(kept, lengths, sources)

    def merge(self, offers: Offers, used: Array, weight: Array, stays: Array, order: Array) -> None:
        """Merge branches with their pairs in rows `used` (K,) by weights (K,); then add births in order.

        `stays` (B,) are the weights of the branches as they are.
        """
        count, begun = len(self._states), self._begun[order]
        changed = np.bincount(offers.branch[used], minlength=count) > 0
        old, same = np.flatnonzero(changed), np.flatnonzero(~changed)
        row = np.concatenate([np.searchsorted(old, offers.branch[used]), np.arange(len(old))])
        both = concatenate([self._corrected(used), self._states[old]])
        mixed = merged(both, row, np.concatenate([weight, stays[old]]), len(old))
        new = np.arange(count, count + len(begun))
        self._states = placed(count + len(new), [(old, mixed), (same, self._states[same]), (new, begun)])
        self.rows = np.concatenate([self.rows, offers.births.rows[order]])
        self.origin = np.append(self.origin, np.full(len(new), -1))

    def crossings(self, taken: Array, by_place: bool) -> Offers | None:
        """New targets at which measurements cross."""
        settings, scan = self._progress.settings, self._progress.scan
        if not settings.angles_alone:
            return None
        free = [np.isin(np.arange(1, size + 1), taken[:, s], invert=True) for s, size in enumerate(scan.sizes.tolist())]
        found = settings.births.crossings(scan, free)
        if found is None:
            return None
        # nearly all of them are ghosts
        best = np.argsort(-found.scores, kind="stable")[:_MOST_CROSSINGS]
        if by_place:
            best = best[np.lexsort(found.positions[best].T)]
        ids = np.empty(len(best), dtype=np.int64)
        ids[np.lexsort(found.positions[best].T)] = self._progress.work.new_ids(len(best))
        births = Births(ids, found.rows[best], np.full(len(best), scan.time), found.scores[best])
        self._begun = settings.initiation.start(settings.filter, found.positions[best], found.covariances[best])
        self._corrected = self._states.__getitem__
        nothing = np.zeros(0, dtype=np.int64)
        return Offers(np.zeros(len(self.rows)), nothing, nothing, np.zeros(0), np.zeros(0), births)

    def finished(self, seen: Array | None = None) -> Grown:
        """The branches at the end of the scan, which is the instant."""
        hit = np.asarray(self.rows.any(axis=1)) if seen is None else seen
        seen = np.where(hit, self._progress.scan.time, np.nan)
        at_all = detected_or_in_view(self._progress, self._states, hit)
        return Grown(self._states, seen, seen, at_all)


class InOrder(Growth):
    """Measurements have times of their own, or sensors covered sectors: each branch is filtered in their order."""

    def __init__(self, progress: Progress, timed: TimedScan) -> None:
        super().__init__(progress)
        self.order, self._timed = timed.order, timed
        self._misses = timed.misses(progress.settings.terms)
        # the sensors processed so far: only they can have missed a branch
        self._past = np.zeros_like(self._misses)
        self._anchor, self._done = self.origin, list[int]()
        self._gained, self._total = np.zeros(len(self.origin)), np.zeros(0)

    def pairs(self, s: int) -> Offers:
        """Pairs by the measurements of sensor s, filtered in time order with those of earlier sensors."""
        timed, terms, past = self._timed, self._progress.settings.terms, self._past
        past[:, s] = self._misses[:, s]
        parent, measurement, rows, followed = timed.grown(
            s, self._done, self._anchor, self.origin, self.rows, self._progress.settings.max_tuples
        )
        self._total = -score_costs(timed, followed, rows, terms, past[self._anchor[parent]])
        missed, gain = self._misses[self._anchor, s], self._total - self._gained[parent]
        return Offers(missed, parent, measurement, gain, followed.when, self._no_births())

    def with_births(self, s: int, offers: Offers, numbers: Array) -> Offers:
        """New targets, which only the sensors processed so far can have missed."""
        timed = self._timed
        self._own = own = numbers[timed.places.fit[s][numbers]]
        when, past = timed.times[s][own], self._past[timed.offsets[s] + own].sum(axis=1)
        score = timed.places.births[s][own] + past - self._progress.settings.terms.miss[s]
        turn = np.lexsort((*timed.places.positions[s][own].T, when))
        return offers._replace(births=self._births(own, s, turn, when, score))

    def _take_states(self, s: int, offers: Offers, kept: Array) -> None:
        anchor = self._anchor
        self._anchor = np.concatenate([anchor, anchor[offers.branch], self._timed.offsets[s] + self._own])[kept]
        self._gained = np.concatenate([self._gained + offers.missed, self._total, offers.births.score])[kept]
        self._done.append(s)

    def finished(self, seen: Array | None = None) -> Grown:
        """The branches at the end of the scan, filtered once more through all that belongs to them."""
        followed = self._timed.follow(self.origin, self.rows)
        last = np.where(self.rows.any(axis=1), followed.when, np.nan)
        at_all = covered(self._progress, self._misses[self._anchor])
        return Grown(self._timed.at_end(followed, self.origin), followed.first, last, at_all)


def _in_blocks(kept: Array, lengths: Sequence[int], sources: Sequence[Callable[[Array], Any]]) -> Any:
    """The states of rows `kept` (K,) of several batches one after the other, of these lengths, in blocks.

    A source makes the states of rows of its batch; a block stays in the cache.
    """
    ends = np.cumsum(lengths)
    which = np.searchsorted(ends, kept, side="right")
    blocks = []
    for part in range(len(lengths)):
        places = np.flatnonzero(which == part)
        blocks += [(part, places[k : k + _BLOCK]) for k in range(0, len(places), _BLOCK)]
    made = (
        (places, sources[part](kept[places] - (ends[part] - lengths[part])))
        for part, places in blocks or [(0, np.zeros(0, dtype=np.int64))]
    )
    # a single block has all rows in order
    return placed(len(kept), made) if len(blocks) > 1 else next(made)[1]


def growth_of(progress: Progress) -> AtOnce | InOrder:
    """The branches before the scan's first sensor."""
    return AtOnce(progress) if progress.timed is None else InOrder(progress, progress.timed)


class Scores:
    """Scores of tracks within a scan: those before it, then new ones.

    Their best is counted after each sensor in a scan of one instant, else at the end: measurements interleave in time.
    """

    def __init__(self, progress: Progress) -> None:
        self._before, self._at_once = progress.state.tracks, progress.timed is None
        self.track_id, self.now, self.best = self._before.track_id, self._before.score, self._before.best

    def after(self, now: Array, births: Births, begun: Array) -> Array:
        """Count a sensor: the scores `now` (T,) of the old tracks, and `begun` (N,) of births; their order by id."""
        if not len(births.ids):
            self.now, self.best = now, np.maximum(self.best, now) if self._at_once else self.best
            return births.ids
        order = np.argsort(births.ids)
        self.track_id = np.append(self.track_id, births.ids[order])
        self.now = np.append(now, begun[order])
        if self._at_once:
            self.best = np.append(np.maximum(self.best, now), begun[order])
        return order

    def batch(self, states: Any, first: Array, last: Array) -> TrackBatch:
        """The tracks with these states at the end, and the times of their first and last measurements in the scan."""
        old = len(self._before)
        # of both only the numbers and counts are used: the states already stand one after the other
        known = self._before.scored(states, self.now[:old] - self._before.score, last[:old])
        new = TrackBatch.new(states, self.track_id[old:], self.now[old:], last[old:])
        new.numbers[:, STARTED] = first[old:]
        numbers, counts = np.concatenate([known.numbers, new.numbers]), np.concatenate([known.counts, new.counts])
        batch = TrackBatch(states, numbers, counts)
        if self._at_once:
            batch.numbers[:, BEST] = self.best
        return batch
