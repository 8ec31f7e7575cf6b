"""Read plots (categories 001, 010, 020, 048), service messages (002, 034) and reports (010, 020, 021) as recordings."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.integrations.asterix.blocks import CATEGORIES, Records
from assoc.integrations.asterix.items import (
    ANGLE_STEP,
    COARSE,
    LEVEL_STEP,
    PLOTS,
    SECOND,
    PlotItems,
    ReportItems,
    on_earth,
    place,
    report_items,
    signed,
    value,
)
from assoc.recordings.cleaning import WIDTH, Cleaning
from assoc.recordings.columns import DAY
from assoc.recordings.recording import UNDECODED, Recording
from assoc.scene.geodesy import checked_origin, east_north_up

_SERVICE = (2, 34)
_TRACKS = 62
# truncated times of day begin anew every 512 s
_CYCLE = 65536

Source = tuple[int, int]
"""System area code and system identification code of a radar or ground station."""


@dataclass(frozen=True)
class RadarNote:
    """Service messages of a radar (categories 002 and 034).

    Attributes
    ----------
    norths : array (n,)
        Times at which the antenna passed north, seconds of the recording.
    rotation : float or None
        Last reported duration of a turn, seconds.
    place : tuple of latitude, longitude, height, or None
        Radians, metres above the ellipsoid.
    """

    norths: Array
    rotation: float | None = None
    place: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class AsterixContent:
    """Content of a file.

    Attributes
    ----------
    plots : dict of (SAC, SIC) to Recording
        Plots of each radar; `Recording.addresses` are the aircraft's ICAO addresses.
    adsb : dict of (SAC, SIC) to Recording
        ADS-B reports of each ground station, as seen from `origin`.
    multilateration : dict of (SAC, SIC) to Recording
        Positions in WGS 84 of each multilateration system, as seen from `origin`.
    radars : dict of (SAC, SIC) to RadarNote
    origin : tuple of latitude, longitude, height, or None
        Point from which reports are given as range and azimuth.
    notes : dict of str to int
        Counts of content that could not be read, by kind.
    """

    plots: Mapping[Source, Recording]
    adsb: Mapping[Source, Recording]
    radars: Mapping[Source, RadarNote]
    origin: tuple[float, float, float] | None = None
    notes: Mapping[str, int] = field(default_factory=dict)
    multilateration: Mapping[Source, Recording] = field(default_factory=dict)


class Clock:
    """The time of day of a source, running on over midnight."""

    def __init__(self) -> None:
        self.day = self.latest = 0.0
        self.begun = False
        """Whether it has had any time."""
        self.rows: list[tuple[float, ...]] = []
        """What came at these times."""

    def time(self, raw: int) -> float:
        """Seconds of the recording, by the raw time of day."""
        running = raw * SECOND + self.day
        if self.begun and running < self.latest - DAY / 2:
            self.day += DAY
            running += DAY
        elif self.day and running > self.latest + DAY / 2:
            # late, from before midnight
            running -= DAY
        self.latest = max(self.latest, running) if self.begun else running
        self.begun = True
        return running

    def taken(self) -> Array:
        """The rows so far."""
        rows, self.rows = self.rows, []
        return np.array(rows, dtype=np.float64).reshape(len(rows), -1 if rows else WIDTH)


@explains_wrong_types
def read_asterix(
    path: str | os.PathLike[str],
    *,
    origin: tuple[float, float, float] | None = None,
    editions: Mapping[int, str] | None = None,
) -> AsterixContent:
    """Read a file of ASTERIX data blocks: plain, in frames of FINAL or ORADIS, or in the UDP packets of a capture.

    Parameters
    ----------
    path : path-like
    origin : tuple of latitude, longitude, height, optional
        Point from which reports are given, radians and metres; default: on the ground below the first report.
    editions : dict of int to str, optional
        Editions by category, such as ``{21: "0.26"}``. Else that is taken, for each source, in which its blocks decode
        to plausible values.

    Returns
    -------
    AsterixContent
        Times are seconds of the day and continue after midnight. Identities are Mode 3/A codes (12 bits as a number,
        0 not decoded). Truncated times (001) take their multiple of 512 s from the radar's service messages (002);
        without these they begin at the first plot's. What cannot be decoded in a truncated or damaged file is counted
        in the notes.

    Raises
    ------
    InvalidInputError
        The file cannot be read, or holds no plot and no report; or the origin is not valid radians and metres.
    MissingExtraError
        libasterix is not installed.
    """
    seen_from = None if origin is None else checked_origin(origin)
    read = Decoded(path, editions)
    for _ in read.blocks():
        pass
    read.check()
    notes, name = read.notes, os.path.basename(os.fspath(path))
    if seen_from is None:
        first = next((one.rows[0] for one in (*read.reports.values(), *read.located.values())), None)
        seen_from = None if first is None else (first[1], first[2], 0.0)

    def recordings(found: dict[Source, Clock]) -> dict[Source, Recording]:
        rows = {source: clock.taken() for source, clock in found.items()}
        rows = {source: one if one.shape[1] == WIDTH else _seen(one, seen_from) for source, one in rows.items()}
        return {source: Cleaning(name, notes, clock=True).together(one) for source, one in rows.items()}

    plots, reports, located = map(recordings, (read.plots, read.reports, read.located))
    radars = {source: RadarNote(np.unique(radar.pop("norths")), **radar) for source, radar in read.radars.items()}
    return AsterixContent(plots, reports, radars, seen_from, dict(notes), located)


class Decoded:
    """What has been decoded of a file so far."""

    def __init__(
        self, path: str | os.PathLike[str], editions: Mapping[int, str] | None = None, *, tracks: bool = False
    ) -> None:
        self.notes = Counter[str]()
        self.plots: dict[Source, Clock] = {}
        self.reports: dict[Source, Clock] = {}
        self.located: dict[Source, Clock] = {}
        self.radars: dict[Source, dict[str, Any]] = {}
        self._clocks: dict[Source, Clock] = {}
        self._path = os.fspath(path)
        categories = [category for category in CATEGORIES if category != _TRACKS or tracks]
        self._records = Records(path, self.notes, editions, categories=categories)

    def blocks(self) -> Iterator[list[tuple[int, str, Any]]]:
        """Decode block after block; yields its records, with their category and edition."""
        for found in self._records:
            for category, edition, record in found:
                if category != _TRACKS:
                    self._take(record, category, edition)
            yield found

    def check(self) -> None:
        """Refuse a file in which there is nothing, once it is read."""
        if not (self.plots or self.reports or self.located):
            skipped = "; ".join(f"{count} {what}" for what, count in self.notes.items())
            raise InvalidInputError(
                f"{self._path}: holds no ASTERIX plots (001, 010, 020, 048) or reports (010, 020, 021)"
                f"{': ' + skipped if skipped else ''}"
            )

    def _take(self, record: Any, category: int, edition: str) -> None:
        sac, sic = value(record, "010", "SAC"), value(record, "010", "SIC")
        if sac is None or sic is None:
            self.notes["records without a source"] += 1
        elif category in _SERVICE:
            radar = self.radars.setdefault((sac, sic), {"norths": []})
            _take_service(record, radar, self._clocks.setdefault((sac, sic), Clock()))
        else:
            self._taken(record, category, report_items(category, edition), (sac, sic))

    def _taken(self, record: Any, category: int, items: ReportItems | None, source: Source) -> None:
        """Add a report or a plot to those of its source."""
        report = _report(record, items) if items else None
        plot = _plot(record, PLOTS[category]) if report is None and category in PLOTS else None
        found = plot or report
        if found is None:
            self.notes[f"records of category {category:03d} without time or position"] += 1
            return
        if report and not on_earth((report[1], report[2])):
            self.notes[f"records of category {category:03d} left out, at a latitude or longitude that cannot be"] += 1
            return
        kept = self.plots if plot is not None else self.reports if category == 21 else self.located
        clock = kept.setdefault(source, Clock())
        raw, *rest = found
        if category == 1:
            raw = full_time(int(raw), clock, self._clocks.get(source))
        if raw * SECOND < DAY:
            clock.time(int(raw))
        # not as it runs on here, where each message counts at once: a wrong one is seen by those after it
        clock.rows.append((int(raw) * SECOND, *rest))


def full_time(raw: int, *clocks: Clock | None) -> int:
    """The raw time of day of a truncated one: that nearest to the latest time on the source's clocks."""
    known = [clock.latest for clock in clocks if clock is not None and clock.begun]
    if not known:
        return raw
    steps = round(max(known) % DAY / SECOND)
    return (steps + (raw - steps + _CYCLE // 2) % _CYCLE - _CYCLE // 2) % round(DAY / SECOND)


def _plot(record: Any, items: PlotItems) -> tuple[float, ...] | None:
    """A row of `assoc.recordings.cleaning`, with the raw time."""
    item, first, second = items.polar
    time, rho, theta = value(record, items.time), value(record, item, first), value(record, item, second)
    if time is None:
        return None
    if rho is not None and theta is not None:
        where = (rho * items.step, math.pi / 2 - theta * ANGLE_STEP)
    else:
        x, y = value(record, "042", "X"), value(record, "042", "Y")
        step, bits = items.cartesian
        if x is None or y is None or not bits:
            return None
        east, north = signed(x, bits) * step, signed(y, bits) * step
        where = (math.hypot(east, north), math.atan2(north, east))
    level = value(record, *items.level)
    doubtful = bool(value(record, items.level[0], "V") or value(record, items.level[0], "G"))
    altitude = math.nan if level is None else signed(level, 14) * LEVEL_STEP
    address = float(value(record, "220") or 0)
    return (time, *where, _identity(record, items.code), altitude, -1.0, address, float(doubtful), 0.0)


def _identity(record: Any, item: str) -> float:
    code = value(record, item, "MODE3A")
    if code is None:
        code = value(record, item)
    if code is None or value(record, item, "V") or value(record, item, "G"):
        return float(UNDECODED)
    return float(code & 0o7777)


def _report(record: Any, items: ReportItems) -> tuple[float, ...] | None:
    """Raw time, latitude, longitude, identity, altitude, address of a report."""
    time = next((t for t in (value(record, item) for item in items.times) if t is not None), None)
    where = place(record, items)
    if time is None or where is None:
        return None
    level = value(record, *items.level)
    altitude = math.nan if level is None else signed(level, items.level_bits) * LEVEL_STEP
    return (time, *where, _identity(record, items.code), altitude, float(value(record, items.address) or 0))


def _take_service(record: Any, radar: dict[str, Any], clock: Clock) -> None:
    kind, time, turn = value(record, "000"), value(record, "030"), value(record, "041")
    if time is not None:
        now = clock.time(time)
        if kind == 1:
            radar["norths"].append(now)
    if turn:
        radar["rotation"] = turn * SECOND
    height, lat, lon = (value(record, "120", name) for name in ("HGT", "LAT", "LON"))
    if height is not None and lat is not None and lon is not None:
        radar["place"] = (signed(lat, 24) * COARSE, signed(lon, 24) * COARSE, float(signed(height, 16)))


def _seen(rows: Array, origin: tuple[float, float, float] | None) -> Array:
    """Rows of reports as rows of plots, as seen from a place."""
    assert origin is not None
    times, lat, lon, identities, altitudes, addresses = rows.T
    east, north, up = east_north_up(lat, lon, np.nan_to_num(altitudes), origin).T
    none = np.zeros(len(rows))
    return np.column_stack(
        [times, np.hypot(np.hypot(east, north), up), np.arctan2(north, east), identities, altitudes,
         none - 1.0, addresses, none, none]
    )  # fmt: skip
