"""Plots of any reader, cleaned before any tracker: blanks, impossible values, wrong times, late ones, repeats.

Readers hand in rows, in parts and in the order of their file; recordings in the order of time come out, and the notes
say what was corrected, and how often.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.recordings.altitude import NEARBY, garbled_altitudes
from assoc.recordings.columns import DAY, FLIGHT_LEVEL
from assoc.recordings.recording import UNDECODED, Recording
from assoc.recordings.rotation import estimate_rotation
from assoc.recordings.running_times import RunningTimes

TIME, RANGE, AZIMUTH, MODE3, ALTITUDE, AIRCRAFT, ADDRESS, DOUBTFUL, LINE = range(9)
"""Columns of rows: seconds, metres, radians, code, metres, number, address, whether the altitude is doubted, line.

NaN is "not there" of a number; code and address are then 0, the aircraft -1.
"""
WIDTH = LINE + 1
MAX_DISORDER = 30.0
"""Plots up to this late (s) are sorted in; where several in a row are later, that is an error."""
TWIN = 0.25
"""Seconds. An antenna does not come back so soon: the same plot again came over another line of the feed."""

BLANK = "rows without time, range or bearing left out"
IMPOSSIBLE = "rows left out whose time, range or bearing cannot be"
# metres, radians, seconds: what no radar measures; and that no aircraft reaches
_FARTHEST, _TURNS, _LATEST, _HIGHEST = 1e8, 20.0, 1e12, 1e5
# numbers from which on times are no seconds: as such they would be in the year 5138
_EPOCHS = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))
_ENOUGH, _TRIED = 20, 2000


class Cleaning:
    """Rows (n, `WIDTH`) of one radar, given in parts, as recordings of a `name`.

    `notes` get what was corrected, and are complete after the last part. With `clock` times are times of day. Plots up
    to `disorder` seconds late are sorted in; later ones are left out, or an error of the file `strict`. `codes` are
    flight levels that are taken for garbled; with `sources` rows know their aircraft. Recordings have at least
    `at_once` plots, but for the last.
    """

    def __init__(
        self, name: str, notes: Counter[str], *, clock: bool, disorder: float = NEARBY,
        codes: Array | tuple[int, ...] = (), sources: bool = False, at_once: int = 1, strict: str = "",
    ) -> None:  # fmt: skip
        self._name, self._notes, self._disorder, self._codes = name, notes, disorder, codes
        self._sources, self._at_once, self._strict = sources, at_once, strict
        self._times, self._clock = RunningTimes(max(disorder, MAX_DISORDER), clock), clock
        self._rows = np.zeros((0, WIDTH))
        """Sorted; the first `_done` of them are given, and kept for those after them."""
        self._done = 0
        self._latest = -math.inf
        self.count = 0
        """Plots so far."""

    def take(self, rows: Array, *, last: bool = False) -> Iterator[Recording]:
        """Take rows in, and yield the plots that are complete: none can come before them, nor judge their altitudes."""
        rows = self._times.take(self._possible(rows.reshape(-1, WIDTH)))
        if last:
            rows = np.concatenate([rows, self._times.rest(WIDTH)])
            self._note("plots left out whose time no other supports", self._times.left_out)
            self._note("midnights passed", self._times.midnights)
        self._sort_in(rows)
        times, begin = self._rows[:, TIME], self._done
        end = len(times) if last else int(np.searchsorted(times, self._latest - self._disorder - NEARBY))
        if end == begin or (end - begin < self._at_once and not last):
            return
        identities = self._rows[:, MODE3].astype(np.int64)
        levels = self._rows[:, ALTITUDE] / FLIGHT_LEVEL
        garbled = garbled_altitudes(np.round(levels, 6), identities, self._codes, times)[begin:end]
        rows = self._rows[begin:end]
        yield Recording(
            times=rows[:, TIME],
            ranges=rows[:, RANGE],
            azimuths=rows[:, AZIMUTH],
            identities=identities[begin:end],
            altitudes=rows[:, ALTITUDE],
            garbled=garbled | (rows[:, DOUBTFUL] > 0),
            lines=rows[:, LINE].astype(np.int64),
            addresses=rows[:, ADDRESS].astype(np.int64),
            sources=rows[:, AIRCRAFT].astype(np.int64) if self._sources else None,
            name=self._name,
        )
        kept = int(np.searchsorted(times, times[end - 1] - NEARBY))
        self._rows, self._done = self._rows[kept:], end - kept

    def together(self, rows: Array) -> Recording:
        """All plots, of all rows."""
        found = next(self.take(rows, last=True), None)
        return replace(found or Recording([], [], [], name=self._name), notes=dict(self._notes))  # type: ignore[arg-type]

    def _note(self, what: str, count: int) -> None:
        if count:
            self._notes[what] += count

    def _possible(self, rows: Array) -> Array:
        """Rows that are plots; altitudes that cannot be are missing."""
        blank = np.isnan(rows[:, : AZIMUTH + 1]).any(axis=1)
        # as in tables 4.5 to 4.8 of the thesis, between groups
        zeros = (rows[:, RANGE] == 0) & (rows[:, AZIMUTH] == math.pi / 2) & (rows[:, MODE3] == UNDECODED)
        zeros &= np.nan_to_num(rows[:, ALTITUDE]) == 0
        possible = (rows[:, RANGE] >= 0) & (rows[:, RANGE] <= _FARTHEST) & (np.abs(rows[:, AZIMUTH]) <= _TURNS)
        possible &= np.abs(rows[:, TIME]) <= _LATEST
        if self._clock:
            possible &= rows[:, TIME] <= DAY
        high = np.abs(rows[:, ALTITUDE]) > _HIGHEST
        if high.any():
            self._note("altitudes that cannot be, taken for missing", int(high.sum()))
            rows = rows.copy()
            rows[high, ALTITUDE] = np.nan
        self._note(BLANK, int(blank.sum()))
        self._note("rows of zeros left out", int((zeros & ~blank).sum()))
        self._note(IMPOSSIBLE, int((~possible & ~blank).sum()))
        return rows[possible & ~blank & ~zeros]

    def _sort_in(self, rows: Array) -> None:
        """Sort rows in by time, without those that come too late, and repeated ones."""
        if not len(rows):
            return
        late = np.maximum(np.maximum.accumulate(rows[:, TIME]), self._latest) - rows[:, TIME]
        if self._strict and (late > self._disorder).any():
            row = int(np.argmax(late > self._disorder))
            raise InvalidInputError(
                f"{self._strict}: line {rows[row, LINE]:.0f}: the time jumps back by {late[row]:.6g} s, expected at "
                f"most {self._disorder:g} s; split the file there (from Python: or allow more with max_disorder)"
            )
        if self._strict:
            # in other files plots come by sectors and are seldom in order
            self._note("late plots sorted in", int((late > 0).sum()))
        self._latest = max(self._latest, float(rows[:, TIME].max()))
        too_late = late > self._disorder
        self._note(f"plots left out that came more than {self._disorder:g} s late", int(too_late.sum()))
        rows = np.concatenate([self._rows, rows[~too_late]])
        rows = rows[np.argsort(rows[:, TIME], kind="stable")]
        again, exact = repeated(rows)
        self._note("repeated rows left out", int(exact.sum()))
        self._note(f"repeated rows left out, with times up to {TWIN:g} s later", int((again & ~exact).sum()))
        self.count += len(rows) - len(self._rows) - int(again.sum())
        self._rows = rows[~again] if again.any() else rows


def repeated(rows: Array) -> tuple[Array, Array]:
    """Whether a row, in the order of time, repeats one up to `TWIN` seconds before it; and at the same time."""
    again, exact = np.zeros((2, len(rows)), dtype=np.bool_)
    keys = rows[:, [ADDRESS, AIRCRAFT, ALTITUDE, MODE3, AZIMUTH, RANGE]]
    # missing values are equal to one another only
    keys[:, 2] = np.nan_to_num(keys[:, 2], nan=-math.inf)
    order = np.lexsort(keys.T)
    later = np.diff(rows[order, TIME])
    keys = keys[order]
    same = (keys[1:] == keys[:-1]).all(axis=1) & (later <= TWIN)
    again[order[1:][same]] = True
    exact[order[1:][same & (later == 0)]] = True
    return again, exact


def seconds_in(times: Array, azimuths: Array) -> float:
    """The seconds in one step of numbers that may be times in milliseconds, or finer, of an epoch or of the day.

    Times of an epoch are told by their size. Whole numbers that may be either are milliseconds of the day if the
    antenna turns by them: a turn of seconds would be one of milliseconds then, which fits no plots.
    """
    known = np.isfinite(times) & np.isfinite(azimuths)
    times, azimuths = times[known][:_TRIED], azimuths[known][:_TRIED]
    if not len(times):
        return 1.0
    usual = float(np.median(np.abs(times)))
    for least, step in _EPOCHS:
        if usual >= least:
            return step
    if len(times) < _ENOUGH or not DAY < usual < 1e3 * DAY or (times != np.round(times)).any():
        return 1.0
    try:
        estimate_rotation(Recording(np.maximum.accumulate(times) * 1e-3, np.ones(len(times)), azimuths))
    except InvalidInputError:
        return 1.0
    return 1e-3
