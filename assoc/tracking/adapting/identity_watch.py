"""Identities that cannot all be right, told by name: which one, of which tracks, by which sensor, when.

A transponder or an AIS that says a wrong code or address is seen in three ways: its track's address changes, two
sensors say different ones of one track, or two tracks have the same one at a time. A sensor's word counts once it has
said the same of a confirmed track three times in a row: single garbled or misplaced plots mean nothing. A code may
change in flight, and codes that end in 00 are of many aircraft.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

from assoc._text.plain import one_line
from assoc._text.times import moment
from assoc._types import Array
from assoc.recordings.several import NO_HEIGHT
from assoc.sensors import Sensor
from assoc.tracking.stages.identity_evidence import ADDRESSES, UNKNOWN
from assoc.tracking.track import Track

SURE = 3
"""Equal identities in a row that a sensor must have said of a track."""
MOST = 1_000
"""Odd identities that are remembered."""
_CODE = 0
_FORGET = 100


class OddIdentity(NamedTuple):
    """Identities that cannot all be right; `str` says it in one line."""

    time: float
    """Seconds."""
    text: str

    def __str__(self) -> str:
        return f"{self.text}, {moment(self.time)}"


class _Voice:
    """What one sensor says of one track."""

    __slots__ = ("before", "last", "run", "said", "settled", "since")

    def __init__(self) -> None:
        self.said, self.run, self.settled = UNKNOWN, 0, UNKNOWN
        self.since = self.before = self.last = -math.inf
        """When it was sure of the settled identity, and when it said it the last two times, seconds."""


class IdentityWatch:
    """Watches the identities of tracks' measurements; it is not saved with a tracker.

    Parameters
    ----------
    sensors : sequence of Sensor
        Plots of one radar with heights and without are one sensor.
    decimal : bool
        Whether a code is its four octal digits, read as a decimal number.
    """

    def __init__(self, sensors: Sequence[Sensor], *, decimal: bool = False) -> None:
        names = (one_line(sensor.name.removesuffix(NO_HEIGHT)) for sensor in sensors)
        self._names = [name or f"sensor {s}" for s, name in enumerate(names, 1)]
        self._base = 10 if decimal else 8
        self._known: set[object] = set()
        self.found: list[OddIdentity] = []
        """What was found so far, at most 1,000."""
        self.begin_anew()

    def begin_anew(self) -> None:
        """Forget all tracks and times, where tracks begin anew; what was found stays."""
        self._forget_at = _FORGET
        self._voices: dict[tuple[int, int], dict[str, _Voice]] = {}
        self._owners: dict[tuple[int, int], set[int]] = {}
        self._time = -math.inf

    def take(
        self,
        time: float,
        taken: Sequence[Array],
        confirmed: Sequence[Array],
        times: Sequence[Array] | None,
        identities: Sequence[Array],
        living: Callable[[], Iterable[Track]],
    ) -> list[OddIdentity]:
        """Take in the measurements of a step; returns what is new. Steps that are done again are left out.

        Parameters
        ----------
        time : float
            Of the step, seconds.
        taken, confirmed : sequences over sensors of arrays (n_s,)
            The track that took each measurement, 0 if none did, and whether it was confirmed then.
        times : sequence over sensors of arrays (n_s,) or None
            Own times; None: that of the step.
        identities : sequence over sensors of int arrays (n_s, 2)
            Codes and addresses, 0 where there are none.
        living : callable
            Returns the tracks that live.
        """
        if time <= self._time:
            return []
        self._time, before = time, len(self.found)
        for s, (ids, sure, pairs) in enumerate(zip(taken, confirmed, identities, strict=True)):
            known = sure & (ids > 0) & pairs.any(axis=1)
            stamps = [time] * int(known.sum()) if times is None else times[s][known].tolist()
            for track, when, pair in zip(ids[known].tolist(), stamps, pairs[known].tolist(), strict=True):
                for column, number in enumerate(pair):
                    if number != UNKNOWN:
                        self._hear(track, self._names[s], when, column, number)
        if len(self._voices) > self._forget_at:
            self._forget({track.track_id for track in living()})
        return self.found[before:]

    def _forget(self, living: set[int]) -> None:
        """Forget tracks that do not live."""
        self._voices = {key: voices for key, voices in self._voices.items() if key[0] in living}
        self._owners = {key: owners & living for key, owners in self._owners.items() if owners & living}
        self._forget_at = _FORGET + 2 * len(self._voices)

    def _hear(self, track: int, sensor: str, time: float, column: int, number: int) -> None:
        voices = self._voices.setdefault((track, column), {})
        voice = voices.get(sensor)
        if voice is None:
            voice = voices[sensor] = _Voice()
        voice.run = voice.run + 1 if voice.said == number else 1
        voice.said = number
        if voice.settled != number:
            if voice.run < SURE:
                return
            old, voice.settled, voice.since = voice.settled, number, time
            voice.before = voice.last = -math.inf
            self._owners.setdefault((column, number), set()).add(track)
            if old != UNKNOWN and column != _CODE:
                text = f"track {track}: {self._named(column, old)} became {self._digits(column, number)} ({sensor})"
                self._add(time, (track, old, number), text)
        owners = self._owners.get((column, number), ())
        if len(voices) == 1 and len(owners) == 1 and track in owners:
            # nearly all: nobody else says it, or anything of this track
            voice.before, voice.last = voice.last, time
            return
        name = self._named(column, number)
        # codes whose last two octal digits are 0 are not of one aircraft
        shared = column == _CODE and number % self._base**2 == 0
        for other, twin in () if shared else self._twins(track, column, number):
            if _at_once(voice, twin):
                low, high = sorted((track, other))
                text = f"{name} is that of tracks {low} and {high} at once ({sensor})"
                self._add(time, (column, number, low, high), text)
        for other_name, other_voice in voices.items():
            said = other_voice.settled
            if said not in (UNKNOWN, number) and _at_once(voice, other_voice):
                low, high = sorted((number, said))
                # what another track has is a matter of the two tracks
                if not any(self._owners.get((column, one), {track}) - {track} for one in (low, high)):
                    text = f"track {track}: {name} by {sensor}, {self._digits(column, said)} by {other_name}"
                    self._add(time, (column, track, low, high), text)
        voice.before, voice.last = voice.last, time

    def _twins(self, track: int, column: int, number: int) -> Iterator[tuple[int, _Voice]]:
        """Voices that say of other tracks what is said of this one."""
        for other in sorted(self._owners.get((column, number), set()) - {track}):
            for voice in self._voices.get((other, column), {}).values():
                if voice.settled == number:
                    yield other, voice

    def _named(self, column: int, number: int) -> str:
        return f"{'code' if column == _CODE else 'address'} {self._digits(column, number)}"

    def _digits(self, column: int, number: int) -> str:
        """Four octal digits of a code, six hexadecimal ones of an address, nine decimal ones of a ship's."""
        if column == _CODE:
            return f"{number:04o}" if self._base == 8 else f"{number:04d}"
        return f"{number:06x}" if number < ADDRESSES else f"{number:09d}"

    def _add(self, time: float, key: object, text: str) -> None:
        if key not in self._known and len(self.found) < MOST:
            self._known.add(key)
            self.found.append(OddIdentity(time, text))


def _at_once(one: _Voice, other: _Voice) -> bool:
    """Whether `one`, heard now, and another have both been heard twice since the other was sure.

    A track that has ended, and takes one more plot of those of its successor, is not meant.
    """
    return one.last > other.since and other.before > one.since
