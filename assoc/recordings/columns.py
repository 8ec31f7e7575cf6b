"""Columns of a CSV file: their meanings, units, and numbers."""

from __future__ import annotations

import datetime
import math
import re
from collections.abc import Mapping, Sequence

from assoc.errors import InvalidInputError

NAUTICAL_MILE = 1852.0
FLIGHT_LEVEL = 30.48
"""A flight level is 100 feet, in metres."""

DAY = 86_400.0

COLUMNS: dict[str, tuple[str, ...]] = {
    "time": ("time", "timestamp", "datetime", "utc", "tod", "time_of_day"),
    "range": ("range", "rho", "distance", "slant_range"),
    "bearing": ("bearing", "theta", "azimuth", "az", "brg"),
    "mode3": ("mode3", "mode_3", "mode3a", "squawk", "mode_a", "mode_3_a", "mode_3a", "ssr", "ssr_code", "identity"),
    "altitude": ("altitude", "alt", "mode_c", "flight_level", "fl"),
    "aircraft": ("aircraft",),
}
"""Usual names by meaning, with or without a unit at the end: the first that the file has is taken.

Upper case, spaces and other signs make no difference: ``Mode 3/A``, ``Range [NM]``.
"""

OCTAL = COLUMNS["mode3"][3:-1]
"""Names of columns whose codes are written as pilots dial them, with octal digits."""

REQUIRED = ("time", "range", "bearing")

UNITS: dict[str, dict[str, float]] = {
    "range": {"nmi": NAUTICAL_MILE, "km": 1000.0, "m": 1.0},
    "bearing": {"deg": math.pi / 180.0, "rad": 1.0},
    "altitude": {"fl": FLIGHT_LEVEL, "ft": 0.3048, "m": 1.0},
    "mode3": {"dec": 10, "oct": 8},
}
"""Units of each column in metres and radians; for codes the base of their digits.

The first is the default, for the columns `OCTAL` the second.
"""

_ALIASES = {"nm": "nmi", "meters": "m", "metres": "m", "degrees": "deg", "radians": "rad", "feet": "ft", "octal": "oct"}
_ENDINGS = {
    meaning: {f"_{name}": unit for name, unit in [*zip(known, known, strict=True), *_ALIASES.items()] if unit in known}
    for meaning, known in UNITS.items()
}
_CLOCK = re.compile(r"(\d{1,2}):(\d{2}):(\d{2}(?:\.\d{1,9})?)\Z")


def plain_name(name: str) -> str:
    """The name of a column in small letters and digits, with a _ between its words."""
    return re.sub(r"[\W_]+", "_", name.strip().lower()).strip("_")


def choose(
    header: Sequence[str], columns: Mapping[str, str], units: Mapping[str, str]
) -> tuple[dict[str, int], dict[str, str]]:
    """Find the number of the column, and the unit, of every meaning that the header of a file has.

    Upper and lower case are the same; ``columns`` and ``units`` are what the user gave, by meaning. Units are those of
    range, bearing and altitude, and the base of codes.
    """
    for meaning in columns:
        if meaning not in COLUMNS:
            raise InvalidInputError(f"columns: unknown meaning {meaning!r}; known: {', '.join(COLUMNS)}")
    for meaning, unit in units.items():
        if meaning not in UNITS:
            raise InvalidInputError(f"units: unknown meaning {meaning!r}; known: {', '.join(UNITS)}")
        if unit not in UNITS[meaning]:
            raise InvalidInputError(f"units: expected {' or '.join(UNITS[meaning])} for the {meaning}, got {unit!r}")
    names = [plain_name(name) for name in header]
    found_columns: dict[str, int] = {}
    chosen: dict[str, str] = {meaning: next(iter(known)) for meaning, known in UNITS.items()}
    for meaning, usual in COLUMNS.items():
        endings = _ENDINGS.get(meaning, {})
        if meaning in columns:
            wanted = [plain_name(columns[meaning])]
        else:
            wanted = [name + ending for name in usual for ending in ("", *endings)]
        found = next((name for name in wanted if name in names), None)
        if found is None:
            if meaning in REQUIRED or meaning in columns:
                have = ", ".join(name.strip()[:30] for name in header[:12])
                what = repr(columns[meaning]) if meaning in columns else " or ".join(usual)
                raise InvalidInputError(f"no column {what} for the {meaning}; it has: {have!r}")
            continue
        if names.count(found) > 1:
            raise InvalidInputError(f"the column {found!r} is there {names.count(found)} times")
        found_columns[meaning] = names.index(found)
        unit = next((unit for ending, unit in endings.items() if found.endswith(ending)), "")
        if found in OCTAL:
            unit = "oct"
        if unit:
            chosen[meaning] = unit
    if len(set(found_columns.values())) < len(found_columns):
        raise InvalidInputError("columns: two meanings have the same column")
    return found_columns, {**chosen, **units}


def seconds(text: str) -> tuple[float, bool]:
    """Read a time: seconds, a clock time h:mm:ss, or a date with a time (UTC by default): ISO 8601, or day.month.year.

    Returns seconds, and whether it is a clock time, which begins anew at midnight; ValueError for anything else.
    """
    match = _CLOCK.match(text)
    if match:
        hours, minutes, rest = int(match[1]), int(match[2]), float(match[3])
        if hours > 24 or minutes > 59 or rest >= 61:
            raise ValueError(text)
        return 3600.0 * hours + 60.0 * minutes + rest, True
    text = re.sub(r"^(\d\d)\.(\d\d)\.(\d{4})(?=[T ])", r"\3-\2-\1", text)
    # 1.5e-05 has a dash there, too
    if text[4:5] == "-" and text[:4].isdigit() and len(text) <= 40:
        moment = datetime.datetime.fromisoformat(text)
        if moment.tzinfo is None:
            moment = moment.replace(tzinfo=datetime.UTC)
        return moment.timestamp(), False
    return number(text), False


def number(text: str) -> float:
    """Read a finite number; other spellings that Python accepts (1_000, nan, other scripts' digits) are refused."""
    if not text.isascii() or "_" in text:
        raise ValueError(text)
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


def code(text: str, base: float) -> int:
    """Read a Mode 3/A code: a whole number, or its octal digits as the number of their 12 bits; empty is 0."""
    value = whole(text)
    if value < 0 or (base == 8 and value > 7777):
        raise ValueError(text)
    return int(str(value), 8) if base == 8 else value


def whole(text: str) -> int:
    """Read a whole number, also written as 902.0; empty is 0."""
    if not text:
        return 0
    value = number(text)
    if value != int(value) or not -1 <= value < 2**53:
        raise ValueError(text)
    return int(value)
