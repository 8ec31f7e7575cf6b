"""Measurements that arrive late: the tracker goes back to the scan that they belong to, and comes again.

What a tracker was before each of the last scans is kept, and so are the scans. A late measurement is put into its scan,
and all scans since are taken in anew: the tracks are those of a tracker that got everything in order, with any filter
and any way to associate. Tracks keep their ids: one that is found anew has the id under which it was known.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from assoc._parameters import positive
from assoc._system.door import doors
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.scene.own_times import checked_times
from assoc.tracking.checking import checked_measurements
from assoc.tracking.checkpoint import Memory
from assoc.tracking.identity_evidence import checked_identities, no_identities
from assoc.tracking.track import Decision, Step, Track
from assoc.tracking.tracker import Tracker

HORIZON = 30.0
"""Seconds that a measurement may be late where nothing else is said."""

# when there are so many names, and then twice as many as are left, those of tracks that are gone are forgotten
_MANY = 1_000


@dataclass(eq=False)
class _Kept:
    """A scan of the past, what the tracker was before it, and what it said then."""

    before: Memory
    time: float
    measurements: list[Array]
    times: list[Array] | None
    sectors: Array | None
    identities: list[Array] | None = None
    assigned: tuple[Array, ...] = ()


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

    def __init__(self, tracker: Tracker, horizon: float = HORIZON, *, first_id: int = 1) -> None:
        if not isinstance(tracker, Tracker):
            raise InvalidInputError(f"tracker must be a tracker of assoc.tracking, got {type(tracker).__name__}")
        self.tracker, self.horizon = tracker, positive(horizon, "horizon")
        self.late = self.refused = 0
        self._kept: deque[_Kept] = deque()
        self._names: dict[int, int] = {track.track_id: track.track_id for track in tracker.tracks}
        self.next_id = max(first_id, max(self._names, default=0) + 1)
        self._decided: dict[int, tuple[int, Decision]] = {}
        """By scan: the scan whose step has decided it, and how."""
        self._many = _MANY

    @property
    def time(self) -> float | None:
        """Time of the last step, seconds; None before the first."""
        return self.tracker.time

    @property
    def tracks(self) -> list[Track]:
        """The tracks that live now, by their ids."""
        named = [track.named(self._name(track.track_id)) for track in self.tracker.tracks]
        return sorted(named, key=lambda track: track.track_id)

    @property
    def scans(self) -> list[float]:
        """Times of the scans that may still be revised, the oldest first, seconds."""
        return [kept.time for kept in self._kept]

    def past_tracks(self, scan: int) -> list[Track]:
        """The tracks at the end of one of `scans`, as they are by all that has arrived since.

        Parameters
        ----------
        scan : int
            Number in `scans`; negative from the end.
        """
        count = len(self._kept)
        if not -count <= scan < count:
            raise InvalidInputError(f"scan must be a number in the {count} scans that are kept, got {scan}")
        following = scan % count + 1
        if following == count:
            return self.tracks
        now = self.tracker.remember()
        self.tracker.go_back(self._kept[following].before)
        try:
            return self.tracks
        finally:
            self.tracker.go_back(now)

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
        tracker = self.tracker
        checked = checked_measurements(measurements, tracker.sensors)
        now = tracker.time
        codes = None
        if identities is not None and tracker.identities is not None:
            codes = checked_identities(identities, [len(z) for z in checked])
        if times is None or now is None:
            return self._finish(self._advance(time, checked, times, sectors, codes), [], 0)
        stamps = checked_times(times, checked, float(time), "times")
        on_time = [one >= now for one in stamps]
        if all(one.all() for one in on_time):
            return self._finish(self._advance(time, checked, list(stamps), sectors, codes), [], 0)
        start = tracker.remember(), list(self._kept), dict(self._names), dict(self._decided), self.next_id
        confirmed = {track.track_id for track in self.tracks if track.confirmed}
        try:
            moves, refused = self._insert(checked, stamps, codes, on_time)
            if moves:
                self._again(min(k for k, *_ in moves))
            fresh = [z[one] for z, one in zip(checked, on_time, strict=True)]
            own = [t[one] for t, one in zip(stamps, on_time, strict=True)]
            told = None if codes is None else [i[one] for i, one in zip(codes, on_time, strict=True)]
            step = self._advance(time, fresh, own, sectors, told)
        except BaseException:
            tracker.go_back(start[0])
            self._kept, self._names, self._decided, self.next_id = deque(start[1]), *start[2:]
            raise
        assigned = [np.zeros(len(z), dtype=np.int64) for z in checked]
        for s, one in enumerate(on_time):
            assigned[s][one] = step.assigned[s]
        for k, s, rows, place in moves:
            assigned[s][rows] = self._kept[k].assigned[s][place:][: len(rows)]
        sure = [track.track_id for track in self.tracks if track.confirmed]
        known = tuple(np.isin(one, sure) & (one > 0) for one in assigned)
        ended = np.array(sorted(confirmed - {track.track_id for track in self.tracks}), dtype=np.int64)
        done = replace(step, assigned=tuple(assigned), confirmed=known, ended=ended)
        return self._finish(done, [rows for _, _, rows, _ in moves], refused)

    def _insert(
        self, measurements: list[Array], stamps: Sequence[Array], codes: list[Array] | None, on_time: list[Array]
    ) -> tuple[list[tuple[int, int, Array, int]], int]:
        """Put late measurements into their scans: scan, sensor, rows and place there; and how many are too old."""
        assert self.tracker.time is not None
        ends = np.array([kept.time for kept in self._kept])
        moves, refused = [], 0
        copies: dict[int, _Kept] = {}
        for s, (z, times) in enumerate(zip(measurements, stamps, strict=True)):
            rows = np.flatnonzero(~on_time[s])
            # a time on the border of two scans belongs to the later one, as it does in time
            scan = np.searchsorted(ends, times[rows], side="right")
            first = self._kept[0].before.time if self._kept else None
            good = scan < len(ends)
            if first is not None:
                good &= times[rows] >= first
            refused += int((~good).sum())
            for k in np.unique(scan[good]).tolist():
                mine = rows[good & (scan == k)]
                old = copies.setdefault(k, replace(self._kept[k]))
                if old.times is None:
                    old.times = [np.full(len(one), old.time) for one in old.measurements]
                old.measurements, old.times = list(old.measurements), list(old.times)
                if codes is not None or old.identities is not None:
                    known = no_identities(old.measurements) if old.identities is None else list(old.identities)
                    told = no_identities(measurements) if codes is None else codes
                    known[s] = np.concatenate([known[s], told[s][mine]])
                    old.identities = known
                moves.append((k, s, mine, len(old.measurements[s])))
                old.measurements[s] = np.concatenate([old.measurements[s], z[mine]])
                old.times[s] = np.concatenate([old.times[s], times[mine]])
        for k, changed in copies.items():
            self._kept[k] = changed
        return moves, refused

    def _again(self, first: int) -> None:
        """Take the scans from this one on in anew, and find the tracks' ids again."""
        past = list(self._kept)
        self.tracker.go_back(past[first].before)
        # tracks that began since are called otherwise inside now
        names = {inner: outer for inner, outer in self._names.items() if inner < past[first].before.next_id}
        votes: Counter[tuple[int, int]] = Counter()
        steps = []
        for k in range(first, len(past)):
            kept = past[k]
            self._kept[k] = kept = replace(kept, before=self.tracker.remember())
            step = self.tracker.step(kept.time, kept.measurements, kept.times, kept.sectors, kept.identities)
            steps.append(step)
            for new, old in zip(step.assigned, kept.assigned, strict=True):
                votes.update(zip(new[: len(old)].tolist(), old.tolist(), strict=True))
        taken = set(names.values())
        for (inner, outer), _ in sorted(votes.items(), key=lambda one: (-one[1], one[0])):
            if inner and outer and inner not in names and outer not in taken:
                names[inner] = outer
                taken.add(outer)
        self._names = names
        for k, step in enumerate(steps, start=first):
            self._kept[k].assigned = self._named(step.assigned)
            self._decide(step)

    def _advance(
        self, time: float, measurements: list[Array], times: Sequence[Array] | None, sectors: Array | None,
        codes: list[Array] | None,
    ) -> Step:  # fmt: skip
        """Take in a scan that is in time."""
        before = self.tracker.remember()
        step = self.tracker.step(time, measurements, times, sectors, codes)
        kept = _Kept(before, step.time, measurements, None if times is None else list(times), sectors, codes)
        kept.assigned = self._named(step.assigned)
        self._kept.append(kept)
        self._decide(step)
        ended = np.array(sorted(self._name(i) for i in step.ended.tolist()), dtype=np.int64)
        return replace(step, assigned=kept.assigned, ended=ended)

    def _decide(self, step: Step) -> None:
        for one in step.final:
            self._decided[one.scan] = step.scan, self._outside(one)

    def _finish(self, step: Step, late: list[Array], refused: int) -> Step:
        """Forget what nothing can be late for any more, and the names of tracks that are gone."""
        count = sum(len(rows) for rows in late)
        self.late, self.refused = self.late + count, self.refused + refused
        while self._kept and self._kept[0].time < step.time - self.horizon:
            self._kept.popleft()
        open_scans = step.scan - len(self._kept)
        # what a scan that is kept has decided, it may decide otherwise when it is taken in anew
        done = [scan for scan in sorted(self._decided) if self._decided[scan][0] <= open_scans]
        final = tuple(self._decided.pop(scan)[1] for scan in done)
        if len(self._names) > self._many:
            living = self.tracker.remember().track_ids.union(*(kept.before.track_ids for kept in self._kept))
            self._names = {inner: outer for inner, outer in self._names.items() if inner in living}
            self._many = _MANY + 2 * len(self._names)
        return replace(step, final=final, late=count, refused=refused)

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
