"""Identities that cannot all be right: which number, of which tracks, by which sensor, when.

A transponder or an AIS that sends a wrong code or address is noticed in four ways: its track's address changes; a track
with a new address goes on where another ended (a tracker that associates by addresses); two sensors measure different
ones on one track; two tracks have the same one at a time. A number counts once a sensor has measured it on a confirmed
track three times in a row: single garbled or misplaced plots mean nothing. A code may change in flight, and codes that
end in 00 are shared by many aircraft.

Tracks that swap plots where targets meet are no fault of identities. A real change survives a swap: the old address is
measured on no track any more, and the new one was not that of another track. Two tracks with two addresses in common
have exchanged plots.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from assoc._text.times import moment
from assoc._types import Array
from assoc.tracking.records.identity_evidence import UNKNOWN, address_text

SURE = 3
"""Equal identities in a row that a sensor must have measured on a track."""
SILENT = 6
"""Plots in a row with a new address after which it replaces the old one, which was not measured meanwhile."""
MOST = 1_000
"""Odd identities that are kept."""
_CODE = 0
_FORGET = 100


class OddIdentity(NamedTuple):
    """Identities that cannot all be right; `str` says it in one line."""

    time: float
    """Seconds."""
    kind: str
    """"became", "goes on", "twice" or "differ"."""
    column: int
    """0: a Mode 3/A code, 1: an address."""
    tracks: tuple[int, ...]
    numbers: tuple[int, ...]
    sensors: tuple[str, ...]
    decimal: bool = False
    """Whether a code is its four octal digits, read as a decimal number."""

    @property
    def key(self) -> tuple[object, ...]:
        """What is odd, whichever sensor measured it, and whenever."""
        return self.kind, self.column, self.tracks, self.numbers

    def named(self, name: Callable[[int], int]) -> OddIdentity:
        """The same with the tracks' names in place of their ids."""
        tracks = tuple(map(name, self.tracks))
        return self._replace(tracks=tuple(sorted(tracks)) if self.kind == "twice" else tracks)

    def __str__(self) -> str:
        word, by = ("code" if self.column == _CODE else "address"), self.sensors
        (track, *rest), number = self.tracks, [self._digits(number) for number in self.numbers]
        texts = {
            "became": lambda: f"track {track}: {word} {number[0]} became {number[1]} ({by[0]})",
            "goes on": lambda: f"track {track} goes on as {rest[0]}: {word} {number[0]} became {number[1]} ({by[0]})",
            "twice": lambda: f"{word} {number[0]} is that of tracks {track} and {rest[0]} at once ({by[0]})",
            "differ": lambda: f"track {track}: {word} {number[0]} by {by[0]}, {number[1]} by {by[1]}",
        }
        return f"{texts[self.kind]()}, {moment(self.time)}"

    def _digits(self, number: int) -> str:
        if self.column == _CODE:
            return f"{number:04d}" if self.decimal else f"{number:04o}"
        return address_text(number)


class Series(NamedTuple):
    """The numbers that one sensor measured on one track; times in seconds."""

    number: int
    """The last one."""
    run: int
    """How often in a row."""
    begin: float
    """When first in this row."""
    before: float
    last: float
    """The last two times."""
    settled: int
    """The last number that came three times in a row."""


class LastSeen(NamedTuple):
    """When and on which tracks a number was last measured."""

    time: float
    """On any track or none, seconds."""
    scan: int
    tracks: tuple[tuple[int, float], ...]
    """The last two confirmed tracks that had it, the newest first, and when."""


class Change(NamedTuple):
    """A number that another one may have replaced."""

    number: int
    track: int
    since: float
    """When the new one was first measured, seconds."""


class TrackLookup(NamedTuple):
    """What is known of tracks besides their identities."""

    near: Callable[[int], Sequence[int]]
    """The confirmed tracks whose targets may be where a track's is, the nearest first."""
    living: Callable[[], set[int]]
    """Ids of the tracks that live or may be taken up again."""


class IdentityWatch(NamedTuple):
    """What is known of identities; an immutable part of a tracker's state."""

    decimal: bool = False
    """As of `OddIdentity`."""
    series: Mapping[tuple[int, int, str], Series] = {}
    """By track, column and name of the sensor."""
    numbers: Mapping[tuple[int, int], LastSeen] = {}
    """By column and number."""
    changes: Mapping[tuple[int, int, str], Change] = {}
    """By track, column and name of the sensor."""
    found: tuple[OddIdentity, ...] = ()
    """Odd ones found so far, at most 1,000."""
    forget_at: int = _FORGET

    def after(
        self, scan: int, time: float, names: Sequence[str], taken: Sequence[Array], confirmed: Sequence[Array],
        times: Sequence[Array] | None, identities: Sequence[Array], lookup: TrackLookup, *, used: bool = False,
    ) -> IdentityWatch:  # fmt: skip
        """The watch after the measurements of a step.

        Parameters
        ----------
        scan, time : int, float
            Number and time (s) of the step.
        names : sequence over sensors of str
            Those of one name are one sensor.
        taken, confirmed : sequences over sensors of arrays (n_s,)
            The track that took each measurement, 0 if none did, and whether it was confirmed then.
        times : sequence over sensors of arrays (n_s,) or None
            Own times; None: that of the step.
        identities : sequence over sensors of int arrays (n_s, 2)
            Codes and addresses, 0 where there are none.
        lookup : TrackLookup
        used : bool
            Whether the tracker associates by addresses.
        """
        if not any(pairs.any() for pairs in identities):
            return self
        update = _Update(self, scan, names, lookup, used)
        for s, (ids, sure, pairs) in enumerate(zip(taken, confirmed, identities, strict=True)):
            known = pairs.any(axis=1)
            stamps = [time] * int(known.sum()) if times is None else times[s][known].tolist()
            rows = zip(ids[known].tolist(), sure[known].tolist(), stamps, pairs[known].tolist(), strict=True)
            for track, certain, when, pair in rows:
                for column, number in enumerate(pair):
                    if number != UNKNOWN:
                        update.take(track if certain else 0, column, names[s], when, number)
        return update.watch()

    def text(self) -> str:
        """The watch as JSON; `restored` reads it."""
        tables = ([[*key, *value] for key, value in table.items()] for table in self[1:4])
        return json.dumps([self.decimal, *tables, self.found, self.forget_at])

    @staticmethod
    def restored(text: str) -> IdentityWatch:
        """Read what `text` returned; ValueError or TypeError for anything else."""
        decimal, series, numbers, changes, found, forget_at = json.loads(text)
        return IdentityWatch(
            bool(decimal),
            {(int(t), int(c), str(s)): Series(int(a), int(n), float(x), float(y), float(z), int(b))
             for t, c, s, a, n, x, y, z, b in series},
            {(int(c), int(n)): LastSeen(float(last), int(scan), tuple((int(t), float(x)) for t, x in of))
             for c, n, last, scan, of in numbers},
            {(int(t), int(c), str(s)): Change(int(n), int(o), float(x)) for t, c, s, n, o, x in changes},
            tuple(_odd(*row) for row in found),
            int(forget_at),
        )  # fmt: skip


def _odd(time: Any, kind: Any, column: Any, tracks: Any, numbers: Any, sensors: Any, decimal: Any) -> OddIdentity:
    ids, values, names = tuple(map(int, tracks)), tuple(map(int, numbers)), tuple(map(str, sensors))
    found = OddIdentity(float(time), str(kind), int(column), ids, values, names, bool(decimal))
    try:
        str(found)
    except (KeyError, IndexError) as error:
        raise ValueError(f"an odd identity lacks {error}") from None
    return found


class _Update:
    """The watch while the measurements of a step are taken in."""

    def __init__(self, before: IdentityWatch, scan: int, names: Sequence[str], lookup: TrackLookup, used: bool) -> None:
        self._before, self._scan, self._lookup, self._used = before, scan, lookup, used
        self._names = tuple(dict.fromkeys(names))
        self._series, self._numbers, self._changes = dict(before.series), dict(before.numbers), dict(before.changes)
        self._found = list(before.found)

    def watch(self) -> IdentityWatch:
        """The watch now."""
        forget_at = self._before.forget_at
        if max(len(self._series), len(self._numbers)) > forget_at:
            self._forget(self._lookup.living())
            forget_at = _FORGET + 2 * max(len(self._series), len(self._numbers))
        tables = self._series, self._numbers, self._changes
        return self._before._replace(
            series=tables[0], numbers=tables[1], changes=tables[2], found=tuple(self._found), forget_at=forget_at
        )

    def _forget(self, living: set[int]) -> None:
        """Forget tracks that do not live, and numbers that only they had and that were not measured lately."""
        self._series = {key: series for key, series in self._series.items() if key[0] in living}
        self._changes = {key: change for key, change in self._changes.items() if key[0] in living}
        late = self._scan - _FORGET
        self._numbers = {
            key: seen
            for key, seen in self._numbers.items()
            if seen.scan > late or any(track in living for track, _ in seen.tracks)
        }

    def take(self, track: int, column: int, sensor: str, time: float, number: int) -> None:
        """Take in the number of a plot of a confirmed track; 0: of anything else."""
        seen = self._numbers.get((column, number))
        tracks = () if seen is None else seen.tracks
        alone = len(tracks) == 1 and tracks[0][0] == track
        others = () if alone else tuple(other for other in tracks if other[0] != track)
        if track:
            tracks = ((track, time), *others[:1])
        self._numbers[column, number] = LastSeen(time, self._scan, tracks)
        if not track:
            return
        key = track, column, sensor
        series = self._series.get(key)
        if series is None:
            series = Series(number, 1, time, time, time, UNKNOWN)
            if self._used and column != _CODE and not others:
                self._find_predecessor(key, time)
        elif series.number == number:
            series = Series(number, series.run + 1, series.begin, series.last, time, series.settled)
        else:
            series = Series(number, 1, time, time, time, series.settled)
        if series.run >= SURE:
            if series.settled != number:
                self._settle(key, series, others)
                series = series._replace(settled=number)
            if key in self._changes:
                self._judge(key, series)
        self._series[key] = series
        if series.run >= SURE:
            if others and not self._shared(column, number):
                self._find_twins(key, series, others)
            if len(self._names) > 1:
                self._compare_sensors(key, series)

    def _shared(self, column: int, number: int) -> bool:
        """Whether the last two octal digits of a code are 0: those are not of one aircraft."""
        return column == _CODE and number % (100 if self._before.decimal else 64) == 0

    def _settle(self, key: tuple[int, int, str], series: Series, others: tuple[tuple[int, float], ...]) -> None:
        """A new number came three times in a row: was it another one before?"""
        if others:
            self._changes.pop(key, None)
        elif key[1] != _CODE and series.settled != UNKNOWN:
            self._changes[key] = Change(series.settled, key[0], series.begin)

    def _find_predecessor(self, key: tuple[int, int, str], time: float) -> None:
        """A track has its first number: may it go on where another, of another address, ended?"""
        for other in self._lookup.near(key[0]):
            for theirs in self._of(other, key[1]).values():
                if theirs.settled != UNKNOWN:
                    self._changes[key] = Change(theirs.settled, other, time)
                    return

    def _is_unseen(self, column: int, number: int, since: float) -> bool:
        seen = self._numbers.get((column, number))
        return seen is not None and seen.time < since

    def _judge(self, key: tuple[int, int, str], series: Series) -> None:
        """Whether a number that another one may have replaced is measured no more."""
        (track, column, sensor), change = key, self._changes[key]
        if not self._is_unseen(column, change.number, change.since):
            del self._changes[key]
        elif series.run >= SILENT:
            del self._changes[key]
            kind, tracks = ("became", (track,)) if change.track == track else ("goes on", (change.track, track))
            self._add(series.last, kind, column, tracks, (change.number, series.number), (sensor,))

    def _find_twins(self, key: tuple[int, int, str], series: Series, others: tuple[tuple[int, float], ...]) -> None:
        """Is a number that of two tracks at once?"""
        track, column, sensor = key
        for other, when in others:
            if when <= series.begin:
                continue
            mine, theirs = self._of(track, column), self._of(other, column)
            if not any(their.number == series.number and _at_once(series, their) for their in theirs.values()):
                continue
            numbers = ({own.number for own in found.values() if own.last >= series.begin} for found in (mine, theirs))
            # two in common: they have exchanged plots
            if len(set.intersection(*numbers)) == 1 and other not in self._lookup.near(track):
                both = min(track, other), max(track, other)
                self._add(series.last, "twice", column, both, (series.number,), (sensor,))

    def _compare_sensors(self, key: tuple[int, int, str], series: Series) -> None:
        """Do two sensors measure different numbers on a track?"""
        track, column, sensor = key
        for other in self._names:
            theirs = self._series.get((track, column, other))
            if theirs is None or theirs.number == series.number or not _at_once(series, theirs):
                continue
            since, pairs = min(series.begin, theirs.begin), sorted([(series.number, sensor), (theirs.number, other)])
            # what another track has is a matter of the two tracks
            tracks = (self._numbers[column, number].tracks for number, _ in pairs if (column, number) in self._numbers)
            if all(found == track or when < since for of in tracks for found, when in of):
                numbers, sensors = zip(*pairs, strict=True)
                self._add(series.last, "differ", column, (track,), numbers, sensors)

    def _of(self, track: int, column: int) -> dict[str, Series]:
        """The numbers of a track by sensor."""
        found = {name: self._series.get((track, column, name)) for name in self._names}
        return {name: series for name, series in found.items() if series is not None}

    def _add(self, time: float, kind: str, column: int, tracks: Any, numbers: Any, sensors: Any) -> None:
        odd = OddIdentity(time, kind, column, tracks, numbers, sensors, self._before.decimal)
        if len(self._found) < MOST and not any(found.key == odd.key for found in self._found):
            self._found.append(odd)


def _at_once(series: Series, other: Series) -> bool:
    """Whether `series`, measured now, and another both came twice since the other's number was first measured.

    A track that has ended, and takes one more plot of those of its successor, is not meant.
    """
    return min(series.run, other.run) >= SURE and series.before > other.begin and other.before > series.begin
