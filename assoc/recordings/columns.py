"""Columns of a CSV file: their meanings, units, and numbers."""

from __future__ import annotations

import datetime
import difflib
import math
import re
from collections.abc import Mapping, Sequence

from assoc.errors import InvalidInputError

NAUTICAL_MILE = 1852.0
FLIGHT_LEVEL = 30.48
"""A flight level is 100 feet, in metres."""

DAY = 86_400.0

BLANKS = ("", "-", "--", "nan", "NaN", "NAN", "-nan", "-NaN", "NA", "<NA>", "#N/A", "N/A", "n/a", "null", "NULL",
          "Null", "None", "none", "NaT")  # fmt: skip
"""Cells that stand for a missing value."""

COLUMNS: dict[str, tuple[str, ...]] = {
    "time": ("time", "timestamp", "datetime", "utc", "time_utc", "utc_time", "tod", "time_of_day", "t"),
    "range": ("range", "rho", "distance", "slant_range"),
    "bearing": ("bearing", "theta", "azimuth", "az", "brg"),
    "mode3": ("mode3", "identity", "mode_3/a", "squawk", "mode_a", "ssr", "ssr_code"),
    "altitude": ("altitude", "alt", "mode_c", "flight_level", "fl"),
    "aircraft": ("aircraft",),
}
"""Usual names by meaning, with or without a unit at the end: the first that the file has is taken.

Upper case, spaces and other signs make no difference: ``Mode 3/A``, ``Range [NM]``, ``FlightLevel``.
"""

OCTAL = COLUMNS["mode3"][2:]
"""Names of columns whose codes are written as pilots dial them, with octal digits."""

REQUIRED = ("time", "range", "bearing")

UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3},
    "range": {"nmi": NAUTICAL_MILE, "km": 1000.0, "m": 1.0},
    "bearing": {"deg": math.pi / 180.0, "rad": 1.0},
    "altitude": {"fl": FLIGHT_LEVEL, "ft": 0.3048, "m": 1.0},
    "mode3": {"dec": 10, "oct": 8},
}
"""Units of each column in seconds, metres and radians; for codes the base of their digits.

The first is the default, for the columns `OCTAL` the second.
"""

_ALIASES = {
    "nm": "nmi", "meters": "m", "metres": "m", "degrees": "deg", "radians": "rad", "feet": "ft", "octal": "oct",
    "sec": "s", "seconds": "s", "msec": "ms", "milliseconds": "ms", "°": "deg",
}  # fmt: skip
_LEVEL = re.compile(r"FL *(\d+)", re.IGNORECASE)
_CLOCK = re.compile(r"(\d{1,2}):(\d{2}):(\d{2}(?:\.\d{1,9})?)\Z")


def plain_name(name: str) -> str:
    """The name of a column as its letters and digits only, in lower case."""
    return re.sub(r"[\W_]+", "", name.lower())


def unit_of(meaning: str, text: str) -> str:
    """The unit of a meaning that a text such as ``[NM]`` names; empty if it names none."""
    plain = plain_name(text) or text.strip(" []()")
    unit = _ALIASES.get(plain, plain)
    return unit if unit in UNITS.get(meaning, {}) else ""


def choose(
    header: Sequence[str], columns: Mapping[str, str], units: Mapping[str, str]
) -> tuple[dict[str, int], dict[str, str]]:
    """Find the number of the column of every meaning that the header of a file has, and the units it says.

    ``columns`` and ``units`` are what the user gave, by meaning. Units are those of time, range, bearing and altitude,
    and the base of codes; where nobody says them they are left out.
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
    chosen: dict[str, str] = {}
    for meaning, usual in COLUMNS.items():
        wanted = [columns[meaning]] if meaning in columns else usual
        endings = ["", *(end for end in (*UNITS.get(meaning, {}), *_ALIASES) if unit_of(meaning, end))]
        candidates = [(plain_name(name), ending) for name in wanted for ending in endings]
        found = next(((name, ending) for name, ending in candidates if name + ending in names), None)
        if found is None:
            if meaning in REQUIRED or meaning in columns:
                have = ", ".join(name.strip()[:30] for name in header[:12])
                what = repr(columns[meaning]) if meaning in columns else " or ".join(usual)
                raise InvalidInputError(f"no column {what} for the {meaning}; it has: {have!r}")
            continue
        name = "".join(found)
        if names.count(name) > 1:
            raise InvalidInputError(f"the column {name!r} is there {names.count(name)} times")
        found_columns[meaning] = names.index(name)
        # of a column that the user names, a last word of several
        unit = unit_of(
            meaning, found[1] or "".join(re.split(r"[\W_]+", header[names.index(name)].strip(" ])"))[1:][-1:])
        )
        if meaning == "mode3" and not unit and found[0] in map(plain_name, OCTAL):
            unit = "oct"
        if unit:
            chosen[meaning] = unit
    if len(set(found_columns.values())) < len(found_columns):
        raise InvalidInputError("columns: two meanings have the same column")
    return found_columns, {**chosen, **units}


def not_read(header: Sequence[str], columns_of: Mapping[str, int]) -> str:
    """The columns that are not read, each with the usual name that is nearest to it; empty if all are."""
    left = [name.strip()[:30] for k, name in enumerate(header) if k not in columns_of.values() and name.strip()]
    usual = {plain_name(name): name for meaning, names in COLUMNS.items() if meaning not in columns_of
             for name in names if len(name) > 2}  # fmt: skip
    said = []
    for name in left[:8]:
        near = difflib.get_close_matches(plain_name(name), usual, n=1, cutoff=0.75)
        said.append(f"{name} ({usual[near[0]]}?)" if near else name)
    return ", ".join(said + ["..."] * (len(left) > 8))


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


def level(text: str, unit: float) -> float:
    """Read an altitude in a unit of so many metres; ``FL298`` is a flight level in any."""
    found = _LEVEL.fullmatch(text)
    return float(found[1]) * FLIGHT_LEVEL / unit if found else number(text)


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
