"""Radar plots from a CSV or Parquet file, whole or in parts."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._files.reading import read_lines, readable, refuse_pipe
from assoc._system.imports import check_extra
from assoc._system.wrong_types import explains_wrong_types
from assoc._text.plain import one_line
from assoc._types import Array
from assoc.errors import InvalidInputError, LimitExceededError, warn
from assoc.recordings.altitude import GARBLED_CODES, NEARBY, garbled_altitudes
from assoc.recordings.columns import COLUMNS, UNITS, choose
from assoc.recordings.recording import Recording, joined
from assoc.recordings.running_times import RunningTimes
from assoc.recordings.table_rows import AIRCRAFT, ALTITUDE, BEARING, MODE3, RANGE, TIME, TableRows

if TYPE_CHECKING:
    import pandas as pd

MAX_DISORDER = 30.0
"""Plots up to this late (s) are sorted in; where several in a row are later, that is an error."""

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
    point. Text that is not UTF-8 is taken for Windows-1252.

    Parameters
    ----------
    path : path-like
    columns : mapping of str to str, optional
        Names of the columns for "time", "range", "bearing", "mode3", "altitude", "aircraft", where they are not
        the usual ones (`assoc.recordings.columns.COLUMNS`).
    units : mapping of str to str, optional
        Of "range" (nmi, km, m), "bearing" (deg, rad) and "altitude" (fl, ft, m), and of the codes of "mode3": dec, the
        12 bits as a number, or oct, their octal digits. By default the end of the column's name (range_km), else
        nautical miles, degrees, flight levels and dec, for a column squawk oct.
    max_disorder : float, default 30
        Plots up to this many seconds late are sorted in. A plot whose time is further from those before and after it
        is left out; where times jump back for good, that is an error with its line.
    garbled_codes : array_like of int, optional
        Flight levels that are taken for garbled answers (default `GARBLED_CODES`).

    Returns
    -------
    Recording
        In the order of time. Its notes count late rows (sorted in), rows left out (repeated ones, those of zeros, which
        are fillers, and those without a time, range or bearing), invalid codes, and midnights passed.

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
        parquet = self.file.suffix.lower() == ".parquet"
        found: tuple[list[str], str, Any] = _frames(self.file, self._at_once) if parquet else _lines(self.file)
        header, separator, content = found
        try:
            columns_of, units = choose(header, self._columns, self._units)
        except InvalidInputError as error:
            raise InvalidInputError(f"{self.file}: {error}") from None
        table = TableRows(self.file, columns_of, header, UNITS["mode3"][units["mode3"]], separator, self._at_once)
        order = _Order(self.file, self._max_disorder)
        plots = _Plots(self.file.name, units, "aircraft" in columns_of, self._codes, self._at_once)
        times = None
        for rows in table.of_frames(content) if parquet else table.of_lines(content):
            if times is None:
                times = RunningTimes(max(self._max_disorder, MAX_DISORDER), bool(table.clock))
            yield from plots.of(order.take(times.take(rows)), last=False)
        if times is not None:
            yield from plots.of(order.take(times.rest(len(COLUMNS) + 1)), last=False)
        if not order.count:
            why = f": {table.blank} rows have no time, range or bearing" if table.blank else ""
            raise InvalidInputError(f"{self.file}: holds no plots{why}")
        yield from plots.of(order.rest(), last=True)
        plots.doubt_units(self.file, table.names)
        self.notes = {
            "late plots sorted in": order.late,
            "repeated rows left out": order.repeated,
            "rows of zeros left out": table.fillers,
            "rows without time, range or bearing left out": table.blank,
            "invalid codes": table.unread,
            "midnights passed": 0 if times is None else times.midnights,
            "plots left out whose time no other supports": 0 if times is None else times.left_out,
        }


def _lines(file: Path) -> tuple[list[str], str, Iterator[str]]:
    """Header, separator and further lines of a CSV file."""
    lines = read_lines(file, fallback="cp1252")
    head = next(lines, "")
    if not head.strip():
        raise InvalidInputError(f"{file}: has no header line, expected column names such as time,range,bearing")
    separator = max(",;\t", key=head.count)
    try:
        return next(csv.reader([head], delimiter=separator)), separator, lines
    except csv.Error as error:
        raise InvalidInputError(f"{file}: line 1: {error}") from None


def _frames(file: Path, at_once: int) -> tuple[list[str], str, Iterator[pd.DataFrame]]:
    """Column names of a Parquet file, the separator of its rows as CSV, and its rows in parts."""
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
    return [str(name) for name in next(content)], ",", content


class _Order:
    """Sorts rows by time that may be late, and leaves repeated ones out."""

    def __init__(self, file: Path, max_disorder: float) -> None:
        self._file, self._max_disorder = file, max_disorder
        self._waiting = np.zeros((0, len(COLUMNS) + 1))
        self._latest = -math.inf
        self.count = self.late = self.repeated = 0

    def take(self, rows: Array) -> Array:
        """Take rows in, and return those before which none can come any more."""
        if not len(rows):
            return rows
        times = rows[:, TIME]
        late = np.maximum(np.maximum.accumulate(times), self._latest) - times
        if (late > self._max_disorder).any():
            row = int(np.argmax(late > self._max_disorder))
            raise InvalidInputError(
                f"{self._file}: line {rows[row, -1]:.0f}: the time jumps back by {late[row]:.6g} s, expected at "
                f"most {self._max_disorder:g} s; split the file there (from Python: or allow more with max_disorder)"
            )
        self.count += len(rows)
        self.late += int((late > 0).sum())
        self._latest = max(self._latest, float(times.max()))
        self._waiting = np.concatenate([self._waiting, rows])
        return self._out(self._latest - self._max_disorder)

    def rest(self) -> Array:
        """The last rows."""
        return self._out(math.inf)

    def _out(self, end: float) -> Array:
        rows = self._waiting[np.argsort(self._waiting[:, TIME], kind="stable")]
        cut = int(np.searchsorted(rows[:, TIME], end))
        self._waiting, rows = rows[cut:], rows[:cut]
        same = np.flatnonzero(np.diff(rows[:, TIME]) == 0)
        if len(same):
            # missing values are equal to one another only
            twins = np.union1d(same, same + 1)
            _, first = np.unique(np.nan_to_num(rows[twins, :-1], nan=-math.inf), axis=0, return_index=True)
            again = np.delete(twins, first)
            self.repeated += len(again)
            rows = np.delete(rows, again, axis=0)
        return rows


class _Plots:
    """Makes sorted rows into recordings, and flags garbled altitudes by the plots before and after."""

    def __init__(self, name: str, units: Mapping[str, str], sources: bool, codes: Array | None, at_once: int) -> None:
        self._name, self._units, self._sources, self._at_once = name, units, sources, at_once
        self._codes = () if units["altitude"] != "fl" else GARBLED_CODES if codes is None else codes
        self._rows = np.zeros((0, len(COLUMNS) + 1))
        self._done = self._count = 0
        self._farthest, self._least, self._most = 0.0, math.inf, -math.inf

    def of(self, rows: Array, *, last: bool) -> Iterator[Recording]:
        """Take rows in, and yield the plots that can be judged."""
        self._rows = np.concatenate([self._rows, rows])
        times, begin = self._rows[:, TIME], self._done
        end = len(times) if last or not len(times) else int(np.searchsorted(times, times[-1] - NEARBY))
        if end == begin or (end - begin < self._at_once and not last):
            return
        scale = {meaning: UNITS[meaning][unit] for meaning, unit in self._units.items()}
        levels, identities = self._rows[:, ALTITUDE], self._rows[:, MODE3].astype(np.int64)
        in_levels = levels * scale["altitude"] / UNITS["altitude"]["fl"]
        garbled = garbled_altitudes(in_levels, identities, self._codes, times)[begin:end]
        rows = self._rows[begin:end]
        self._count += len(rows)
        self._farthest = max(self._farthest, float(rows[:, RANGE].max()))
        self._least = min(self._least, float(np.abs(rows[:, BEARING]).min()))
        self._most = max(self._most, float(np.abs(rows[:, BEARING]).max()))
        yield Recording(
            times=rows[:, TIME],
            ranges=rows[:, RANGE] * scale["range"],
            azimuths=math.pi / 2 - rows[:, BEARING] * scale["bearing"],
            identities=identities[begin:end],
            altitudes=rows[:, ALTITUDE] * scale["altitude"],
            garbled=garbled,
            lines=rows[:, -1].astype(np.int64),
            sources=rows[:, AIRCRAFT].astype(np.int64) if self._sources else None,
            name=self._name,
        )
        kept = int(np.searchsorted(times, times[end - 1] - NEARBY))
        self._rows, self._done = self._rows[kept:], end - kept

    def doubt_units(self, file: Path, names: Mapping[str, str]) -> None:
        """Warn of ranges and bearings that are hardly in their units."""
        unit = self._units["range"]
        metres = self._farthest * UNITS["range"][unit]
        if unit != "m" and metres > _REACH:
            warn(
                f"{file}: column {names['range']!r}: {self._farthest:.6g} {unit} are {metres / 1000:,.0f} km: "
                "metres? (name the column range_m, or set the unit of range to m)"
            )
        wide = self._most - self._least > 3.0 and self._most <= 6.2832
        if self._units["bearing"] == "deg" and self._count >= _ENOUGH and wide:
            warn(
                f"{file}: column {names['bearing']!r}: all within {self._most:.3g} deg: radians? "
                "(name the column bearing_rad, or set the unit of bearing to rad)"
            )
