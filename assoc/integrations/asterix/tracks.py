"""Write a table of tracks as ASTERIX, category 062, and read it back."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.door import door
from assoc._system.imports import check_extra
from assoc.errors import InvalidInputError
from assoc.integrations.asterix.blocks import data_blocks, read_bytes, records, signed, value
from assoc.integrations.asterix.reading import Source, SourceRows
from assoc.integrations.asterix.writing import check_source, time_of_day, write_blocks
from assoc.sensors.arrays import finite_array

if TYPE_CHECKING:
    import pandas as pd

PLACE_STEP, SPEED_STEP, HEIGHT_STEP, CLIMB_STEP = 0.5, 0.25, 6.25 * 0.3048, 6.25 * 0.3048 / 60.0
"""Resolutions of the category: metres, m/s, metres (6.25 ft), m/s (6.25 ft/min)."""
COLUMNS = ("track_id", "time", "x", "y", "z", "vx", "vy", "vz", "confirmed")
_STEPS = {"x": (PLACE_STEP, 24), "y": (PLACE_STEP, 24), "z": (HEIGHT_STEP, 16)}
_STEPS |= {"vx": (SPEED_STEP, 16), "vy": (SPEED_STEP, 16), "vz": (CLIMB_STEP, 16)}
MOST_TRACKS = 65536
_DEGREE_STEP = 180.0 / 2**25
_ACCURACIES = (
    ("sigma_x", ("APC", "X"), PLACE_STEP), ("sigma_y", ("APC", "Y"), PLACE_STEP), ("sigma_z", ("AGA",), HEIGHT_STEP),
)  # fmt: skip


@door
def write_tracks(path: str | os.PathLike[str], tracks: pd.DataFrame, source: Source = (0, 1)) -> None:
    """Write a table of tracks as category 062: positions, height, velocity, climb, accuracies, number, status.

    Parameters
    ----------
    path : path-like
    tracks : DataFrame
        Columns track_id, time, x, y, z, vx, vy, vz (tracks.csv, `assoc.tracking.TrackTable.to_frame`), and confirmed
        if known. NaN means unknown, except for x and y, which are required. Track numbers have 16 bits: ids are taken
        modulo 65,536. If there, sigma_x, sigma_y and sigma_z become accuracies (I062/500), latitude and longitude
        positions in WGS 84 (I062/105), with altitude in place of z, and status says which tracks coast (I062/080).
    source : (int, int)
        System area code and system identification code of the tracker.

    Raises
    ------
    InvalidInputError
        A column is missing, a value does not fit the category, or the file cannot be written.
    MissingExtraError
        libasterix is not installed.
    """
    check_extra("asterix", "asterix")
    check_source(source)
    for name in COLUMNS[:-1]:
        if name not in tracks:
            raise InvalidInputError(f"tracks: the column {name!r} is missing")
    times = finite_array(tracks["time"].to_numpy(), "tracks: time", (len(tracks),))
    ids = finite_array(tracks["track_id"].to_numpy(), "tracks: track_id", (len(tracks),))
    if (ids != np.round(ids)).any():
        raise InvalidInputError("tracks: expected whole numbers in the column 'track_id'")
    raw, given = {}, {}
    for name, (step, bits) in _STEPS.items():
        try:
            column = "altitude" if name == "z" and _on_earth(tracks) else name
            values = np.round(tracks[column].to_numpy(dtype=np.float64) / step)
        except (TypeError, ValueError):
            raise InvalidInputError(f"tracks: expected numbers in the column {name!r}") from None
        most = 1 << (bits - 1)
        given[name] = ~np.isnan(values)
        if name not in ("x", "y"):
            values = np.where(given[name], values, 0.0)
        if len(values) and not ((values >= -most) & (values < most)).all():
            expected = f"expected at most {most * step:g} in size"
            raise InvalidInputError(f"tracks: {name} does not fit category 062, {expected}")
        raw[name] = values.astype(np.int64) & ((1 << bits) - 1)
    known = tracks["confirmed"].to_numpy() if "confirmed" in tracks else np.ones(len(tracks), dtype=bool)
    coasting = (
        tracks["status"].isin(["coasting", "lost"]).to_numpy() if "status" in tracks else np.zeros(len(tracks), bool)
    )
    starts, ends = (~tracks["track_id"].duplicated(keep=keep).to_numpy() for keep in ("first", "last"))
    accuracies = _accuracies(tracks)
    contents: list[dict[str, Any]] = []
    for k, (number, time) in enumerate(zip(ids.tolist(), times.tolist(), strict=True)):
        contents.append(
            {
                "010": (("SAC", source[0]), ("SIC", source[1])),
                "070": time_of_day(time),
                "040": int(number) % MOST_TRACKS,
                "080": (
                    (0, 0, 0, 0, ("CNF", 0 if known[k] else 1), 1),
                    (0, ("TSE", int(ends[k])), ("TSB", int(starts[k])), 0, 0, 0, 0, 1),
                    (0, 0, 0, 0, 0, 1),
                    (("CST", int(coasting[k])), 0, 0, 0, 0, 0, 0, None),
                ),
                "100": (("X", int(raw["x"][k])), ("Y", int(raw["y"][k]))),
                **accuracies[k],
            }
        )
        if given["vx"][k] and given["vy"][k]:
            contents[-1]["185"] = (("VX", int(raw["vx"][k])), ("VY", int(raw["vy"][k])))
        for item, name in (("130", "z"), ("220", "vz")):
            if given[name][k]:
                contents[-1][item] = int(raw[name][k])
    write_blocks(path, 62, contents)


def _on_earth(tracks: pd.DataFrame) -> bool:
    return {"latitude", "longitude", "altitude"} <= set(tracks.columns)


def _accuracies(tracks: pd.DataFrame) -> list[dict[str, Any]]:
    """Items 105 and 500 of each row, as far as its columns are there and finite; larger errors become the largest."""
    items: list[dict[str, Any]] = [{} for _ in range(len(tracks))]
    names = ("sigma_x", "sigma_y", "sigma_z")
    sigmas = np.column_stack([tracks[name] if name in tracks else np.full(len(tracks), np.nan) for name in names])
    x, y, z = np.minimum(np.ceil(sigmas / [PLACE_STEP, PLACE_STEP, HEIGHT_STEP]), [65535, 65535, 255]).T
    if _on_earth(tracks):
        degrees = tracks[["latitude", "longitude"]].to_numpy(dtype=np.float64)
        most = [90.0, 180.0 - _DEGREE_STEP]
        latitudes, longitudes = np.clip(np.round(degrees / _DEGREE_STEP), -(2.0**25), np.array(most) / _DEGREE_STEP).T
    for k, item in enumerate(items):
        if np.isfinite([x[k], y[k]]).all():
            item["500"] = {"APC": (("X", int(x[k])), ("Y", int(y[k])))}
            if z[k] > 0:
                item["500"]["AGA"] = int(z[k])
        if _on_earth(tracks) and np.isfinite(degrees[k]).all():
            place = (("LAT", int(latitudes[k]) & 0xFFFFFFFF), ("LON", int(longitudes[k]) & 0xFFFFFFFF))
            item["105"] = place
    return items


@door
def read_tracks(path: str | os.PathLike[str]) -> pd.DataFrame:
    """Read tracks of category 062 that have a time, a number and a system position.

    Returns
    -------
    DataFrame
        Columns track_id, time, x, y, z, vx, vy, vz, confirmed; metres, m/s, seconds of the day, continued after
        midnight; NaN for absent items. If any record has them also sigma_x, sigma_y, sigma_z, and latitude, longitude
        (degrees), altitude, which is then what z would be.

    Raises
    ------
    InvalidInputError
        The file cannot be read, or holds no tracks.
    """
    import pandas as pd

    notes: dict[str, int] = {}
    clock, found = SourceRows(), []
    for block in data_blocks(read_bytes(path), notes):
        if block.category != 62:
            continue
        for record in records(block, notes):
            time, number = value(record, "070"), value(record, "040")
            x, y = value(record, "100", "X"), value(record, "100", "Y")
            if time is None or number is None or x is None or y is None:
                continue
            parts = {"x": x, "y": y, "z": value(record, "130"), "vz": value(record, "220")}
            parts |= {"vx": value(record, "185", "VX"), "vy": value(record, "185", "VY")}
            now = clock.time(time)
            clock.rows.append((now,))
            values = {
                name: np.nan if parts[name] is None else signed(int(parts[name] or 0), bits) * step
                for name, (step, bits) in _STEPS.items()
            }
            for name, items, step in _ACCURACIES:
                raw = value(record, "500", *items)
                if raw is not None:
                    values[name] = raw * step
            lat, lon = value(record, "105", "LAT"), value(record, "105", "LON")
            if lat is not None and lon is not None:
                values |= {"latitude": signed(lat, 32) * _DEGREE_STEP, "longitude": signed(lon, 32) * _DEGREE_STEP}
                values |= {"altitude": values["z"], "z": np.nan}
            found.append({"track_id": number, "time": now, **values, "confirmed": value(record, "080", "CNF") != 1})
    if not found:
        said_of = "; ".join(f"{count} {what}" for what, count in notes.items())
        raise InvalidInputError(f"{os.fspath(path)}: holds no ASTERIX tracks (062){': ' + said_of if said_of else ''}")
    frame = pd.DataFrame(found)
    return frame[[*COLUMNS, *(name for name in frame.columns if name not in COLUMNS)]]
