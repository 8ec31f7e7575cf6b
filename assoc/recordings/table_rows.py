"""Rows of radar plots in a CSV or Parquet file: cells as numbers, errors by line."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.recordings.cleaning import ADDRESS, AIRCRAFT, DOUBTFUL, LINE, MODE3, WIDTH
from assoc.recordings.columns import BLANKS, COLUMNS, code, level, number, seconds, whole
from assoc.recordings.recording import UNDECODED

if TYPE_CHECKING:
    import pandas as pd

_BLANKS = frozenset(BLANKS)


class TableRows:
    """Makes rows of a file into arrays (n, `WIDTH`) of its numbers in their units, NaN where a cell is blank.

    ``scale`` are the units' factors by meaning, for codes the base of their digits.
    """

    def __init__(
        self,
        file: Path,
        columns_of: Mapping[str, int],
        header: list[str],
        scale: Mapping[str, float],
        separator: str,
        at_once: int,
    ) -> None:
        self.file, self._at_once = file, at_once
        self.columns_of = columns_of
        self.scale, self.base, self.separator = scale, scale["mode3"], separator
        self.decimal = "." if separator == "," else ","
        self.names = {meaning: header[index].strip()[:30] for meaning, index in columns_of.items()}
        self.unread = self.not_octal = 0
        self.clock: bool | None = None

    def of_lines(self, lines: Iterator[str], done: int) -> Iterator[Array]:
        """The rows of the lines that follow the first ones, of which there are ``done``."""
        while block := list(islice(lines, self._at_once)):
            text = "".join(block)
            if '"' in text:
                # what is in quotes may reach over several lines: the rest is read cell by cell
                yield from self._slowly(chain(block, lines), done)
                return
            found = self._quickly(text, len(block), done)
            yield from self._slowly(block, done) if found is None else (found,)
            done += len(block)

    def of_frames(self, frames: Iterator[pd.DataFrame]) -> Iterator[Array]:
        """The rows of tables."""
        done = 1
        for frame in frames:
            chosen = frame.iloc[:, list(self.columns_of.values())]
            found = None
            if all(kind.kind in "iu" or kind == np.float64 for kind in chosen.dtypes):
                found = self._checked(chosen.to_numpy(dtype=np.float64), done)
            if found is None:
                yield from self._slowly(io.StringIO(frame.to_csv(index=False, header=False)), done)
            else:
                yield found
            done += len(frame)

    def _quickly(self, text: str, count: int, done: int) -> Array | None:
        """Rows of plain numbers; None if there is anything else in them."""
        import pandas as pd

        text = text.replace("\r\n", "\n")
        if self.clock or "\r" in text or "#" in text:
            return None
        # later versions read numbers exactly, and warn of the argument
        exact: Any = (
            {"float_precision": "round_trip"} if tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1) else {}
        )
        try:
            frame = pd.read_csv(
                io.StringIO(text), header=None, sep=self.separator, decimal=self.decimal, dtype=np.float64,
                usecols=list(self.columns_of.values()), na_values=list(BLANKS), keep_default_na=False,
                quoting=csv.QUOTE_NONE, **exact,
            )  # fmt: skip
        except (ValueError, OverflowError):
            return None
        return self._checked(frame[list(self.columns_of.values())].to_numpy(), done) if len(frame) == count else None

    def _checked(self, given: Array, done: int) -> Array | None:
        """Rows (n, `WIDTH`) of given columns (n, c), if they need no look at single cells."""
        rows = np.full((len(given), WIDTH), np.nan)
        rows[:, [MODE3, AIRCRAFT, ADDRESS, DOUBTFUL]] = UNDECODED, -1.0, 0.0, 0.0
        meanings = list(COLUMNS)
        for column, meaning in zip(given.T, self.columns_of, strict=True):
            empty = {"mode3": float(UNDECODED), "aircraft": -1.0}.get(meaning, np.nan)
            rows[:, meanings.index(meaning)] = np.where(np.isnan(column), empty, column)
        rows[:, LINE] = done + 1 + np.arange(len(rows))
        mode3, aircraft = rows[:, MODE3], rows[:, AIRCRAFT]
        usual = ~np.isinf(given).any(axis=1)
        usual &= (mode3 >= 0) & (mode3 < 2.0**53) & (mode3 == np.floor(mode3))
        usual &= (aircraft >= -1) & (aircraft < 2.0**53) & (aircraft == np.floor(aircraft))
        if not usual.all() or self.clock:
            return None
        if self.base == 8:
            digits = mode3.astype(np.int64)[:, None] // 10 ** np.arange(4) % 10
            if (mode3 > 7777).any() or (digits > 7).any():
                return None
            rows[:, MODE3] = digits @ 8 ** np.arange(4)
        self.clock = False
        return rows

    def _slowly(self, lines: Iterable[str], done: int) -> Iterator[Array]:
        """The rows of any lines, cell by cell; errors name the line."""
        cells_of = csv.reader(lines, delimiter=self.separator)
        rows: list[tuple[float, ...]] = []
        try:
            for cells in cells_of:
                line = cells_of.line_num + done
                row = self._row(cells, line)
                if row is not None:
                    rows.append((*row, 0.0, 0.0, line))
                if len(rows) >= self._at_once:
                    yield np.array(rows)
                    rows = []
        except csv.Error as error:
            raise InvalidInputError(f"{self.file}: line {cells_of.line_num + done}: {error}") from None
        if rows:
            yield np.array(rows)

    def _row(self, cells: list[str], line: int) -> tuple[float, ...] | None:
        """The values of a row; None of an empty one or a comment."""
        if not any(cell.strip() for cell in cells) or cells[0].lstrip().startswith("#"):
            return None
        row = {}
        for meaning, index in self.columns_of.items():
            text = cells[index].strip() if index < len(cells) else ""
            text = "" if text in _BLANKS else text.replace(self.decimal, ".")
            try:
                row[meaning] = self._value(meaning, text)
            except (ValueError, OverflowError):
                raise self._error(line, meaning, self._expected(meaning), text) from None
        defaults = {"aircraft": -1.0, "mode3": float(UNDECODED)}
        return tuple(row.get(meaning, defaults.get(meaning, math.nan)) for meaning in COLUMNS)

    def _value(self, meaning: str, text: str) -> float:
        if meaning == "mode3":
            try:
                return float(code(text, self.base))
            except (ValueError, OverflowError):
                self.unread += 1
                self.not_octal += self.base == 8 and ("8" in text or "9" in text)
                return float(UNDECODED)
        if meaning == "aircraft":
            return float(whole(text)) if text else -1.0
        if not text:
            return math.nan
        if meaning == "time":
            value, clock = seconds(text)
            if self.clock not in (None, clock):
                raise ValueError(text)
            self.clock = clock
            return value
        return level(text, self.scale["altitude"]) if meaning == "altitude" else number(text)

    def _expected(self, meaning: str) -> str:
        if meaning == "time":
            kind = {None: "seconds, h:mm:ss or an ISO date", True: "h:mm:ss", False: "seconds or an ISO date"}
            return kind[self.clock]
        return "a whole number" if meaning == "aircraft" else "a number"

    def _error(self, line: int, meaning: str, expected: str, text: str) -> InvalidInputError:
        name = self.names[meaning]
        return InvalidInputError(f"{self.file}: line {line}, column {name!r}: expected {expected}, got {text[:60]!r}")
