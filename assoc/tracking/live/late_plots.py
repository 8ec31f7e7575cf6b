"""Measurements that arrive late: the tracker goes back to the scan that they belong to, and comes again.

The tracker's state before each of the last scans is kept, and so are the scans. A late measurement is put into its
scan, and all scans since are taken in anew: the tracks are those of a tracker that got everything in order, with any
filter and any way to associate. Tracks keep their ids: one that is found anew has the id under which it was known.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from assoc._parameters import positive
from assoc._system.door import doors
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.scene.own_times import checked_times
from assoc.tracking.births.nursery import current
from assoc.tracking.checking import checked_measurements
from assoc.tracking.identity_evidence import checked_identities, no_identities
from assoc.tracking.state import TrackerState
from assoc.tracking.track import Decision, Step, Track
from assoc.tracking.tracker import Tracker

HORIZON = 30.0
"""Seconds that a measurement may be late where nothing else is said."""

# when there are so many names, and then twice as many as are left, those of tracks that are gone are forgotten
_MANY = 1_000


class _Past(NamedTuple):
    """A scan of the past, the tracker's state before it, and what it said then."""

    before: TrackerState
    time: float
    measurements: Sequence[Array]
    times: Sequence[Array] | None
    sectors: Array | None
    identities: Sequence[Array] | None
    assigned: tuple[Array, ...]

    def with_late(self, s: int, z: Array, times: Array, codes: Array | None) -> _Past:
        """The scan with more measurements of sensor s, behind its own."""
        own, identities = self.times or [np.full(len(one), self.time) for one in self.measurements], self.identities
        if codes is not None or identities is not None:
            known = identities or no_identities(self.measurements)
            identities = _appended(known, s, np.zeros((len(z), 2), dtype=np.int64) if codes is None else codes)
        measurements, own = _appended(self.measurements, s, z), _appended(own, s, times)
        return self._replace(measurements=measurements, times=own, identities=identities)


def _appended(arrays: Sequence[Array], s: int, more: Array) -> list[Array]:
    return [np.concatenate([one, more]) if r == s else one for r, one in enumerate(arrays)]


class _Move(NamedTuple):
    """Late measurements of a sensor that were put into a scan of the past."""

    scan: int
    sensor: int
    rows: Array
    """Their numbers among those of the sensor that came in."""
    place: int
    """Where they stand in the scan."""


@doors
class LatePlots:
    """A tracker for measurements that may be late.

    Parameters
    ----------
    tracker : Tracker
        Of any kind, not begun or begun. It is this object's own from now on.
    horizon : float
        Seconds: a measurement that belongs to a scan which ended longer ago is refused, and counted.
    first_id : int
        Of new tracks.

    Attributes
    ----------
    late, refused : int
        Measurements so far that were late and taken in, or refused.
    next_id : int
        Of the next new track.
    """

    def __init__(self, tracker: Tracker, horizon: float = HORIZON, *, first_id: int = 1, many: int = _MANY) -> None:
        if not isinstance(tracker, Tracker):
            raise InvalidInputError(f"tracker must be a tracker of assoc.tracking, got {type(tracker).__name__}")
        self.tracker, self.horizon = tracker, positive(horizon, "horizon")
        self.late = self.refused = 0
        self._past: list[_Past] = []
        self._names: dict[int, int] = {track.track_id: track.track_id for track in tracker.tracks}
        """By the tracker's own ids: those under which tracks are known outside."""
        self.next_id = max(first_id, max(self._names, default=0) + 1)
        self._decided: dict[int, tuple[int, Decision]] = {}
        """By scan: the scan whose step has decided it, and how."""
        self._many = self._most = many

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
        inner = current(settings, state).tracks(settings.filter, state.time)
        return sorted((track.named(self._name(track.track_id)) for track in inner), key=lambda track: track.track_id)

    @property
    def scans(self) -> list[float]:
        """Times of the scans that may still be revised, the oldest first, seconds."""
        return [past.time for past in self._past]

    def past_tracks(self, scan: int) -> list[Track]:
        """The tracks at the end of one of `scans`, as they are by all that has arrived since.

        Parameters
        ----------
        scan : int
            Number in `scans`; negative from the end.
        """
        count = len(self._past)
        if not -count <= scan < count:
            raise InvalidInputError(f"scan must be a number in the {count} scans that are kept, got {scan}")
        states = [*(past.before for past in self._past[1:]), self.tracker.state]
        return self._tracks(states[scan])

    def step(
        self,
        time: float,
        measurements: Sequence[Array],
        times: Sequence[Array] | None = None,
        sectors: Array | None = None,
        identities: Sequence[Array] | None = None,
    ) -> Step:
        """Take one scan in, as `Tracker.step` does; times may lie before the last scan's.

        Parameters
        ----------
        time, measurements, sectors, identities
            See `Tracker.step`. The sectors are those of the time since the last scan, whatever arrives.
        times : sequence over sensors of arrays (n_s,), optional
            Each measurement's own time, not after `time`.

        Returns
        -------
        Step
            `assigned` has the tracks of all that was given, also of the late, 0 for what is refused; `late` and
            `refused` count them. `final` holds scans that nothing can be late for any more; late measurements
            stand behind those that came in time.

        Raises
        ------
        InvalidInputError
            As `Tracker.step`; the tracker is then as it was before.
        """
        tracker, now = self.tracker, self.tracker.time
        checked = checked_measurements(measurements, tracker.sensors)
        codes = None
        if identities is not None and tracker.settings.identity is not None:
            codes = checked_identities(identities, [len(z) for z in checked])
        if times is None or now is None:
            return self._finish(self._advance(time, checked, times, sectors, codes), 0, 0)
        stamps = checked_times(times, checked, float(time), "times")
        on_time = [one >= now for one in stamps]
        if all(one.all() for one in on_time):
            return self._finish(self._advance(time, checked, stamps, sectors, codes), 0, 0)
        before = tracker.state, self._past, self._names, self._decided, self.next_id
        self._past, self._names, self._decided = list(self._past), dict(self._names), dict(self._decided)
        confirmed = {track.track_id for track in self.tracks if track.confirmed}
        try:
            moves, refused = self._insert(checked, stamps, codes, on_time)
            if moves:
                self._again(min(move.scan for move in moves))
            fresh, own, told = (
                None if arrays is None else [array[one] for array, one in zip(arrays, on_time, strict=True)]
                for arrays in (checked, stamps, codes)
            )
            assert fresh is not None
            step = self._advance(time, fresh, own, sectors, told)
        except BaseException:
            tracker.state, self._past, self._names, self._decided, self.next_id = before
            raise
        assigned = [np.zeros(len(z), dtype=np.int64) for z in checked]
        for s, one in enumerate(on_time):
            assigned[s][one] = step.assigned[s]
        for k, s, rows, place in moves:
            assigned[s][rows] = self._past[k].assigned[s][place:][: len(rows)]
        sure = [track.track_id for track in self.tracks if track.confirmed]
        known = tuple(np.isin(one, sure) & (one > 0) for one in assigned)
        ended = np.array(sorted(confirmed - {track.track_id for track in self.tracks}), dtype=np.int64)
        done = replace(step, assigned=tuple(assigned), confirmed=known, ended=ended)
        return self._finish(done, sum(len(move.rows) for move in moves), refused)

    def _insert(
        self, measurements: list[Array], stamps: Sequence[Array], codes: list[Array] | None, on_time: list[Array]
    ) -> tuple[list[_Move], int]:
        """Put late measurements into their scans; also how many are too old."""
        ends = np.array([past.time for past in self._past])
        first = self._past[0].before.time if self._past else None
        moves, refused = [], 0
        for s, (z, times) in enumerate(zip(measurements, stamps, strict=True)):
            rows = np.flatnonzero(~on_time[s])
            # a time on the border of two scans belongs to the later one, as it does in time
            scan = np.searchsorted(ends, times[rows], side="right")
            good = scan < len(ends)
            if first is not None:
                good &= times[rows] >= first
            refused += int((~good).sum())
            for k in np.unique(scan[good]).tolist():
                mine = rows[good & (scan == k)]
                moves.append(_Move(k, s, mine, len(self._past[k].measurements[s])))
                told = None if codes is None else codes[s][mine]
                self._past[k] = self._past[k].with_late(s, z[mine], times[mine], told)
        return moves, refused

    def _again(self, first: int) -> None:
        """Take the scans from this one on in anew, and find the tracks' ids again."""
        tracker = self.tracker
        tracker.state = self._past[first].before
        # tracks that began since are called otherwise inside now
        names = {inner: outer for inner, outer in self._names.items() if inner < tracker.state.next_id}
        votes: Counter[tuple[int, int]] = Counter()
        steps = []
        for k, past in enumerate(self._past[first:], start=first):
            self._past[k] = past._replace(before=tracker.state)
            step = tracker.step(past.time, past.measurements, past.times, past.sectors, past.identities)
            steps.append(step)
            for new, old in zip(step.assigned, past.assigned, strict=True):
                votes.update(zip(new[: len(old)].tolist(), old.tolist(), strict=True))
        taken = set(names.values())
        for (inner, outer), _ in sorted(votes.items(), key=lambda one: (-one[1], one[0])):
            if inner and outer and inner not in names and outer not in taken:
                names[inner] = outer
                taken.add(outer)
        self._names = names
        for k, step in enumerate(steps, start=first):
            self._past[k] = self._past[k]._replace(assigned=self._named(step.assigned))
            self._decide(step)

    def _advance(
        self, time: float, measurements: Sequence[Array], times: Sequence[Array] | None, sectors: Array | None,
        codes: Sequence[Array] | None,
    ) -> Step:  # fmt: skip
        """Take in a scan that is in time."""
        before = self.tracker.state
        step = self.tracker.step(time, measurements, times, sectors, codes)
        assigned = self._named(step.assigned)
        self._past.append(_Past(before, step.time, measurements, times, sectors, codes, assigned))
        self._decide(step)
        ended = np.array(sorted(self._name(i) for i in step.ended.tolist()), dtype=np.int64)
        return replace(step, assigned=assigned, ended=ended)

    def _decide(self, step: Step) -> None:
        for one in step.final:
            self._decided[one.scan] = step.scan, self._outside(one)

    def _finish(self, step: Step, late: int, refused: int) -> Step:
        """Forget what nothing can be late for any more, and the names of tracks that are gone."""
        self.late, self.refused = self.late + late, self.refused + refused
        self._past = [past for past in self._past if past.time >= step.time - self.horizon]
        open_scans = step.scan - len(self._past)
        # what a scan that is kept has decided, it may decide otherwise when it is taken in anew
        done = [scan for scan in sorted(self._decided) if self._decided[scan][0] <= open_scans]
        final = tuple(self._decided.pop(scan)[1] for scan in done)
        if len(self._names) > self._most:
            living = set().union(
                *(_ids(state) for state in (self.tracker.state, *(past.before for past in self._past)))
            )
            self._names = {inner: outer for inner, outer in self._names.items() if inner in living}
            self._most = self._many + 2 * len(self._names)
        return replace(step, final=final, late=late, refused=refused)

    def flush(self) -> tuple[Decision, ...]:
        """What is said of the scans that are not final yet, oldest first; for the end of a recording."""
        decided = [self._decided.pop(scan)[1] for scan in sorted(self._decided)]
        return (*decided, *map(self._outside, self.tracker.flush()))

    def _name(self, inner: int) -> int:
        """The id by which a track is known outside."""
        if inner not in self._names:
            self._names[inner] = self.next_id
            self.next_id += 1
        return self._names[inner]

    def _outside(self, one: Decision) -> Decision:
        return replace(one, assigned=self._named(one.assigned))

    def _named(self, assigned: Sequence[Array]) -> tuple[Array, ...]:
        return tuple(
            np.array([self._name(i) if i else 0 for i in one.tolist()], dtype=np.int64).reshape(-1) for one in assigned
        )


def _ids(state: TrackerState) -> set[int]:
    """Ids of the tracks that live, those in the nursery included."""
    own = set(state.tracks.track_id.tolist())
    return own if state.nursery is None else own | set(state.nursery.state.tracks.track_id.tolist())
