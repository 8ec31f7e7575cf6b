"""Radar plots from a CSV file."""

from __future__ import annotations

import csv
import io
import math
import os
from array import array
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from assoc._files.reading import read_bytes, read_lines
from assoc._system.door import door
from assoc._system.imports import check_extra
from assoc._text.plain import one_line
from assoc._types import Array
from assoc.errors import InvalidInputError, LimitExceededError, warn
from assoc.recordings.altitude import GARBLED_CODES, garbled_altitudes
from assoc.recordings.columns import COLUMNS, DAY, REQUIRED, UNITS, choose, code, number, seconds, whole
from assoc.recordings.recording import UNDECODED, Recording

MAX_DISORDER = 30.0
"""Plots up to this late (s) are sorted in; later ones are an error."""

MOST_PLOTS = 20_000_000
_FARTHEST = 1e7
# metres: no radar of plots sees farther; and plots from which on bearings within 2 pi degrees are no chance
_REACH, _ENOUGH = 1.5e6, 10


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
    file = Path(path)
    if not 0 <= max_disorder < math.inf:
        raise InvalidInputError(f"max_disorder: expected seconds >= 0, got {max_disorder!r}")
    lines = _parquet_lines(file) if file.suffix.lower() == ".parquet" else read_lines(file, fallback="cp1252")
    return _read(file, lines, columns or {}, units or {}, max_disorder, garbled_codes)


def _parquet_lines(file: Path) -> Iterator[str]:
    """The table of a Parquet file as lines of CSV."""
    check_extra("pyarrow", "parquet")
    import pandas as pd

    content = read_bytes(file)
    try:
        frame = pd.read_parquet(io.BytesIO(content))
    except (ValueError, OSError) as error:
        raise InvalidInputError(f"{file}: is not a readable Parquet file ({one_line(error)[:100]})") from None
    yield from io.StringIO(frame.to_csv(index=False))


def _read(
    file: Path,
    lines: Iterator[str],
    columns: Mapping[str, str],
    units: Mapping[str, str],
    max_disorder: float,
    garbled_codes: Array | None,
) -> Recording:
    head = next(lines, "")
    if not head.strip():
        raise InvalidInputError(f"{file}: has no header line, expected column names such as time,range,bearing")
    separator = max(",;\t", key=head.count)
    try:
        header = next(csv.reader([head], delimiter=separator))
        columns_of, scales = choose(header, columns, units)
    except csv.Error as error:
        raise InvalidInputError(f"{file}: line 1: {error}") from None
    except InvalidInputError as error:
        raise InvalidInputError(f"{file}: {error}") from None
    table = _Table(file, columns_of, header, UNITS["mode3"][scales["mode3"]], decimal="." if separator == "," else ",")
    rows = csv.reader(lines, delimiter=separator)
    try:
        for cells in rows:
            table.add(cells, rows.line_num + 1)
    except csv.Error as error:
        raise InvalidInputError(f"{file}: line {rows.line_num + 1}: {error}") from None
    return table.recording(scales, max_disorder, garbled_codes)


class _Table:
    """Rows of the file as they come."""

    def __init__(self, file: Path, columns_of: Mapping[str, int], header: list[str], base: float, decimal: str) -> None:
        self.file = file
        self.columns_of = columns_of
        self.base, self.decimal = base, decimal
        self.names = {meaning: header[index].strip()[:30] for meaning, index in columns_of.items()}
        self.values = {meaning: array("d") for meaning in COLUMNS}
        self.lines = array("q")
        self.fillers = self.midnights = self.blank = self.unread = 0
        self.clock: bool | None = None
        self.day = 0.0
        self.before = 0.0

    def add(self, cells: list[str], line: int) -> None:
        """Add one row; errors name its line."""
        if not any(cell.strip() for cell in cells):
            return
        row = {}
        for meaning, index in self.columns_of.items():
            text = cells[index].strip().replace(self.decimal, ".") if index < len(cells) else ""
            if not text and meaning in REQUIRED:
                self.blank += 1
                return
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
            return
        if len(self.lines) >= MOST_PLOTS:
            raise LimitExceededError(f"{self.file}: more than {MOST_PLOTS} plots; split the file")
        row["time"] = self._running(row["time"])
        for meaning, values in self.values.items():
            default = math.nan if meaning == "altitude" else -1.0 if meaning == "aircraft" else float(UNDECODED)
            values.append(row.get(meaning, default))
        self.lines.append(line)

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
        if self.clock and self.lines and time + self.day < self.before - DAY / 2:
            self.day += DAY
            self.midnights += 1
        running = time + self.day
        # a late plot of the day before
        if self.clock and self.midnights and running > self.before + DAY / 2:
            running -= DAY
        self.before = max(self.before, running) if self.lines else running
        return running

    def _expected(self, meaning: str) -> str:
        if meaning == "time":
            kind = {None: "seconds, h:mm:ss or an ISO date", True: "h:mm:ss", False: "seconds or an ISO date"}
            return kind[self.clock]
        return "a whole number" if meaning == "aircraft" else "a number"

    def _error(self, line: int, meaning: str, expected: str, text: str) -> InvalidInputError:
        name = self.names[meaning]
        return InvalidInputError(f"{self.file}: line {line}, column {name!r}: expected {expected}, got {text[:60]!r}")

    def _doubt_units(self, units: Mapping[str, str], columns: Mapping[str, Array]) -> None:
        """Warn of ranges and bearings that are hardly in their units."""
        farthest, turned, unit = columns["range"].max(), np.abs(columns["bearing"]), units["range"]
        metres = farthest * UNITS["range"][unit]
        if unit != "m" and metres > _REACH:
            warn(
                f"{self.file}: column {self.names['range']!r}: {farthest:.6g} {unit} are {metres / 1000:,.0f} km: "
                "metres? (name the column range_m, or set the unit of range to m)"
            )
        if units["bearing"] == "deg" and len(turned) >= _ENOUGH and np.ptp(turned) > 3.0 and turned.max() <= 6.2832:
            warn(
                f"{self.file}: column {self.names['bearing']!r}: all within {turned.max():.3g} deg: radians? "
                "(name the column bearing_rad, or set the unit of bearing to rad)"
            )

    def recording(self, units: Mapping[str, str], max_disorder: float, codes: Array | None) -> Recording:
        """Sort, leave out repeated rows, and convert units."""
        if not self.lines:
            why = f": {self.blank} rows have no time, range or bearing" if self.blank else ""
            raise InvalidInputError(f"{self.file}: holds no plots{why}")
        columns = {meaning: np.array(values) for meaning, values in self.values.items()}
        lines = np.array(self.lines)
        latest = np.maximum.accumulate(columns["time"])
        late = latest - columns["time"]
        if (late > max_disorder).any():
            row = int(np.argmax(late > max_disorder))
            raise InvalidInputError(
                f"{self.file}: line {lines[row]}: the time jumps back by {late[row]:.6g} s, expected at most "
                f"{max_disorder:g} s; split the file there (from Python: or allow more with max_disorder)"
            )
        order = np.argsort(columns["time"], kind="stable")
        # missing values are equal to one another only
        content = np.stack([np.nan_to_num(columns[meaning], nan=-math.inf) for meaning in self.columns_of], axis=1)
        _, first = np.unique(content[order], axis=0, return_index=True)
        keep = order[np.sort(first)]
        self._doubt_units(units, columns)
        scale = {meaning: UNITS[meaning][unit] for meaning, unit in units.items()}
        levels = columns["altitude"][keep]
        identities = columns["mode3"][keep].astype(np.int64)
        in_levels = levels * scale["altitude"] / UNITS["altitude"]["fl"]
        known = GARBLED_CODES if codes is None else codes
        return Recording(
            times=columns["time"][keep],
            ranges=columns["range"][keep] * scale["range"],
            azimuths=math.pi / 2 - columns["bearing"][keep] * scale["bearing"],
            identities=identities,
            altitudes=levels * scale["altitude"],
            garbled=garbled_altitudes(in_levels, identities, known if units["altitude"] == "fl" else ()),
            lines=lines[keep],
            sources=columns["aircraft"][keep].astype(np.int64) if "aircraft" in self.columns_of else None,
            notes={
                "late plots sorted in": int((late > 0).sum()),
                "repeated rows left out": len(order) - len(keep),
                "rows of zeros left out": self.fillers,
                "rows without time, range or bearing left out": self.blank,
                "invalid codes": self.unread,
                "midnights passed": self.midnights,
            },
            name=self.file.name,
        )
