"""How the branches of a tracker grow by a scan, sensor by sensor: what may happen next, and what was kept of it.

After each sensor the candidates are the branches before, missed, then the pairs of a branch and a measurement, then
new targets; the tracker says which rows of them are kept. Whether measurements are of one instant or have times of
their own matters here and nowhere else.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.own_times import TimedScan, score_costs
from assoc.costs.tracks.scores import ScoreTerms
from assoc.costs.tracks.tuples import gate_of, require_states, track_pairs
from assoc.filters.base import Filter
from assoc.filters.batches import concatenate
from assoc.scene.scan import Scan
from assoc.sensors import Sensor
from assoc.tracking.births.new_tracks import NewTracks
from assoc.tracking.track_batch import STARTED, TrackBatch


class Births(NamedTuple):
    """New targets that may be."""

    rows: Array
    """1-based measurement of each sensor, int32 (N, S)."""
    score: Array
    """(N,)."""
    turn: Array
    """The order in which they are given ids: by time and place, so that that of the measurements does not matter."""


class Offers(NamedTuple):
    """What the measurements of one sensor may mean to B branches."""

    missed: Array
    """What a miss adds to the score of each branch, (B,)."""
    branch: Array
    """Of each pair of a branch and a measurement in its gate, (K,)."""
    measurement: Array
    """0-based, (K,)."""
    gain: Array
    """What it adds to the score, (K,)."""
    births: Births


class Growth(ABC):
    """B branches within a scan.

    Parameters
    ----------
    batch : TrackBatch
        The branches before the scan.
    sensors : int
        How many.

    Attributes
    ----------
    order : sequence of int
        Sensors, in the order in which they are to be taken in.
    origin : int64 array (B,)
        Row before the scan, -1 for new targets.
    rows : int32 array (B, S)
        1-based measurement of each sensor in this scan, 0: none.
    ids : int64 array (B,)
        Tracks.
    """

    order: Sequence[int]

    def __init__(self, batch: TrackBatch, sensors: int) -> None:
        self._before = batch
        self.origin, self.ids = np.arange(len(batch)), batch.track_id.copy()
        self.rows, self._gained = np.zeros((len(batch), sensors), dtype=np.int32), np.zeros(len(batch))

    @abstractmethod
    def offers(self, s: int) -> Offers:
        """What the measurements of sensor s may mean."""

    def take(self, s: int, offers: Offers, kept: Array, new_ids: Array) -> None:
        """Go on with these rows of what was offered; `new_ids` are those of the births."""
        require_states(self._before.states, len(kept))
        hit = self.rows[offers.branch]
        hit[:, s] = offers.measurement + 1
        births = offers.births
        self.rows = np.concatenate([self.rows, hit, births.rows])[kept]
        self.origin = np.concatenate([self.origin, self.origin[offers.branch], np.full(len(new_ids), -1)])[kept]
        self.ids = np.concatenate([self.ids, self.ids[offers.branch], new_ids])[kept]
        gained = self._gained
        self._gained = np.concatenate([gained + offers.missed, gained[offers.branch] + offers.gain, births.score])[kept]
        self._take_states(s, offers, kept)

    @abstractmethod
    def _take_states(self, s: int, offers: Offers, kept: Array) -> None:
        """Let what else is known of the branches follow."""

    def _batch(self, states: Any, first: Array, last: Array) -> TrackBatch:
        """Tracks of these states; times of the first and the last measurement in this scan, NaN for none."""
        fresh = self.origin < 0
        old, new = np.flatnonzero(~fresh), np.flatnonzero(fresh)
        known = self._before[self.origin[old]].scored(states[old], self._gained[old], last[old])
        begun = TrackBatch.new(states[new], self.ids[new], self._gained[new], last[new])
        begun.numbers[:, STARTED] = first[new]
        back = np.argsort(np.concatenate([old, new]), kind="stable")
        return TrackBatch.concatenate([known, begun])[back]

    @abstractmethod
    def finished(self) -> tuple[TrackBatch, Array]:
        """The branches at the end of the scan, and which were looked at or seen, bool (B,)."""


class AtOnce(Growth):
    """All sensors looked everywhere at one instant: branches are predicted to it, and corrected sensor by sensor.

    Parameters
    ----------
    batch : TrackBatch
    scan : Scan
    predicted
        States of the batch at the time of the scan.
    filter, sensors, terms, new_tracks, gate_probability
        The tracker's.
    """

    def __init__(
        self, batch: TrackBatch, scan: Scan, predicted: Any, filter: Filter[Any], sensors: Sequence[Sensor],
        terms: ScoreTerms, new_tracks: NewTracks, gate_probability: float,
    ) -> None:  # fmt: skip
        super().__init__(batch, len(sensors))
        self.order = range(len(sensors))
        self._scan, self._filter, self._sensors, self._terms = scan, filter, sensors, terms
        self._new_tracks, self._gates = new_tracks, [gate_of(one, gate_probability) for one in sensors]
        self._states = predicted
        self._offered: list[Any] = []

    def offers(self, s: int) -> Offers:
        """What the measurements of sensor s may mean."""
        z, sensor = self._scan.measurements[s], self._sensors[s]
        pairs = track_pairs(self._filter, self._states, z, sensor, self._gates[s])
        begun, fit, positions, score = self._new_tracks.singles(s, z)
        self._offered = [self._states, pairs.states, begun]
        births = Births(_single(np.flatnonzero(fit), s, self.rows.shape[1]), score, np.lexsort(positions.T))
        missed = np.full(len(self.rows), self._terms.miss[s])
        return Offers(missed, pairs.track, pairs.measurement, pairs.log_likelihood + self._terms.detection[s], births)

    def _take_states(self, s: int, offers: Offers, kept: Array) -> None:
        self._states = concatenate(self._offered)[kept]

    def take_crossings(self, births: Births, states: Any, kept: Array, new_ids: Array) -> None:
        """Go on with these rows of the branches and new targets that several sensors together tell of."""
        nothing = np.zeros(0, dtype=np.int64)
        self._offered = [self._states, states]
        self.take(0, Offers(np.zeros(len(self.rows)), nothing, nothing, np.zeros(0), births), kept, new_ids)

    def finished(self) -> tuple[TrackBatch, Array]:
        """The branches at the end of the scan, and which were looked at: all."""
        seen = np.where(self.rows.any(axis=1), self._scan.time, np.nan)
        return self._batch(self._states, seen, seen), np.ones(len(seen), dtype=np.bool_)


class InOrder(Growth):
    """Measurements have times of their own, or sensors looked at sectors: each branch is filtered in their order.

    Parameters
    ----------
    batch : TrackBatch
    timed : TimedScan
    terms : ScoreTerms
    """

    def __init__(self, batch: TrackBatch, timed: TimedScan, terms: ScoreTerms) -> None:
        super().__init__(batch, len(timed.sensors))
        self.order, self._timed, self._terms = timed.order, timed, terms
        self._looked = timed.looked()
        # the sensors that have been taken in: only they can have missed a branch
        self._past = np.zeros_like(self._looked)
        self._anchor, self._done = self.origin, list[int]()

    def offers(self, s: int) -> Offers:
        """What the measurements of sensor s may mean, each at its time among those of the sensors before."""
        timed, terms, past = self._timed, self._terms, self._past
        past[:, s] = self._looked[:, s]
        grown = timed.grown(s, self._done, self._anchor, self.origin, self.rows)
        total = -score_costs(timed, grown.followed, grown.rows, terms, past[self._anchor[grown.parent]])
        self._own = np.flatnonzero(timed.places.fit[s])
        anchor = timed.offsets[s] + self._own
        score = timed.places.births[s][self._own] + past[anchor] @ terms.miss - terms.miss[s]
        turn = np.lexsort((*timed.places.positions[s][self._own].T, timed.times[s][self._own]))
        births = Births(_single(self._own, s, self.rows.shape[1]), score, turn)
        missed = self._looked[self._anchor, s] * terms.miss[s]
        return Offers(missed, grown.parent, grown.measurement, total - self._gained[grown.parent], births)

    def _take_states(self, s: int, offers: Offers, kept: Array) -> None:
        anchor = self._anchor
        self._anchor = np.concatenate([anchor, anchor[offers.branch], self._timed.offsets[s] + self._own])[kept]
        self._done.append(s)

    def finished(self) -> tuple[TrackBatch, Array]:
        """The branches at the end of the scan, and which of them a sensor looked at."""
        followed = self._timed.follow(self.origin, self.rows)
        seen = self.rows.any(axis=1)
        last = np.where(seen, followed.when, np.nan)
        batch = self._batch(self._timed.at_end(followed, self.origin), followed.first, last)
        return batch, np.asarray(self._looked[self._anchor].any(axis=1))


def _single(numbers: Array, s: int, sensors: int) -> Array:
    """Rows of single measurements (0-based numbers) of sensor s."""
    rows = np.zeros((len(numbers), sensors), dtype=np.int32)
    rows[:, s] = numbers + 1
    return rows
