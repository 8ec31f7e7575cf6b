"""Reports of aircraft (time, identity, latitude, longitude, altitude) from a CSV or Parquet file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.extras import check_extra
from assoc._types import Array
from assoc.errors import InvalidInputError, warn

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
"""Where no column is named, the first of these that the file has is taken; a name it need not have."""

MOTION = {"updated": "lastposupdate", "speed": "velocity", "heading": "heading", "climb": "vertrate"}
"""Columns of OpenSky's that are used where they are: when the position was heard (s), m/s, degrees, m/s."""

ALTITUDE_UNITS = {"m": 1.0, "ft": 0.3048}

SPEED_UNITS = {"m/s": (1.0, 1.0), "kt": (1852.0 / 3600.0, 0.3048 / 60.0)}
"""Of the speed over ground, and of the climb that is told beside it: where speeds are in knots, feet per minute."""

HIGH = 18_000.0
"""Metres that aircraft seldom fly at: where a tenth of all reports lies above, feet were taken for metres."""

_MISSING = ["", "nan", "NaN", "-nan", "-NaN", "NA", "<NA>", "#N/A", "N/A", "n/a", "null", "NULL", "None"]

_LIMITS = {"latitude": 90.0, "longitude": 360.0, "altitude": 1e6, "time": 1e12}


@dataclass(frozen=True, eq=False)
class FlightReports:
    """Reports of a file: time (s), number of the target, place (rad, rad, m), sorted by target and time.

    `updated` (n,) tells when each position was heard, s, and `velocity` (n, 3) how the target flew east, north and up,
    m/s; both are NaN where the file does not say. `names` tells what the targets are called, by their numbers; `notes`
    which rows were left out, and how many.
    """

    time: Array
    target: Array
    latitude: Array
    longitude: Array
    height: Array
    updated: Array
    velocity: Array
    names: Mapping[int, str] = field(default_factory=dict)
    notes: Mapping[str, int] = field(default_factory=dict)


def read_flight_reports(
    path: str, named: Mapping[str, str | None], altitude_unit: str = "m", speed_unit: str = "m/s"
) -> FlightReports:
    """Read a file; rows without a time, an identity or a place are left out and counted.

    Parameters
    ----------
    path : str
        A CSV file, or a Parquet file whose name ends in .parquet.
    named : mapping of str to str or None
        Columns by meaning (`COLUMNS`), where they are not the usual ones.
    altitude_unit : str
        One of `ALTITUDE_UNITS`.
    speed_unit : str
        One of `SPEED_UNITS`: "m/s", or "kt" for speeds in knots and climbs in feet per minute.

    Raises
    ------
    InvalidInputError
        The file or a column is missing, or holds what is not a number; the message begins with the file.
    MissingExtraError
        A Parquet file, and pyarrow is not installed.

    Warns
    -----
    AssocWarning
        Altitudes that aircraft do not fly at, as of feet that are read as metres.
    """
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
        raise InvalidInputError(f"{path}: no row has a time, an identity and a place")
    for meaning, limit in _LIMITS.items():
        wrong = known & (np.abs(columns[meaning]) > limit)
        if wrong.any():
            row = int(np.argmax(wrong))
            raise InvalidInputError(
                f"{_place(path, row, chosen[meaning])}: "
                f"expected at most {limit:g} in size, got {columns[meaning][row]:g}"
            )
    # known ones alone: beside a missing one pandas cuts texts to their first letter
    ids, target = np.unique(identity[known].astype(str).to_numpy(dtype=str), return_inverse=True)
    time, lat, lon, height = (columns[meaning][known] for meaning in ("time", "latitude", "longitude", "altitude"))
    height = height * ALTITUDE_UNITS[altitude_unit]
    if len(height) >= 10 and float(np.quantile(height, 0.9)) > HIGH:
        warn(
            f"{path}: a tenth of all reports lies above {np.quantile(height, 0.9):.0f} m, where hardly an aircraft "
            "flies: altitudes in feet? (altitude_unit='ft', --altitude-unit ft)"
        )
    order = np.lexsort((time, target))
    # of two reports at one instant the first stays
    first = np.ones(len(order), dtype=bool)
    first[1:] = (np.diff(time[order]) > 0) | (np.diff(target[order]) != 0)
    order = order[first]
    notes = {
        "rows in the file": len(known),
        "rows left out, without time, latitude or longitude": int((~placed).sum()),
        "rows left out, without identity": int((placed & ~known_id).sum()),
        "rows left out, without altitude": int((placed & known_id & ~high).sum()),
        "rows left out, second report of an aircraft at one instant": int((~first).sum()),
    }
    updated, velocity = _motion(table, chosen)
    over_ground, climbing = SPEED_UNITS[speed_unit]
    velocity = velocity * [over_ground, over_ground, climbing]
    calls = table[chosen["name"]][known] if "name" in chosen else None
    return FlightReports(
        time[order],
        target[order],
        np.radians(lat[order]),
        np.radians(lon[order]),
        height[order],
        updated[known][order],
        velocity[known][order],
        _names(ids, target, calls),
        {what: count for what, count in notes.items() if count},
    )


def _table(path: str, named: Mapping[str, str | None]) -> tuple[pd.DataFrame, dict[str, str]]:
    import pandas as pd

    parquet = Path(path).suffix.lower() in (".parquet", ".pq")
    if parquet:
        check_extra("pyarrow", "parquet")
    try:
        if parquet:
            table = pd.read_parquet(path)
            chosen = choose_columns(path, [str(name) for name in table.columns], named)
        else:
            chosen = choose_columns(path, list(pd.read_csv(path, nrows=0).columns), named)
            # nan and null are numbers that are missing, but names as good as others
            texts: Any = {chosen[meaning]: str for meaning in ("id", "name") if meaning in chosen}
            missing = {column: [""] if column in texts else _MISSING for column in chosen.values()}
            table = pd.read_csv(
                path,
                usecols=list(chosen.values()),
                dtype=texts,
                low_memory=False,
                keep_default_na=False,
                na_values=missing,
            )
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except InvalidInputError:
        raise
    except ValueError as error:  # pandas' parser errors, pyarrow's and UnicodeDecodeError are ValueErrors
        reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise InvalidInputError(f"{path}: is not a {'Parquet' if parquet else 'CSV'} file ({reason})") from None
    return table, chosen


def choose_columns(path: str, header: list[str], named: Mapping[str, str | None]) -> dict[str, str]:
    """Return the column of each meaning; a name may be missing.

    Raises
    ------
    InvalidInputError
        A column is missing, or has two meanings.
    """
    chosen: dict[str, str] = {}
    for meaning, usual in COLUMNS.items():
        wanted = named.get(meaning)
        candidates = usual if wanted is None else (wanted,)
        found = next((one for one in candidates if one in header), None)
        if found is None and (meaning != "name" or wanted is not None):
            have = ", ".join(str(column)[:30] for column in header[:12])
            raise InvalidInputError(f"{path}: no column {' or '.join(candidates)} for the {meaning}; it has: {have}")
        if found is not None:
            chosen[meaning] = str(found)
    for meaning, usual_name in MOTION.items():
        if usual_name in header and usual_name not in chosen.values():
            chosen[meaning] = usual_name
    if len(set(chosen.values())) < len(chosen):
        raise InvalidInputError(f"{path}: the columns must be different, got {', '.join(chosen.values())}")
    return chosen


def _motion(table: pd.DataFrame, chosen: Mapping[str, str]) -> tuple[Array, Array]:
    """When positions were heard, (n,), and velocities east, north, up, (n, 3); NaN where nothing sound is said."""
    import pandas as pd

    def column(meaning: str) -> Array:
        if meaning not in chosen:
            return np.full(len(table), np.nan)
        values = np.asarray(pd.to_numeric(table[chosen[meaning]], errors="coerce").to_numpy(dtype=np.float64))
        return np.where(np.isfinite(values), values, np.nan)

    speed, heading = column("speed"), np.radians(column("heading"))
    # level flight where no climb is told
    climb = column("climb") if "climb" in chosen else np.zeros(len(table))
    return column("updated"), np.stack([speed * np.sin(heading), speed * np.cos(heading), climb], axis=1)


def _place(path: str, row: int, column: str) -> str:
    if Path(path).suffix.lower() in (".parquet", ".pq"):
        return f"{path}: row {row}, column {column!r}"
    with open(path, "rb") as file:
        # lines without anything are no rows
        filled = (number for number, line in enumerate(file, start=1) if line.strip())
        line = next(islice(filled, row + 1, None), row + 2)
    return f"{path}: line {line}, column {column!r}"


def _numbers(path: str, column: str, text: pd.Series) -> Array:
    import pandas as pd

    values = np.asarray(pd.to_numeric(text, errors="coerce").to_numpy(dtype=np.float64))
    wrong = np.isinf(values) | (np.isnan(values) & text.notna().to_numpy())
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InvalidInputError(f"{_place(path, row, column)}: expected a number, got {text.iloc[row]!r}")
    return values


def _times(path: str, column: str, text: pd.Series) -> Array:
    """Seconds as they are, dates (ISO 8601, UTC unless they say otherwise) as seconds since 1970-01-01 UTC."""
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
            f"{_place(path, row, column)}: expected seconds or a date (ISO 8601), got {str(text.iloc[row])[:60]!r}"
        )
    seconds = (moments - pd.Timestamp(0, tz="UTC")) / pd.Timedelta(seconds=1)
    return np.asarray(seconds.to_numpy(dtype=np.float64))


def _names(ids: Array, target: Array, calls: pd.Series | None) -> dict[int, str]:
    """Call signs where there are any, the most frequent of each aircraft, else its identity."""
    names = {number: str(name) for number, name in enumerate(ids.tolist())}
    if calls is not None:
        import pandas as pd

        known = pd.DataFrame({"target": target, "call": calls.fillna("").astype(str).str.strip().to_numpy()})
        known = known[known["call"] != ""]
        for number, group in known.groupby("target")["call"]:
            names[int(str(number))] = str(group.value_counts(sort=True).index[0])
    return names
