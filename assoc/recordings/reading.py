"""Radar plots from a CSV or Parquet file, whole or in parts."""

from __future__ import annotations

import csv
import itertools
import math
import os
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from assoc._files.reading import kind_of, read_lines, readable, refuse_pipe
from assoc._system.imports import check_extra
from assoc._system.wrong_types import explains_wrong_types
from assoc._text.plain import one_line
from assoc._types import Array
from assoc.errors import InvalidInputError, LimitExceededError, warn
from assoc.recordings.altitude import GARBLED_CODES
from assoc.recordings.cleaning import (
    ALTITUDE,
    AZIMUTH,
    BLANK,
    IMPOSSIBLE,
    MAX_DISORDER,
    RANGE,
    TIME,
    WIDTH,
    Cleaning,
    seconds_in,
)
from assoc.recordings.columns import UNITS, choose, not_read, unit_of
from assoc.recordings.recording import Recording, joined
from assoc.recordings.table_rows import TableRows

MOST_PLOTS = 20_000_000
# metres: no radar of plots sees farther; and plots from which on bearings within 2 pi degrees are no chance
_REACH, _ENOUGH = 1.5e6, 10


@explains_wrong_types
def read_plots(
    path: str | os.PathLike[str],
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    max_disorder: float = MAX_DISORDER,
    garbled_codes: Array | None = None,
) -> Recording:
    """Read radar plots from a CSV file with a header line, or from the same table in a Parquet file.

    Needed are columns for time, range and bearing; Mode 3, altitude and (from a simulation) aircraft are read
    where they are there. Separators are commas, semicolons or tabs; with the last two a comma may stand for the decimal
    point. Lines that begin with # are comments, a line ``sep=;`` and a row of units below the header are understood.
    Text that is not UTF-8 is taken for Windows-1252.

    Parameters
    ----------
    path : path-like
    columns : mapping of str to str, optional
        Names of the columns for "time", "range", "bearing", "mode3", "altitude", "aircraft", where they are not
        the usual ones (`assoc.recordings.columns.COLUMNS`).
    units : mapping of str to str, optional
        Of "time" (s, ms), "range" (nmi, km, m), "bearing" (deg, rad) and "altitude" (fl, ft, m), and of the codes of
        "mode3": dec, the 12 bits as a number, or oct, their octal digits. By default the end of the column's name
        (range_km) or a row of units, else seconds, nautical miles, degrees, flight levels and dec, for a column squawk
        oct. Times in milliseconds are also known by their size, or by the antenna's turns.
    max_disorder : float, default 30
        Plots up to this many seconds late are sorted in. A plot whose time is further from those before and after it
        is left out; where times jump back for good, that is an error with its line.
    garbled_codes : array_like of int, optional
        Flight levels that are taken for garbled answers (default `GARBLED_CODES`).

    Returns
    -------
    Recording
        In the order of time. Its notes count what was corrected and left out (`assoc.recordings.cleaning`), invalid
        codes, midnights passed, and name the columns that were not read.

    Raises
    ------
    InvalidInputError
        The file cannot be read as such a table; the message begins with the path and names the line.
    """
    return PlotReader(path, columns, units, max_disorder, garbled_codes).together()


class PlotReader:
    """The plots of a file in parts, in the order of time, so that memory does not grow with the file.

    Arguments are as for `read_plots`, ``notes`` as those of a `Recording`; they are complete after the last part.
    About ``at_once`` rows are read at a time.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        columns: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        max_disorder: float = MAX_DISORDER,
        garbled_codes: Array | None = None,
        *,
        at_once: int = 50_000,
    ) -> None:
        if not 0 <= max_disorder < math.inf:
            raise InvalidInputError(f"max_disorder: expected seconds >= 0, got {max_disorder!r}")
        self.file = Path(path)
        self.notes: dict[str, int] = {}
        self._columns, self._units = columns or {}, units or {}
        self._max_disorder, self._codes, self._at_once = max_disorder, garbled_codes, at_once

    def together(self) -> Recording:
        """All parts as one recording."""
        parts: list[Recording] = []
        for part in self:
            parts.append(part)
            if sum(map(len, parts)) > MOST_PLOTS:
                raise LimitExceededError(f"{self.file}: more than {MOST_PLOTS} plots; split the file")
        return joined(parts, self.notes, self.file.name)

    def __iter__(self) -> Iterator[Recording]:
        kind = kind_of(self.file)
        parquet = kind == "parquet"
        binary = kind == "asterix" and self.file.is_file()
        hint = "; if it is ASTERIX, assoc.integrations.asterix.read_asterix reads it" if binary else ""
        try:
            found = _frames(self.file, self._at_once) if parquet else _lines(self.file)
        except InvalidInputError as error:
            raise InvalidInputError(f"{error}{hint}") from None
        try:
            columns_of, said = choose(found.header, self._columns, self._units)
        except InvalidInputError as error:
            if len(found.header) == 1 and not hint:
                hint = "; expected columns between commas, semicolons or tabs"
            raise InvalidInputError(f"{self.file}: {error}{hint}") from None
        of_row = {
            meaning: unit_of(meaning, found.units[k]) for meaning, k in columns_of.items() if k < len(found.units)
        }
        said = {**{meaning: unit for meaning, unit in of_row.items() if unit}, **said}
        units = {meaning: said.get(meaning, next(iter(known))) for meaning, known in UNITS.items()}
        scale = {meaning: UNITS[meaning][unit] for meaning, unit in units.items()}
        table = TableRows(self.file, columns_of, found.header, scale, found.separator, self._at_once)
        notes = Counter[str]()
        if left := not_read(found.header, columns_of):
            notes[f"columns not read ({left})"] = len(found.header) - len(columns_of)
        clean, doubts, step = None, _Doubts(units, "range" in said, self.file, table), scale["time"]
        for rows in table.of_frames(found.content) if parquet else table.of_lines(found.content, found.done):
            doubts.see(rows)
            with np.errstate(over="ignore"):
                rows[:, RANGE] *= scale["range"]
                rows[:, AZIMUTH] = math.pi / 2 - rows[:, AZIMUTH] * scale["bearing"]
                rows[:, ALTITUDE] *= scale["altitude"]
            clock = bool(table.clock)
            if clean is None:
                garbled = () if units["altitude"] != "fl" else GARBLED_CODES if self._codes is None else self._codes
                clean = Cleaning(
                    self.file.name, notes, clock=clock, disorder=self._max_disorder, codes=garbled,
                    sources="aircraft" in columns_of, at_once=self._at_once, strict=str(self.file),
                )  # fmt: skip
                if not clock and "time" not in said:
                    step = seconds_in(rows[:, TIME], rows[:, AZIMUTH])
            rows[:, TIME] *= 1.0 if clock else step
            yield from clean.take(rows)
        if clean is not None:
            yield from clean.take(np.zeros((0, WIDTH)), last=True)
        if clean is None or not clean.count:
            why = "; ".join(f"{count} {what}" for what, count in notes.items() if what in (BLANK, IMPOSSIBLE))
            raise InvalidInputError(f"{self.file}: holds no plots{': ' + why if why else ''}")
        doubts.tell()
        if table.unread:
            notes["invalid codes"] = table.unread
        if step != scale["time"]:
            notes[f"times read in steps of {step:g} s"] = clean.count
        self.notes = dict(notes)


class _Found(NamedTuple):
    """The beginning of a file, and what follows it: lines of text, or tables."""

    header: list[str]
    separator: str
    content: Iterator[Any]
    done: int
    """Lines so far."""
    units: list[str]
    """Cells of a row of units below the header."""


def _lines(file: Path) -> _Found:
    """Header and further lines of a CSV file; comments before the header are skipped, unless one is the header."""
    lines, done, comment, separator = read_lines(file, fallback="cp1252"), 0, "", ""
    for head in lines:
        done += 1
        if head.lower().startswith("sep=") and len(head.strip()) == 5:
            separator = head.strip()[-1]
        elif head.startswith("#"):
            comment = head.lstrip("# ")
        elif head.strip():
            break
    else:
        raise InvalidInputError(f"{file}: has no header line, expected column names such as time,range,bearing")
    if comment and head.lstrip(' "')[:1].isdigit():
        lines, head, done = itertools.chain([head], lines), comment, done - 1
    separator = separator or max(",;\t", key=head.count)
    try:
        header = next(csv.reader([head], delimiter=separator))
        below = next(lines, None)
        cells = [] if below is None else next(csv.reader([below], delimiter=separator), [])
    except (csv.Error, TypeError) as error:
        raise InvalidInputError(f"{file}: line {done}: {error}") from None
    # a row of units has no digits
    named = any(unit_of(meaning, cell) for cell in cells for meaning in UNITS)
    if named and not any(sign.isdigit() for sign in below or ""):
        return _Found(header, separator, lines, done + 1, cells)
    return _Found(header, separator, lines if below is None else itertools.chain([below], lines), done, [])


def _frames(file: Path, at_once: int) -> _Found:
    """Column names of a Parquet file, and its rows in parts."""
    check_extra("pyarrow", "parquet")
    from pyarrow import parquet

    refuse_pipe(file)
    with readable(file), open(file, "rb"):
        pass

    def frames() -> Iterator[Any]:
        try:
            with parquet.ParquetFile(file) as opened:
                yield opened.schema_arrow.names
                for batch in opened.iter_batches(at_once):
                    # by the file's own columns: pandas may have kept one as an index
                    yield batch.to_pandas(ignore_metadata=True)
        except (ValueError, OSError) as error:
            if isinstance(error, InvalidInputError):
                raise
            raise InvalidInputError(f"{file}: is not a readable Parquet file ({one_line(error)[:100]})") from None

    content = frames()
    return _Found([str(name) for name in next(content)], ",", content, 1, [])


class _Doubts:
    """Warns of ranges, bearings and codes that are hardly in their units; refuses ranges in metres without a unit."""

    def __init__(self, units: Mapping[str, str], stated: bool, file: Path, table: TableRows) -> None:
        self._units, self._stated, self._file, self._table = units, stated, file, table
        self._count, self._farthest, self._least, self._most = 0, 0.0, math.inf, -math.inf

    def see(self, rows: Array) -> None:
        """Take in rows, in the units of the file."""
        bearings = np.abs(rows[:, AZIMUTH])
        self._count += len(rows)
        self._farthest = max(self._farthest, float(np.nanmax(rows[:, RANGE], initial=0.0)))
        self._least = min(self._least, float(np.nanmin(bearings, initial=math.inf)))
        self._most = max(self._most, float(np.nanmax(bearings, initial=-math.inf)))
        known = rows[np.isfinite(rows[:, RANGE]), RANGE]
        far = len(known) >= _ENOUGH and np.median(known) * UNITS["range"][self._units["range"]] > _REACH
        # radars that watch satellites see as far: if the file says so, it is so
        if far and not self._stated:
            raise InvalidInputError(self._too_far())

    def _too_far(self) -> str:
        unit, metres = self._units["range"], self._farthest * UNITS["range"][self._units["range"]]
        column = f"{self._file}: column {self._table.names['range']!r}"
        told = "metres? (name the column range_m, or set the unit of range to m)"
        return f"{column}: {self._farthest:.6g} {unit} are {metres / 1000:,.0f} km: {told}"

    def tell(self) -> None:
        """Warn, once all rows are seen."""
        names, not_octal = self._table.names, self._table.not_octal
        if self._units["range"] != "m" and self._farthest * UNITS["range"][self._units["range"]] > _REACH:
            warn(self._too_far())
        wide = self._most - self._least > 3.0 and self._most <= 6.2832
        if self._units["bearing"] == "deg" and self._count >= _ENOUGH and wide:
            warn(
                f"{self._file}: column {names['bearing']!r}: all within {self._most:.3g} deg: radians? "
                "(name the column bearing_rad, or set the unit of bearing to rad)"
            )
        if not_octal:
            warn(
                f"{self._file}: column {names['mode3']!r}: {not_octal} codes have an 8 or 9, which octal digits "
                "cannot have: the 12 bits as a number? (name the column mode3_dec, or set the unit of mode3 to dec)"
            )
