"""Recorded trajectories as receivers keep them: what is no new report, and what cannot be right.

Receivers repeat an aircraft's last position for minutes after they heard it last, and now and then decode an altitude
or a place wrongly. Taken for truth, the first are aircraft that stand still and vanish, the others jumps of kilometres.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from assoc._types import Array
from assoc.scene.geodesy import earth_centered

MOVES = 15.0
"""Targets slower than this may well be twice at one place, m/s."""
FASTEST = 700.0
"""No target flies faster, m/s."""
_STEEPEST = 60.0
_LEVEL = 300.0
_NEIGHBOURS, _FEWEST, _ROUNDS = 4, 3, 6


@dataclass(frozen=True, eq=False)
class Reports:
    """Reports of targets, sorted by target and time, n of them.

    Attributes
    ----------
    time : array (n,)
        Seconds; of the position, where the file tells it.
    target : int array (n,)
    latitude, longitude, height : arrays (n,)
        Radians, metres.
    velocity : array (n, 3)
        East, north, up at the target's place, m/s; NaN where it is not known.
    """

    time: Array
    target: Array
    latitude: Array
    longitude: Array
    height: Array
    velocity: Array

    def __len__(self) -> int:
        return len(self.time)

    def rows(self, keep: Array) -> Reports:
        """Some of the reports."""
        return Reports(**{one.name: getattr(self, one.name)[keep] for one in fields(self)})


@dataclass(frozen=True)
class Cleaning:
    """What was done to the reports of a file.

    Attributes
    ----------
    repeated : int
        Left out: they repeat an older position.
    places : int
        Left out: nobody flies so fast there and back.
    altitudes : int
        Mended: far from those before and after.
    """

    repeated: int
    places: int
    altitudes: int

    def notes(self) -> dict[str, int]:
        """What was cleaned, in words, and how often; nothing that did not happen."""
        found = {
            "rows left out, repeating an older position": self.repeated,
            "rows left out, at a place too far to fly to": self.places,
            "altitudes mended, far from those before and after": self.altitudes,
        }
        return {what: count for what, count in found.items() if count}


def clean(reports: Reports, updated: Array) -> tuple[Reports, Cleaning]:
    """Leave out what is no new report, and mend altitudes.

    Parameters
    ----------
    reports : Reports
    updated : array (n,)
        When each position was heard, seconds; NaN where the file does not tell.

    Returns
    -------
    Reports, Cleaning
    """
    repeated = _repeats(reports, updated)
    told = ~np.isnan(updated) & (updated <= reports.time)
    fresh = replace(reports, time=np.where(told, updated, reports.time)).rows(~repeated)
    order = np.lexsort((fresh.time, fresh.target))
    fresh = fresh.rows(order)
    first = np.ones(len(fresh), dtype=np.bool_)
    first[1:] = (np.diff(fresh.time) > 0) | (np.diff(fresh.target) != 0)
    fresh = fresh.rows(first)
    jumps = _jumps(fresh)
    kept = fresh.rows(~jumps)
    heights, wrong = _mended_heights(kept)
    found = Cleaning(len(reports) - len(fresh), int(jumps.sum()), int(wrong.sum()))
    return replace(kept, height=heights), found


def _repeats(reports: Reports, updated: Array) -> Array:
    """Rows whose position was heard when an earlier row's was; without such times, the same place in flight."""
    same = np.zeros(len(reports), dtype=np.bool_)
    if len(reports) < 2:
        return same
    of_one = np.diff(reports.target) == 0
    told = ~np.isnan(updated[1:]) & ~np.isnan(updated[:-1])
    still = (np.diff(reports.latitude) == 0) & (np.diff(reports.longitude) == 0)
    speed = np.hypot(reports.velocity[1:, 0], reports.velocity[1:, 1])
    # where no speed is told, that with which the target came to the place
    came = _speeds(reports)[1:]
    # in a run of repeats, the speed with which its first report was reached
    last = np.maximum.accumulate(np.where(still & of_one, 0, np.arange(1, len(still) + 1)))
    came = np.where(last > 0, came[np.maximum(last, 1) - 1], 0.0)
    moving = np.where(np.isnan(speed), came, speed) > MOVES
    # several copies of a network may be a few hundredths apart
    same[1:] = of_one & np.where(told, np.diff(np.nan_to_num(updated)) < 0.05, still & moving)
    return same


def _speeds(reports: Reports) -> Array:
    """Speed from the report before to each, (n,), m/s; 0 for a target's first."""
    place = earth_centered(reports.latitude, reports.longitude, reports.height)
    away = np.zeros(len(reports))
    away[1:] = np.linalg.norm(np.diff(place, axis=0), axis=1) / np.maximum(np.diff(reports.time), 1e-3)
    away[1:][np.diff(reports.target) != 0] = 0.0
    return away


def _jumps(reports: Reports) -> Array:
    """Reports to and from which a target would fly too fast, though not from the one before to the next."""
    level = replace(reports, height=np.zeros(len(reports)))
    fast = np.zeros(len(reports), dtype=np.bool_)
    if len(reports) < 3:
        return fast
    place = earth_centered(level.latitude, level.longitude, level.height)
    speed = _speeds(level)
    around = np.linalg.norm(place[2:] - place[:-2], axis=1) / np.maximum(reports.time[2:] - reports.time[:-2], 1e-3)
    whole = (reports.target[2:] == reports.target[1:-1]) & (reports.target[1:-1] == reports.target[:-2])
    fast[1:-1] = whole & (speed[1:-1] > FASTEST) & (speed[2:] > FASTEST) & (around <= FASTEST)
    return fast


def _mended_heights(reports: Reports) -> tuple[Array, Array]:
    """Heights, those far from their neighbours' replaced by a line between good ones; and which these were."""
    heights, wrong = reports.height.copy(), np.zeros(len(reports), dtype=np.bool_)
    # again and again: an outlier must not make its neighbours look wrong
    for _ in range(_ROUNDS):
        before, wrong = wrong, _off_level(reports, np.where(wrong, np.nan, reports.height))
        if (before == wrong).all():
            break
    for target in np.unique(reports.target[wrong]).tolist():
        rows = np.flatnonzero(reports.target == target)
        bad, good = rows[wrong[rows]], rows[~wrong[rows]]
        if len(good):
            heights[bad] = np.interp(reports.time[bad], reports.time[good], reports.height[good])
    return heights, wrong


def _off_level(reports: Reports, trusted: Array) -> Array:
    """Whether a height is farther from the median of those around it than a target can climb, bool (n,)."""
    count = len(reports)
    heights, times = np.full((2 * _NEIGHBOURS, count), np.nan), np.full((2 * _NEIGHBOURS, count), np.nan)
    shifts = [shift for shift in range(-_NEIGHBOURS, _NEIGHBOURS + 1) if shift and abs(shift) < count]
    for row, shift in enumerate(shifts):
        here = slice(max(0, -shift), count - max(0, shift))
        there = slice(max(0, shift), count + min(0, shift))
        same = (reports.target[here] == reports.target[there]) & ~np.isnan(trusted[there])
        heights[row, here] = np.where(same, trusted[there], np.nan)
        times[row, here] = np.where(same, reports.time[there], np.nan)
    # with too few around it a height stays what it was taken for
    off = np.isnan(trusted)
    enough = np.flatnonzero((~np.isnan(heights)).sum(axis=0) >= _FEWEST)
    level, middle = np.nanmedian(heights[:, enough], axis=0), np.nanmedian(times[:, enough], axis=0)
    allowed = _LEVEL + _STEEPEST * np.abs(middle - reports.time[enough])
    off[enough] = np.abs(reports.height[enough] - level) > allowed
    return off
