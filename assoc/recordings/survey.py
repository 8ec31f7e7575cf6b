"""What must be known of a whole recording before it is tracked, and its plots in a temporary file."""

from __future__ import annotations

import math
import tempfile
import weakref
from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from assoc._types import Array
from assoc.errors import LimitExceededError
from assoc.recordings.recording import RECORDED, Recording, in_words

CELLS = 72
"""Sectors in which bearings are counted."""
# more distinct values than this are no steps
_MOST_STEPS = 400_000


class Survey:
    """Counts over the plots of a recording, in parts or at once.

    Number of plots, first and last time (s), farthest range (m); distinct ``ranges`` (m) and ``bearings`` (rad), empty
    if there are too many; plots by bearing, ``sectors`` (72,); ``high``: plots with an altitude that is not garbled.
    """

    def __init__(self, parts: Iterable[Recording] = ()) -> None:
        self.count = self.high = 0
        self.first, self.last, self.farthest = math.nan, math.nan, 0.0
        self.ranges = self.bearings = np.zeros(0)
        self.sectors = np.zeros(CELLS, dtype=np.int64)
        self.named = self.coded = False
        self._garbled = self._missing = self._undecoded = 0
        self._identities = np.zeros(0, dtype=np.int64)
        for part in parts:
            self.add(part)

    def add(self, part: Recording) -> None:
        """Count the plots that follow."""
        if not len(part):
            return
        self.first = self.first if self.count else float(part.times[0])
        self.count, self.last = self.count + len(part), float(part.times[-1])
        self.farthest = max(self.farthest, float(part.ranges.max()))
        bearings = part.bearings
        self.ranges = _distinct(self.ranges, part.ranges, self.count)
        self.bearings = _distinct(self.bearings, bearings, self.count)
        self.sectors += np.bincount((bearings / (2 * math.pi) * CELLS).astype(np.int64) % CELLS, minlength=CELLS)
        self.high += int(np.isfinite(part.trusted_altitudes).sum())
        self._garbled += int(part.garbled.sum())
        self._missing += int(np.isnan(part.altitudes).sum())
        self._undecoded += int((~part.decoded).sum())
        self._identities = np.union1d(self._identities, part.identities[part.decoded])
        self.coded |= bool(part.decoded.any())
        self.named |= self.coded or part.sources is not None

    def summary(self, notes: Mapping[str, int]) -> str:
        """Contents and defects in a few lines."""
        if not self.count:
            return "no plots"
        counts = self.count, len(self._identities), self._undecoded, self._garbled, self._missing
        return in_words(self.last - self.first, counts, notes)


def _distinct(known: Array, values: Array, count: int) -> Array:
    if count > len(values) and not len(known):
        return known  # there were too many
    found = np.union1d(known, values)
    return found if len(found) <= _MOST_STEPS else np.zeros(0)


class StoredPlots:
    """Plots, given in parts in the order of time, in a temporary file; read again part by part; with their `Survey`."""

    def __init__(self, parts: Iterable[Recording]) -> None:
        self.survey = Survey()
        self.sourced = self.addressed = False
        self._file = tempfile.TemporaryFile()
        weakref.finalize(self, self._file.close)
        self._sizes: list[int] = []
        self._name = ""
        try:
            for part in parts:
                self.survey.add(part)
                self.sourced, self._name = part.sources is not None, part.name
                self.addressed |= bool(part.addresses.any())
                sources = np.full(len(part), -1) if part.sources is None else part.sources
                columns = [*(getattr(part, name) for name in RECORDED), sources]
                np.stack(columns, dtype=np.float64, casting="unsafe").tofile(self._file)
                self._sizes.append(len(part))
        except OSError as error:
            raise LimitExceededError(
                f"plots cannot be kept in {tempfile.gettempdir()} ({error.strerror or error}); "
                "set TMPDIR to a folder with more room"
            ) from None

    def __len__(self) -> int:
        return self.survey.count

    def __iter__(self) -> Iterator[Recording]:
        at = 0
        for size in self._sizes:
            # several readers may be at different places
            self._file.seek(at)
            content = np.fromfile(self._file, np.float64, (len(RECORDED) + 1) * size).reshape(-1, size)
            at = self._file.tell()
            columns = dict(zip(RECORDED, content[:-1], strict=True))
            for name in ("identities", "lines", "addresses"):
                columns[name] = columns[name].astype(np.int64)
            columns["garbled"] = columns["garbled"] > 0
            sources = content[-1].astype(np.int64) if self.sourced else None
            yield Recording(**columns, sources=sources, name=self._name)
