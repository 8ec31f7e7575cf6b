"""What the columns of lines of plots mean: their header, compass bearings and nautical miles, biases of the radars."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.recordings.columns import BLANKS, COLUMNS, UNITS, choose, code, level, number, plain_name, seconds
from assoc.recordings.flights.positions import NAMES
from assoc.recordings.flights.table import ENDINGS
from assoc.recordings.on_earth import USUAL_ALTITUDE, Bias, azimuths_in_plane
from assoc.scene.geodesy import east_north_up, geodetic
from assoc.sensors import PositionSensor, Radar2D

if TYPE_CHECKING:
    from assoc.scene.geodesy import Origin
    from assoc.scene.scene import Scene

SENSOR = ("sensor", "radar", "source", "station")
"""What the column of sensors is called."""
ADDRESS = ("address", "icao_address", "icao", "icao24", "mode_s", "address_hex", "mmsi")
"""What the column of addresses is called."""


class LineForm:
    """How the lines of one stream are to be read; it remembers the header.

    `places` say where each sensor of the scene stands on the earth (by default from the scene's origin), `biases` what
    it states too much.
    """

    def __init__(
        self, scene: Scene, places: Sequence[Origin] | None = None, biases: Sequence[Bias] | None = None
    ) -> None:
        self.scene, self._places = scene, places
        self._biases = biases or [Bias()] * len(scene.sensors)
        self._header: list[str] | None = None
        self._separator = ","
        self._wrong = ""
        self._known: dict[tuple[str, ...], tuple[dict[str, int], dict[str, str]] | None] = {}

    def cells(self, text: str) -> list[str]:
        """The cells of a line of CSV: between commas, or semicolons or tabs, where a comma is a decimal sign."""
        separator = max(",;\t", key=text.count) if self._header is None else self._separator
        self._separator = separator
        return [part.strip() if separator == "," else part.strip().replace(",", ".") for part in text.split(separator)]

    def takes_header(self, cells: list[str]) -> bool:
        """Whether a line of CSV is a header, which holds for the lines that follow.

        One without a column for the sensor, where there are several, is refused.
        """
        if any(_is_number(cell) for cell in cells):
            return False
        names = {plain_name(cell) for cell in cells}
        if not names & {*map(plain_name, (*SENSOR, *COLUMNS["time"]))}:
            return False
        self._header, self._wrong = [cell.lower() for cell in cells], ""
        if not names & {*SENSOR} and len(self.scene.sensors) > 1:
            self._wrong = f"the header has no column {' or '.join(SENSOR[:2])}"
        elif not names & {*map(plain_name, COLUMNS["time"])}:
            self._wrong = "the header has no column time"
        if self._wrong:
            raise InvalidInputError(self._wrong)
        return True

    def named(self, cells: list[str]) -> dict[str, Any] | None:
        """A line by the names of the header; None where there is none."""
        if self._wrong:
            raise ValueError(self._wrong)
        if self._header is None or cells[0] == "platform":
            return None
        if len(cells) > len(self._header):
            raise ValueError(f"{len(cells)} values, the header has {len(self._header)} columns")
        found: dict[str, Any] = dict(zip(self._header, cells, strict=False))
        for name, usual in (("sensor", SENSOR), ("address", ADDRESS), ("time", COLUMNS["time"])):
            plain = [plain_name(other) for other in usual]
            own = next((other for other in self._header[: len(cells)] if plain_name(other) in plain), None)
            if own is not None:
                found[name] = found[own]
        found.setdefault("sensor", "1")
        found["time"] = seconds(str(found["time"]))[0]
        return found

    def in_compass(self, found: dict[str, Any], s: int | None) -> bool:
        """Replace bearings, ranges and altitudes, named as in recordings, by what a sensor measures; False if none are.

        ``found`` then has values, and mode3 as its octal digits.
        """
        if s is not None and isinstance(self.scene.sensors[s], PositionSensor):
            return self._reported(found, self.scene.sensors[s].dim)
        names = tuple(map(str, found))
        if names not in self._known:
            self._known[names] = _columns(names)
        chosen = self._known[names]
        if chosen is None or s is None:
            return False
        columns, units = chosen
        sensor, cells = self.scene.sensors[s], [*found.values()]
        if not isinstance(sensor, Radar2D):
            raise ValueError(f"bearings are of sensors of range and azimuth, not of a {type(sensor).__name__}")

        def value(meaning: str) -> float:
            cell = cells[columns[meaning]] if meaning in columns else None
            text, unit = "" if cell is None else str(cell).strip(), _factor(meaning, units)
            if text in BLANKS:
                return math.nan
            return (level(text, unit) if meaning == "altitude" else number(text)) * unit

        altitude = value("altitude")
        z = np.array([[value("range"), math.pi / 2 - value("bearing")]])
        found["values"] = self._in_scene(s, z, np.array([altitude]))[0].tolist()
        if sensor.components[sensor.dim - 1] == "height":
            found["values"].append("" if math.isnan(altitude) else altitude)
        cell = cells[columns["mode3"]] if "mode3" in columns else None
        dialled = "" if cell is None else str(cell).strip()
        try:
            bits = code("" if dialled in BLANKS else dialled, _factor("mode3", units))
        except (ValueError, OverflowError):
            bits = -1
        found["mode3"] = int(f"{bits:o}") if 0 <= bits <= 0o7777 else -1
        return True

    def _reported(self, found: dict[str, Any], dim: int) -> bool:
        """Replace latitude and longitude, degrees, and altitude, metres, by x, y (and z); False if there are none."""
        plain = {plain_name(str(name)): value for name, value in found.items()}
        values = []
        for meaning in ("latitude", "longitude", "altitude"):
            names = [plain_name(name + ending) for name in NAMES[meaning] for ending in ENDINGS]
            values.append(next((plain[name] for name in names if plain.get(name) not in (None, "")), None))
        if values[0] is None or values[1] is None or self.scene.origin is None:
            return False
        latitude, longitude, altitude = (float(value or 0.0) for value in values)
        angles = np.radians([[latitude], [longitude]])
        found["values"] = east_north_up(angles[0], angles[1], np.array([altitude]), self.scene.origin)[0, :dim].tolist()
        return True

    def unbiased(self, s: int, time: float, values: Sequence[Any]) -> tuple[float, list[Any]]:
        """Time and values of a plot without the bias of its radar."""
        bias = self._biases[s]
        if bias == Bias() or len(values) < 2:
            return time, [*values]
        far, azimuth, *rest = values
        far = max(float(far) * (1.0 - 1e-3 * bias.gain) - bias.range, 0.0)
        return time - bias.time, [far, math.remainder(float(azimuth) + math.radians(bias.bearing), 2 * math.pi), *rest]

    def _in_scene(self, s: int, z: Array, altitudes: Array) -> Array:
        """Range and azimuth (1, 2) in the plane of the scene, of those in the plane of the radar."""
        origin = self.scene.origin
        if origin is None or not np.isfinite(z).all():
            return z
        place = self._places[s] if self._places else geodetic(self.scene.sensors[s].position, origin)[0].tolist()
        return np.column_stack([z[:, 0], azimuths_in_plane(z, altitudes, tuple(place), origin, USUAL_ALTITUDE)])


def _columns(names: Sequence[str]) -> tuple[dict[str, int], dict[str, str]] | None:
    """Columns and units as in recordings; None where range and azimuth have the plain names of what sensors measure."""
    plain = [plain_name(name) for name in names]
    if {"values", "position"} & {*plain}:
        return None
    try:
        columns, units = choose(names, {}, {})
    except InvalidInputError:
        return None
    is_plain = plain[columns["bearing"]] == "azimuth" and plain[columns["range"]] == "range"
    return None if is_plain else (columns, units)


def _factor(meaning: str, units: dict[str, str]) -> float:
    """What makes metres and radians of a column, or the base of its codes; the usual unit where none is said."""
    return UNITS[meaning][units.get(meaning, next(iter(UNITS[meaning])))]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
