"""The records of a file as rows: what was sent, in units that people read."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from typing import Any

from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InvalidInputError
from assoc.integrations.asterix.blocks import CATEGORIES
from assoc.integrations.asterix.items import place, report_items, signed, value
from assoc.integrations.asterix.reading import Clock, Decoded, full_time
from assoc.recordings.cleaning import Cleaning

_TIMES = {1: ("141",), 2: ("030",), 10: ("140",), 20: ("140",), 21: ("073", "071", "077", "030"), 34: ("030",)}
_TIMES |= {48: ("140",), 62: ("070",)}
# column, step, bits of a signed number or 0, and where it stands by category; of a column's lines the first counts
_NUMBERS: tuple[tuple[str, float, int, dict[int, tuple[str, ...]]], ...] = (
    ("range_nmi", 1 / 256, 0, {48: ("040", "RHO")}),
    ("range_nmi", 1 / 128, 0, {1: ("040", "RHO")}),
    ("range_nmi", 1 / 1852, 0, {10: ("040", "RHO")}),
    ("bearing_deg", 360 / 2**16, 0, {1: ("040", "THETA"), 10: ("040", "TH"), 48: ("040", "THETA")}),
    ("latitude_deg", 1, 0, {}),
    ("longitude_deg", 1, 0, {}),
    ("x_m", 0.5, 24, {20: ("042", "X"), 62: ("100", "X")}),
    ("y_m", 0.5, 24, {20: ("042", "Y"), 62: ("100", "Y")}),
    ("x_m", 1, 16, {10: ("042", "X")}),
    ("y_m", 1, 16, {10: ("042", "Y")}),
    ("vx_m_s", 0.25, 16, {62: ("185", "VX")}),
    ("vy_m_s", 0.25, 16, {62: ("185", "VY")}),
    ("altitude_fl", 0.25, 14, {1: ("090", "HGT"), 10: ("090", "FL"), 20: ("090", "FL"), 48: ("090", "FL")}),
    ("altitude_fl", 0.25, 16, {21: ("145",), 62: ("136",)}),
    (
        "track",
        1,
        0,
        {1: ("161",), 10: ("161", "TRK"), 20: ("161", "TRN"), 21: ("161", "TRNUM"), 48: ("161", "TRN"), 62: ("040",)},
    ),
)
_CODES = {category: ("060" if category in (10, 62) else "070", "MODE3A") for category in (1, 10, 20, 21, 48, 62)}
_ADDRESSES = {10: "220", 20: "220", 21: "080", 48: "220"}
_CALLSIGNS = {10: ("245", "CHR"), 20: ("245", "CHR"), 21: ("170",), 48: ("240",)}
NAMES = ", ".join(f"{category:03d}" for category in CATEGORIES)
"""Categories that are read."""
COLUMNS = ("category", "sac", "sic", "time", *dict.fromkeys(name for name, *_ in _NUMBERS))
COLUMNS += ("mode3_oct", "address_hex", "callsign")


@explains_wrong_types
def read_records(
    path: str | os.PathLike[str],
    notes: dict[str, int] | None = None,
    *,
    editions: Mapping[int, str] | None = None,
) -> list[dict[str, Any]]:
    """Read the records of the categories in `CATEGORIES`, of all sources, in the order of the file.

    Parameters
    ----------
    path : path-like
        As for `read_asterix`.
    notes : dict of str to int, optional
        Gets what could not be read, and what `read_asterix` would correct, by kind.
    editions : dict of int to str, optional
        As for `read_asterix`.

    Returns
    -------
    list of dict
        By the names in `COLUMNS`, those that a record has. Times are seconds of the day and continue after midnight.
        All is as sent: repeated records, and codes that the radar does not call valid.

    Raises
    ------
    InvalidInputError
        The file cannot be read, or holds none of these records.
    MissingExtraError
        libasterix is not installed.
    """
    read = Decoded(path, editions, tracks=True)
    rows = list(_rows(read))
    if notes is not None:
        for clock in read.plots.values():
            for _ in Cleaning("", read.notes, clock=True).take(clock.taken(), last=True):
                pass
        notes.update(read.notes)
    if not rows:
        skipped = "; ".join(f"{count} {what}" for what, count in read.notes.items())
        raise InvalidInputError(
            f"{os.fspath(path)}: holds no ASTERIX records of categories {NAMES}{': ' + skipped if skipped else ''}"
        )
    return rows


def _rows(read: Decoded) -> Iterator[dict[str, Any]]:
    clocks: dict[tuple[int, ...], Clock] = {}
    for found in read.blocks():
        for category, edition, record in found:
            row: dict[str, Any] = {"category": category}
            row |= {"sac": value(record, "010", "SAC"), "sic": value(record, "010", "SIC")}
            time = next((t for t in (value(record, item) for item in _TIMES[category]) if t is not None), None)
            if time is not None:
                clock = clocks.setdefault((category, row["sac"], row["sic"]), Clock())
                if category == 1:
                    time = full_time(time, clock, clocks.get((2, row["sac"], row["sic"])))
                row["time"] = clock.time(time)
            for name, step, bits, items in _NUMBERS:
                raw = value(record, *items[category]) if category in items else None
                if raw is not None:
                    row.setdefault(name, (signed(raw, bits) if bits else raw) * step)
            report = report_items(category, edition)
            if report and (where := place(record, report)):
                row |= {"latitude_deg": math.degrees(where[0]), "longitude_deg": math.degrees(where[1])}
            code = value(record, *_CODES[category]) if category in _CODES else None
            address = value(record, _ADDRESSES[category]) if category in _ADDRESSES else None
            letters = value(record, *_CALLSIGNS[category]) if category in _CALLSIGNS else None
            row |= {} if code is None else {"mode3_oct": f"{code:04o}"}
            row |= {} if address is None else {"address_hex": f"{address:06X}"}
            row |= {} if letters is None else {"callsign": _letters(letters)}
            yield row


def _letters(raw: int) -> str:
    """Eight characters of six bits: A to Z, digits and spaces; others are not defined."""
    codes = [raw >> shift & 63 for shift in range(42, -1, -6)]
    letters = [chr(code + 64 if code < 27 else code) for code in codes if 0 < code < 27 or 47 < code < 58 or code == 32]
    return "".join(letters).strip()
