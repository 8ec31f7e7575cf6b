"""Many tracks as arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.filters.base import Filter
from assoc.filters.batches import arrays_of, concatenate, state_from
from assoc.filters.state import gaussian
from assoc.tracking.records.initiation import velocity_components
from assoc.tracking.records.life_cycle import HISTORY, LifeCycle
from assoc.tracking.records.track import Track, TrackColumns

MASK = (1 << HISTORY) - 1
"""Number of last scans whose detections are stored, one bit each."""


SCORE, BEST, STARTED, LAST, EXISTS, HIDDEN = 0, 1, 2, 3, 4, 5
"""Columns of the numbers of a batch."""
ID, SURE, BITS, MISSED, HITS, PARENT = 0, 1, 2, 3, 4, 5
"""Columns of the counts of a batch."""

_NUMBERS = {"score": SCORE, "best": BEST, "started": STARTED, "last_detection": LAST, "existence": EXISTS,
            "hidden": HIDDEN}  # fmt: skip
_COUNTS = {"track_id": ID, "confirmed": SURE, "detections": BITS, "missed": MISSED, "hits": HITS,
           "parent": PARENT}  # fmt: skip
_HANDED_OUT = ("track_id", "confirmed", "score", "hits", "started", "last_detection", "existence", "missed", "hidden",
               "parent")  # fmt: skip


def _column(table: str, number: int, what: str) -> Any:
    """A column of a table of a batch as a property."""
    return property(lambda batch: getattr(batch, table)[:, number], doc=what)


class TrackBatch:
    """T tracks (or branches of tracks).

    Two tables hold everything but the states: with few tracks, the number of numpy calls determines the time.

    Attributes
    ----------
    states
        The filter's states, all at one time.
    numbers : array (T, 6)
        Score, best score, start (s), last detection (s), log odds of existence, seconds since the last detection out of
        view.
    counts : int64 array (T, 6)
        Track id, confirmed, detections, missed, hits, parent.
    """

    __slots__ = ("counts", "numbers", "states")

    def __init__(self, states: Any, numbers: Array, counts: Array) -> None:
        self.states, self.numbers, self.counts = states, numbers, counts

    score = _column("numbers", SCORE, "Log likelihood ratio, (T,).")
    best = _column("numbers", BEST, "Largest value of the score so far, (T,).")
    started = _column("numbers", STARTED, "Seconds, (T,).")
    last_detection = _column("numbers", LAST, "Seconds, (T,).")
    existence = _column("numbers", EXISTS, "Logarithm of the odds that the target is still there, (T,).")
    hidden = _column("numbers", HIDDEN, "Seconds out of view of all sensors since the last detection, (T,).")
    track_id = _column("counts", ID, "Ids, int64 (T,).")
    detections = _column("counts", BITS, "One bit a scan, the last one lowest: whether it was detected; int64 (T,).")
    missed = _column("counts", MISSED, "Scans in a row without a detection, int64 (T,).")
    hits = _column("counts", HITS, "Scans with a detection, int64 (T,).")
    parent = _column("counts", PARENT, "Id of the track that each parted from, 0 for none, int64 (T,).")

    @property
    def confirmed(self) -> Array:
        """Whether each is confirmed, bool (T,)."""
        return self.counts[:, SURE] != 0

    def __len__(self) -> int:
        return len(self.counts)

    def __getitem__(self, rows: Any) -> TrackBatch:
        """Return the tracks that an index array, mask or slice selects."""
        return TrackBatch(self.states[rows], self.numbers[rows], self.counts[rows])

    @staticmethod
    def new(states: Any, track_id: Array, score: Array | float, when: Array | float) -> TrackBatch:
        """New tracks, each with one detection that the scan's `counted` will count."""
        count = len(track_id)
        numbers, counts = np.zeros((count, 6)), np.zeros((count, 6), dtype=np.int64)
        numbers[:, SCORE] = numbers[:, BEST] = numbers[:, EXISTS] = score
        numbers[:, STARTED] = numbers[:, LAST] = when
        counts[:, ID] = track_id
        return TrackBatch(states, numbers, counts)

    @staticmethod
    def concatenate(parts: Sequence[TrackBatch]) -> TrackBatch:
        """Return one batch with the tracks of several."""
        return TrackBatch(
            concatenate([part.states for part in parts]),
            np.concatenate([part.numbers for part in parts]),
            np.concatenate([part.counts for part in parts]),
        )

    def moved(self, states: Any) -> TrackBatch:
        """The same tracks with other states."""
        return TrackBatch(states, self.numbers, self.counts)

    def scored(self, states: Any, gain: Array | float, detected_at: Array | None = None) -> TrackBatch:
        """Tracks after a scan of one sensor, or of all: new states, gain of scores, detections.

        Parameters
        ----------
        states
        gain : array (T,) or float
        detected_at : array (T,), optional
            Time of the detection, NaN where the track was missed; left out, all were missed.
        """
        numbers = self.numbers.copy()
        numbers[:, SCORE] += gain
        numbers[:, EXISTS] += gain
        np.maximum(numbers[:, BEST], numbers[:, SCORE], out=numbers[:, BEST])
        if detected_at is not None:
            np.fmax(numbers[:, LAST], detected_at, out=numbers[:, LAST])
            numbers[~np.isnan(detected_at), HIDDEN] = 0.0
        return TrackBatch(states, numbers, self.counts)

    def survived(self, lifetimes: float) -> TrackBatch:
        """Tracks after `lifetimes` mean lifetimes: existence is multiplied by exp(-lifetimes)."""
        if lifetimes == 0.0:
            return self
        numbers = self.numbers.copy()
        # odds p / (1 - p) with p = exp(-lifetimes) / (1 + exp(-odds before))
        gone = np.logaddexp(-numbers[:, EXISTS], np.log(-np.expm1(-lifetimes)))
        numbers[:, EXISTS] = -lifetimes - gone
        return TrackBatch(self.states, numbers, self.counts)

    def hidden_for(self, seconds: Array) -> TrackBatch:
        """The same tracks, out of view of all sensors for so many more seconds (T,)."""
        numbers = self.numbers.copy()
        numbers[:, HIDDEN] += seconds
        return TrackBatch(self.states, numbers, self.counts)

    def counted(self, detected: Array, covered: Array | None = None) -> TrackBatch:
        """Count the scan's detections and misses: `detected`, bool (T,), by any sensor.

        With `covered`, bool (T,), the scan counts only for tracks that a dwell of some sensor covered.
        """
        if covered is not None and not covered.all():
            rows = np.flatnonzero(covered | detected)
            counts = self.counts.copy()
            counts[rows] = self[rows].counted(detected[rows]).counts
            return TrackBatch(self.states, self.numbers, counts)
        counts = self.counts.copy()
        counts[:, BITS] = ((counts[:, BITS] << np.int64(1)) & MASK) | detected
        counts[:, MISSED] += 1
        counts[detected, MISSED] = 0
        counts[:, HITS] += detected
        return TrackBatch(self.states, self.numbers, counts)

    def with_confirmed(self, confirmed: Array | bool) -> TrackBatch:
        """The same tracks; exactly those in the mask are confirmed."""
        counts = self.counts.copy()
        counts[:, SURE] = confirmed
        return TrackBatch(self.states, self.numbers, counts)

    def renamed(self, ids: Array, names: Array) -> TrackBatch:
        """The same tracks with these names (K,) in place of ids (K,)."""
        counts = self.counts.copy()
        for i, name in zip(ids.tolist(), names.tolist(), strict=True):
            counts[self.track_id == i, ID] = name
            counts[self.parent == i, PARENT] = name
        return TrackBatch(self.states, self.numbers, counts)

    def with_parents(self, ids: Array, parents: Array) -> TrackBatch:
        """The same tracks, those with ids (K,) parted from the tracks `parents` (K,)."""
        counts = self.counts.copy()
        for i, parent in zip(ids.tolist(), parents.tolist(), strict=True):
            counts[self.track_id == i, PARENT] = parent
        return TrackBatch(self.states, self.numbers, counts)

    def confirm(self, life_cycle: LifeCycle, hourly: Array | float) -> TrackBatch:
        """Confirm the tracks that meet the criterion."""
        return self.with_confirmed(self.confirmed | life_cycle.confirms(self.score, self.detections, hourly))

    def to_delete(self, life_cycle: LifeCycle, time: float, patience: Array) -> Array:
        """Which tracks are to be deleted; see `LifeCycle.deletes`."""
        silent = time - self.last_detection - self.hidden * self.confirmed
        return life_cycle.deletes(self.confirmed, self.score, self.best, silent, self.missed, patience)

    def arrays(self) -> dict[str, Array]:
        """Everything as plain arrays."""
        found = {name: getattr(self, name) for name in (*_NUMBERS, *_COUNTS)}
        return found | {f"state.{name}": value for name, value in arrays_of(self.states).items()}

    def restored(self, arrays: Mapping[str, Array]) -> TrackBatch:
        """A batch like this one, from the `arrays` of another."""
        numbers = np.stack([arrays[name] for name in _NUMBERS], axis=1)
        counts = np.stack([arrays[name].astype(np.int64) for name in _COUNTS], axis=1)
        state = {name: arrays[f"state.{name}"] for name in arrays_of(self.states)}
        return TrackBatch(state_from(type(self.states), state), numbers, counts)

    def columns(self, filter: Filter[Any], time: float) -> TrackColumns:
        """The tracks as columns."""
        motion, count = filter.motion, len(self)
        position, velocity = np.zeros((count, 3)), np.zeros((count, 3))
        mean = self.states.mean.copy()
        position[:, : len(motion.position)] = mean[:, list(motion.position)]
        places = velocity_components(motion)
        velocity[:, : len(places)] = mean[:, places]
        values = {name: getattr(self, name).copy() for name in _HANDED_OUT}
        values["existence"] = 1.0 / (1.0 + np.exp(np.clip(-self.existence, -500.0, 500.0)))
        states = {"mean": mean, "covariance": self.states.covariance.copy(), "position": position, "velocity": velocity}
        return TrackColumns(time=np.full(count, time), **states, **values)

    def tracks(self, filter: Filter[Any], time: float) -> list[Track]:
        """Hand out the tracks."""
        found = self.columns(filter, time)
        columns = [column.tolist() for column in (found.track_id, *found[6:])]
        return [
            Track(i, time, found.mean[row].copy(), found.covariance[row].copy(), found.position[row],
                  found.velocity[row], *rest)
            for row, (i, *rest) in enumerate(zip(*columns, strict=True))
        ]  # fmt: skip


def one_state(filter: Filter[Any]) -> Any:
    """A state of the filter's kind, of one target."""
    n = filter.motion.dim
    return filter.start(gaussian(np.zeros((1, n)), np.eye(n)[None]))


def empty_batch(filter: Filter[Any]) -> TrackBatch:
    """No tracks, with states of the filter's kind."""
    nothing = np.zeros(0, dtype=np.int64)
    return TrackBatch.new(one_state(filter)[nothing], nothing, np.zeros(0), np.zeros(0))
