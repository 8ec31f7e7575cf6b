"""Where the categories of ASTERIX have what a plot or a report needs, and what values there can be."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from assoc.recordings.columns import DAY, FLIGHT_LEVEL, NAUTICAL_MILE

SECOND = 1.0 / 128.0
"""Step of times of day."""
RANGE_STEP, ANGLE_STEP = NAUTICAL_MILE / 256.0, 2.0 * math.pi / 65536.0
"""Steps of measured positions in category 048."""
LEVEL_STEP = 0.25 * FLIGHT_LEVEL
COARSE = math.pi / 2**23
"""Step of latitudes and longitudes of 24 bits, radians."""
# quarter flight levels at which somebody may fly
_LEVELS = range(-80, 6000)


class PlotItems(NamedTuple):
    """Where a category has what a plot needs."""

    time: str
    polar: tuple[str, str, str]
    step: float
    code: str
    level: tuple[str, str]
    cartesian: tuple[float, int] = (0.0, 0)
    """Step and bits of item 042, if that is an alternative."""


class ReportItems(NamedTuple):
    """Where a category has what a report of a position in WGS 84 needs: items with bits and steps, best first."""

    times: tuple[str, ...]
    places: tuple[tuple[str, int, float], ...]
    code: str
    level: tuple[str, ...]
    level_bits: int
    address: str


PLOTS = {
    1: PlotItems("141", ("040", "RHO", "THETA"), NAUTICAL_MILE / 128.0, "070", ("090", "HGT")),
    10: PlotItems("140", ("040", "RHO", "TH"), 1.0, "060", ("090", "FL"), (1.0, 16)),
    20: PlotItems("140", ("040", "RHO", "THETA"), 1.0, "070", ("090", "FL"), (0.5, 24)),
    48: PlotItems("140", ("040", "RHO", "THETA"), RANGE_STEP, "070", ("090", "FL")),
}
_ADSB = ReportItems(
    ("071", "073", "077"), (("131", 32, math.pi / 2**30), ("130", 24, COARSE)), "070", ("145",), 16, "080"
)
_REPORTS = {
    10: ReportItems(("140",), (("041", 32, math.pi / 2**31),), "060", ("090", "FL"), 14, "220"),
    20: ReportItems(("140",), (("041", 32, math.pi / 2**25),), "070", ("090", "FL"), 14, "220"),
    21: _ADSB,
    62: ReportItems(("070",), (("105", 32, math.pi / 2**25),), "060", ("136",), 16, "380"),
}


def report_items(category: int, edition: str) -> ReportItems | None:
    """Items of reports; in editions 0 of category 021 they are others."""
    if category == 21 and edition.startswith("0."):
        place = ("130", 24, COARSE) if edition == "0.23" else ("130", 32, math.pi / 2**25)
        return _ADSB._replace(times=("030",), places=(place,))
    return _REPORTS.get(category)


def value(record: Any, item: str, *path: str) -> int | None:
    """Raw number of an item or of an element in it; None if absent."""
    found = record.get_item(item)
    try:
        for name in path:
            if found is None:
                return None
            found = found.variation.get_item(name)
    except ValueError:  # the item has no such element in this category
        return None
    return None if found is None else int(found.as_uint())


def signed(raw: int, bits: int) -> int:
    """Signed value of a raw number in two's complement."""
    return raw - (1 << bits) if raw >> (bits - 1) else raw


def place(record: Any, items: ReportItems) -> tuple[float, float] | None:
    """Latitude and longitude, radians; None if absent."""
    for item, bits, step in items.places:
        lat, lon = value(record, item, "LAT"), value(record, item, "LON")
        if lat is not None and lon is not None:
            return signed(lat, bits) * step, signed(lon, bits) * step
    return None


def on_earth(where: tuple[float, float]) -> bool:
    """Whether a latitude and a longitude are a place."""
    return abs(where[0]) <= math.pi / 2 and abs(where[1]) <= math.pi


def plausible(record: Any, category: int, edition: str) -> bool:
    """Whether a record has the time of a day, a place on the earth and a level at which one flies, where it has any."""
    report, plot = report_items(category, edition), PLOTS.get(category)
    # truncated times of category 001 may be any
    times = report.times if report else (plot.time,) if plot and category != 1 else ("030",)
    if any((time := value(record, item)) is not None and time * SECOND >= DAY for item in times):
        return False
    if report and (where := place(record, report)) and not on_earth(where):
        return False
    known = report or plot
    level = value(record, *known.level) if known else None
    bits = report.level_bits if report else 14
    return level is None or signed(level, bits) in _LEVELS
