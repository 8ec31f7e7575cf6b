"""Late measurements: the tracker goes back to the scan that they belong to and repeats all scans since.

The last scans, and the tracker's state before each of them, are kept. A late measurement is inserted into its scan, and
all later scans are processed again: the tracks are those of a tracker that got everything in order, with any filter and
any method of association. Tracks keep their ids through this.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from assoc._parameters import positive
from assoc._system.imports import removed_attribute
from assoc._system.memory import in_words
from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError, warn
from assoc.scene.own_times import checked_times
from assoc.tracking.file import state_arrays
from assoc.tracking.records.identity_evidence import checked_identities, no_identities
from assoc.tracking.records.track import Decision, Step, Track
from assoc.tracking.records.track_batch import ID, PARENT, TrackBatch
from assoc.tracking.stages.checking import checked_measurements
from assoc.tracking.stages.starter import current
from assoc.tracking.state import TrackerState, may_return
from assoc.tracking.tracker import Tracker

HORIZON = 30.0
"""Default limit on how late a measurement may be, seconds."""
MEMORY = 1e9
"""Default limit on the memory of the scans that are kept, bytes."""

# the names of dead tracks are removed when there are this many names; next time at twice the number left, and so on
_MANY = 1_000


class _Past(NamedTuple):
    """A past scan, the tracker's state before it, and the tracks of its measurements."""

    before: TrackerState
    time: float
    measurements: Sequence[Array]
    times: Sequence[Array] | None
    sectors: Array | None
    identities: Sequence[Array] | None
    assigned: tuple[Array, ...]
    bytes: int
    """Memory of the state and the measurements."""

    def by_sensor(self) -> Iterator[tuple[Array, Array, Array]]:
        """Times, values and identities of each sensor's measurements."""
        stamps = self.times or [np.full(len(z), self.time) for z in self.measurements]
        return zip(stamps, self.measurements, self.identities or no_identities(self.measurements), strict=True)

    def with_late(self, s: int, z: Array, times: Array, codes: Array | None) -> _Past:
        """The scan with late measurements of sensor s appended."""
        stamps, identities = self.times or [np.full(len(z), self.time) for z in self.measurements], self.identities
        if codes is not None or identities is not None:
            known = identities or no_identities(self.measurements)
            identities = _appended(known, s, np.zeros((len(z), 2), dtype=np.int64) if codes is None else codes)
        measurements, stamps = _appended(self.measurements, s, z), _appended(stamps, s, times)
        more = self.bytes + z.nbytes + times.nbytes
        return self._replace(measurements=measurements, times=stamps, identities=identities, bytes=more)


def _appended(arrays: Sequence[Array], s: int, more: Array) -> list[Array]:
    return [np.concatenate([array, more]) if r == s else array for r, array in enumerate(arrays)]


class _Move(NamedTuple):
    """Late measurements of a sensor that were inserted into a past scan."""

    scan: int
    sensor: int
    rows: Array
    """Rows among the sensor's measurements in this step."""
    begin: int
    """Index of the first of them in the scan."""


@explains_wrong_types
class LatePlots:
    """A tracker for measurements that may be late.

    Parameters
    ----------
    tracker : Tracker
        Any tracker, started or not. Do not step it elsewhere afterwards.
    horizon : float
        Seconds: measurements of scans that ended longer ago are refused, and counted.
    first_id : int
        Smallest id of new tracks.
    memory : float
        Bytes for the scans that are kept, and the tracker's state before each. Where they would take more the oldest
        are forgotten before the horizon, with an AssocWarning the first time. A step that goes back takes this twice.

    Attributes
    ----------
    late, refused : int
        Late measurements so far that were used, or refused.
    next_id : int
        Id of the next new track.
    """

    def __init__(
        self,
        tracker: Tracker,
        horizon: float = HORIZON,
        *,
        first_id: int = 1,
        memory: float = MEMORY,
        many: int = _MANY,
    ) -> None:
        if not isinstance(tracker, Tracker):
            raise InvalidInputError(f"tracker must be a tracker of assoc.tracking, got {type(tracker).__name__}")
        self.tracker, self.horizon, self.memory = tracker, positive(horizon, "horizon"), positive(memory, "memory")
        self.late = self.refused = 0
        self.past: list[_Past] = []
        """The scans that may still be revised, the oldest first."""
        self.names: dict[int, int] = {track.track_id: track.track_id for track in tracker.tracks}
        """From the tracker's internal ids to the ids that are handed out."""
        self.next_id = max(first_id, max(self.names, default=0) + 1)
        self._decided: dict[int, tuple[int, Decision]] = {}
        """By scan: the scan whose step decided it, and the decision."""
        self._many = self._most = many
        self._warned = False

    @property
    def time(self) -> float | None:
        """Time of the last step, seconds; None before the first."""
        return self.tracker.time

    @property
    def tracks(self) -> list[Track]:
        """The tracks that live now, by their ids."""
        return self._tracks(self.tracker.state)

    def _tracks(self, state: TrackerState) -> list[Track]:
        if state.time is None:
            return []
        settings = self.tracker.settings
        inner = current(settings, state)
        counts = inner.counts.copy()
        counts[:, ID] = [self._name(i) for i in inner.track_id.tolist()]
        counts[:, PARENT] = [self.names.get(i, 0) for i in inner.parent.tolist()]
        order = np.argsort(counts[:, ID], kind="stable")
        return TrackBatch(inner.states, inner.numbers, counts)[order].tracks(settings.filter, state.time)

    if not TYPE_CHECKING:
        __getattr__ = removed_attribute

    @property
    def scans(self) -> list[float]:
        """Times of the scans that may still be revised, the oldest first, seconds."""
        return [past.time for past in self.past]

    def past_tracks(self, scan: int) -> list[Track]:
        """The tracks at the end of one of `scans`, by all measurements that have arrived since.

        Parameters
        ----------
        scan : int
            Index in `scans`; negative from the end.
        """
        count = len(self.past)
        if not -count <= scan < count:
            raise InvalidInputError(f"scan must be a number in the {count} scans that are kept, got {scan}")
        states = [*(past.before for past in self.past[1:]), self.tracker.state]
        return self._tracks(states[scan])

    def step(
        self,
        time: float,
        measurements: Sequence[Array],
        times: Sequence[Array] | None = None,
        sectors: Array | None = None,
        identities: Sequence[Array] | None = None,
    ) -> Step:
        """Process one scan, like `Tracker.step`; times may lie before the last scan's.

        Parameters
        ----------
        time, measurements, sectors, identities
            See `Tracker.step`. The sectors are those since the last scan, whatever measurements arrive.
        times : sequence over sensors of arrays (n_s,), optional
            Each measurement's own time, not after `time`. Late are those not after the last scan's time.

        Returns
        -------
        Step
            `assigned` has the tracks of all measurements given, late ones included, 0 for refused ones; `late` and
            `refused` count them. `final` holds scans to which no late measurement can be added any more; late
            measurements come after those that arrived in time.

        Raises
        ------
        InvalidInputError
            As `Tracker.step`; the tracker is then as it was before.
        """
        tracker, now = self.tracker, self.tracker.time
        checked = checked_measurements(measurements, tracker.sensors)
        codes = None
        if identities is not None:
            codes = checked_identities(identities, [len(z) for z in checked])
        if times is None or now is None:
            return self._finish(self._advance(time, checked, times, sectors, codes), 0, 0)
        stamps = checked_times(times, checked, float(time), "times")
        # a scan holds what was measured after the one before, up to its own time
        on_time = [(array > now) | (array == float(time)) for array in stamps]
        if all(mask.all() for mask in on_time):
            return self._finish(self._advance(time, checked, stamps, sectors, codes), 0, 0)
        before = tracker.state, self.past, self.names, self._decided, self.next_id
        self.past, self.names, self._decided = list(self.past), dict(self.names), dict(self._decided)
        confirmed = {track.track_id for track in self.tracks if track.confirmed}
        try:
            moves, refused = self._insert(checked, stamps, codes, on_time)
            if moves:
                self._again(min(move.scan for move in moves), confirmed)
            new, new_stamps, new_codes = (
                None if arrays is None else [array[mask] for array, mask in zip(arrays, on_time, strict=True)]
                for arrays in (checked, stamps, codes)
            )
            assert new is not None
            step = self._advance(time, new, new_stamps, sectors, new_codes)
        except BaseException:
            tracker.state, self.past, self.names, self._decided, self.next_id = before
            raise
        assigned = [np.zeros(len(z), dtype=np.int64) for z in checked]
        for s, mask in enumerate(on_time):
            assigned[s][mask] = step.assigned[s]
        for k, s, rows, begin in moves:
            assigned[s][rows] = self.past[k].assigned[s][begin:][: len(rows)]
        sure = [track.track_id for track in self.tracks if track.confirmed]
        known = tuple(np.isin(ids, sure) & (ids > 0) for ids in assigned)
        ended = np.array(sorted(confirmed - {track.track_id for track in self.tracks}), dtype=np.int64)
        done = replace(step, assigned=tuple(assigned), confirmed=known, ended=ended)
        return self._finish(done, sum(len(move.rows) for move in moves), refused)

    def _insert(
        self, measurements: list[Array], stamps: Sequence[Array], codes: list[Array] | None, on_time: list[Array]
    ) -> tuple[list[_Move], int]:
        """Insert late measurements into their scans; also return how many are too old."""
        ends = np.array([past.time for past in self.past])
        first = self.past[0].before.time if self.past else None
        moves, refused = [], 0
        for s, (z, times) in enumerate(zip(measurements, stamps, strict=True)):
            rows = np.flatnonzero(~on_time[s])
            scan = np.searchsorted(ends, times[rows])
            good = scan < len(ends)
            if first is not None:
                good &= times[rows] > first
            refused += int((~good).sum())
            for k in np.unique(scan[good]).tolist():
                late = rows[good & (scan == k)]
                moves.append(_Move(k, s, late, len(self.past[k].measurements[s])))
                late_codes = None if codes is None else codes[s][late]
                self.past[k] = self.past[k].with_late(s, z[late], times[late], late_codes)
        return moves, refused

    def _again(self, first: int, confirmed: set[int]) -> None:
        """Process the scans from index `first` on again, and match the tracks to their ids, `confirmed` ones first."""
        tracker = self.tracker
        tracker.state = self.past[first].before
        # tracks that began since then have new internal ids; tentative ones may turn out to be other tracks
        doubtful = _tentative(tracker.state)
        older = {inner: outer for inner, outer in self.names.items() if inner < tracker.state.next_id}
        names = {inner: outer for inner, outer in older.items() if inner not in doubtful}
        votes: Counter[tuple[int, int]] = Counter()
        steps = []
        for k, past in enumerate(self.past[first:], start=first):
            self.past[k] = past._replace(before=tracker.state, bytes=self._bytes(tracker.state, past.measurements))
            step = tracker.step(past.time, past.measurements, past.times, past.sectors, past.identities)
            steps.append(step)
            for new, old in zip(step.assigned, past.assigned, strict=True):
                votes.update(zip(new[: len(old)].tolist(), old.tolist(), strict=True))
        taken = set(names.values())
        order = sorted(votes.items(), key=lambda vote: (vote[0][1] not in confirmed, -vote[1], vote[0]))
        for inner, outer in [*(pair for pair, _ in order), *older.items()]:
            if inner and outer and inner not in names and outer not in taken:
                names[inner] = outer
                taken.add(outer)
        self.names = names
        for k, step in enumerate(steps, start=first):
            self.past[k] = self.past[k]._replace(assigned=self._named(step.assigned))
            self._decide(step)

    def _advance(
        self, time: float, measurements: Sequence[Array], times: Sequence[Array] | None, sectors: Array | None,
        codes: Sequence[Array] | None,
    ) -> Step:  # fmt: skip
        """Process a scan that is in time order."""
        before = self.tracker.state
        step = self.tracker.step(time, measurements, times, sectors, codes)
        assigned = self._named(step.assigned)
        taken = self._bytes(before, measurements)
        self.past.append(_Past(before, step.time, measurements, times, sectors, codes, assigned, taken))
        self._decide(step)
        ended = np.array(sorted(self._name(i) for i in step.ended.tolist()), dtype=np.int64)
        return replace(step, assigned=assigned, ended=ended)

    def _bytes(self, state: TrackerState, measurements: Sequence[Array]) -> int:
        return sum(array.nbytes for array in (*state_arrays(self.tracker.settings, state).values(), *measurements))

    def _decide(self, step: Step) -> None:
        for decision in step.final:
            self._decided[decision.scan] = step.scan, self._outside(decision)

    def _finish(self, step: Step, late: int, refused: int) -> Step:
        """Forget scans beyond the horizon, and the names of dead tracks."""
        self.late, self.refused = self.late + late, self.refused + refused
        self.past = [past for past in self.past if past.time >= step.time - self.horizon]
        self._forget_beyond_memory()
        open_scans = step.scan - len(self.past)
        # decisions made by a scan that is still kept may change when it is processed again
        done = [scan for scan in sorted(self._decided) if self._decided[scan][0] <= open_scans]
        final = tuple(self._decided.pop(scan)[1] for scan in done)
        if len(self.names) > self._most:
            states = self.tracker.state, *(past.before for past in self.past)
            living = set().union(*map(may_return, states))
            self.names = {inner: outer for inner, outer in self.names.items() if inner in living}
            self._most = self._many + 2 * len(self.names)
        return replace(step, final=final, late=late, refused=refused)

    def _forget_beyond_memory(self) -> None:
        """Forget the oldest scans where all together take more memory than they may, and say so once."""
        taken = np.cumsum([past.bytes for past in reversed(self.past)])
        if (fitting := int(np.searchsorted(taken, self.memory, side="right"))) == len(self.past):
            return
        self.past = self.past[len(self.past) - fitting :]
        if not self._warned:
            self._warned = True
            warn(
                f"{in_words(self.memory)} hold the states of the last {fitting} scans, less than {self.horizon:g} s: "
                "measurements of earlier scans are refused; raise memory or lower horizon"
            )

    def flush(self) -> tuple[Decision, ...]:
        """Decide the scans that are not final yet, oldest first; for the end of a recording."""
        decided = [self._decided.pop(scan)[1] for scan in sorted(self._decided)]
        return (*decided, *map(self._outside, self.tracker.flush()))

    def _name(self, inner: int) -> int:
        """The id that is handed out for a track, by its internal id."""
        if inner not in self.names:
            self.names[inner] = self.next_id
            self.next_id += 1
        return self.names[inner]

    def _outside(self, decision: Decision) -> Decision:
        """The decision with the ids that are handed out."""
        return replace(decision, assigned=self._named(decision.assigned))

    def _named(self, assigned: Sequence[Array]) -> tuple[Array, ...]:
        return tuple(
            np.array([self._name(i) if i else 0 for i in ids.tolist()], dtype=np.int64).reshape(-1) for ids in assigned
        )


def _tentative(state: TrackerState) -> set[int]:
    """Ids of the living tracks that are not confirmed, those in the starter included."""
    begun = [] if state.starter is None else [state.starter.state.tracks]
    batches = [state.tracks, *begun]
    sure = {i for batch in batches for i in batch.track_id[batch.confirmed].tolist()}
    return {i for batch in batches for i in batch.track_id.tolist()} - sure
