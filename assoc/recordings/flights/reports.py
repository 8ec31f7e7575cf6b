"""Reports of aircraft (time, identity, latitude, longitude, altitude) from a CSV or Parquet file."""

from __future__ import annotations

import io
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._files.reading import check_unpacked, kind_of, open_input, refuse_pipe
from assoc._system.imports import check_extra
from assoc._types import Array
from assoc.errors import InvalidInputError, LimitExceededError, warn
from assoc.recordings.columns import BLANKS, plain_name
from assoc.recordings.reading import MOST_PLOTS

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = {
    "time": ("time", "timestamp"),
    "id": ("id", "track_id", "icao24"),
    "latitude": ("lat", "latitude"),
    "longitude": ("lon", "longitude"),
    "altitude": ("altitude", "geoaltitude", "baroaltitude"),
    "name": ("callsign", "call_sign", "flight"),
}
"""Usual columns by meaning: the first that the file has is taken; the name is optional."""

MOTION = {"updated": "lastposupdate", "speed": "velocity", "heading": "heading", "climb": "vertrate"}
"""Columns of OpenSky that are used if present: time of the position (s), m/s, degrees, m/s."""

ALTITUDE_UNITS = {"m": 1.0, "ft": 0.3048}

SPEED_UNITS = {"m/s": (1.0, 1.0), "kt": (1852.0 / 3600.0, 0.3048 / 60.0)}
"""Factors of the ground speed and of the climb rate, which comes in feet per minute where speeds are in knots."""

HIGH = 18_000.0
"""Metres. Aircraft seldom fly higher: if a tenth of all reports does, feet were probably taken for metres."""

# bytes in which the names of the columns are
_START = 1_000_000
_LIMITS = {"latitude": 90.0, "longitude": 360.0, "altitude": 1e6, "time": 1e12}


@dataclass(frozen=True, eq=False)
class Reports:
    """Reports of targets, sorted by target and time, n of them."""

    time: Array
    """Seconds."""
    target: Array
    latitude: Array
    """Radians, as the longitude; the height is in metres."""
    longitude: Array
    height: Array
    velocity: Array
    """East, north, up at the target's position, (n, 3), m/s; NaN where unknown."""
    updated: Array
    """When each position was received, seconds; NaN where unknown."""

    def __len__(self) -> int:
        return len(self.time)

    def rows(self, keep: Array) -> Reports:
        """Return the reports that an index array or mask selects."""
        return Reports(**{field.name: getattr(self, field.name)[keep] for field in fields(self)})

    def first_at_each_time(self) -> Array:
        """Whether each report, sorted, is the first of its target at its time, bool (n,)."""
        first = np.ones(len(self), dtype=np.bool_)
        first[1:] = (np.diff(self.time) > 0) | (np.diff(self.target) != 0)
        return first


def read_flight_reports(
    path: str, named: Mapping[str, str | None], altitude_unit: str = "m", speed_unit: str = "m/s"
) -> tuple[Reports, dict[int, str], dict[str, int]]:
    """Read a CSV or .parquet file; rows without time, identity or position are left out and counted.

    ``named`` are columns by meaning (`COLUMNS`), where they are not the usual ones. Units are of `ALTITUDE_UNITS` and
    `SPEED_UNITS`: "m/s", or "kt" for speeds in knots and climbs in feet per minute. Returns the reports, the names of
    targets by number, and which rows were left out, and how many.

    InvalidInputError, beginning with the file: it or a column is missing, or a value is not a number.
    MissingExtraError: pyarrow is not installed. Warns of altitudes too high for aircraft, as when feet are read as
    metres.
    """
    import pandas as pd

    table, chosen = _table(path, named)
    columns = {"time": _times(path, chosen["time"], table[chosen["time"]])}
    for meaning in ("latitude", "longitude", "altitude"):
        columns[meaning] = _numbers(path, chosen[meaning], table[chosen[meaning]])
    identity = table[chosen["id"]]
    known_id = (identity.notna() & (identity.astype(str).str.strip() != "")).to_numpy()
    placed = ~np.isnan(np.stack([columns[meaning] for meaning in ("time", "latitude", "longitude")])).any(axis=0)
    high = ~np.isnan(columns["altitude"])
    known = known_id & placed & high
    if not known.any():
        raise InvalidInputError(f"{path}: no row has a time, an identity and a position")
    rows = known
    for meaning, limit in _LIMITS.items():
        wrong = known & (np.abs(columns[meaning]) > limit)
        known = known & ~wrong
        if not known.any():
            row = int(np.argmax(wrong))
            raise InvalidInputError(
                f"{_cell(path, row, chosen[meaning])}: "
                f"expected at most {limit:g} in size, got {columns[meaning][row]:g}"
            )
    impossible = int(rows.sum() - known.sum())
    # without missing ones: beside these pandas cuts texts to their first letter
    target, ids = pd.factorize(identity[known].astype(str), sort=True)
    time, lat, lon, height = (columns[meaning][known] for meaning in ("time", "latitude", "longitude", "altitude"))
    height = height * ALTITUDE_UNITS[altitude_unit]
    if len(height) >= 10 and float(np.quantile(height, 0.9)) > HIGH:
        warn(
            f"{path}: a tenth of all reports lies above {np.quantile(height, 0.9):.0f} m, higher than aircraft usually "
            "fly: altitudes in feet? (altitude_unit='ft', --altitude-unit ft)"
        )
    updated, velocity = _motion(table, chosen)
    over_ground, climbing = SPEED_UNITS[speed_unit]
    velocity = velocity * [over_ground, over_ground, climbing]
    every = Reports(time, target, np.radians(lat), np.radians(lon), height, velocity[known], updated[known])
    every = every.rows(np.lexsort((time, target)))
    first = every.first_at_each_time()
    notes = {
        "rows in the file": len(known),
        "rows left out, without time, latitude or longitude": int((~placed).sum()),
        "rows left out, without identity": int((placed & ~known_id).sum()),
        "rows left out, without altitude": int((placed & known_id & ~high).sum()),
        "rows left out whose time or position cannot be": impossible,
        "rows left out, second report of an aircraft at one instant": int((~first).sum()),
    }
    calls = table[chosen["name"]][known] if "name" in chosen else None
    return every.rows(first), _names(ids, target, calls), {what: count for what, count in notes.items() if count}


def _table(path: str, named: Mapping[str, str | None]) -> tuple[pd.DataFrame, dict[str, str]]:
    import pandas as pd

    refuse_pipe(path)
    parquet = kind_of(path) == "parquet"
    if parquet:
        check_extra("pyarrow", "parquet")
    try:
        if parquet:
            table, chosen = _read_parquet(path, named)
        else:
            with open_input(path) as file:
                start = file.read(_START)
            if len(start) == _START and b"\n" not in start:
                raise InvalidInputError(f"{path}: the first line is longer than {_START} bytes, expected column names")
            chosen = choose_columns(path, list(pd.read_csv(io.BytesIO(start), nrows=0).columns), named)
            # nan and null are missing numbers, but valid names
            texts: Any = {chosen[meaning]: str for meaning in ("id", "name") if meaning in chosen}
            missing = {column: [""] if column in texts else list(BLANKS) for column in chosen.values()}
            with open_input(path) as file:
                table = pd.read_csv(
                    file,
                    usecols=list(chosen.values()),
                    dtype=texts,
                    low_memory=False,
                    keep_default_na=False,
                    na_values=missing,
                    nrows=MOST_PLOTS + 1,
                )
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


def _read_parquet(path: str, named: Mapping[str, str | None]) -> tuple[pd.DataFrame, dict[str, str]]:
    """Read the columns that are needed, after their memory was added up: equal rows take next to none in the file."""
    import pyarrow as pa
    import pyarrow.compute as pc
    from pyarrow import parquet

    with parquet.ParquetFile(path) as file:
        schema = file.schema_arrow
    chosen = choose_columns(path, schema.names, named)
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


def choose_columns(path: str, header: list[str], named: Mapping[str, str | None]) -> dict[str, str]:
    """Return the column of each meaning; a name may be missing, any other is refused, as one with two meanings.

    Upper case, spaces and other signs make no difference.
    """
    chosen: dict[str, str] = {}
    known = {plain_name(str(name)): str(name) for name in header[::-1]}
    for meaning, usual in COLUMNS.items():
        wanted = named.get(meaning)
        candidates = usual if wanted is None else (wanted,)
        found = next((known[plain_name(name)] for name in candidates if plain_name(name) in known), None)
        if found is None and (meaning != "name" or wanted is not None):
            have = ", ".join(str(column)[:30] for column in header[:12])
            raise InvalidInputError(f"{path}: no column {' or '.join(candidates)} for the {meaning}; it has: {have}")
        if found is not None:
            chosen[meaning] = found
    for meaning, usual_name in MOTION.items():
        found = known.get(plain_name(usual_name))
        if found is not None and found not in chosen.values():
            chosen[meaning] = found
    if len(set(chosen.values())) < len(chosen):
        raise InvalidInputError(f"{path}: the columns must be different, got {', '.join(chosen.values())}")
    return chosen


def _motion(table: pd.DataFrame, chosen: Mapping[str, str]) -> tuple[Array, Array]:
    """When positions were received, (n,), and velocities east, north, up, (n, 3); NaN where unknown."""
    import pandas as pd

    def column(meaning: str) -> Array:
        if meaning not in chosen:
            return np.full(len(table), np.nan)
        values = np.asarray(pd.to_numeric(table[chosen[meaning]], errors="coerce").to_numpy(dtype=np.float64))
        return np.where(np.isfinite(values), values, np.nan)

    speed, heading = column("speed"), np.radians(column("heading"))
    # without a climb rate flight is taken as level
    climb = column("climb") if "climb" in chosen else np.zeros(len(table))
    return column("updated"), np.stack([speed * np.sin(heading), speed * np.cos(heading), climb], axis=1)


def _cell(path: str, row: int, column: str) -> str:
    if kind_of(path) == "parquet":
        return f"{path}: row {row}, column {column!r}"
    with open_input(path) as file:
        # empty lines are not rows
        filled = (number for number, line in enumerate(file, start=1) if line.strip())
        line = next(islice(filled, row + 1, None), row + 2)
    return f"{path}: line {line}, column {column!r}"


def _numbers(path: str, column: str, text: pd.Series) -> Array:
    import pandas as pd

    values = np.asarray(pd.to_numeric(text, errors="coerce").to_numpy(dtype=np.float64))
    wrong = np.isinf(values) | (np.isnan(values) & text.notna().to_numpy())
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InvalidInputError(f"{_cell(path, row, column)}: expected a number, got {text.iloc[row]!r}")
    return values


def _times(path: str, column: str, text: pd.Series) -> Array:
    """Seconds as they are; dates (ISO 8601, UTC by default) as seconds since 1970-01-01 UTC."""
    import pandas as pd

    present = text.notna().to_numpy()
    dates = text.dtype.kind == "M" or isinstance(text.dtype, pd.DatetimeTZDtype)
    if not dates and bool(present.any()):
        first = text.iloc[int(np.argmax(present))]
        dates = not pd.api.types.is_number(first) and math.isnan(pd.to_numeric(pd.Series([first]), errors="coerce")[0])
    if not dates:
        return _numbers(path, column, text)
    try:
        moments = pd.to_datetime(text, format=None if text.dtype.kind == "M" else "ISO8601", utc=True, errors="coerce")
    except (ValueError, TypeError, OverflowError):  # what errors="coerce" does not catch
        moments = pd.Series(pd.NaT, index=text.index, dtype="datetime64[ns, UTC]")
    wrong = moments.isna().to_numpy() & present
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InvalidInputError(
            f"{_cell(path, row, column)}: expected seconds or a date (ISO 8601), got {str(text.iloc[row])[:60]!r}"
        )
    seconds = (moments - pd.Timestamp(0, tz="UTC")) / pd.Timedelta(seconds=1)
    return np.asarray(seconds.to_numpy(dtype=np.float64))


def _names(ids: Array, target: Array, calls: pd.Series | None) -> dict[int, str]:
    """The most frequent call sign of each aircraft, or its identity if there is none."""
    names = {number: str(name) for number, name in enumerate(ids.tolist())}
    if calls is not None:
        import pandas as pd

        known = pd.DataFrame({"target": target, "call": calls.fillna("").astype(str).str.strip().to_numpy()})
        known = known[known["call"] != ""]
        for number, group in known.groupby("target")["call"]:
            names[int(str(number))] = str(group.value_counts(sort=True).index[0])
    return names
