"""The plots of an ASTERIX file part by part."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.integrations.asterix.reading import Decoded, Source, recording_of
from assoc.recordings.altitude import NEARBY
from assoc.recordings.recording import Recording


class AsterixPlots:
    """The plots of one radar in a file in parts, in the order of time, so that memory grows by the file's bytes alone.

    Parameters
    ----------
    path : path-like
    radar : str, optional
        SAC/SIC of the radar; needed if the file has plots of several.
    label : str
        What gives the radar, for errors.
    at_once : int
        About how many plots a part has.

    Attributes
    ----------
    notes : dict of str to int
        As those of `AsterixContent`, and plots that came too late; complete after the last part.
    """

    def __init__(
        self, path: str | os.PathLike[str], radar: str | None = None, label: str = "radar", *, at_once: int = 50_000
    ) -> None:
        self._path, self._radar, self._label, self._at_once = path, radar, label, at_once
        self.notes: dict[str, int] = {}

    def __iter__(self) -> Iterator[Recording]:
        read, name = Decoded(), os.path.basename(os.fspath(self._path))
        self.notes = read.notes
        waiting = _Waiting(name, read.notes)
        for _ in read.blocks(self._path):
            for source, rows in read.plots.items():
                if self._radar not in (None, _name(source)) or len(read.plots) > 1 and self._radar is None:
                    rows.rows = []
                elif len(rows.rows) >= self._at_once:
                    yield from waiting.of(rows.taken(read.notes, last=False), last=False)
        read.check(self._path)
        chosen = chosen_radar(self._path, read.plots, self._radar, self._label)
        yield from waiting.of(read.plots[chosen].taken(read.notes, last=True), last=True)


def chosen_radar(path: str | os.PathLike[str], plots: Iterable[Source], radar: str | None, label: str) -> Source:
    """The radar of a file whose plots are wanted: the only one, or that named SAC/SIC."""
    known = {_name(source): source for source in sorted(plots)}
    if not known:
        raise InvalidInputError(f"{os.fspath(path)}: holds no plots (categories 001, 010, 020, 048)")
    if radar not in known and (radar is not None or len(known) > 1):
        raise InvalidInputError(f"{label}: the file holds plots of {', '.join(known)}; name one")
    return known[radar or next(iter(known))]


def _name(source: Source) -> str:
    return f"{source[0]}/{source[1]}"


_LATEST = 101
"""Plots whose median time is that of a part's end."""


class _Waiting:
    """Plots that wait for those before them, and for those after them by which garbled altitudes are found."""

    def __init__(self, name: str, notes: dict[str, int]) -> None:
        self._name, self._notes = name, notes
        self._rows = np.zeros((0, 7))
        self._done = 0
        """Rows that are given, and kept for those after them."""

    def of(self, new: Array, *, last: bool) -> Iterator[Recording]:
        """Take rows in, and yield the plots that are complete."""
        rows = new.reshape(-1, 7)
        given = float(self._rows[self._done - 1, 0]) if self._done else -math.inf
        # the usual time of the latest: single wrong ones must not make all others late
        now = float(np.median(rows[-_LATEST:, 0])) if len(rows) else given
        late = rows[:, 0] < given
        if late.any():
            what = f"plots left out that came more than {NEARBY:g} s late"
            self._notes[what] = self._notes.get(what, 0) + int(late.sum())
        rows = np.concatenate([self._rows, rows[~late]])
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        times, begin = rows[:, 0], self._done
        end = len(rows) if last or not len(rows) else int(np.searchsorted(times, now - NEARBY))
        if end > begin:
            yield recording_of(rows, self._name, self._notes).take(np.arange(begin, end))
        kept = int(np.searchsorted(times, times[end - 1] - NEARBY)) if end else 0
        self._rows, self._done = rows[kept:], max(end, begin) - kept
