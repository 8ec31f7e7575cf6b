"""Positions that targets report themselves (AIS, ADS-B), or that other systems give, as sensors of a scene."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from assoc._text.plain import printable
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.recordings.columns import COLUMNS
from assoc.recordings.flights.table import columns_of, numbers_of, read_table, require, seconds_of
from assoc.recordings.recording import Recording
from assoc.recordings.several import NO_HEIGHT, heights_above
from assoc.scene.geodesy import Origin, east_north_up, geodetic
from assoc.scene.scene import Scene
from assoc.sensors import PositionSensor

if TYPE_CHECKING:
    import pandas as pd

NAMES = {
    "time": ("lastposupdate", *COLUMNS["time"], "time_s", "base_date_time"),
    "id": ("mmsi", "icao24", "icao", "icao_address", "address", "address_hex", "hex", "id", "track_id"),
    "latitude": ("lat", "latitude"),
    "longitude": ("lon", "long", "lng", "longitude"),
    "x": ("x", "x_m"),
    "y": ("y", "y_m"),
    "altitude": ("geoaltitude", "geo_altitude", "altitude", "alt", "baroaltitude", "baro_altitude", "z", "height"),
    "mode3": ("squawk", "mode3_oct", "mode_3_a", "mode_a"),
}
"""Usual names of columns by meaning; one of a position on the earth and x, y in metres is needed."""
ALTITUDES = {"m": 1.0, "ft": 0.3048, "fl": 30.48}
_SHIP = 10**8
_DETECTION, _FALSE = 0.95, 0.01
_BOX = 5_000.0


@dataclass(frozen=True, eq=False)
class Positions:
    """Reported positions in the order of time, n of them.

    ``places`` are latitude, longitude (radians) and altitude (metres, NaN where unknown) if ``on_earth``, else x, y, z
    in the frame of the scene; ``identities`` (n, 2) are Mode 3/A code and address, 0 where unknown: the nine digits of
    an MMSI, or 24 bits.
    """

    times: Array
    places: Array
    identities: Array
    on_earth: bool = True
    notes: Mapping[str, int] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.times)

    @property
    def heard(self) -> Array:
        """Whether each has an altitude, bool (n,)."""
        known: Array = np.isfinite(self.places[:, 2])
        return known

    @property
    def pace(self) -> float:
        """Seconds between reports of one target, as short as a twentieth of them are; 10 s where no target is known."""
        gaps = []
        for name in np.unique(self.identities[:, 1]).tolist():
            own = np.diff(self.times[self.identities[:, 1] == name])
            gaps.append(own[own > 0])
        every = np.concatenate([np.zeros(0), *gaps])
        return float(np.quantile(every, 0.05)) if len(every) >= 20 else 10.0

    @property
    def middle(self) -> Origin:
        """Latitude and longitude of the middle of all, at height 0; where they are on the earth."""
        if not self.on_earth:
            raise InvalidInputError("origin: expected [latitude, longitude, height], which x and y do not say")
        latitude, longitude = np.median(self.places[:, :2], axis=0).tolist()
        return latitude, longitude, 0.0

    def take(self, rows: Array) -> Positions:
        """Those of some rows."""
        return replace(self, times=self.times[rows], places=self.places[rows], identities=self.identities[rows])

    def in_scene(self, origin: Origin) -> Array:
        """Positions x, y, z (n, 3) in the frame of a scene; where no altitude is known as at 0, z is NaN."""
        if not self.on_earth:
            return self.places
        latitude, longitude, altitude = self.places.T
        found = east_north_up(latitude, longitude, np.nan_to_num(altitude), origin)
        found[~self.heard, 2] = np.nan
        return found


def positions_of(recording: Recording, origin: Origin) -> Positions:
    """Reports that ASTERIX files have, which are read as seen from an origin."""
    z, altitudes = recording.measurements, recording.altitudes
    up = heights_above(z, np.nan_to_num(altitudes), np.zeros(3), origin)
    ground = np.sqrt(np.maximum(z[:, 0] ** 2 - up**2, 0.0))
    there = geodetic(np.column_stack([ground * np.cos(z[:, 1]), ground * np.sin(z[:, 1]), up]), origin)
    there[:, 2] = altitudes
    identities = np.stack([recording.identities, recording.addresses], axis=1)
    return Positions(recording.times, there, identities, notes=recording.notes)


def read_positions(
    path: str, columns: Mapping[str, str] | None = None, units: Mapping[str, str] | None = None
) -> Positions:
    """Read a CSV or .parquet file of AIS, ADS-B (OpenSky's states) or x, y; an altitude is not needed.

    Rows without a time or a position, and those that repeat an earlier report, are left out and counted. `columns` are
    by meaning (`NAMES`), where they are not the usual ones; `units` are those of altitude: m (default), ft or fl.

    InvalidInputError: the file or a column is missing, or no row is left.
    """
    given = dict(columns or {})
    for meaning in given:
        if meaning not in NAMES:
            raise InvalidInputError(f"columns: unknown meaning {meaning!r}; known: {', '.join(NAMES)}")
    unit = dict(units or {}).get("altitude", "m")
    if {*(units or {})} - {"altitude"} or unit not in ALTITUDES:
        raise InvalidInputError(f"units: expected altitude = one of {', '.join(ALTITUDES)}, got {dict(units or {})}")
    table, chosen = read_table(path, lambda header: _chosen(path, header, given), ("id", "mode3"))
    numbers = {
        meaning: numbers_of(table[chosen[meaning]])
        for meaning in ("latitude", "longitude", "x", "y", "altitude")
        if meaning in chosen
    }
    on_earth, count = "latitude" in chosen, len(table)
    first, second = (numbers[name] for name in (("latitude", "longitude") if on_earth else ("x", "y")))
    altitude = ALTITUDES[unit] * numbers.get("altitude", np.full(count, np.nan))
    times = seconds_of(table[chosen["time"]])
    if not np.isfinite(times).any() and count:
        text = printable(str(table[chosen["time"]].iloc[0])[:40])
        raise InvalidInputError(f"{path}: column {chosen['time']!r}: expected seconds or ISO dates, got {text!r}")
    # AIS says 91 and 181 where it does not know
    good = np.isfinite(first) & np.isfinite(second) & np.isfinite(times)
    if on_earth:
        good &= (np.abs(first) <= 90.0) & (np.abs(second) <= 180.0)
    if not good.any():
        raise InvalidInputError(f"{path}: no row has a time and a position")
    place = np.column_stack(
        [np.radians(first) if on_earth else first, np.radians(second) if on_earth else second, altitude]
    )
    names = table[chosen["id"]] if "id" in chosen else None
    identities = np.stack([_codes(table, chosen), _addresses(names, count)], axis=1)
    rows = np.flatnonzero(good)
    rows = rows[np.argsort(times[rows], kind="stable")]
    _, fresh = np.unique(np.column_stack([times[rows], identities[rows, 1]]), axis=0, return_index=True)
    kept = rows[np.sort(fresh)] if names is not None else rows
    notes = {
        "reports left out, without time or position": int(count - len(rows)),
        "reports left out, repeated": int(len(rows) - len(kept)),
    }
    return Positions(times[kept], place[kept], identities[kept], on_earth, {what: n for what, n in notes.items() if n})


def _chosen(path: str, header: Sequence[str], given: Mapping[str, str]) -> dict[str, str]:
    """The column of each meaning that the file has: a time, and a position on the earth or x and y."""
    found = columns_of(path, header, NAMES, given)
    require(path, header, found, NAMES, "time", *(("x", "y") if "x" in found else ("latitude", "longitude")))
    return found


def _codes(table: pd.DataFrame, chosen: Mapping[str, str]) -> Array:
    """Mode 3/A codes, written with octal digits; 0 where there is none."""
    if "mode3" not in chosen:
        return np.zeros(len(table), dtype=np.int64)
    texts = table[chosen["mode3"]].astype("string").fillna("").str.strip().str.replace(r"\.0$", "", regex=True)
    return np.array([int(text, 8) if text and len(text) <= 4 and {*text} <= {*"01234567"} else 0 for text in texts])


def _addresses(names: pd.Series | None, count: int) -> Array:
    """Nine digits are a ship, six hexadecimal ones an address; any other names are numbered. 0 where there is none."""
    import pandas as pd

    if names is None:
        return np.zeros(count, dtype=np.int64)
    codes, known = pd.factorize(names.astype("string").fillna("").str.strip().str.replace(r"\.0$", "", regex=True))
    numbers = []
    for number, name in enumerate(known, 1):
        is_ship = name.isdigit() and len(name) == 9 and int(name) >= _SHIP
        is_address = len(name) == 6 and not {*name.lower()} - {*"0123456789abcdef"}
        missing = name.lower() in ("", "nan", "none", "null")
        numbers.append(0 if missing else int(name) if is_ship else int(name, 16) if is_address else number)
    return np.array(numbers, dtype=np.int64)[codes]


def sensors_of(
    positions: Positions, name: str, noise: Sequence[float], where: Array
) -> list[tuple[Array, PositionSensor]]:
    """The sensors that make reports at positions (n, 3): those with altitudes and those without; rows of each.

    ``noise`` is that of x and y and of z, metres.
    """
    heard, found = positions.heard, list[tuple[Array, PositionSensor]]()
    for rows, label in (
        (np.flatnonzero(heard), name),
        (np.flatnonzero(~heard), name + (NO_HEIGHT if heard.any() else "")),
    ):
        if not len(rows):
            continue
        dim = 3 if heard[rows[0]] else 2
        box = np.stack([where[rows].min(axis=0) - _BOX, where[rows].max(axis=0) + _BOX], axis=1)[:dim]
        sensor = PositionSensor(
            position=np.zeros(3), noise=np.array([noise[0], noise[0], noise[1]][:dim]), field_of_view=box, name=label,
            detection_probability=_DETECTION * len(rows) / len(heard), false_alarm_rate=_FALSE,
        )  # fmt: skip
        found.append((rows, sensor))
    return found


def scene_with(
    scene: Scene | None,
    identities: Sequence[tuple[Array, ...]],
    reports: Sequence[tuple[Positions, PositionSensor]],
    origin: Origin,
    interval: float,
) -> tuple[Scene, list[tuple[Array, ...]]]:
    """Add sensors of reports to a scene of radars, or make one; and their identities to those of its plots, by scans.

    Reports never look: what a target does not report is no miss. Scans begin earlier, or go on, where only they do.
    """
    placed = [(one, one.in_scene(origin)[:, : sensor.dim], sensor) for one, sensor in reports]
    begin = min(float(one.times[0]) for one, _, _ in placed)
    end = max(float(one.times[-1]) for one, _, _ in placed)
    middle = np.array([begin + interval]) if scene is None else np.asarray(scene.times)
    before = max(0, math.ceil((middle[0] - interval - begin) / interval))
    after = max(0, math.ceil((end - middle[-1]) / interval))
    edges = np.concatenate(
        [middle[0] - interval * np.arange(before, 0, -1), middle, middle[-1] + interval * np.arange(1, after + 1)]
    )
    cuts = [np.searchsorted(one.times, edges[:-1], side="right") for one, _, _ in placed]

    def joined(theirs: Sequence[Sequence[Array]], nothing: Sequence[Array], own: Sequence[Array]) -> list[list[Array]]:
        """What is known of each scan of the radars' and of the reports' sensors."""
        parts = [np.split(values, cut) for values, cut in zip(own, cuts, strict=True)]
        padded = [nothing] * before + [*theirs] + [nothing] * after
        return [[*first, *(part[k] for part in parts)] for k, first in enumerate(padded)]

    known = () if scene is None else scene.sensors
    empty: list[list[Array]] = [[]]
    none = [np.zeros((0, sensor.dim)) for sensor in known]
    sensors = [sensor for _, _, sensor in placed]
    region = np.array([[-1.0, 1.0], [-1.0, 1.0], [-1e3, 2e4]]) if scene is None else np.array(scene.region)
    for sensor in sensors:
        low, high = sensor.field_of_view.T
        region[: sensor.dim, 0] = np.minimum(region[: sensor.dim, 0], low)
        region[: sensor.dim, 1] = np.maximum(region[: sensor.dim, 1], high)
    sectors = np.zeros((len(edges), len(known) + len(sensors), 2))
    if scene is not None and scene.sectors is not None:
        sectors[before : before + scene.num_scans, : len(known)] = scene.sectors
    made = Scene(
        [*known, *sensors],
        edges,
        joined(empty if scene is None else scene.measurements, none, [where for _, where, _ in placed]),
        region,
        name="" if scene is None else scene.name,
        measurement_times=joined(
            empty if scene is None else scene.measurement_times or empty,
            [np.zeros(0)] * len(known),
            [one.times for one, _, _ in placed],
        ),
        sectors=sectors,
        origin=origin,
    )
    who = [np.zeros((0, 2), dtype=np.int64)] * len(known)
    rows = joined(identities or empty, who, [one.identities for one, _, _ in placed])
    return made, [tuple(row) for row in rows]
