"""Read plots (categories 001, 010, 020, 048), service messages (002, 034) and reports (010, 020, 021) as recordings."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.integrations.asterix.blocks import data_blocks, read_bytes, records, signed, value
from assoc.recordings.altitude import NEARBY, garbled_altitudes
from assoc.recordings.columns import DAY, FLIGHT_LEVEL, NAUTICAL_MILE
from assoc.recordings.recording import UNDECODED, Recording
from assoc.recordings.running_times import RunningTimes
from assoc.scene.geodesy import checked_origin, east_north_up

SECOND = 1.0 / 128.0
"""Step of times of day."""
RANGE_STEP, ANGLE_STEP = NAUTICAL_MILE / 256.0, 2.0 * math.pi / 65536.0
"""Steps of measured positions in category 048."""
LEVEL_STEP = 0.25 * FLIGHT_LEVEL
_FINE, _COARSE = math.pi / 2**30, math.pi / 2**23
_SERVICE = (2, 34)
# truncated times of day begin anew every 512 s
_CYCLE = 65536

Source = tuple[int, int]
"""System area code and system identification code of a radar or ground station."""


class _Plot(NamedTuple):
    """Where a category has what a plot needs."""

    time: str
    polar: tuple[str, str, str]
    step: float
    code: str
    level: tuple[str, str]
    cartesian: tuple[float, int] = (0.0, 0)
    """Step and bits of item 042, if that is an alternative."""


class _Report(NamedTuple):
    """Where a category has what a report of a position in WGS 84 needs: items with bits and steps, best first."""

    times: tuple[str, ...]
    places: tuple[tuple[str, int, float], ...]
    code: str
    level: tuple[str, ...]
    level_bits: int
    address: str


_PLOTS = {
    1: _Plot("141", ("040", "RHO", "THETA"), NAUTICAL_MILE / 128.0, "070", ("090", "HGT")),
    10: _Plot("140", ("040", "RHO", "TH"), 1.0, "060", ("090", "FL"), (1.0, 16)),
    20: _Plot("140", ("040", "RHO", "THETA"), 1.0, "070", ("090", "FL"), (0.5, 24)),
    48: _Plot("140", ("040", "RHO", "THETA"), RANGE_STEP, "070", ("090", "FL")),
}
_REPORTS = {
    10: _Report(("140",), (("041", 32, math.pi / 2**31),), "060", ("090", "FL"), 14, "220"),
    20: _Report(("140",), (("041", 32, math.pi / 2**25),), "070", ("090", "FL"), 14, "220"),
    21: _Report(("071", "073", "077"), (("131", 32, _FINE), ("130", 24, _COARSE)), "070", ("145",), 16, "080"),
}


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


WRONG_TIMES = "plots left out whose time no other supports"


class SourceRows:
    """Rows of one source, the time of day first; times continue beyond 24 h after midnight."""

    def __init__(self) -> None:
        self.rows: list[tuple[float, ...]] = []
        self.day = self.latest = 0.0
        self.begun = False
        """Whether it has had any time."""
        self._times = RunningTimes(NEARBY, clock=True)

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

    def taken(self, notes: dict[str, int], *, last: bool) -> Array:
        """The rows so far whose times are sure, which run on; all that are right if these are the last."""
        columns = len(self.rows[0]) if self.rows else 0
        before = self._times.left_out
        found = self._times.take(np.array(self.rows, dtype=np.float64).reshape(len(self.rows), columns))
        self.rows = []
        if last:
            rest = self._times.rest(found.shape[1])
            found = np.concatenate([found, rest]) if len(rest) else found
        if self._times.left_out > before:
            notes[WRONG_TIMES] = notes.get(WRONG_TIMES, 0) + self._times.left_out - before
        return found

    def table(self, notes: dict[str, int]) -> Array:
        """All rows, sorted by the first column, the time."""
        table = self.taken(notes, last=True)
        return np.asarray(table[np.argsort(table[:, 0], kind="stable")])


@explains_wrong_types
def read_asterix(path: str | os.PathLike[str], *, origin: tuple[float, float, float] | None = None) -> AsterixContent:
    """Read a file of ASTERIX data blocks, plain or in the UDP packets of a pcap.

    Parameters
    ----------
    path : path-like
    origin : tuple of latitude, longitude, height, optional
        Point from which reports are given, radians and metres; default: on the ground below the first report.

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
    read = Decoded()
    for _ in read.blocks(path):
        pass
    read.check(path)
    notes, plots, reports, located = read.notes, read.plots, read.reports, read.located
    name = os.path.basename(os.fspath(path))
    if seen_from is None:
        first = next((rows.rows[0] for rows in (*reports.values(), *located.values()) if rows.rows), None)
        seen_from = None if first is None else (first[1], first[2], 0.0)
    return AsterixContent(
        {source: recording_of(rows.table(notes), name, notes) for source, rows in plots.items() if rows.rows},
        {source: _seen(rows, seen_from, name, notes) for source, rows in reports.items() if rows.rows and seen_from},
        {source: RadarNote(np.sort(radar.pop("norths")), **radar) for source, radar in read.radars.items()},
        seen_from,
        notes,
        {source: _seen(rows, seen_from, name, notes) for source, rows in located.items() if rows.rows and seen_from},
    )


class Decoded:
    """What has been decoded of a file so far."""

    def __init__(self) -> None:
        self.notes: dict[str, int] = {}
        self.plots: dict[Source, SourceRows] = {}
        self.reports: dict[Source, SourceRows] = {}
        self.located: dict[Source, SourceRows] = {}
        self.radars: dict[Source, dict[str, Any]] = {}
        self._clocks: dict[Source, SourceRows] = {}

    def blocks(self, path: str | os.PathLike[str]) -> Iterator[None]:
        """Decode block after block."""
        for block in data_blocks(read_bytes(path), self.notes):
            if block.category not in _PLOTS and block.category not in _REPORTS and block.category not in _SERVICE:
                self._count(f"data blocks of category {block.category:03d}")
                continue
            for record in records(block, self.notes):
                self._take(record, block.category)
            yield

    def check(self, path: str | os.PathLike[str]) -> None:
        """Refuse a file in which there is nothing, once it is read."""
        if not (self.plots or self.reports or self.located):
            skipped = "; ".join(f"{count} {what}" for what, count in self.notes.items())
            raise InvalidInputError(
                f"{os.fspath(path)}: holds no ASTERIX plots (001, 010, 020, 048) or reports (010, 020, 021)"
                f"{': ' + skipped if skipped else ''}"
            )

    def _count(self, what: str) -> None:
        self.notes[what] = self.notes.get(what, 0) + 1

    def _take(self, record: Any, category: int) -> None:
        sac, sic = value(record, "010", "SAC"), value(record, "010", "SIC")
        if sac is None or sic is None:
            self._count("records without a source")
        elif category in _SERVICE:
            radar = self.radars.setdefault((sac, sic), {"norths": []})
            _take_service(record, radar, self._clocks.setdefault((sac, sic), SourceRows()))
        elif not self._taken(record, category, (sac, sic)):
            self._count(f"records of category {category:03d} without time or position")

    def _taken(self, record: Any, category: int, source: Source) -> bool:
        """Whether a record is a report or a plot; it is added to those of its source."""
        report = _report(record, _REPORTS[category]) if category in _REPORTS else None
        plot = _plot(record, _PLOTS[category]) if report is None and category in _PLOTS else None
        found = plot or report
        if found is None:
            return False
        kept = self.plots if plot is not None else self.reports if category == 21 else self.located
        rows = kept.setdefault(source, SourceRows())
        raw, *rest = found
        if category == 1:
            raw = full_time(int(raw), rows, self._clocks.get(source))
        rows.time(int(raw))
        # not as it runs on here, where each message counts at once: a wrong one is seen by those after it
        rows.rows.append((int(raw) * SECOND, *rest))
        return True


def full_time(raw: int, *clocks: SourceRows | None) -> int:
    """The raw time of day of a truncated one: that nearest to the latest time on the source's clocks."""
    known = [clock.latest for clock in clocks if clock is not None and clock.begun]
    if not known:
        return raw
    steps = round(max(known) % DAY / SECOND)
    return (steps + (raw - steps + _CYCLE // 2) % _CYCLE - _CYCLE // 2) % round(DAY / SECOND)


def _plot(record: Any, items: _Plot) -> tuple[float, ...] | None:
    """Raw time, range, azimuth, identity, altitude, whether that is garbled, address."""
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
    return (time, *where, _identity(record, items.code), altitude, float(doubtful), float(value(record, "220") or 0))


def _identity(record: Any, item: str) -> float:
    code = value(record, item, "MODE3A")
    if code is None:
        code = value(record, item)
    if code is None or value(record, item, "V") or value(record, item, "G"):
        return float(UNDECODED)
    return float(code & 0o7777)


def _report(record: Any, items: _Report) -> tuple[float, ...] | None:
    """Raw time, latitude, longitude, identity, altitude, address of a report."""
    time = next((t for t in (value(record, item) for item in items.times) if t is not None), None)
    for item, bits, step in items.places:
        lat, lon = value(record, item, "LAT"), value(record, item, "LON")
        if time is not None and lat is not None and lon is not None:
            level = value(record, *items.level)
            altitude = math.nan if level is None else signed(level, items.level_bits) * LEVEL_STEP
            place = (signed(lat, bits) * step, signed(lon, bits) * step)
            return (time, *place, _identity(record, items.code), altitude, float(value(record, items.address) or 0))
    return None


def _take_service(record: Any, radar: dict[str, Any], clock: SourceRows) -> None:
    kind, time, turn = value(record, "000"), value(record, "030"), value(record, "041")
    if time is not None:
        now = clock.time(time)
        if kind == 1:
            radar["norths"].append(now)
    if turn:
        radar["rotation"] = turn * SECOND
    height, lat, lon = (value(record, "120", name) for name in ("HGT", "LAT", "LON"))
    if height is not None and lat is not None and lon is not None:
        radar["place"] = (signed(lat, 24) * _COARSE, signed(lon, 24) * _COARSE, float(signed(height, 16)))


def recording_of(rows: Array, name: str, notes: Mapping[str, int]) -> Recording:
    """Plots of rows in the order of time."""
    times, ranges, azimuths, identities, altitudes, doubtful, addresses = rows.T
    known = identities.astype(np.int64)
    return Recording(
        times=times, ranges=ranges, azimuths=azimuths, identities=known, altitudes=altitudes,
        garbled=(doubtful > 0) | garbled_altitudes(altitudes / FLIGHT_LEVEL, known, (), times),
        addresses=addresses.astype(np.int64), notes=dict(notes), name=name,
    )  # fmt: skip


def _seen(rows: SourceRows, origin: tuple[float, float, float], name: str, notes: dict[str, int]) -> Recording:
    times, lat, lon, identities, altitudes, addresses = rows.table(notes).T
    place = east_north_up(lat, lon, np.nan_to_num(altitudes), origin)
    return Recording(
        times=times, ranges=np.linalg.norm(place, axis=1), azimuths=np.arctan2(place[:, 1], place[:, 0]),
        identities=identities.astype(np.int64), altitudes=altitudes, addresses=addresses.astype(np.int64),
        notes=dict(notes), name=name,
    )  # fmt: skip
