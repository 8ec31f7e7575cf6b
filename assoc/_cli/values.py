"""Values that a command line or a configuration file gives, parsed and checked."""

from __future__ import annotations

import math
import os
import sys
from typing import Any

from assoc.errors import InvalidInputError


def whole_number(text: str, label: str, least: int) -> int:
    """Parse a whole number of at least ``least``."""
    try:
        value = int(text)
    except ValueError:
        value = least - 1
    if value < least:
        raise InvalidInputError(f"{label}: expected a whole number >= {least}, got {text!r}")
    return value


def processes(text: str, label: str) -> int:
    """Parse a number of processes; "all" is one for each core."""
    if text == "all":
        return cores()
    try:
        return whole_number(text, label, 1)
    except InvalidInputError:
        raise InvalidInputError(f"{label}: expected a whole number >= 1 or 'all', got {text!r}") from None


def cores() -> int:
    """Return how many cores this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not everywhere
        return os.cpu_count() or 1


def seconds(text: str, label: str) -> float:
    """Parse a number of seconds above 0."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise InvalidInputError(f"{label}: expected seconds > 0, got {text!r}")
    return value


def scan_range(text: str, count: int, name: str, label: str = "--scans") -> range:
    """Parse A:B or A, within the scans of the source ``name``.

    Raises
    ------
    InvalidInputError
        It is not of that form, or reaches beyond.
    """
    first, colon, last = text.partition(":")
    try:
        start = int(first) if first or not colon else 0
        stop = (int(last) if last else count) if colon else start + 1
    except ValueError:
        raise InvalidInputError(f"{label}: expected A:B or A in whole numbers, got {text!r}") from None
    if not 0 <= start < stop <= count:
        raise InvalidInputError(f"{label}: {text} is not within the scans 0:{count} of {name}")
    return range(start, stop)


def number(text: str, label: str) -> float:
    """Parse a number."""
    try:
        return float(text)
    except ValueError:
        raise InvalidInputError(f"{label}: expected a number, got {text!r}") from None


def density(text: str, label: str) -> float | str:
    """Parse a number above 0, or "auto"."""
    if text == "auto":
        return text
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise InvalidInputError(f"{label}: expected a number above 0, or auto, got {text!r}")
    return value


def place_on_earth(text: str, label: str) -> tuple[float, float, float]:
    """Parse LAT,LON or LAT,LON,HEIGHT (degrees, metres) into radians and metres."""
    parts = text.split(",")
    if len(parts) not in (2, 3):
        raise InvalidInputError(f"{label}: expected LAT,LON or LAT,LON,HEIGHT in degrees and metres, got {text!r}")
    lat, lon, height = (number(part, label) for part in [*parts, "0"][:3])
    if not (abs(lat) <= 90 and abs(lon) <= 360 and abs(height) <= 1e6):
        raise InvalidInputError(f"{label}: expected a latitude within +-90 and a longitude within +-360, got {text!r}")
    return math.radians(lat), math.radians(lon), height


def check_kind(value: Any, kind: type, label: str) -> None:
    """Refuse a value of a file that is not text (str), a number (float) or a whole number (int)."""
    taken: Any = (int, float) if kind is float else kind
    if kind is float and isinstance(value, int) and abs(value) > sys.float_info.max:
        raise InvalidInputError(f"{label}: expected a number within +-1.8e308, got a larger one")
    if not isinstance(value, taken) or isinstance(value, bool):
        expected = {str: "text", float: "a number"}.get(kind, "a whole number")
        raise InvalidInputError(f"{label}: expected {expected}, got {value!r}")
