"""Tables of reported positions, CSV or Parquet: columns by the names that people give them, cells as numbers."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._files.reading import check_unpacked, kind_of, open_input, refuse_pipe
from assoc._system.imports import check_extra
from assoc._text.plain import printable
from assoc._types import Array
from assoc.errors import InvalidInputError, LimitExceededError, warn
from assoc.recordings.columns import BLANKS, plain_name
from assoc.recordings.reading import MOST_PLOTS

if TYPE_CHECKING:
    import pandas as pd

ENDINGS = ("", "_deg", "_degrees")
"""What names of latitudes and longitudes may end in."""
# bytes in which the names of the columns are
_START = 1_000_000

Choice = Callable[[Sequence[str]], dict[str, str]]
"""Finds the columns of a header by meaning."""


def read_table(path: str, choose: Choice, texts: Sequence[str]) -> tuple[pd.DataFrame, dict[str, str]]:
    """Read the columns of a file that ``choose`` finds by meaning, those of some meanings as texts.

    InvalidInputError, beginning with the file: it is missing, or no table. LimitExceededError: it has too many rows.
    MissingExtraError: pyarrow is not installed.
    """
    refuse_pipe(path)
    parquet = kind_of(path) == "parquet"
    if parquet:
        check_extra("pyarrow", "parquet")
    try:
        table, chosen = _read_parquet(path, choose) if parquet else _read_csv(path, choose, texts)
    except InvalidInputError:
        raise
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:  # pandas' parser errors, pyarrow's and UnicodeDecodeError are ValueErrors
        reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise InvalidInputError(f"{path}: is not a {'Parquet' if parquet else 'CSV'} file ({reason})") from None
    if len(table) > MOST_PLOTS:
        raise LimitExceededError(f"{path}: more than {MOST_PLOTS} rows; split the file")
    return table, chosen


def _read_csv(path: str, choose: Choice, texts: Sequence[str]) -> tuple[pd.DataFrame, dict[str, str]]:
    import pandas as pd

    with open_input(path) as file:
        start = file.read(_START)
    first, newline, _ = start.partition(b"\n")
    if len(start) == _START and not newline:
        raise InvalidInputError(f"{path}: the first line is longer than {_START} bytes, expected column names")
    separator = max(",;\t", key=lambda mark: first.count(mark.encode()))
    chosen = choose([*pd.read_csv(io.BytesIO(start), nrows=0, sep=separator).columns])
    # nan and null are missing numbers, but valid names
    kept: Any = {chosen[meaning]: str for meaning in texts if meaning in chosen}
    missing = {column: [""] if column in kept else list(BLANKS) for column in chosen.values()}
    with open_input(path) as file:
        table = pd.read_csv(
            file, sep=separator, usecols=list(chosen.values()), dtype=kept, low_memory=False,
            keep_default_na=False, na_values=missing, nrows=MOST_PLOTS + 1,
        )  # fmt: skip
    return table, chosen


def _read_parquet(path: str, choose: Choice) -> tuple[pd.DataFrame, dict[str, str]]:
    """Read the columns that are needed, after their memory was added up: equal rows take next to none in the file."""
    import pyarrow as pa
    import pyarrow.compute as pc
    from pyarrow import parquet

    with parquet.ParquetFile(path) as file:
        schema = file.schema_arrow
    chosen = choose(schema.names)
    wanted = [*chosen.values()]
    for name in wanted:
        kinds = [field.type for field in schema if field.name == name]
        if len(kinds) > 1 or pa.types.is_nested(kinds[0]) or pa.types.is_fixed_size_binary(kinds[0]):
            raise InvalidInputError(f"{path}: column {name!r}: expected one column of numbers, dates or texts")
    # of texts a list of the different ones is read first, for any of them may be long and stand in all rows
    with parquet.ParquetFile(path, read_dictionary=wanted) as file:
        rows, packed = file.metadata.num_rows, os.path.getsize(path)
        groups = [file.metadata.row_group(k) for k in range(file.metadata.num_row_groups)]
        columns = [group.column(k) for group in groups for k in range(group.num_columns)]
        held = sum(chunk.total_uncompressed_size for chunk in columns if chunk.path_in_schema in wanted)
        check_unpacked(path, held + 8 * rows * len(wanted), packed)
        table = file.read(wanted)
    for index, name in enumerate(wanted):
        column = table[name]
        if pa.types.is_dictionary(column.type):
            longest = (pc.max(pc.binary_length(chunk.dictionary)).as_py() or 0 for chunk in column.chunks)
            held += rows * max(longest, default=0)
            check_unpacked(path, held + 8 * rows * len(wanted), packed)
            table = table.set_column(index, name, column.cast(column.type.value_type))
    return table.to_pandas(ignore_metadata=True), chosen


def columns_of(
    path: str, header: Sequence[str], names: Mapping[str, Sequence[str]], given: Mapping[str, str | None]
) -> dict[str, str]:
    """The column of each meaning that a header has: the one given, which must be there, else the first usual name.

    Upper case, spaces and other signs make no difference.
    """
    known = {plain_name(str(name)): str(name) for name in header[::-1]}
    chosen: dict[str, str] = {}
    for meaning, usual in names.items():
        wanted = given.get(meaning)
        plain = [plain_name(name + end) for name in usual for end in ENDINGS] if not wanted else [plain_name(wanted)]
        found = next((known[name] for name in plain if name in known), None)
        if found is not None:
            chosen[meaning] = found
        elif wanted:
            raise _missing(path, header, meaning, [wanted])
    if len({*chosen.values()}) < len(chosen):
        raise InvalidInputError(f"{path}: the columns must be different, got {printable(', '.join(chosen.values()))}")
    return chosen


def require(
    path: str, header: Sequence[str], chosen: Mapping[str, str], names: Mapping[str, Sequence[str]], *needed: str
) -> None:
    """Refuse a file without a column of some meanings."""
    for meaning in needed:
        if meaning not in chosen:
            raise _missing(path, header, meaning, names[meaning])


def _missing(path: str, header: Sequence[str], meaning: str, names: Sequence[str]) -> InvalidInputError:
    have = printable(", ".join(str(column)[:30] for column in header[:12]))
    return InvalidInputError(f"{path}: no column {' or '.join(names)} for the {meaning}; it has: {have}")


def numbers_of(column: pd.Series) -> Array:
    """Numbers of a column, (n,); NaN where there is none, or an infinite one."""
    import pandas as pd

    values = np.asarray(pd.to_numeric(column, errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan))
    return np.where(np.isfinite(values), values, np.nan)


def seconds_of(column: pd.Series) -> Array:
    """Seconds as they are, dates (by default UTC) as seconds since 1970-01-01 UTC; NaN where it is none.

    Dates are ISO 8601, or day/month/year; month/day/year where only that can be, or takes less time altogether.
    """
    import pandas as pd

    if column.dtype.kind == "M" or isinstance(column.dtype, pd.DatetimeTZDtype):
        return _since_1970(column, None)
    numbers = numbers_of(column)
    if np.isfinite(numbers).any():
        return numbers
    seconds = _since_1970(column, "ISO8601")
    if np.isfinite(seconds).any() or column.dtype.kind != "O":
        return seconds
    texts = column.astype(str).str.strip()
    days, months = (
        _since_1970(texts.str.replace(r"^(\d\d)[/.](\d\d)[/.](\d{4})\b", order, regex=True), "ISO8601")
        for order in (r"\3-\2-\1", r"\3-\1-\2")
    )
    (known, span), (known_months, span_months) = (
        (int(np.isfinite(each).sum()), float(np.ptp(each[np.isfinite(each)])) if np.isfinite(each).any() else 0.0)
        for each in (days, months)
    )
    if known and known == known_months:
        first = str(texts.iloc[int(np.flatnonzero(np.isfinite(days))[0])])[:40]
        order = "day/month/year" if span <= span_months else "month/day/year"
        warn(f"{column.name}: dates as {first} are taken as {order}; ISO dates (2026-07-31) say which it is")
    return days if (known, -span) >= (known_months, -span_months) else months


def _since_1970(column: pd.Series, form: str | None) -> Array:
    import pandas as pd

    try:
        moments = pd.to_datetime(column, format=form, utc=True, errors="coerce")
    except (ValueError, TypeError, OverflowError):  # what errors="coerce" does not catch
        return np.full(len(column), np.nan)
    # in microseconds: nanoseconds end in the year 2262
    exact = moments.dt.tz_convert(None).to_numpy(dtype="datetime64[us]")
    return np.asarray((exact - np.datetime64(0, "us")) / np.timedelta64(1, "s"), dtype=np.float64)
