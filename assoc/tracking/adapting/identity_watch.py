"""Identities that cannot all be right, told by name: which one, of which tracks, by which sensor, when.

A transponder or an AIS that says a wrong code or address is seen in four ways: its track's address changes; a track
with a new address goes on where another ended (a tracker that associates by addresses); two sensors say different ones
of one track; two tracks have the same one at a time. A sensor's word counts once it has said the same of a confirmed
track three times in a row: single garbled or misplaced plots mean nothing. A code may change in flight, and codes that
end in 00 are of many aircraft.

Tracks that swap plots where targets meet are no fault of identities. What is wrong survives a swap: an address that
became another is heard no more, from any track; the new one was not that of another track. Two tracks with two
addresses in common have exchanged plots.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from assoc._text.times import moment
from assoc._types import Array
from assoc.tracking.stages.identity_evidence import UNKNOWN, address_text

SURE = 3
"""Equal identities in a row that a sensor must have said of a track."""
SILENT = 6
"""Reports of a new address in a row after which the old one, unheard meanwhile, is taken to have become it."""
MOST = 1_000
"""Odd identities that are remembered."""
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
        """What is odd, whoever says it, and when."""
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


class Voice(NamedTuple):
    """What one sensor says of one track; times in seconds."""

    said: int
    """The last number."""
    run: int
    """How often in a row."""
    begin: float
    """When it said it first."""
    before: float
    last: float
    """The last two times."""
    settled: int
    """The last number that it said three times in a row."""


class Heard(NamedTuple):
    """Where a number was heard."""

    last: float
    """When, of any track or none, seconds."""
    scan: int
    carriers: tuple[tuple[int, float], ...]
    """The last two confirmed tracks that had it, the newest first, and when."""


class Doubt(NamedTuple):
    """A number that may have become another one."""

    number: int
    track: int
    since: float
    """When the new one was first said, seconds."""


class Sight(NamedTuple):
    """What is known of tracks besides their identities."""

    near: Callable[[int], Sequence[int]]
    """The confirmed tracks whose targets may be where a track's is, the nearest first."""
    living: Callable[[], set[int]]
    """Ids of the tracks that live or may be taken up again."""


class IdentityWatch(NamedTuple):
    """What is known of identities; an immutable part of a tracker's state."""

    decimal: bool = False
    """As of `OddIdentity`."""
    voices: Mapping[tuple[int, int, str], Voice] = {}
    """By track, column and name of the sensor."""
    numbers: Mapping[tuple[int, int], Heard] = {}
    """By column and number."""
    doubts: Mapping[tuple[int, int, str], Doubt] = {}
    """As voices."""
    found: tuple[OddIdentity, ...] = ()
    """What was found so far, at most 1,000."""
    forget_at: int = _FORGET

    def after(
        self, scan: int, time: float, names: Sequence[str], taken: Sequence[Array], confirmed: Sequence[Array],
        times: Sequence[Array] | None, identities: Sequence[Array], sight: Sight, *, used: bool = False,
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
        sight : Sight
        used : bool
            Whether the tracker associates by addresses.
        """
        if not any(pairs.any() for pairs in identities):
            return self
        hearing = _Hearing(self, scan, names, sight, used)
        for s, (ids, sure, pairs) in enumerate(zip(taken, confirmed, identities, strict=True)):
            known = pairs.any(axis=1)
            stamps = [time] * int(known.sum()) if times is None else times[s][known].tolist()
            rows = zip(ids[known].tolist(), sure[known].tolist(), stamps, pairs[known].tolist(), strict=True)
            for track, certain, when, pair in rows:
                for column, number in enumerate(pair):
                    if number != UNKNOWN:
                        hearing.hear(track if certain else 0, column, names[s], when, number)
        return hearing.watch()

    def text(self) -> str:
        """The watch as JSON; `restored` reads it."""
        tables = ([[*key, *value] for key, value in table.items()] for table in self[1:4])
        return json.dumps([self.decimal, *tables, self.found, self.forget_at])

    @staticmethod
    def restored(text: str) -> IdentityWatch:
        """Read what `text` returned; ValueError or TypeError for anything else."""
        decimal, voices, numbers, doubts, found, forget_at = json.loads(text)
        return IdentityWatch(
            bool(decimal),
            {(int(t), int(c), str(s)): Voice(int(a), int(n), float(x), float(y), float(z), int(b))
             for t, c, s, a, n, x, y, z, b in voices},
            {(int(c), int(n)): Heard(float(last), int(scan), tuple((int(t), float(x)) for t, x in of))
             for c, n, last, scan, of in numbers},
            {(int(t), int(c), str(s)): Doubt(int(n), int(o), float(x)) for t, c, s, n, o, x in doubts},
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


class _Hearing:
    """The watch while the measurements of a step are taken in."""

    def __init__(self, before: IdentityWatch, scan: int, names: Sequence[str], sight: Sight, used: bool) -> None:
        self._before, self._scan, self._sight, self._used = before, scan, sight, used
        self._names = tuple(dict.fromkeys(names))
        self._voices, self._numbers, self._doubts = dict(before.voices), dict(before.numbers), dict(before.doubts)
        self._found = list(before.found)

    def watch(self) -> IdentityWatch:
        """The watch now."""
        forget_at = self._before.forget_at
        if max(len(self._voices), len(self._numbers)) > forget_at:
            self._forget(self._sight.living())
            forget_at = _FORGET + 2 * max(len(self._voices), len(self._numbers))
        tables = self._voices, self._numbers, self._doubts
        return self._before._replace(
            voices=tables[0], numbers=tables[1], doubts=tables[2], found=tuple(self._found), forget_at=forget_at
        )

    def _forget(self, living: set[int]) -> None:
        """Forget tracks that do not live, and numbers that only they had and that were not heard of late."""
        self._voices = {key: voice for key, voice in self._voices.items() if key[0] in living}
        self._doubts = {key: doubt for key, doubt in self._doubts.items() if key[0] in living}
        late = self._scan - _FORGET
        self._numbers = {
            key: heard
            for key, heard in self._numbers.items()
            if heard.scan > late or any(track in living for track, _ in heard.carriers)
        }

    def hear(self, track: int, column: int, sensor: str, time: float, number: int) -> None:
        """Take in what a sensor says of a confirmed track; 0: of something else."""
        heard = self._numbers.get((column, number))
        carriers = () if heard is None else heard.carriers
        alone = len(carriers) == 1 and carriers[0][0] == track
        others = () if alone else tuple(carrier for carrier in carriers if carrier[0] != track)
        if track:
            carriers = ((track, time), *others[:1])
        self._numbers[column, number] = Heard(time, self._scan, carriers)
        if not track:
            return
        key = track, column, sensor
        voice = self._voices.get(key)
        if voice is None:
            voice = Voice(number, 1, time, time, time, UNKNOWN)
            if self._used and column != _CODE and not others:
                self._find_predecessor(key, time)
        elif voice.said == number:
            voice = Voice(number, voice.run + 1, voice.begin, voice.last, time, voice.settled)
        else:
            voice = Voice(number, 1, time, time, time, voice.settled)
        if voice.run >= SURE:
            if voice.settled != number:
                self._settle(key, voice, others)
                voice = voice._replace(settled=number)
            if key in self._doubts:
                self._judge(key, voice)
        self._voices[key] = voice
        if voice.run >= SURE:
            if others and not self._shared(column, number):
                self._find_twins(key, voice, others)
            if len(self._names) > 1:
                self._compare_sensors(key, voice)

    def _shared(self, column: int, number: int) -> bool:
        """Whether the last two octal digits of a code are 0: those are not of one aircraft."""
        return column == _CODE and number % (100 if self._before.decimal else 64) == 0

    def _settle(self, key: tuple[int, int, str], voice: Voice, others: tuple[tuple[int, float], ...]) -> None:
        """A sensor has said a new number of a track three times: was it another one before?"""
        if others:
            self._doubts.pop(key, None)
        elif key[1] != _CODE and voice.settled != UNKNOWN:
            self._doubts[key] = Doubt(voice.settled, key[0], voice.begin)

    def _find_predecessor(self, key: tuple[int, int, str], time: float) -> None:
        """A track is heard for the first time: may it go on where another, of another address, ended?"""
        for other in self._sight.near(key[0]):
            for theirs in self._of(other, key[1]).values():
                if theirs.settled != UNKNOWN:
                    self._doubts[key] = Doubt(theirs.settled, other, time)
                    return

    def _unheard(self, column: int, number: int, since: float) -> bool:
        heard = self._numbers.get((column, number))
        return heard is not None and heard.last < since

    def _judge(self, key: tuple[int, int, str], voice: Voice) -> None:
        """Whether a number that may have become another one is heard no more."""
        (track, column, sensor), doubt = key, self._doubts[key]
        if not self._unheard(column, doubt.number, doubt.since):
            del self._doubts[key]
        elif voice.run >= SILENT:
            del self._doubts[key]
            kind, tracks = ("became", (track,)) if doubt.track == track else ("goes on", (doubt.track, track))
            self._add(voice.last, kind, column, tracks, (doubt.number, voice.said), (sensor,))

    def _find_twins(self, key: tuple[int, int, str], voice: Voice, others: tuple[tuple[int, float], ...]) -> None:
        """Is a number that of two tracks at once?"""
        track, column, sensor = key
        for other, when in others:
            if when <= voice.begin:
                continue
            mine, theirs = self._of(track, column), self._of(other, column)
            if not any(their.said == voice.said and _at_once(voice, their) for their in theirs.values()):
                continue
            said = ({own.said for own in voices.values() if own.last >= voice.begin} for voices in (mine, theirs))
            # two in common: they have exchanged plots
            if len(set.intersection(*said)) == 1 and other not in self._sight.near(track):
                self._add(voice.last, "twice", column, (min(track, other), max(track, other)), (voice.said,), (sensor,))

    def _compare_sensors(self, key: tuple[int, int, str], voice: Voice) -> None:
        """Do two sensors say different numbers of a track?"""
        track, column, sensor = key
        for other in self._names:
            theirs = self._voices.get((track, column, other))
            if theirs is None or theirs.said == voice.said or not _at_once(voice, theirs):
                continue
            since, pairs = min(voice.begin, theirs.begin), sorted([(voice.said, sensor), (theirs.said, other)])
            # what another track has is a matter of the two tracks
            carriers = (
                self._numbers[column, number].carriers for number, _ in pairs if (column, number) in self._numbers
            )
            if all(carrier == track or when < since for of in carriers for carrier, when in of):
                numbers, sensors = zip(*pairs, strict=True)
                self._add(voice.last, "differ", column, (track,), numbers, sensors)

    def _of(self, track: int, column: int) -> dict[str, Voice]:
        """What the sensors say of a track."""
        found = {name: self._voices.get((track, column, name)) for name in self._names}
        return {name: voice for name, voice in found.items() if voice is not None}

    def _add(self, time: float, kind: str, column: int, tracks: Any, numbers: Any, sensors: Any) -> None:
        odd = OddIdentity(time, kind, column, tracks, numbers, sensors, self._before.decimal)
        if len(self._found) < MOST and not any(found.key == odd.key for found in self._found):
            self._found.append(odd)


def _at_once(voice: Voice, other: Voice) -> bool:
    """Whether `voice`, heard now, and another have both been heard twice since the other's number was first said.

    A track that has ended, and takes one more plot of those of its successor, is not meant.
    """
    return min(voice.run, other.run) >= SURE and voice.before > other.begin and other.before > voice.begin
