"""The clustering time window: plots grouped by antenna rotation, each with its own time stamp."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from assoc._parameters import is_number
from assoc._system.door import door
from assoc._text.times import moment
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.recordings.recording import Recording
from assoc.recordings.rotation import estimate_rotation

LONG_GAP = 20.0
"""Rotations without a plot after which the antenna's phase is taken anew."""

MOST_TURNS = 1e12

EARTH_RADIUS = 6.371e6
"""Metres."""


@dataclass(frozen=True, eq=False, repr=False)
class Window:
    """A group of plots that a tracker takes together.

    Attributes
    ----------
    number : int
        Of the rotation (or group) from 0; numbers without a plot are left out.
    times : array (n,)
        The time stamp of each plot, seconds, not decreasing.
    measurements : array (n, 2)
        Range (m) and azimuth (rad, from +x towards +y).
    identities : int array (n,)
        Mode 3, 0 where it was not decoded.
    altitudes : array (n,)
        Metres, NaN where it is missing or garbled.
    rows : int array (n,)
        The plots' numbers in the recording.
    addresses : int array (n,)
        ICAO addresses, 0 where they are not known.
    """

    number: int
    times: Array
    measurements: Array
    identities: Array
    altitudes: Array
    rows: Array
    addresses: Array

    @classmethod
    def of(cls, recording: Recording, rows: Array, number: int) -> Window:
        """Make a window of some plots of a recording."""
        rows = np.sort(np.asarray(rows, dtype=np.int64))
        return cls(
            number=int(number),
            times=recording.times[rows],
            measurements=recording.measurements[rows],
            identities=recording.identities[rows],
            altitudes=recording.trusted_altitudes[rows],
            rows=rows,
            addresses=recording.addresses[rows],
        )

    @property
    def heights(self) -> Array:
        """Altitudes as heights above the plane that touches the earth at the radar, metres (n,)."""
        return self.altitudes - self.measurements[:, 0] ** 2 / (2.0 * EARTH_RADIUS)

    def __len__(self) -> int:
        return len(self.times)

    def __repr__(self) -> str:
        span = f", {moment(self.times[0])} to {moment(self.times[-1])}" if len(self) else ""
        return f"Window({self.number}, {len(self)} plots{span})"


@door
def clustering_time_window(
    recording: Recording, rotation: float | None = None, *, by: Literal["antenna", "time"] = "antenna"
) -> list[Window]:
    """Group plots so that each aircraft is at most once in a group.

    Parameters
    ----------
    recording : Recording
    rotation : float, optional
        Seconds that the antenna takes for a turn; without it, it is estimated.
    by : {"antenna", "time"}
        "antenna": by the turn in which the antenna made the plot, counted from where the fewest plots are. A time
        stamp may be off by nearly half a turn (stamps in whole seconds, delays). "time": by consecutive windows of
        one rotation time from the first plot on, as the paper does.

    Returns
    -------
    list of Window
        In the order of time, without empty ones. No window reaches over a gap of more than 20 rotations.

    References
    ----------
    Cahyono, Multitarget tracking using multiple hypothesis tracking with clustering time window radar data,
    thesis, ITS Surabaya (2014), section 3.2.2.
    """
    if by not in ("antenna", "time"):
        raise InvalidInputError(f"by: expected 'antenna' or 'time', got {by!r}")
    if not len(recording):
        return []
    turn = estimate_rotation(recording) if rotation is None else rotation
    if not is_number(turn, 0.0) or turn == 0:
        raise InvalidInputError(f"rotation: expected seconds > 0, got {rotation!r}")
    turn = float(turn)
    span = float(recording.times[-1] - recording.times[0])
    if not span / turn < MOST_TURNS:
        raise InvalidInputError(f"rotation: {turn:g} s is too short for a recording of {span:g} s")
    numbers = _by_time(recording.times, turn) if by == "time" else _by_antenna(recording, turn)
    return windows_of(recording, numbers)


def windows_of(recording: Recording, numbers: Array) -> list[Window]:
    """Windows from the number of the group of each plot (n,); groups come in the order of their numbers."""
    order = np.argsort(numbers, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1)
    return [Window.of(recording, rows, numbers[rows[0]]) for rows in groups if len(rows)]


def _by_time(times: Array, turn: float) -> Array:
    # a billionth of a turn forgives rounding at the edges
    return np.floor((times - times[0]) / turn + 1e-9).astype(np.int64)


def _by_antenna(recording: Recording, turn: float) -> Array:
    bearings = np.mod(recording.bearings - _quietest(recording.bearings), 2 * math.pi) / (2 * math.pi)
    numbers = np.zeros(len(recording), dtype=np.int64)
    parts = np.split(np.arange(len(recording)), np.flatnonzero(np.diff(recording.times) > LONG_GAP * turn) + 1)
    last = -1
    for rows in parts:
        turns = recording.times[rows] / turn - bearings[rows]
        phase = running_phase(recording.times[rows], turns, turn)
        turn_numbers = np.round(turns - phase).astype(np.int64)
        turn_numbers += last + 1 - turn_numbers.min()
        numbers[rows] = turn_numbers
        last = int(turn_numbers.max())
    return numbers


def running_phase(times: Array, turns: Array, turn: float) -> Array:
    """Fraction of a turn by which the antenna is ahead (n,), followed slowly, unwrapped.

    The estimated rotation time is off by a little, and motors drift: the mean over the last turns keeps count.
    """
    angles = np.exp(2j * math.pi * turns)
    # the first few turns set the start, so that the first plot's error does not
    first = np.angle(angles[times - times[0] <= 5 * turn].sum())
    phase = np.empty(len(turns))
    held, now = complex(math.cos(first), math.sin(first)), first / (2 * math.pi)
    before = times[0]
    for row in range(len(turns)):
        held = held * math.exp(-(times[row] - before) / (10 * turn)) + 0.05 * angles[row]
        before = times[row]
        fraction = math.atan2(held.imag, held.real) / (2 * math.pi)
        now += (fraction - now + 0.5) % 1.0 - 0.5
        phase[row] = now
    return phase


def _quietest(bearings: Array) -> float:
    """Where to cut the circle: the middle of the sector with the fewest plots, rad.

    An aircraft that crosses the cut against the antenna would be twice in a turn.
    """
    cells = 72
    counts = np.bincount((bearings / (2 * math.pi) * cells).astype(np.int64) % cells, minlength=cells).astype(float)
    # smoothed around the circle: the middle of an empty sector is better than its edge
    width = np.minimum(np.arange(cells), cells - np.arange(cells))
    weights = np.exp(-0.5 * (width / 4.0) ** 2)
    smooth = np.real(np.fft.ifft(np.fft.fft(counts) * np.fft.fft(weights)))
    return (float(np.argmin(np.round(smooth, 9))) + 0.5) * 2 * math.pi / cells
