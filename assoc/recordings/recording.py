"""A recording: the plots of one radar, each with its own time stamp."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._text.shown import Shown
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.sensors.arrays import finite_array
from assoc.sensors.base import wrap_angle

UNDECODED = 0
"""The identity (Mode 3) of a plot whose transponder answer was not decoded."""


@explains_wrong_types
@dataclass(frozen=True, eq=False, repr=False)
class Recording(Shown):
    """Plots of a radar, in the order of time.

    Parameters
    ----------
    times : array_like (n,)
        Seconds, not decreasing.
    ranges : array_like (n,)
        Slant range, metres, 0 or more.
    azimuths : array_like (n,)
        From +x (east) towards +y (north), radians; kept within (-pi, pi].
    identities : array_like of int (n,), optional
        Mode 3 codes, their 12 bits as a number (7700 is 0o7700, 4032); 0 is "not decoded", and the default.
    altitudes : array_like (n,), optional
        As reported, metres; NaN where there is none.
    garbled : array_like of bool (n,), optional
        Altitudes that cannot be right.
    lines : array_like of int (n,), optional
        Line of the plot in its file.
    addresses : array_like of int (n,), optional
        ICAO addresses of 24 bits; 0 is "not known", and the default.
    sources : array_like of int (n,), optional
        The aircraft that caused the plot, -1 for a false plot; known in simulations.
    notes : mapping of str to int, optional
        What reading had to correct, and how often.
    name : str

    Raises
    ------
    InvalidInputError
        One line that names the argument and what was expected.
    """

    times: Array
    ranges: Array
    azimuths: Array
    identities: Array = None  # type: ignore[assignment]  # always an array once made
    altitudes: Array = None  # type: ignore[assignment]
    garbled: Array = None  # type: ignore[assignment]
    lines: Array = None  # type: ignore[assignment]
    sources: Array | None = None
    notes: Mapping[str, int] = field(default_factory=dict)
    name: str = ""
    addresses: Array = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        put = object.__setattr__
        times = finite_array(self.times, "times")
        if times.ndim != 1:
            raise InvalidInputError(f"times must have shape (n,), got {times.shape}")
        put(self, "times", times)
        shape = times.shape
        if (np.diff(times) < 0).any():
            raise InvalidInputError(f"times must not decrease, plot {int(np.argmax(np.diff(times) < 0)) + 1} does")
        put(self, "ranges", finite_array(self.ranges, "ranges", shape))
        if (self.ranges < 0).any():
            raise InvalidInputError(f"ranges must be 0 or more, got {self.ranges.min():g}")
        azimuths = wrap_angle(finite_array(self.azimuths, "azimuths", shape))
        azimuths.setflags(write=False)
        put(self, "azimuths", azimuths)
        altitudes = np.full(shape, np.nan) if self.altitudes is None else np.array(self.altitudes, np.float64)
        if altitudes.shape != shape or np.isinf(altitudes).any():
            raise InvalidInputError(f"altitudes must be numbers or NaN of shape {shape}, got {altitudes.shape}")
        altitudes.setflags(write=False)
        put(self, "altitudes", altitudes)
        numbers = (("identities", UNDECODED), ("addresses", 0), ("lines", 0), ("garbled", False), ("sources", None))
        for name, default in numbers:
            value: Any = getattr(self, name)
            if value is None and default is None:
                continue
            array = np.full(shape, default) if value is None else np.array(value)
            if array.size == 0:
                array = array.astype(np.int64)
            kinds = "biu" if name == "garbled" else "iu"
            if array.shape != shape or array.dtype.kind not in kinds:
                got = f"{array.dtype} {array.shape}"
                raise InvalidInputError(f"{name} must be whole numbers of shape {shape}, got {got}")
            array = array.astype(np.bool_ if name == "garbled" else np.int64)
            array.setflags(write=False)
            put(self, name, array)
        for name in ("identities", "addresses"):
            if (getattr(self, name) < 0).any():
                raise InvalidInputError(f"{name} must be 0 or more, got {getattr(self, name).min()}")
        put(self, "notes", dict(self.notes))

    def __len__(self) -> int:
        return len(self.times)

    @property
    def measurements(self) -> Array:
        """Range and azimuth (n, 2), metres and radians, as a `Radar2D` measures them."""
        return np.stack([self.ranges, self.azimuths], axis=1)

    @property
    def aircraft(self) -> Array | None:
        """Which aircraft each plot is of (n,): the sources, else Mode 3, -1 where it is not decoded.

        None where neither is known. A plot without an identity counts as one of no aircraft, as in the thesis.
        """
        if self.sources is not None:
            return self.sources
        decoded = self.identities != UNDECODED
        return np.where(decoded, self.identities, -1) if decoded.any() else None

    @property
    def positions(self) -> Array:
        """Positions x (east), y (north) in the slant plane (n, 2), metres."""
        return self.ranges[:, None] * np.stack([np.cos(self.azimuths), np.sin(self.azimuths)], axis=1)

    @property
    def bearings(self) -> Array:
        """Compass bearings (n,), from north clockwise, radians in [0, 2 pi)."""
        return np.mod(math.pi / 2 - self.azimuths, 2 * math.pi)

    @property
    def decoded(self) -> Array:
        """Whether each plot has an identity, bool (n,)."""
        known: Array = self.identities != UNDECODED
        return known

    @property
    def trusted_altitudes(self) -> Array:
        """Altitudes (n,), metres, NaN where they are missing or garbled."""
        return np.where(self.garbled, np.nan, self.altitudes)

    def take(self, rows: Array) -> Recording:
        """Return the plots of some rows, in the order of time."""
        chosen = np.sort(np.arange(len(self))[rows])
        parts = {name: getattr(self, name)[chosen] for name in RECORDED}
        sources = None if self.sources is None else self.sources[chosen]
        return Recording(**parts, sources=sources, notes=self.notes, name=self.name)

    def summary(self) -> str:
        """Return its contents and defects in a few lines."""
        if not len(self):
            return "no plots"
        identities = len(np.unique(self.identities[self.decoded]))
        missing = int(np.isnan(self.altitudes).sum())
        counts = len(self), identities, int((~self.decoded).sum()), int(self.garbled.sum()), missing
        return in_words(float(self.times[-1] - self.times[0]), counts, self.notes)

    def __repr__(self) -> str:
        name = f"{self.name!r}, " if self.name else ""
        span = f" over {self.times[-1] - self.times[0]:g} s" if len(self) else ""
        return f"Recording({name}{len(self)} plots{span})"


RECORDED = ("times", "ranges", "azimuths", "identities", "altitudes", "garbled", "lines", "addresses")


def joined(parts: Sequence[Recording], notes: Mapping[str, int], name: str) -> Recording:
    """One recording of parts in the order of time."""
    if not parts:
        return Recording([], [], [], notes=notes, name=name)  # type: ignore[arg-type]
    columns = {column: np.concatenate([getattr(part, column) for part in parts]) for column in RECORDED}
    known = [part.sources for part in parts if part.sources is not None]
    return Recording(**columns, sources=np.concatenate(known) if known else None, notes=notes, name=name)


def in_words(span: float, counts: tuple[int, int, int, int, int], notes: Mapping[str, int]) -> str:
    """A few lines on a recording: its seconds, plots, identities, plots without one, garbled and missing altitudes."""
    plots, identities, undecoded, garbled, missing = counts
    lines = [
        f"{plots} plots over {span:g} s",
        f"{identities} identities; {undecoded} plots not decoded",
        f"altitudes: {garbled} garbled, {missing} missing",
        *(f"{what}: {count}" for what, count in notes.items() if count),
    ]
    return "\n".join(lines)
