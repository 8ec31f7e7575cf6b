"""How the branches of a tracker grow by a scan, sensor by sensor.

At each sensor the candidates are, in this order: the old branches with a miss, the pairs of a branch and a measurement,
and new targets. The tracker chooses the rows to keep. Only this module distinguishes scans of one instant from
measurements with times of their own.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.own_times import TimedScan, score_costs
from assoc.costs.tracks.tuples import corrected, gate_of, require_states, track_pairs
from assoc.filters.base import Filter
from assoc.filters.batches import placed
from assoc.tracking.progress import Progress
from assoc.tracking.records.track_batch import TrackBatch
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

    @abstractmethod
    def offers(self, s: int) -> Offers:
        """Candidates by the measurements of sensor s."""

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
    def finished(self) -> Grown:
        """The branches at the end of the scan."""

    def _births(self, numbers: Array, s: int, turn: Array, when: Array, score: Array) -> Births:
        """Single measurements (numbers from 0) of sensor s; `turn` is the order in which they are given ids."""
        ids = np.empty(len(numbers), dtype=np.int64)
        ids[turn] = self._progress.work.new_ids(len(numbers))
        rows = np.zeros((len(numbers), self.rows.shape[1]), dtype=np.int32)
        rows[:, s] = numbers + 1
        return Births(ids, rows, when, score)


class AtOnce(Growth):
    """All sensors covered everything at one instant: predicted branches are updated sensor by sensor.

    Where no sensor measures velocities only positions are: the whole states of those that are left in the end follow.
    """

    def __init__(self, progress: Progress) -> None:
        super().__init__(progress)
        settings, states = progress.settings, self._before.states
        self.order = range(self.rows.shape[1])
        self._filter, self._states = self._seen(states)
        self._partly = self._filter is not settings.filter
        self._corrected: Callable[[Array], Any] = self._states.__getitem__
        # states at the beginning, one batch after the other: where each branch comes from, and what it was corrected by
        self._begun, self._sources = [states], self.origin
        self._since = self.rows

    def _seen(self, states: Any) -> tuple[Filter[Any], Any]:
        """What says how well measurements fit, and what it reads of states."""
        settings = self._progress.settings
        if any(getattr(sensor, "measures_velocity", True) for sensor in settings.sensors):
            return settings.filter, states
        return settings.filter.positions_alone(states)

    def offers(self, s: int) -> Offers:
        """Candidates by the measurements of sensor s."""
        settings, time = self._progress.settings, self._progress.scan.time
        z, sensor, terms = self._progress.scan.measurements[s], settings.sensors[s], settings.terms
        gate = gate_of(sensor, settings.gate_probability)
        pairs = track_pairs(self._filter, self._states, z, sensor, gate)
        begun, fit, positions, score = settings.births.singles(s, self._progress.scan, np.arange(len(z)))
        self._corrected = pairs.correct
        self._begun.append(begun)
        numbers = np.flatnonzero(fit)
        births = self._births(numbers, s, np.lexsort(positions.T), np.full(len(numbers), time), score)
        missed = misses_of(self._progress, self._states, s, self._partly)
        gain = pairs.log_likelihood + terms.detection[s] - self._progress.scan.crowd(s, pairs.measurement)
        return Offers(missed, pairs.track, pairs.measurement, gain, np.full(len(gain), time), births)

    def _take_states(self, s: int, offers: Offers, kept: Array) -> None:
        hit, begun = self._since[offers.branch], self._begun[-1]
        hit[:, s] = offers.measurement + 1
        self._since = np.concatenate([self._since, hit, np.zeros_like(offers.births.rows)])[kept]
        first = sum(map(len, self._begun[:-1]))
        new = np.arange(first, first + len(begun))
        self._sources = np.concatenate([self._sources, self._sources[offers.branch], new])[kept]
        _, positions = self._seen(begun)
        sources = self._states.__getitem__, self._corrected, positions.__getitem__
        lengths = len(self._states), len(offers.branch), len(begun)
        self._states = _in_blocks(kept, lengths, lambda part, _, rows: sources[part](rows))

    def _whole_states(self) -> Any:
        """The states of all branches, corrected by all that belongs to them."""
        settings, scan = self._progress.settings, self._progress.scan
        if not self._partly:
            return self._states
        require_states(self._before.states, len(self._sources))

        def grown(part: int, places: Array, rows: Array) -> Any:
            begun = self._begun[part][rows]
            return corrected(settings.filter, begun, scan.measurements, settings.sensors, self._since[places])

        return _in_blocks(self._sources, [len(states) for states in self._begun], grown)

    def crossings(self, taken: Array, by_place: bool) -> Offers | None:
        """New targets from crossings of measurements that are not in `taken` (T, S), of sensors that start none alone.

        They are sorted by position, or the most likely first.
        """
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
        begun = settings.initiation.start(settings.filter, found.positions[best], found.covariances[best])
        self._corrected = self._states.__getitem__
        self._begun.append(begun)
        nothing = np.zeros(0, dtype=np.int64)
        return Offers(np.zeros(len(self.rows)), nothing, nothing, np.zeros(0), np.zeros(0), births)

    def finished(self) -> Grown:
        """The branches at the end of the scan."""
        hit = np.asarray(self.rows.any(axis=1))
        seen = np.where(hit, self._progress.scan.time, np.nan)
        states = self._whole_states()
        at_all = detected_or_in_view(self._progress, states, hit)
        return Grown(states, seen, seen, at_all)


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

    def offers(self, s: int) -> Offers:
        """Candidates by the measurements of sensor s, filtered in time order with those of earlier sensors."""
        timed, terms, past = self._timed, self._progress.settings.terms, self._past
        past[:, s] = self._misses[:, s]
        grown = timed.grown(s, self._done, self._anchor, self.origin, self.rows)
        self._total = -score_costs(timed, grown.followed, grown.rows, terms, past[self._anchor[grown.parent]])
        self._own = np.flatnonzero(timed.places.fit[s])
        anchor, when = timed.offsets[s] + self._own, timed.times[s][self._own]
        score = timed.places.births[s][self._own] + past[anchor].sum(axis=1) - terms.miss[s]
        turn = np.lexsort((*timed.places.positions[s][self._own].T, when))
        births = self._births(self._own, s, turn, when, score)
        missed = self._misses[self._anchor, s]
        gain = self._total - self._gained[grown.parent]
        return Offers(missed, grown.parent, grown.measurement, gain, grown.followed.when, births)

    def _take_states(self, s: int, offers: Offers, kept: Array) -> None:
        anchor = self._anchor
        self._anchor = np.concatenate([anchor, anchor[offers.branch], self._timed.offsets[s] + self._own])[kept]
        self._gained = np.concatenate([self._gained + offers.missed, self._total, offers.births.score])[kept]
        self._done.append(s)

    def finished(self) -> Grown:
        """The branches at the end of the scan."""
        followed = self._timed.follow(self.origin, self.rows)
        last = np.where(self.rows.any(axis=1), followed.when, np.nan)
        at_all = covered(self._progress, self._misses[self._anchor])
        return Grown(self._timed.at_end(followed, self.origin), followed.first, last, at_all)


def _in_blocks(kept: Array, lengths: Sequence[int], states: Callable[[int, Array, Array], Any]) -> Any:
    """The states of rows `kept` (K,) of several batches one after the other, of these lengths, in blocks.

    A block is `states` of the number of a batch, places in the result and rows of the batch; it stays in the cache.
    """
    ends = np.cumsum(lengths)
    which = np.searchsorted(ends, kept, side="right")
    blocks = []
    for part in range(len(lengths)):
        places = np.flatnonzero(which == part)
        blocks += [(part, places[k : k + _BLOCK]) for k in range(0, len(places), _BLOCK)]
    made = (
        (places, states(part, places, kept[places] - (ends[part] - lengths[part])))
        for part, places in blocks or [(0, np.zeros(0, dtype=np.int64))]
    )
    return placed(len(kept), made)


def growth_of(progress: Progress, timed: TimedScan | None) -> AtOnce | InOrder:
    """The branches before the scan's first sensor."""
    return AtOnce(progress) if timed is None else InOrder(progress, timed)
