"""Radar plots from a CSV or Parquet file, whole or in parts."""

from __future__ import annotations

import csv
import io
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._files.reading import read_lines, readable
from assoc._system.door import door
from assoc._system.imports import check_extra
from assoc._text.plain import one_line
from assoc._types import Array
from assoc.errors import InvalidInputError, LimitExceededError, warn
from assoc.recordings.altitude import GARBLED_CODES, NEARBY, garbled_altitudes
from assoc.recordings.columns import COLUMNS, DAY, REQUIRED, UNITS, choose, code, number, seconds, whole
from assoc.recordings.recording import UNDECODED, Recording, joined

if TYPE_CHECKING:
    import pandas as pd

MAX_DISORDER = 30.0
"""Plots up to this late (s) are sorted in; later ones are an error."""

MOST_PLOTS = 20_000_000
_FARTHEST = 1e7
# metres: no radar of plots sees farther; and plots from which on bearings within 2 pi degrees are no chance
_REACH, _ENOUGH = 1.5e6, 10
# what pandas takes for a number and `number` does not
_NO_NUMBER = re.compile(r"(^|[,;\t])[ +-]*(nan|inf)", re.IGNORECASE | re.MULTILINE)
_TIME, _RANGE, _BEARING, _MODE3, _ALTITUDE, _AIRCRAFT = range(len(COLUMNS))


@door
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
        Plots up to this many seconds late are sorted in; one that is later is an error with its line.
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
        table = _Table(self.file, columns_of, header, UNITS["mode3"][units["mode3"]], separator, self._at_once)
        order = _Order(table, self._max_disorder)
        plots = _Plots(self.file.name, units, "aircraft" in columns_of, self._codes, self._at_once)
        for rows in table.of_frames(content) if parquet else table.of_lines(content):
            yield from plots.of(order.take(rows), last=False)
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
            "midnights passed": table.midnights,
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

    with readable(file), open(file, "rb"):
        pass

    def frames() -> Iterator[Any]:
        try:
            with parquet.ParquetFile(file) as opened:
                yield opened.schema_arrow.names
                for batch in opened.iter_batches(at_once):
                    yield batch.to_pandas()
        except (ValueError, OSError) as error:
            if isinstance(error, InvalidInputError):
                raise
            raise InvalidInputError(f"{file}: is not a readable Parquet file ({one_line(error)[:100]})") from None

    content = frames()
    return [str(name) for name in next(content)], ",", content


class _Table:
    """Makes rows of a file into arrays with a column for each meaning, NaN where it is empty, and the line (n, 7)."""

    def __init__(
        self, file: Path, columns_of: Mapping[str, int], header: list[str], base: float, separator: str, at_once: int
    ) -> None:
        self.file, self._at_once = file, at_once
        self.columns_of = columns_of
        self.base, self.separator = base, separator
        self.decimal = "." if separator == "," else ","
        self.names = {meaning: header[index].strip()[:30] for meaning, index in columns_of.items()}
        self.fillers = self.midnights = self.blank = self.unread = 0
        self.clock: bool | None = None
        self.day = self.before = 0.0
        self._begun = False

    def of_lines(self, lines: Iterator[str]) -> Iterator[Array]:
        """The rows of the lines that follow the header."""
        done = 1
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
        if self.clock or "\r" in text or _NO_NUMBER.search(text):
            return None
        # later versions read numbers exactly, and warn of the argument
        exact: Any = (
            {"float_precision": "round_trip"} if tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1) else {}
        )
        try:
            frame = pd.read_csv(
                io.StringIO(text), header=None, sep=self.separator, decimal=self.decimal, dtype=np.float64,
                usecols=list(self.columns_of.values()), na_values=[""], keep_default_na=False, quoting=csv.QUOTE_NONE,
                **exact,
            )  # fmt: skip
        except (ValueError, OverflowError):
            return None
        return self._checked(frame[list(self.columns_of.values())].to_numpy(), done) if len(frame) == count else None

    def _checked(self, given: Array, done: int) -> Array | None:
        """Rows (n, 7) of given columns (n, c), if nothing in them is unusual."""
        rows = np.full((len(given), len(COLUMNS) + 1), np.nan)
        rows[:, _MODE3], rows[:, _AIRCRAFT] = UNDECODED, -1.0
        meanings = list(COLUMNS)
        for column, meaning in zip(given.T, self.columns_of, strict=True):
            empty = {"mode3": float(UNDECODED), "aircraft": -1.0}.get(meaning, np.nan)
            rows[:, meanings.index(meaning)] = np.where(np.isnan(column), empty, column)
        rows[:, -1] = done + 1 + np.arange(len(rows))
        time, distance, bearing, mode3, altitude, aircraft = rows[:, :-1].T
        usual = np.isfinite(rows[:, :_MODE3]).all(axis=1) & (np.abs(time) <= 1e12)
        usual &= (distance >= 0) & (distance <= _FARTHEST) & (np.abs(bearing) <= 1000)
        usual &= np.isnan(altitude) | (np.abs(altitude) <= _FARTHEST)
        usual &= (distance != 0) | (bearing != 0)  # which may be a filler
        usual &= (mode3 >= 0) & (mode3 < 2.0**53) & (mode3 == np.floor(mode3))
        usual &= (aircraft >= -1) & (aircraft < 2.0**53) & (aircraft == np.floor(aircraft))
        if not usual.all() or self.clock:
            return None
        if self.base == 8:
            digits = mode3.astype(np.int64)[:, None] // 10 ** np.arange(4) % 10
            if (mode3 > 7777).any() or (digits > 7).any():
                return None
            rows[:, _MODE3] = digits @ 8 ** np.arange(4)
        self.clock, self._begun = False, self._begun or len(rows) > 0
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
                    rows.append((*row, line))
                if len(rows) >= self._at_once:
                    yield np.array(rows)
                    rows = []
        except csv.Error as error:
            raise InvalidInputError(f"{self.file}: line {cells_of.line_num + done}: {error}") from None
        if rows:
            yield np.array(rows)

    def _row(self, cells: list[str], line: int) -> tuple[float, ...] | None:
        """The values of a row; None of one without a plot."""
        if not any(cell.strip() for cell in cells):
            return None
        row = {}
        for meaning, index in self.columns_of.items():
            text = cells[index].strip().replace(self.decimal, ".") if index < len(cells) else ""
            if not text and meaning in REQUIRED:
                self.blank += 1
                return None
            try:
                row[meaning] = self._value(meaning, text)
            except (ValueError, OverflowError):
                raise self._error(line, meaning, self._expected(meaning), text) from None
        if row["range"] < 0 or row["range"] > _FARTHEST:
            raise self._error(line, "range", f"0 to {_FARTHEST:g}", f"{row['range']:g}")
        if abs(row["bearing"]) > 1000 or abs(row.get("altitude", 0.0)) > _FARTHEST or abs(row["time"]) > 1e12:
            wrong = "bearing" if abs(row["bearing"]) > 1000 else "time" if abs(row["time"]) > 1e12 else "altitude"
            raise self._error(line, wrong, "a number of usual size", f"{row[wrong]:g}")
        # a row of zeros separates groups, as in tables 4.5 to 4.8 of the paper
        if all(row.get(meaning, 0.0) == 0.0 for meaning in ("range", "bearing", "mode3", "altitude")):
            self.fillers += 1
            return None
        row["time"] = self._running(row["time"])
        defaults = {"altitude": math.nan, "aircraft": -1.0, "mode3": float(UNDECODED)}
        return tuple(row.get(meaning, defaults.get(meaning, math.nan)) for meaning in COLUMNS)

    def _value(self, meaning: str, text: str) -> float:
        if meaning == "time":
            value, clock = seconds(text)
            if self.clock not in (None, clock):
                raise ValueError(text)
            self.clock = clock
            return value
        if meaning == "mode3":
            try:
                return float(code(text, self.base))
            except (ValueError, OverflowError):
                self.unread += 1
                return float(UNDECODED)
        if meaning == "aircraft":
            return float(whole(text)) if text else -1.0
        if meaning == "altitude" and not text:
            return math.nan
        return number(text)

    def _running(self, time: float) -> float:
        """Let clock times run on over midnight: a fall by more than half a day is a new day."""
        if self.clock and self._begun and time + self.day < self.before - DAY / 2:
            self.day += DAY
            self.midnights += 1
        running = time + self.day
        # a late plot of the day before
        if self.clock and self.midnights and running > self.before + DAY / 2:
            running -= DAY
        self.before = max(self.before, running) if self._begun else running
        self._begun = True
        return running

    def _expected(self, meaning: str) -> str:
        if meaning == "time":
            kind = {None: "seconds, h:mm:ss or an ISO date", True: "h:mm:ss", False: "seconds or an ISO date"}
            return kind[self.clock]
        return "a whole number" if meaning == "aircraft" else "a number"

    def _error(self, line: int, meaning: str, expected: str, text: str) -> InvalidInputError:
        name = self.names[meaning]
        return InvalidInputError(f"{self.file}: line {line}, column {name!r}: expected {expected}, got {text[:60]!r}")


class _Order:
    """Sorts rows by time that may be late, and leaves repeated ones out."""

    def __init__(self, table: _Table, max_disorder: float) -> None:
        self._table, self._max_disorder = table, max_disorder
        self._waiting = np.zeros((0, len(COLUMNS) + 1))
        self._latest = -math.inf
        self.count = self.late = self.repeated = 0

    def take(self, rows: Array) -> Array:
        """Take rows in, and return those before which none can come any more."""
        times = rows[:, _TIME]
        late = np.maximum(np.maximum.accumulate(times), self._latest) - times
        if (late > self._max_disorder).any():
            row = int(np.argmax(late > self._max_disorder))
            raise InvalidInputError(
                f"{self._table.file}: line {rows[row, -1]:.0f}: the time jumps back by {late[row]:.6g} s, expected at "
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
        rows = self._waiting[np.argsort(self._waiting[:, _TIME], kind="stable")]
        cut = int(np.searchsorted(rows[:, _TIME], end))
        self._waiting, rows = rows[cut:], rows[:cut]
        same = np.flatnonzero(np.diff(rows[:, _TIME]) == 0)
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
        times, begin = self._rows[:, _TIME], self._done
        end = len(times) if last or not len(times) else int(np.searchsorted(times, times[-1] - NEARBY))
        if end == begin or (end - begin < self._at_once and not last):
            return
        scale = {meaning: UNITS[meaning][unit] for meaning, unit in self._units.items()}
        levels, identities = self._rows[:, _ALTITUDE], self._rows[:, _MODE3].astype(np.int64)
        in_levels = levels * scale["altitude"] / UNITS["altitude"]["fl"]
        garbled = garbled_altitudes(in_levels, identities, self._codes, times)[begin:end]
        rows = self._rows[begin:end]
        self._count += len(rows)
        self._farthest = max(self._farthest, float(rows[:, _RANGE].max()))
        self._least = min(self._least, float(np.abs(rows[:, _BEARING]).min()))
        self._most = max(self._most, float(np.abs(rows[:, _BEARING]).max()))
        yield Recording(
            times=rows[:, _TIME],
            ranges=rows[:, _RANGE] * scale["range"],
            azimuths=math.pi / 2 - rows[:, _BEARING] * scale["bearing"],
            identities=identities[begin:end],
            altitudes=rows[:, _ALTITUDE] * scale["altitude"],
            garbled=garbled,
            lines=rows[:, -1].astype(np.int64),
            sources=rows[:, _AIRCRAFT].astype(np.int64) if self._sources else None,
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
