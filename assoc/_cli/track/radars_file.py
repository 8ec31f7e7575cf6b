"""``radars.toml``: several radars, their files and their places, as one scene."""

from __future__ import annotations

import math
import os
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from assoc._cli.inputs import read_toml, with_others
from assoc._cli.values import editions_of
from assoc._files.reading import kind_of
from assoc._text.near import did_you_mean
from assoc._text.plain import printable
from assoc._text.times import UNIX
from assoc.errors import AssocError, InvalidInputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from assoc._types import Array
    from assoc.recordings import Recording
    from assoc.recordings.flights.positions import Positions
    from assoc.recordings.on_earth import Bias
    from assoc.registration import Registration
    from assoc.scene.geodesy import Origin
    from assoc.scene.scene import Scene
    from assoc.sensors import PositionSensor, Radar2D

KEYS = (
    "name", "file", "radar", "editions", "columns", "units", "place", "noise", "detection_probability", "false_alarms",
    "reach_km", "resolution", "turn", "bias",
)  # fmt: skip
"""Keys of a table [[radar]]."""
REPORT_KEYS = ("name", "file", "source", "editions", "columns", "units", "noise")
"""Keys of a table [[reports]]."""
_TOP = ("name", "origin", "interval", "closed", "heights", "radar", "reports")
DAY = 86_400.0
# metres: of positions by satellites, and of altitudes by pressure
_REPORT_NOISE = (10.0, 30.0)
# metres, where a radar's heights by Mode C have no noise of their own: steps of 100 feet, and a pressure that drifts
_HEIGHT_NOISE = 30.0


class Radars(NamedTuple):
    """What a description says, and the scene of its plots."""

    scene: Scene
    recordings: list[Recording]
    radars: list[Radar2D]
    turns: list[float]
    identities: list[tuple[Array, ...]]
    """Codes and addresses of the scene's plots."""
    closed: list[Array]
    """Areas where no track starts: x and y of their corners."""
    places: list[Origin]
    biases: list[Bias]
    """What was taken off the plots of each radar."""
    reports: list[tuple[Positions, PositionSensor]]
    """What targets report themselves, and the sensors of the scene that follow those of the radars."""

    def with_further(self, found: Registration) -> list[Bias]:
        """The biases of all radars, with those found in the scene."""
        from assoc.recordings.on_earth import Bias

        further = []
        for number, bias in enumerate(self.biases):
            of = found.of(self.numbers.index(number))
            bearing = -math.degrees(of.get("azimuth", 0.0))
            more = Bias(of.get("range", 0.0), bearing, 1e3 * of.get("gain", 0.0), of.get("time", 0.0))
            further.append(bias.and_then(more))
        return further

    @property
    def numbers(self) -> list[int]:
        """The radar of each sensor of the scene, from 0."""
        from assoc.recordings.several import parts_of_radars

        return [part.number for part in parts_of_radars(self.recordings, self.radars)]

    @property
    def sensor_turns(self) -> list[float]:
        """Seconds for a turn of each sensor of the scene."""
        return [self.turns[number] for number in self.numbers] + [one.pace for one, _ in self.reports]

    @property
    def references(self) -> tuple[str, ...]:
        """Sensors without bias: satellites give the positions that are reported."""
        return tuple(sensor.name for _, sensor in self.reports)

    @property
    def shortest(self) -> float:
        """Seconds after which a target is seen again at the earliest."""
        return min(self.turns or [one.pace for one, _ in self.reports])


def read_radars(path: str) -> Radars:
    """Read a description and its files, which are found from the folder that it is in.

    Where a key or a file is not as expected the message names the file, the radar and the key.
    """
    import numpy as np

    from assoc.recordings.flights.positions import scene_with, sensors_of
    from assoc.recordings.on_earth import placed
    from assoc.recordings.several import EARTH, identities_of_radars, scene_of_radars

    top = read_toml(path)
    _check_keys(path, top, _TOP)
    tables, of_reports = (_tables(top, key) for key in ("radar", "reports"))
    if not tables and not of_reports:
        raise InvalidInputError(f"{path}: expected a table [[radar]] for each radar, or [[reports]]")
    wrong = list[AssocError]()
    read = _each(_read_radar, path, tables, wrong)
    told = _each(_read_reports, path, of_reports, wrong)
    if wrong:
        raise with_others(wrong)
    if "origin" in top:
        origin = _place(top["origin"], f"{path}: origin")
    else:
        origin = read[0][3] if read else told[0].middle
    heights = _heights(top, path)
    usual = {} if heights is None else {"usual": 0.5 * sum(heights)}
    biases = [_bias(table, f"{path}: radar {printable(str(table.get('name', number)))}")
              for number, table in enumerate(tables, 1)]  # fmt: skip
    days = _days([float(one.times[0]) for one in (*(recording for recording, *_ in read), *told)])
    recordings, radars = [], []
    for (recording, radar, _, place, height_noise), day, bias in zip(read, days, biases, strict=False):
        plots = bias.off(replace(recording, times=recording.times + day))
        own = placed(plots, radar, place, origin, height_noise, **usual)
        recordings.append(own[0])
        radars.append(own[1])
    turns = [turn for _, _, turn, _, _ in read]
    interval = None if "interval" not in top else _number(top["interval"], f"{path}: interval")
    scene = None
    identities: list[tuple[Array, ...]] = []
    if read:
        scene = scene_of_radars(recordings, radars, rotations=turns, interval=interval, origin=origin)
        identities = identities_of_radars(recordings, radars, scene.times)
    reports = []
    for one, table, day in zip(told, of_reports, days[len(read) :], strict=True):
        moved = replace(one, times=one.times + day)
        name, noise = str(table.get("name", "reports")), _report_noise(path, table)
        for rows, sensor in sensors_of(moved, name, noise, moved.in_scene(origin)):
            reports.append((moved.take(rows), sensor))
    if reports:
        pace = interval or 0.5 * min(turns or [one.pace for one, _ in reports])
        scene, identities = scene_with(scene, identities, reports, origin, pace)
    assert scene is not None
    region = np.array(scene.region)
    if heights is not None:
        # far from the origin the ground lies below the plane
        drop = float((np.abs(region[:2]).max(axis=1) ** 2).sum()) / (2.0 * EARTH)
        region[2] = heights[0] - origin[2] - drop, heights[1] - origin[2]
    scene = replace(scene, name=str(top.get("name", scene.name)), region=region)
    closed = _areas(top.get("closed", []), f"{path}: closed", origin)
    places = [place for _, _, _, place, _ in read]
    return Radars(scene, recordings, radars, turns, identities, closed, places, biases, reports)


def _heights(top: dict[str, Any], path: str) -> tuple[float, float] | None:
    """Lowest and highest altitude of targets, metres, if it is said."""
    value = top.get("heights")
    if value is None:
        return None
    if not _is_pair(value) or not -1e3 <= value[0] < value[1] <= 1e6:
        raise InvalidInputError(
            f"{path}: heights: expected [lowest, highest] altitude of targets, metres, got {value!r}"
        )
    return float(value[0]), float(value[1])


def _each(
    read: Callable[[str, int, dict[str, Any]], Any], path: str, tables: list[dict[str, Any]], wrong: list[AssocError]
) -> list[Any]:
    """What is read of each table; what is wrong with them, all in one round."""
    found = []
    for number, table in enumerate(tables, 1):
        try:
            found.append(read(path, number, table))
        except InvalidInputError as error:
            wrong.append(error)
    return found


def _tables(top: dict[str, Any], key: str) -> list[dict[str, Any]]:
    found = top.get(key, [])
    if not isinstance(found, list) or not all(isinstance(table, dict) for table in found):
        raise InvalidInputError(f"{key}: expected a table [[{key}]] for each")
    return found


def _read_reports(path: str, number: int, table: dict[str, Any]) -> Positions:
    """Reports of AIS, ADS-B, or a system that gives positions."""
    from assoc.recordings.flights.positions import positions_of, read_positions

    where = f"{path}: reports {printable(str(table.get('name', number)))}"
    _check_keys(where, table, REPORT_KEYS)
    file = table.get("file")
    if not isinstance(file, str):
        raise InvalidInputError(f"{where}: file: expected the name of a file with its reports")
    file = os.path.join(os.path.dirname(path), file)
    if kind_of(file) != "asterix":
        return read_positions(file, **_texts(table, where))
    from assoc.integrations.asterix import read_asterix
    from assoc.integrations.asterix.parts import chosen_radar

    content = read_asterix(file, editions=editions_of(table.get("editions", {}), f"{where}: editions"))
    sources = {**content.multilateration, **content.adsb}
    if not sources or content.origin is None:
        raise InvalidInputError(f"{file}: has no reports of positions (categories 021, 020, 010)")
    source = chosen_radar(file, sources, table.get("source"), f"{where}: source")
    return positions_of(sources[source], content.origin)


def _report_noise(path: str, table: dict[str, Any]) -> tuple[float, float]:
    """Noise of positions and of altitudes, metres."""
    noise, where = table.get("noise", []), f"{path}: reports: noise"
    if not isinstance(noise, list) or len(noise) > 2:
        raise InvalidInputError(f"{where}: expected [metres] or [metres, metres of altitude], got {noise!r}")
    given = [_number(value, where) for value in noise]
    return (*given, *_REPORT_NOISE[len(given) :])  # type: ignore[return-value]


def _texts(table: dict[str, Any], where: str) -> dict[str, dict[str, str]]:
    """Columns and units that a table says."""
    options = {key: table.get(key, {}) for key in ("columns", "units")}
    for key, value in options.items():
        if not isinstance(value, dict) or not all(isinstance(text, str) for text in value.values()):
            raise InvalidInputError(f"{where}: {key}: expected a table such as {{ range = 'm' }}")
    return options


def _bias(table: dict[str, Any], where: str) -> Bias:
    """What a radar states less what is true."""
    from dataclasses import fields

    from assoc.recordings.on_earth import Bias

    value = table.get("bias", {})
    if not isinstance(value, dict):
        raise InvalidInputError(f"{where}: bias: expected a table such as {{ range = 120.0, bearing = -0.3 }}")
    _check_keys(f"{where}: bias", value, tuple(field.name for field in fields(Bias)))
    for key, number in value.items():
        if isinstance(number, bool) or not isinstance(number, (int, float)) or not abs(number) < 1e9:
            raise InvalidInputError(f"{where}: bias: {key}: expected a number, got {number!r}")
    return Bias(**{key: float(number) for key, number in value.items()})


def write_biases(path: str, biases: list[Bias]) -> None:
    """Write the biases of all radars into a description, which stays as it is otherwise.

    Refused if its tables are not written as ``[[radar]]``, or a bias is written in several lines.
    """
    import tomllib

    from assoc._files.output import write_text
    from assoc._files.reading import read_bytes

    text = read_bytes(path, 1_000_000).decode()
    lines, number, inside = [], 0, False
    for line in text.splitlines(keepends=True):
        if re.match(r"\s*\[", line):
            inside = re.match(r"\s*\[\[\s*radar\s*\]\]", line) is not None
        elif inside and re.match(r"\s*bias\s*=", line):
            continue
        lines.append(line)
        if inside and re.match(r"\s*\[\[", line) and number < len(biases):
            end = "\r\n" if line.endswith("\r\n") else "\n"
            lines.append(f"bias = {_inline(biases[number])}{end}")
            number += 1
    written = "".join(lines)
    wanted = tomllib.loads(text)
    for table, bias in zip(wanted["radar"], biases, strict=True):
        table["bias"] = tomllib.loads(f"bias = {_inline(bias)}")["bias"]
    try:
        good = tomllib.loads(written) == wanted
    except tomllib.TOMLDecodeError:
        good = False
    if not good:
        raise InvalidInputError(
            f"{path}: --write: expected tables [[radar]] on lines of their own, a bias on one line; write yourself: "
            + "; ".join(f"bias = {_inline(bias)}" for bias in biases)
        )
    write_text(path, written)


def _inline(bias: Bias) -> str:
    """A bias as an inline table of TOML, without what is 0."""
    digits = {"range": 1, "bearing": 4, "gain": 4, "time": 3}
    shown = {name: round(getattr(bias, name), places) for name, places in digits.items()}
    return "{ " + ", ".join(f"{name} = {value}" for name, value in shown.items() if value) + " }"


def _areas(value: object, label: str, origin: tuple[float, float, float]) -> list[Array]:
    """Corners of areas in the frame of the scene, by their latitudes and longitudes in degrees."""
    import numpy as np

    from assoc._cli.values import as_polygon
    from assoc.scene.geodesy import east_north_up

    if not isinstance(value, list):
        raise InvalidInputError(f"{label}: expected a list of areas, got {value!r}")
    found = []
    for number, area in enumerate(value, 1):
        where = f"{label}: area {number}"
        corners = area if isinstance(area, list) else []
        if len(corners) < 2 or not all(_is_pair(corner) for corner in corners):
            raise InvalidInputError(
                f"{where}: expected 2 corners of a box, or 3 or more, [latitude, longitude] in degrees, got {area!r}"
            )
        polygon = as_polygon([_place(corner, where)[:2] for corner in corners], where)
        latitudes, longitudes = np.array(polygon).T
        found.append(east_north_up(latitudes, longitudes, np.zeros(len(polygon)), origin)[:, :2])
    return found


def _is_pair(value: Any) -> bool:
    """Whether it is a list of two numbers."""
    return isinstance(value, list) and [type(number) in (int, float) for number in value] == [True, True]


def _days(starts: list[float]) -> list[float]:
    """Seconds that bring times of day, as of ASTERIX, to the day of the files with dates, if there are such."""
    dated = [start for start in starts if start > UNIX]
    if not dated:
        return [0.0] * len(starts)
    return [0.0 if start > UNIX else DAY * round((dated[0] - start) / DAY) for start in starts]


def _read_radar(path: str, number: int, table: dict[str, Any]) -> tuple[Any, ...]:
    """Recording, radar, seconds of a turn, place, and noise of heights (None where there are none)."""
    import numpy as np

    from assoc.recordings import estimate_rotation, radar_of

    name = str(table.get("name", number))
    where = f"{path}: radar {printable(name)}"
    _check_keys(where, table, KEYS)
    recording, turn, place = _plots(path, table, where)
    if "place" in table:
        place = _place(table["place"], f"{where}: place")
    if place is None:
        raise InvalidInputError(f"{where}: place: expected [latitude, longitude, height] in degrees and metres")
    if "turn" in table:
        turn = _number(table["turn"], f"{where}: turn")
    noise = table.get("noise", [])
    if not isinstance(noise, list) or len(noise) not in (0, 2, 3):
        raise InvalidInputError(f"{where}: noise: expected [metres, degrees] or [metres, degrees, metres of height]")
    given = [_number(value, f"{where}: noise") for value in noise]
    options = {
        name: _number(table[key], f"{where}: {key}")
        for key, name in (("detection_probability", "detection_probability"), ("false_alarms", "false_alarm_rate"))
        if key in table
    }
    try:
        if turn is None:
            turn = estimate_rotation(recording)
        if given:
            options |= {"range_noise": given[0], "azimuth_noise": math.radians(given[1])}
        radar = radar_of(recording, name=name, **options)
    except InvalidInputError as error:
        if turn is None:
            raise InvalidInputError(f"{where}: turn: {error}") from None
        what = str(error).removeprefix("range_noise: ").removeprefix("azimuth_noise: ")
        raise InvalidInputError(f"{where}: noise: {what} ([100, 0.1], metres and degrees, is usual)") from None
    if "resolution" in table:
        apart = table["resolution"]
        if not isinstance(apart, list) or len(apart) != 2:
            raise InvalidInputError(f"{where}: resolution: expected [metres, degrees], got {apart!r}")
        length, angle = (_number(value, f"{where}: resolution") for value in apart)
        radar = replace(radar, resolution=np.array([length, math.radians(angle)]))
    if "reach_km" in table:
        view = radar.field_of_view.copy()
        view[0, 1] = 1e3 * _number(table["reach_km"], f"{where}: reach_km")
        recording = recording.take(np.flatnonzero(recording.ranges <= view[0, 1]))
        if not len(recording):
            raise InvalidInputError(f"{where}: reach_km: no plot is within {table['reach_km']} km")
        radar = replace(radar, field_of_view=view)
    heard = bool(np.isfinite(recording.trusted_altitudes).any())
    return recording, radar, turn, place, (given[2] if len(given) == 3 else _HEIGHT_NOISE) if heard else None


def _plots(path: str, table: dict[str, Any], where: str) -> tuple[Recording, float | None, Any]:
    """Plots of a radar; seconds of a turn and place where the file says them."""
    from assoc.recordings import read_plots

    file = table.get("file")
    if not isinstance(file, str):
        raise InvalidInputError(f"{where}: file: expected the name of a file with its plots")
    file = os.path.join(os.path.dirname(path), file)
    if kind_of(file) != "asterix":
        options: dict[str, Any] = _texts(table, where)
        try:
            return read_plots(file, **options), None, None
        except InvalidInputError as error:
            hint = f"; say which it is: columns = {{ ... }} of {where}" if ": no column " in str(error) else ""
            raise InvalidInputError(f"{error}{hint}") from None
    from assoc.integrations.asterix import read_asterix
    from assoc.integrations.asterix.parts import chosen_radar

    content = read_asterix(file, editions=editions_of(table.get("editions", {}), f"{where}: editions"))
    source = chosen_radar(file, content.plots, table.get("radar"), f"{where}: radar")
    note = content.radars.get(source)
    return content.plots[source], None if note is None else note.rotation, None if note is None else note.place


def _check_keys(where: str, table: dict[str, Any], known: tuple[str, ...]) -> None:
    for key in table:
        if key not in known:
            hint = did_you_mean(key, known)
            raise InvalidInputError(f"{where}: unknown key {key!r}; {hint or 'known: ' + ', '.join(known)}")


def _number(value: object, label: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < math.inf:
        raise InvalidInputError(f"{label}: expected a number above 0, got {value!r}")
    return float(value)


def _place(value: object, label: str) -> tuple[float, float, float]:
    """Latitude and longitude in radians, height."""
    from assoc._cli.values import position_on_earth

    if not isinstance(value, list) or not all(isinstance(number, (int, float)) for number in value):
        raise InvalidInputError(f"{label}: expected [latitude, longitude, height] in degrees and metres, got {value!r}")
    return position_on_earth(",".join(map(repr, value)), label)
