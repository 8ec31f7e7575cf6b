"""The clustering time window: plots grouped by antenna rotation, each with its own time stamp."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from assoc._parameters import is_number
from assoc._system.compiled import njit
from assoc._system.wrong_types import explains_wrong_types
from assoc._text.times import moment
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.recordings.recording import Recording, joined
from assoc.recordings.rotation import estimate_rotation
from assoc.recordings.survey import Survey

LONG_GAP = 20.0
"""Rotations without a plot after which the antenna's phase is taken anew."""

MOST_TURNS = 1e12
MOST_GROUPS = 10_000_000
# turns that set the antenna's phase at first
_SETTLED = 5

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
    sources : int array (n,) or None
        The aircraft, -1 for a false plot, where they are known.
    """

    number: int
    times: Array
    measurements: Array
    identities: Array
    altitudes: Array
    rows: Array
    addresses: Array
    sources: Array | None = None

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
            sources=None if recording.sources is None else recording.sources[rows],
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


@explains_wrong_types
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
    return list(windows_in_turn([recording], Survey([recording]), turn, by=by))


def windows_in_turn(
    parts: Iterable[Recording], survey: Survey, rotation: float, *, by: Literal["antenna", "time"] = "antenna"
) -> Iterator[Window]:
    """The windows of `clustering_time_window`, one after the other, from a recording in parts, in the order of time.

    The survey is that of all of them.
    """
    if not is_number(rotation, 0.0) or rotation == 0:
        raise InvalidInputError(f"rotation: expected seconds > 0, got {rotation!r}")
    turn, span = float(rotation), survey.last - survey.first
    if not span / turn < MOST_TURNS:
        raise InvalidInputError(f"rotation: {turn:g} s is too short for a recording of {span:g} s")
    plots = joined([], {}, "")
    numbers = places = np.zeros(0, dtype=np.int64)
    begin = 0
    for part, new, complete in _by_time(parts, survey, turn) if by == "time" else _by_antenna(parts, survey, turn):
        plots = joined([plots, part], {}, "") if len(plots) else part
        numbers = np.concatenate([numbers, new])
        places = np.concatenate([places, np.arange(begin, begin + len(part))])
        begin += len(part)
        out = numbers < complete
        for window in windows_of(plots, numbers, out):
            yield replace(window, rows=places[window.rows])
        plots, numbers, places = plots.take(~out), numbers[~out], places[~out]
    for window in windows_of(plots, numbers):
        yield replace(window, rows=places[window.rows])


def windows_of(recording: Recording, numbers: Array, which: Array | None = None) -> list[Window]:
    """Windows from the number of the group of each plot (n,); groups come in the order of their numbers.

    Of all plots, or of those in `which`, bool (n,).
    """
    rows = np.arange(len(numbers)) if which is None else np.flatnonzero(which)
    order = rows[np.argsort(numbers[rows], kind="stable")]
    groups = np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1)
    return [Window.of(recording, group, numbers[group[0]]) for group in groups if len(group)]


Numbered = Iterator[tuple[Recording, Array, float]]
"""Parts of a recording, the number of each plot's window, and the number before which windows are complete."""


def _by_time(parts: Iterable[Recording], survey: Survey, turn: float) -> Numbered:
    for part in parts:
        # a billionth of a turn forgives rounding at the edges
        numbers = np.floor((part.times - survey.first) / turn + 1e-9).astype(np.int64)
        yield part, numbers, float(numbers[-1])


def _by_antenna(parts: Iterable[Recording], survey: Survey, turn: float) -> Numbered:
    cut = _quietest(survey.sectors)
    last = shift = complete = -1
    state = np.zeros(4)
    for part, begins in _runs(parts, turn):
        turns = part.times / turn - np.mod(part.bearings - cut, 2 * math.pi) / (2 * math.pi)
        if begins:
            state = _first_phase(part.times, turns, turn)
        phase = _follow(part.times, np.exp(2j * math.pi * turns), turn, state)
        numbers = np.round(turns - phase).astype(np.int64)
        if begins:
            shift = last + 1 - int(numbers.min())
        numbers = np.maximum(numbers + shift, complete)
        last = max(last, int(numbers.max()))
        # a plot is at most a turn and a half before the antenna's count at its time
        complete = max(complete, math.floor(part.times[-1] / turn - phase[-1]) + shift - 3)
        yield part, numbers, float(complete)


def _runs(parts: Iterable[Recording], turn: float) -> Iterator[tuple[Recording, bool]]:
    """Parts without long gaps, and whether each is the first after one; the first are longer than five turns."""
    waiting: list[Recording] = []
    before = -math.inf
    for part in parts:
        far = np.diff(part.times, prepend=before) > LONG_GAP * turn
        before = float(part.times[-1])
        for first, end in pairwise([*np.unique([0, *np.flatnonzero(far)]), len(part)]):
            if far[first] and waiting:
                yield joined(waiting, {}, ""), True
            if far[first]:
                waiting = [joined([], {}, "")]
            piece = part.take(np.arange(first, end))
            if not waiting:
                yield piece, False
                continue
            waiting.append(piece)
            if piece.times[-1] - waiting[1].times[0] > _SETTLED * turn:
                yield joined(waiting, {}, ""), True
                waiting = []
    if waiting:
        yield joined(waiting, {}, ""), True


def running_phase(times: Array, turns: Array, turn: float) -> Array:
    """Fraction of a turn by which the antenna is ahead (n,), followed slowly, unwrapped.

    The estimated rotation time is off by a little, and motors drift: the mean over the last turns keeps count.
    """
    phase: Array = _follow(times, np.exp(2j * math.pi * turns), turn, _first_phase(times, turns, turn))
    return phase


def _first_phase(times: Array, turns: Array, turn: float) -> Array:
    """State of the phase before the first plot: its mean as a complex number, itself, and the time, (4,)."""
    # the first few turns set the start, so that the first plot's error does not
    first = np.angle(np.exp(2j * math.pi * turns[times - times[0] <= _SETTLED * turn]).sum())
    return np.array([math.cos(first), math.sin(first), first / (2 * math.pi), times[0]])


@njit
def _follow(times: Array, angles: Array, turn: float, state: Array) -> Array:
    phase = np.empty(len(times))
    held, now, before = complex(state[0], state[1]), state[2], state[3]
    for row in range(len(times)):
        held = held * math.exp(-(times[row] - before) / (10 * turn)) + 0.05 * angles[row]
        before = times[row]
        fraction = math.atan2(held.imag, held.real) / (2 * math.pi)
        now += (fraction - now + 0.5) % 1.0 - 0.5
        phase[row] = now
    state[0], state[1], state[2], state[3] = held.real, held.imag, now, before
    return phase


def _quietest(counts: Array) -> float:
    """Where to cut the circle, by the plots in each of its sectors: the middle of the one with the fewest, rad.

    An aircraft that crosses the cut against the antenna would be twice in a turn.
    """
    cells = len(counts)
    # smoothed around the circle: the middle of an empty sector is better than its edge
    width = np.minimum(np.arange(cells), cells - np.arange(cells))
    weights = np.exp(-0.5 * (width / 4.0) ** 2)
    smooth = np.real(np.fft.ifft(np.fft.fft(counts.astype(float)) * np.fft.fft(weights)))
    return (float(np.argmin(np.round(smooth, 9))) + 0.5) * 2 * math.pi / cells


@explains_wrong_types
def irregular_groups(
    recording: Recording, rng: np.random.Generator, mean: float = 6.2, shape: float = 2.0
) -> list[Window]:
    """Group plots by intervals of irregular length, as the paper's data come without a window.

    The paper has 183 groups for 119 rotations, some shorter and some longer than one, and does not explain
    their lengths. Here they are gamma-distributed.

    Parameters
    ----------
    recording : Recording
    rng : numpy.random.Generator
    mean : float, default 6.2
        Of the lengths, seconds.
    shape : float, default 2
        Of the gamma distribution; with 2 about a fifth of the groups are longer than 9.5 s.

    Returns
    -------
    list of Window
        Without empty ones.
    """
    if not 0 < mean < math.inf or not 0 < shape < math.inf:
        raise InvalidInputError(f"mean, shape: expected numbers > 0, got {mean!r}, {shape!r}")
    if not len(recording):
        return []
    start, end = float(recording.times[0]), float(recording.times[-1])
    edges: list[float] = []
    reached = start
    while reached <= end:
        # drawn in blocks; gaps of hours take as many groups as they last
        lengths = np.cumsum(rng.gamma(shape, mean / shape, 256))
        edges.extend((reached + lengths).tolist())
        reached = edges[-1]
        if len(edges) > MOST_GROUPS:
            raise InvalidInputError(f"mean, shape: {mean:g}, {shape:g} make more than {MOST_GROUPS} groups")
    return windows_of(recording, np.searchsorted(np.array(edges), recording.times, side="right"))
