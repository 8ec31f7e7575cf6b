"""Write a table of tracks as ASTERIX, category 062, and read it back."""

from __future__ import annotations

import math
import os
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.imports import check_extra
from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.integrations.asterix.blocks import Records
from assoc.integrations.asterix.items import LEVEL_STEP, signed, value
from assoc.integrations.asterix.reading import Clock, Source
from assoc.integrations.asterix.writing import check_source, time_of_day, write_blocks
from assoc.scene.geodesy import FLATTENING, SEMI_MAJOR_AXIS
from assoc.sensors.arrays import finite_array

if TYPE_CHECKING:
    import pandas as pd

PLACE_STEP, SPEED_STEP, HEIGHT_STEP, CLIMB_STEP = 0.5, 0.25, 6.25 * 0.3048, 6.25 * 0.3048 / 60.0
"""Resolutions of the category: metres, m/s, metres (6.25 ft), m/s (6.25 ft/min)."""
COLUMNS = ("track_id", "time", "x", "y", "z", "vx", "vy", "vz", "confirmed")
_DEGREE_STEP = 180.0 / 2**25
# item and subfield, step, bits (of signed numbers), by column; of both heights a row has one
_NUMBERS: dict[str, tuple[tuple[str, ...], float, int]] = {
    "x": (("100", "X"), PLACE_STEP, 24), "y": (("100", "Y"), PLACE_STEP, 24), "z": (("130",), HEIGHT_STEP, 16),
    "vx": (("185", "VX"), SPEED_STEP, 16), "vy": (("185", "VY"), SPEED_STEP, 16), "vz": (("220",), CLIMB_STEP, 16),
    "level": (("135", "CTB"), LEVEL_STEP, 15),
}  # fmt: skip
# subfield of item 500, step, largest number
_ACCURACIES: tuple[tuple[str, tuple[str, ...], float, int], ...] = (
    ("sigma_x", ("APC", "X"), PLACE_STEP, 65535), ("sigma_y", ("APC", "Y"), PLACE_STEP, 65535),
    ("sigma_z", ("AGA",), HEIGHT_STEP, 255), ("sigma_z", ("ABA",), LEVEL_STEP, 255),
)  # fmt: skip
# item and subfield, base of the digits, how many
_IDENTITIES = {"mode3_oct": (("060", "MODE3A"), 8, 4), "address_hex": (("380", "ADR"), 16, 6)}
MOST_TRACKS = 65536


@explains_wrong_types
def write_tracks(path: str | os.PathLike[str], tracks: pd.DataFrame, source: Source = (0, 1)) -> None:
    """Write a table of tracks as category 062, in the order of time; docs/formats.md lists the items.

    Parameters
    ----------
    path : path-like
    tracks : DataFrame
        Columns track_id, time, x, y, z, vx, vy, vz (tracks.csv, `assoc.tracking.TrackTable.to_frame`), and confirmed
        if known. NaN means unknown, except for x and y, which are required. Track numbers have 16 bits: ids are taken
        modulo 65,536. If there, altitude is taken in place of z, barometric (bool) says which altitudes are by Mode C
        (I062/135, else I062/130), sigma_x, sigma_y and sigma_z become accuracies (I062/500), latitude and longitude
        positions in WGS 84 (I062/105), status says which tracks coast (I062/080), and mode3_oct and address_hex are
        digits of codes and addresses, empty where unknown (I062/060, I062/380).
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
    finite_array(tracks["time"].to_numpy(), "tracks: time", (len(tracks),))
    # a table may have track after track; times of day of a file run on
    tracks = tracks.sort_values("time", kind="stable")
    ids = finite_array(tracks["track_id"].to_numpy(), "tracks: track_id", (len(tracks),))
    if (ids != np.round(ids)).any():
        raise InvalidInputError("tracks: expected whole numbers in the column 'track_id'")
    known = tracks["confirmed"].to_numpy(dtype=bool) if "confirmed" in tracks else np.ones(len(tracks), dtype=bool)
    barometric = tracks["barometric"].to_numpy(dtype=bool) if "barometric" in tracks else np.zeros(len(tracks), bool)
    numbers = {name: _whole(name, _column(tracks, name, barometric)) for name in _NUMBERS}
    coasting = (
        tracks["status"].isin(["coasting", "lost"]).to_numpy() if "status" in tracks else np.zeros(len(tracks), bool)
    )
    starts, ends = (~tracks["track_id"].duplicated(keep=keep).to_numpy() for keep in ("first", "last"))
    codes, addresses = (_digits(tracks, name) for name in _IDENTITIES)
    places = _places(tracks)
    accuracies = _accuracies(tracks, barometric, places)
    contents: list[dict[str, Any]] = []
    for k, (number, time) in enumerate(zip(ids.tolist(), tracks["time"].tolist(), strict=True)):
        own = {name: values[k] for name, values in numbers.items()}
        items: dict[str, Any] = {
            "010": (("SAC", source[0]), ("SIC", source[1])),
            "070": time_of_day(float(time)),
            "040": int(number) % MOST_TRACKS,
            "080": (
                (0, 0, ("MRH", int(own["z"] is not None)), 0, ("CNF", int(not known[k])), 1),
                (0, ("TSE", int(ends[k])), ("TSB", int(starts[k])), 0, 0, 0, 0, 1),
                (0, 0, 0, 0, 0, 1),
                (("CST", int(coasting[k])), 0, 0, 0, 0, 0, 0, None),
            ),
            "100": (("X", own["x"]), ("Y", own["y"])),
            "105": None if places is None else places[k],
            "185": None if None in (own["vx"], own["vy"]) else (("VX", own["vx"]), ("VY", own["vy"])),
            "130": own["z"],
            "135": None if own["level"] is None else (("QNH", 0), ("CTB", own["level"])),
            "220": own["vz"],
            "060": None if codes[k] is None else (0, 0, 0, 0, ("MODE3A", codes[k])),
            "380": None if addresses[k] is None else {"ADR": addresses[k]},
            "500": accuracies[k] or None,
        }
        contents.append({item: content for item, content in items.items() if content is not None})
    write_blocks(path, 62, contents)


def _column(tracks: pd.DataFrame, name: str, barometric: Array) -> Array:
    """Numbers (n,) of an entry of `_NUMBERS`."""
    height = name in ("z", "level")
    column = name if not height else "altitude" if "altitude" in tracks else "z"
    try:
        values: Array = tracks[column].to_numpy(dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidInputError(f"tracks: expected numbers in the column {column!r}") from None
    if height:
        values = np.where(barometric == (name == "level"), values, np.nan)
    return values


def _whole(name: str, values: Array) -> list[int | None]:
    """Raw numbers of the category; None for what is not known."""
    _, step, bits = _NUMBERS[name]
    whole, most = np.round(values / step), 1 << (bits - 1)
    unknown = np.isnan(whole) & (name not in ("x", "y"))
    if not (((whole >= -most) & (whole < most)) | unknown).all():
        raise InvalidInputError(f"tracks: {name} does not fit category 062, expected at most {most * step:g} in size")
    return [
        None if left_out else int(number) & ((1 << bits) - 1)
        for number, left_out in zip(whole.tolist(), unknown.tolist(), strict=True)
    ]


def _digits(tracks: pd.DataFrame, name: str) -> list[int | None]:
    """Codes or addresses by their digits; None where there are none."""
    _, base, count = _IDENTITIES[name]
    found: list[int | None] = []
    for given in tracks[name].tolist() if name in tracks else [None] * len(tracks):
        # a file's column of octal digits may have been read as numbers
        digits = "" if given is None or given != given else str(given).removesuffix(".0")
        try:
            found.append(int(digits, base) if digits else None)
        except ValueError:
            found.append(-1)
        if found[-1] is not None and (found[-1] < 0 or len(digits) > count):
            raise InvalidInputError(f"tracks: {name}: expected up to {count} digits of base {base}, got {given!r}")
    return found


def _places(tracks: pd.DataFrame) -> list[Any] | None:
    """Item 105 of each row; None where it is not known."""
    if not {"latitude", "longitude"} <= set(tracks.columns):
        return None
    steps = np.round(tracks[["latitude", "longitude"]].to_numpy(dtype=np.float64) / _DEGREE_STEP)
    steps = np.clip(steps, -(2.0**25), [2.0**24, 2.0**25 - 1])
    return [
        (("LAT", int(lat) & 0xFFFFFFFF), ("LON", int(lon) & 0xFFFFFFFF)) if math.isfinite(lat + lon) else None
        for lat, lon in steps.tolist()
    ]


def _accuracies(tracks: pd.DataFrame, barometric: Array, places: list[Any] | None) -> list[dict[str, Any]]:
    """Item 500 of each row, as far as its columns are there and finite; larger errors become the largest."""
    names = ("sigma_x", "sigma_y", "sigma_z")
    sigmas = np.column_stack([tracks[name] if name in tracks else np.full(len(tracks), np.nan) for name in names])
    metres = np.ones((len(tracks), 2))
    if places is not None:
        # north and east; that they are those of the origin matters little
        sine = np.sin(np.radians(tracks["latitude"].to_numpy(dtype=np.float64)))
        squared = FLATTENING * (2.0 - FLATTENING)
        across = SEMI_MAJOR_AXIS / np.sqrt(1.0 - squared * sine**2)
        along = across * (1.0 - squared) / (1.0 - squared * sine**2)
        metres = np.radians(np.stack([along, across * np.sqrt(1.0 - sine**2)], axis=1))
    items: list[dict[str, Any]] = []
    for k, row in enumerate(sigmas):
        own: dict[str, Any] = {}
        if np.isfinite(row[:2]).all():
            own["APC"] = (("X", _up(row[0], PLACE_STEP)), ("Y", _up(row[1], PLACE_STEP)))
            if places is not None and places[k] is not None:
                north, east = (_up(row[1 - i] / metres[k, i], _DEGREE_STEP) for i in range(2))
                own["APW"] = (("LAT", north), ("LON", east))
            if row[2] > 0:
                step, name = (LEVEL_STEP, "ABA") if barometric[k] else (HEIGHT_STEP, "AGA")
                own[name] = _up(row[2], step, 255)
        items.append(own)
    return items


def _up(sigma: float, step: float, most: int = 65535) -> int:
    """A standard deviation in steps, never rounded down; `most` stands for all that is larger."""
    return int(min(math.ceil(min(sigma / step, most)), most))


@explains_wrong_types
def read_tracks(path: str | os.PathLike[str]) -> pd.DataFrame:
    """Read tracks of category 062 that have a time, a number and a system position.

    Returns
    -------
    DataFrame
        Columns track_id, time, x, y, z, vx, vy, vz, confirmed; metres, m/s, seconds of the day, continued after
        midnight; NaN for absent items. If any record has them also sigma_x, sigma_y, sigma_z, latitude, longitude
        (degrees), altitude (then in place of z), barometric, mode3_oct, address_hex; see `write_tracks`.

    Raises
    ------
    InvalidInputError
        The file cannot be read, or holds no tracks.
    """
    import pandas as pd

    notes = Counter[str]()
    clock, found = Clock(), []
    for block in Records(path, notes, categories=(62,)):
        for _, _, record in block:
            time, number = value(record, "070"), value(record, "040")
            raw = {name: value(record, *where) for name, (where, *_) in _NUMBERS.items()}
            if time is None or number is None or raw["x"] is None or raw["y"] is None:
                continue
            now = clock.time(time)
            values: dict[str, Any] = {
                name: np.nan if raw[name] is None else signed(int(raw[name] or 0), bits) * step
                for name, (_, step, bits) in _NUMBERS.items()
            }
            level = values.pop("level")
            if np.isnan(values["z"]) and not np.isnan(level):
                values |= {"altitude": level, "barometric": True}
            for name, where, step, _ in _ACCURACIES:
                sigma = value(record, "500", *where)
                if sigma is not None:
                    values[name] = sigma * step
            lat, lon = value(record, "105", "LAT"), value(record, "105", "LON")
            if lat is not None and lon is not None:
                values |= {"latitude": signed(lat, 32) * _DEGREE_STEP, "longitude": signed(lon, 32) * _DEGREE_STEP}
                values.setdefault("altitude", values["z"])
                values["z"] = np.nan
            for name, (where, base, digits) in _IDENTITIES.items():
                sent = value(record, *where)
                if sent is not None:
                    values[name] = f"{sent:0{digits}{'o' if base == 8 else 'X'}}"
            found.append({"track_id": number, "time": now, **values, "confirmed": value(record, "080", "CNF") != 1})
    if not found:
        said_of = "; ".join(f"{count} {what}" for what, count in notes.items())
        raise InvalidInputError(f"{os.fspath(path)}: holds no ASTERIX tracks (062){': ' + said_of if said_of else ''}")
    frame = pd.DataFrame(found)
    if "barometric" in frame:
        frame["barometric"] = frame["barometric"].eq(True)
        frame["altitude"] = frame["altitude"].fillna(frame["z"])
    return frame[[*COLUMNS, *(name for name in frame.columns if name not in COLUMNS)]]
