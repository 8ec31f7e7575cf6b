"""Kinds of options: each converts the text of a command line or file, and refuses bad text by the option's name."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from assoc._files.output import STDOUT, is_stream
from assoc._system.imports import check_extra
from assoc._text.removed import removed
from assoc.errors import InvalidInputError

Kind = Callable[[str, str], Any]
"""Converts text to a value; the second argument is the option's name in messages."""

FORMATS = (".npz", ".json", ".csv", ".parquet", ".html", ".htm", ".toml", ".png", ".pdf", ".xlsx")
"""File name endings that indicate a format."""


def text(value: str, label: str) -> str:
    """Accept any text."""
    return value


def whole(least: int, more: str = "") -> Kind:
    """Whole numbers of at least ``least``; ``more`` is appended to what messages expect."""

    def read(value: str, label: str) -> int:
        try:
            found = int(value)
        except ValueError:
            found = least - 1
        if found < least:
            raise InvalidInputError(f"{label}: expected a whole number >= {least}{more}, got {value!r}")
        return found

    return read


def real(expected: str, good: Callable[[float], bool]) -> Kind:
    """Numbers that satisfy ``good``; ``expected`` describes them in messages."""

    def read(value: str, label: str) -> float:
        try:
            found = float(value)
        except ValueError:
            found = math.nan
        if not good(found):
            raise InvalidInputError(f"{label}: expected {expected}, got {value!r}")
        return found

    return read


def or_word(word: str, meaning: Callable[[], Any], kind: Kind) -> Kind:
    """A word with a meaning of its own, or another kind."""
    return lambda value, label: meaning() if value == word else kind(value, label)


def listed(kind: Kind) -> Kind:
    """Values separated by commas."""
    return lambda value, label: tuple(kind(part.strip(), label) for part in value.split(","))


def cores() -> int:
    """Return the number of cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


number = real("a number", lambda found: not math.isnan(found))
positive = real("a number above 0", lambda found: 0 < found < math.inf)
not_negative = real("a number >= 0", lambda found: 0 <= found < math.inf)
seconds = real("seconds > 0", lambda found: 0 < found < math.inf)
probability = real("a number in (0, 1]", lambda found: 0 < found <= 1)
density = or_word("auto", lambda: "auto", real("a number above 0, or auto", lambda found: 0 < found < math.inf))
processes = or_word("all", cores, whole(1, " or 'all'"))


def degrees(value: str, label: str) -> float:
    """Read an angle in degrees; returns radians."""
    return math.radians(number(value, label))


def position_on_earth(value: str, label: str) -> tuple[float, float, float]:
    """Read LAT,LON or LAT,LON,HEIGHT (degrees, metres); returns radians and metres."""
    parts = listed(number)(value, label)
    if len(parts) not in (2, 3):
        raise InvalidInputError(f"{label}: expected LAT,LON or LAT,LON,HEIGHT in degrees and metres, got {value!r}")
    lat, lon, height = (*parts, 0.0)[:3]
    if not (abs(lat) <= 90 and abs(lon) <= 360 and abs(height) <= 1e6):
        raise InvalidInputError(f"{label}: expected a latitude within +-90 and a longitude within +-360, got {value!r}")
    return math.radians(lat), math.radians(lon), height


def editions_of(value: object, label: str) -> dict[int, str]:
    """Editions of ASTERIX by category, of text such as ``021=0.26,062=1.16`` or of a table."""
    if isinstance(value, str):
        value = dict(part.partition("=")[::2] for part in value.split(","))
    if not isinstance(value, dict) or not all(key.strip().isdigit() and name for key, name in value.items()):
        raise InvalidInputError(f"{label}: expected categories and editions, as 021=0.26,062=1.16, got {value!r}")
    return {int(key): str(name).strip() for key, name in value.items()}


def area(value: str, label: str) -> tuple[tuple[float, float], ...]:
    """Read the corners of an area, X,Y X,Y ... in metres; two are opposite corners of a box."""
    corners = [listed(number)(part, label) for part in value.split()]
    if len(corners) < 2 or any(len(corner) != 2 or not all(map(math.isfinite, corner)) for corner in corners):
        expected = "2 corners of a box, or 3 or more, X,Y X,Y ... in metres"
        raise InvalidInputError(f"{label}: expected {expected}, got {value!r}")
    return as_polygon([(corner[0], corner[1]) for corner in corners], label)


def as_polygon(corners: list[tuple[float, float]], label: str) -> tuple[tuple[float, float], ...]:
    """Corners of a polygon; two are opposite corners of a box."""
    if len(corners) == 2:
        (x, y), (u, v) = corners
        corners = [(x, y), (u, y), (u, v), (x, v)]
    if sum(x * v - u * y for (x, y), (u, v) in zip(corners, [*corners[1:], corners[0]], strict=True)) == 0.0:
        raise InvalidInputError(f"{label}: the corners enclose nothing: they lie on one line")
    return tuple(corners)


class OneOf:
    """One of several names, which shells can complete; ``aliases`` are further names of some."""

    def __init__(self, names: Iterable[str], aliases: Mapping[str, str] | None = None) -> None:
        self.names, self._aliases = tuple(names), aliases or {}

    def __call__(self, value: str, label: str) -> str:
        """Read a name."""
        value = self._aliases.get(value.lower(), value)
        if value not in self.names:
            if line := removed(f"{label} {value}"):
                raise InvalidInputError(line)
            raise InvalidInputError(f"{label}: unknown name {value!r}; known: {', '.join(self.names)}")
        return value


class Output:
    """Files to write, whose formats are known by the endings of their names.

    A `strict` name must have one of the endings; otherwise only not that of another format. With `streams`, stdout and
    pipes are allowed, in the format of the first ending. `extras`: by ending, "" for all, the package that writes it
    and the extra of assoc that installs it.
    """

    def __init__(
        self,
        *endings: str,
        strict: bool = False,
        streams: bool = True,
        extras: dict[str, tuple[str, str]] | None = None,
    ) -> None:
        self._endings, self._strict, self._streams, self._extras = endings, strict, streams, extras or {}

    def __call__(self, value: str, label: str) -> str:
        """Read a name."""
        ending = self.ending(value)
        if ending not in self._endings and (self._strict or ending in FORMATS):
            raise InvalidInputError(f"{label}: {value}: expected a name that ends in {' or '.join(self._endings)}")
        extra = self._extras.get(ending) or self._extras.get("")
        if extra:
            check_extra(*extra)
        return value

    def ending(self, value: str) -> str:
        """Return the ending of a name."""
        if self._streams and (value == STDOUT or is_stream(value)):
            return self._endings[0]
        return os.path.splitext(value)[1].lower()


html_page = Output(".html", ".htm", extras={"": ("plotly", "report")})
csv_table = Output(".csv")


def scan_range(value: str, count: int, name: str, label: str = "--scans") -> range:
    """Read A:B or A, within the scans of the source ``name``."""
    first, colon, last = value.partition(":")
    try:
        start = int(first) if first or not colon else 0
        stop = (int(last) if last else count) if colon else start + 1
    except ValueError:
        raise InvalidInputError(f"{label}: expected A:B or A in whole numbers, got {value!r}") from None
    if not 0 <= start < stop <= count:
        raise InvalidInputError(f"{label}: {value} is not within the scans 0:{count} of {name}")
    return range(start, stop)
