"""Times of plots as they stand in a file: clocks that run on over midnight, and times that no other plot supports."""

from __future__ import annotations

import numpy as np

from assoc._types import Array
from assoc.recordings.columns import DAY

_AGREE = 3
"""A jump in time is believed when so many plots in a row have made it."""
_LONGER = 10.0
"""At the end of a file fewer plots are believed, if the gap before them is at most this many times the longest one."""


class RunningTimes:
    """Makes the times of rows run on, and leaves out rows whose time is wrong.

    A radar's plots come in the order of time, but for some disorder. A row whose time is further off waits: it is left
    out where the next rows go on as before it, and taken where they follow it, as after a gap or at midnight. So one
    wrong time of day neither moves the plots after it by a day, nor lets them look late.

    Plots may be out of order by `disorder` seconds; with `clock` times begin anew each day. Numbers turn out to be
    seconds of the day where they go on, at midnight, as such.
    """

    def __init__(self, disorder: float, clock: bool = False) -> None:
        self.clock = clock
        self.midnights = self.left_out = 0
        self._disorder = disorder
        self._latest: float | None = None
        self._longest = 0.0
        self._waiting: list[Array] = []

    def take(self, rows: Array) -> Array:
        """Take rows (n, c) in, seconds in the first column; return those that are decided, in their order."""
        if not len(rows):
            return rows
        if not self._waiting and self._latest is not None:
            days = np.round((self._latest - rows[:, 0]) / DAY) if self.clock else np.zeros(len(rows))
            times = np.append(self._latest, rows[:, 0] + DAY * days)
            ahead = np.maximum.accumulate(times)
            # the usual case: nothing is far from what came before
            if (np.abs(times[1:] - ahead[:-1]) <= self._disorder).all():
                self._longest = max(self._longest, float(np.diff(ahead).max()))
                self.midnights += int(self.clock) * int(ahead[-1] // DAY - ahead[0] // DAY)
                self._latest = float(ahead[-1])
                return np.column_stack([times[1:], rows[:, 1:]])
        done: list[Array] = []
        for row in rows:
            self._waiting.append(row)
            self._decide(done)
        return np.array(done).reshape(len(done), rows.shape[1])

    def rest(self, columns: int) -> Array:
        """The last rows, of so many columns."""
        waiting, self._waiting = self._waiting, []
        times = [float(row[0]) for row in waiting]
        done: list[Array] = []
        if waiting and self._latest is None:
            self._accept(waiting, done)
        elif waiting:
            self.clock = self.clock or self._is_midnight(times, self._longest_gap)
            gap = self._unwrapped(times[0]) - self._at_latest
            if 0.0 <= gap <= self._longest_gap:
                self._accept(waiting, done)
            else:
                self.left_out += len(waiting)
        return np.array(done).reshape(len(done), columns)

    @property
    def _longest_gap(self) -> float:
        return _LONGER * max(self._longest, self._disorder)

    @property
    def _at_latest(self) -> float:
        assert self._latest is not None
        return self._latest

    def _decide(self, done: list[Array]) -> None:
        """Take or leave out rows that wait, the last of which is new."""
        if self._latest is None:
            self._begin(done)
            return
        new = self._waiting[-1]
        self.clock = self.clock or self._is_midnight([float(new[0])], self._disorder)
        time = self._unwrapped(float(new[0]))
        if abs(time - self._at_latest) <= self._disorder:
            # those that wait had a time of their own
            self.left_out += len(self._waiting) - 1
            self._waiting = []
            self._accept([new], done)
        elif len(self._waiting) >= _AGREE:
            self.clock = self.clock or self._is_midnight([float(row[0]) for row in self._waiting], self._longest_gap)
            waiting, self._waiting = self._waiting, []
            self._accept(waiting, done)

    def _is_midnight(self, times: list[float], longest: float) -> bool:
        """Whether numbers far back go on as seconds of the next day, after a gap of at most `longest` seconds."""
        of_day = self._at_latest <= DAY and all(0.0 <= time < DAY for time in times)
        return of_day and 0.0 <= times[0] + DAY - self._at_latest <= longest

    def _begin(self, done: list[Array]) -> None:
        """Take the first rows, but one that is far from the two others, which are together, and not after it."""
        if len(self._waiting) < _AGREE:
            return
        waiting, self._waiting = self._waiting, []
        times = np.array([row[0] for row in waiting])
        ahead = np.mod(times - times[0] + DAY / 2, DAY) - DAY / 2 if self.clock else times - times[0]
        near = self._disorder
        if abs(ahead[2] - ahead[1]) <= near and ahead[1] < -near:
            odd = [0]
        else:
            odd = [1] if abs(ahead[2]) <= near < abs(ahead[1]) else []
        self.left_out += len(odd)
        # the third is judged as those that follow it
        self._accept([row for k, row in enumerate(waiting[:2]) if k not in odd], done)
        self._waiting = waiting[2:]
        self._decide(done)

    def _accept(self, rows: list[Array], done: list[Array]) -> None:
        for row in rows:
            time = self._unwrapped(float(row[0]))
            if self._latest is not None:
                self.midnights += int(self.clock and time // DAY > self._latest // DAY)
                self._longest = max(self._longest, time - self._latest)
            self._latest = time if self._latest is None else max(self._latest, time)
            kept = row.copy()
            kept[0] = time
            done.append(kept)

    def _unwrapped(self, time: float) -> float:
        """A time of day on the day on which it is nearest to the latest one."""
        if not self.clock or self._latest is None:
            return time
        return time + DAY * round((self._latest - time) / DAY)
