"""Arrival times at receivers (multilateration, seismic phases) from CSV or Parquet files, as scenes.

No emission lies in two scans: a scan ends where for longer than a wave takes from one receiver to the farthest other
nothing arrives. Times are kept to the nanosecond, which seconds since 1970 as one number would lose.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import Decimal
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from assoc._text.near import did_you_mean
from assoc._text.plain import printable
from assoc._types import Array
from assoc.errors import InvalidInputError, warn
from assoc.recordings.flights.table import columns_of, numbers_of, read_table, require
from assoc.recordings.several import EARTH
from assoc.scene.geodesy import Origin, east_north_up
from assoc.scene.scene import Scene
from assoc.sensors import ArrivalTimeSensor

if TYPE_CHECKING:
    import pandas as pd

_STATION = ("station", "receiver", "name", "sensor", "site", "code", "id")
_TICKS = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
COLUMNS = {
    **{"time" + end: tuple(name + end for name in ("time", "arrival_time", "arrival", "timestamp", "pick", "t"))
       for end in ("", *(f"_{unit}" for unit in _TICKS))},
    "station": _STATION,
    "phase": ("phase", "phase_hint", "wave"),
}  # fmt: skip
"""Usual columns of arrivals by meaning; a time may end in its unit, the phase is optional."""
STATIONS = {
    "station": _STATION,
    "latitude": ("lat", "latitude"),
    "longitude": ("lon", "long", "lng", "longitude"),
    "height": ("height", "elevation", "altitude", "elev", "alt", "z", "z_m", "height_m", "elevation_m"),
    "x": ("x", "x_m"),
    "y": ("y", "y_m"),
}
"""Usual columns of stations: latitude and longitude, or x and y in metres; heights in metres are optional."""
_LAST = 10**12
"""Seconds that a time may be."""
_SCAN = 1000
"""Arrivals of a scan that is cut at its widest gap: costs grow with the square of it."""


class Stations(NamedTuple):
    """Receivers by name: their places x, y, z, and of what place on the earth these are seen (None: of none)."""

    places: dict[str, Array]
    origin: Origin | None


class Arrivals(NamedTuple):
    """Arrival times in order, n of them: seconds since ``start``, which is a whole number of seconds."""

    start: int
    times: Array
    stations: Array
    phases: Array
    rows: Array
    """Row of the file, from 1."""
    dated: bool

    def take(self, rows: Array) -> Arrivals:
        """Those of some rows."""
        return self._replace(
            times=self.times[rows], stations=self.stations[rows], phases=self.phases[rows], rows=self.rows[rows]
        )


class ArrivalScene(NamedTuple):
    """A scene of arrival times, and of which arrivals its measurements are: rows, scan by scan, sensor by sensor."""

    scene: Scene
    rows: list[list[Array]]
    arrivals: Arrivals
    duration: float
    """Seconds that all scans are of."""


def read_stations(path: str) -> Stations:
    """Read the places of receivers (`STATIONS`); InvalidInputError, beginning with the file."""

    def choose(header: Sequence[str]) -> dict[str, str]:
        chosen = columns_of(path, header, STATIONS, {})
        earth = ("x", "y") if "x" in chosen and "latitude" not in chosen else ("latitude", "longitude")
        require(path, header, chosen, STATIONS, "station", *earth)
        return {meaning: chosen[meaning] for meaning in ("station", *earth, "height") if meaning in chosen}

    table, chosen = read_table(path, choose, ("station",))
    names = table[chosen["station"]].astype(str).str.strip().to_numpy()
    height = numbers_of(table[chosen["height"]]) if "height" in chosen else np.zeros(len(table))
    first, second = (numbers_of(table[column]) for column in list(chosen.values())[1:3])
    earth = "latitude" in chosen
    good = np.isfinite(first) & np.isfinite(second) & np.isfinite(height)
    if earth:
        good &= (np.abs(first) <= 90.0) & (np.abs(second) <= 360.0)
    for k in np.flatnonzero(~good).tolist():
        raise InvalidInputError(f"{path}: row {k + 1}: station {printable(names[k])} has no place that can be")
    if len({*names}) < len(names) or not len(names):
        twice = [name for name in names if list(names).count(name) > 1]
        raise InvalidInputError(
            f"{path}: {f'station {printable(twice[0])} is there more than once' if twice else 'has no stations'}"
        )
    if not earth:
        return Stations(dict(zip(names, np.stack([first, second, height], axis=1), strict=True)), None)
    first, second = np.radians(first), np.radians(second)
    origin = (float(first.mean()), float(np.angle(np.exp(1j * second).mean())), 0.0)
    return Stations(dict(zip(names, east_north_up(first, second, height, origin), strict=True)), origin)


def read_arrivals(path: str, stations: Stations) -> Arrivals:
    """Read arrival times at stations (`COLUMNS`); what is left out is counted in a warning.

    Times are numbers, or dates (ISO 8601, by default UTC). InvalidInputError, beginning with the file: it or a column
    is missing, or no row has a time and a known station.
    """

    def choose(header: Sequence[str]) -> dict[str, str]:
        chosen = columns_of(path, header, COLUMNS, {})
        times = [meaning for meaning in COLUMNS if meaning.startswith("time") and meaning in chosen]
        require(path, header, chosen, COLUMNS, *(times[:1] or ["time"]), "station")
        return {meaning: chosen[meaning] for meaning in (times[0], "station", "phase") if meaning in chosen}

    table, chosen = read_table(path, choose, [*COLUMNS])
    meaning, column = next(iter(chosen.items()))
    whole, rest, dated = exact_seconds(table[column], _TICKS[meaning.partition("_")[2] or "s"])
    names = table[chosen["station"]].astype(str).str.strip().to_numpy()
    phases = np.full(len(table), "", dtype=object)
    if "phase" in chosen:
        phases = table[chosen["phase"]].fillna("").astype(str).str.strip().to_numpy(dtype=object)
    timed, known = np.isfinite(rest), np.array([name in stations.places for name in names], dtype=np.bool_)
    strange = sorted({*names[timed & ~known].tolist()})
    if not (timed & known).any():
        near = did_you_mean(strange[0], [*stations.places]) if strange else ""
        what = f"station {printable(strange[0])} is not among the stations; {near}" if strange else "no row has a time"
        raise InvalidInputError(f"{path}: {what.removesuffix('; ')}")
    start = int(whole[timed & known].min())
    times = (whole - start) + rest
    order = np.flatnonzero(timed & known)
    order = order[np.lexsort((phases[order].astype(str), names[order].astype(str), times[order]))]
    same = (np.diff(times[order]) == 0) & (names[order][1:] == names[order][:-1])
    again = np.append(False, same & (phases[order][1:] == phases[order][:-1]))
    left = {
        "rows without a time": int((~timed).sum()),
        f"arrivals at unknown stations ({printable(', '.join(strange[:5]))})": int((timed & ~known).sum()),
        "repeated rows": int(again.sum()),
    }
    if said := "; ".join(f"{count} {what}" for what, count in left.items() if count):
        warn(f"{path}: left out: {said}")
    order = order[~again]
    return Arrivals(start, times[order], names[order], phases[order], order + 1, dated)


def exact_seconds(column: pd.Series, ticks: int) -> tuple[Array, Array, bool]:
    """Whole seconds, int64 (n,), the rest (n,), NaN without a time, of numbers, in so many ticks a second, or of dates.

    The third says whether they are dates.
    """
    import pandas as pd

    dates = column.dtype.kind == "M" or isinstance(column.dtype, pd.DatetimeTZDtype)
    found = [None] if dates else [_divided(text, ticks) for text in column.astype(str)]
    if any(one is not None for one in found):
        whole, rest = np.array([one or (0, math.nan) for one in found], dtype=object).T
        return whole.astype(np.int64), rest.astype(np.float64), False
    form = None if dates else "ISO8601"
    moments = pd.to_datetime(column, format=form, utc=True, errors="coerce").dt.tz_convert(None)
    count = moments.to_numpy(dtype="datetime64[ns]").astype(np.int64)
    known = moments.notna().to_numpy()
    whole, rest = np.divmod(np.where(known, count, 0), 10**9)
    return whole, np.where(known, rest / 1e9, np.nan), True


def _divided(text: str, ticks: int) -> tuple[int, float] | None:
    """Whole seconds of a number, and the rest; None of what is no number."""
    try:
        number = Decimal(text.strip()) / ticks
    except ArithmeticError:
        return None
    if not number.is_finite() or abs(number) > _LAST:
        return None
    whole = math.floor(number)
    return whole, float(number - whole)


def scene_of_arrivals(
    arrivals: Arrivals,
    stations: Stations,
    speeds: Mapping[str, float],
    noise: float,
    heights: tuple[float, float],
    *,
    beyond: float | None = None,
    detection_probability: float = 0.8,
    false_alarms: float | None = None,
) -> ArrivalScene:
    """Make the scene of arrival times.

    ``speeds`` (m/s) are by phase, or of all under the empty name; arrivals of other phases are left out and told. A
    station without arrivals takes no part. The region reaches ``beyond`` the stations, metres (default: as far as they
    reach themselves), from the lower of ``heights`` to the upper, metres above the ellipsoid, or z. ``false_alarms``
    are of each station in a second; by default every second arrival is one.
    """
    everything = set(speeds) == {""}
    keep = np.array([everything or phase in speeds for phase in arrivals.phases], dtype=np.bool_)
    if not keep.all():
        strange = sorted({*arrivals.phases[~keep].tolist()})
        others = ", ".join(repr(phase) for phase in strange[:5])
        warn(f"left out: {np.count_nonzero(~keep)} arrivals of phases without a speed ({printable(others)})")
        arrivals = arrivals.take(np.flatnonzero(keep))
    kinds = ["" if everything else phase for phase in arrivals.phases]
    sensed = sorted({*zip(arrivals.stations.tolist(), kinds, strict=True)})
    if len({name for name, _ in sensed}) < 3:
        raise InvalidInputError(f"arrivals: are of {len({name for name, _ in sensed})} stations, which locate nothing")
    number = {sensor: k for k, sensor in enumerate(sensed)}
    owner = np.array([number[sensor] for sensor in zip(arrivals.stations.tolist(), kinds, strict=True)])
    sites = np.array([stations.places[name] for name, _ in sensed])
    speed = np.array([speeds[phase] for _, phase in sensed])
    region = _region(sites, heights, beyond, stations.origin)
    # what one receiver hears later than another, at most: as far as they are apart, or two waves run from anywhere
    widest = max(float(np.linalg.norm(sites - site, axis=1).max()) for site in sites)
    if speed.min() < speed.max():
        widest = float(np.linalg.norm(np.maximum(region[:, 1] - sites, sites - region[:, 0]).max(axis=0)))
    spread = widest / float(speed.min()) + 10.0 * noise
    cuts = _cuts(arrivals.times, spread)
    scans = np.split(np.arange(len(arrivals.times)), cuts)
    listened = max(spread, *(float(arrivals.times[scan[-1]] - arrivals.times[scan[0]]) for scan in scans))
    duration = max(listened, float(arrivals.times[-1] - arrivals.times[0]))
    if false_alarms is None:
        false_alarms = 0.5 * len(owner) / len(sensed) / duration
    sensors = [
        ArrivalTimeSensor(
            position=site, noise=np.array([noise]), wave_speed=float(own), field_of_view=np.array([[0.0, listened]]),
            detection_probability=detection_probability, false_alarm_rate=false_alarms * listened,
            name=f"{name} {phase}".strip(),
        )
        for site, own, (name, phase) in zip(sites, speed, sensed, strict=True)
    ]  # fmt: skip
    rows = [[scan[owner[scan] == k] for k in range(len(sensed))] for scan in scans]
    starts = [float(arrivals.times[scan[0]]) for scan in scans]
    values = [[(arrivals.times[own] - begin)[:, None] for own in of] for of, begin in zip(rows, starts, strict=True)]
    scene = Scene(sensors, np.array(starts), values, region=region, origin=stations.origin)
    return ArrivalScene(scene, rows, arrivals, duration)


def _region(sites: Array, heights: tuple[float, float], beyond: float | None, origin: Origin | None) -> Array:
    """Where emissions may be, (3, 2), metres: in a plane if both heights are the same."""
    low, high = sites.min(axis=0), sites.max(axis=0)
    more = float((high - low)[:2].max()) if beyond is None else beyond
    region = np.column_stack([low - more, high + more])
    region[2] = heights
    if origin is not None and heights[0] < heights[1]:
        # far from the origin the ground lies below the plane
        region[2, 0] -= float((np.abs(region[:2]).max(axis=1) ** 2).sum()) / (2.0 * EARTH)
    return region


def _cuts(times: Array, spread: float) -> Array:
    """Where scans begin, but the first; told where an emission may lie across."""
    gaps = np.diff(times)
    cuts = [*(np.flatnonzero(gaps > spread) + 1).tolist()]
    forced, waiting = [], list(zip([0, *cuts], [*cuts, len(times)], strict=True))
    while waiting:
        first, last = waiting.pop()
        if last - first > _SCAN:
            quarter = (last - first) // 4
            cut = first + quarter + 1 + int(gaps[first + quarter : last - quarter - 1].argmax())
            forced.append(cut)
            waiting += [(first, cut), (cut, last)]
    if forced:
        warn(f"cut at {len(forced)} gaps shorter than a wave's {spread:.3g} s: an emission there may be found in parts")
    return np.array(sorted([*cuts, *forced]), dtype=np.int64)
