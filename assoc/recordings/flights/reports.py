"""Reports of aircraft (time, identity, latitude, longitude, altitude) from a CSV or Parquet file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError, warn
from assoc.recordings.flights.table import columns_of, numbers_of, read_table, require, seconds_of

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

MOTION = {"updated": ("lastposupdate",), "speed": ("velocity",), "heading": ("heading",), "climb": ("vertrate",)}
"""Columns of OpenSky that are used if present: time of the position (s), m/s, degrees, m/s."""

ALTITUDE_UNITS = {"m": 1.0, "ft": 0.3048}

SPEED_UNITS = {"m/s": (1.0, 1.0), "kt": (1852.0 / 3600.0, 0.3048 / 60.0)}
"""Factors of the ground speed and of the climb rate, which comes in feet per minute where speeds are in knots."""

HIGH = 18_000.0
"""Metres. Aircraft seldom fly higher: if a tenth of all reports does, feet were probably taken for metres."""

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
    """Read a CSV or .parquet file; rows without time, identity or a position that can be are left out and counted.

    ``named`` are columns by meaning (`COLUMNS`), where they are not the usual ones. Units are of `ALTITUDE_UNITS` and
    `SPEED_UNITS`: "m/s", or "kt" for speeds in knots and climbs in feet per minute. Returns the reports, the names of
    targets by number, and which rows were left out, and how many.

    InvalidInputError, beginning with the file: it or a column is missing, or no row is left. MissingExtraError: pyarrow
    is not installed. Warns of altitudes too high for aircraft, as when feet are read as
    metres.
    """
    import pandas as pd

    table, chosen = read_table(path, lambda header: _columns(path, header, named), ("id", "name"))
    columns = {meaning: numbers_of(table[chosen[meaning]]) for meaning in ("latitude", "longitude", "altitude")}
    columns["time"] = seconds_of(table[chosen["time"]])
    identity = table[chosen["id"]]
    known_id = (identity.notna() & (identity.astype(str).str.strip() != "")).to_numpy()
    placed = ~np.isnan(np.stack([columns[meaning] for meaning in ("time", "latitude", "longitude")])).any(axis=0)
    high = ~np.isnan(columns["altitude"])
    rows = known_id & placed & high
    known = rows.copy()
    for meaning, limit in _LIMITS.items():
        known &= ~(np.abs(columns[meaning]) > limit)
    if not known.any():
        raise InvalidInputError(f"{path}: no row has a time, an identity and a position that can be")
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


def _columns(path: str, header: Sequence[str], named: Mapping[str, str | None]) -> dict[str, str]:
    chosen = columns_of(path, header, COLUMNS, named)
    require(path, header, chosen, COLUMNS, *(meaning for meaning in COLUMNS if meaning != "name"))
    motion = columns_of(path, header, MOTION, {})
    return {**{meaning: name for meaning, name in motion.items() if name not in chosen.values()}, **chosen}


def _motion(table: pd.DataFrame, chosen: Mapping[str, str]) -> tuple[Array, Array]:
    """When positions were received, (n,), and velocities east, north, up, (n, 3); NaN where unknown."""

    def column(meaning: str) -> Array:
        return numbers_of(table[chosen[meaning]]) if meaning in chosen else np.full(len(table), np.nan)

    speed, heading = column("speed"), np.radians(column("heading"))
    # without a climb rate flight is taken as level
    climb = column("climb") if "climb" in chosen else np.zeros(len(table))
    return column("updated"), np.stack([speed * np.sin(heading), speed * np.cos(heading), climb], axis=1)


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
