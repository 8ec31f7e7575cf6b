"""Cleaning of recorded trajectories: repeated positions, and values that cannot be right.

Receivers repeat an aircraft's last position for minutes after its last report, and sometimes decode an altitude or a
position wrongly. In a truth the first are aircraft that stand still and vanish, the others jumps of kilometres.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from assoc._types import Array
from assoc.recordings.flights.reports import Reports
from assoc.scene.geodesy import earth_centered

REPEATED = "rows left out, repeating an older position"
JUMPS = "rows left out, at a position too far to fly to"
ALTITUDES = "altitudes mended, far from those before and after"

MOVES = 15.0
"""Slower targets may report the same position twice, m/s."""
FASTEST = 700.0
"""No target flies faster, m/s."""
_STEEPEST = 60.0
_LEVEL = 300.0
_NEIGHBOURS, _FEWEST, _ROUNDS = 4, 3, 6


def clean(reports: Reports) -> tuple[Reports, dict[str, int]]:
    """Leave out repeated and impossible positions, and correct altitudes; also says what was cleaned, and how often.

    Reports are then at the times of their positions, where known.
    """
    known = ~np.isnan(reports.updated) & (reports.updated <= reports.time)
    fresh = replace(reports, time=np.where(known, reports.updated, reports.time)).rows(~_repeats(reports))
    fresh = fresh.rows(np.lexsort((fresh.time, fresh.target)))
    fresh = fresh.rows(fresh.first_at_each_time())
    jumps = _jumps(fresh)
    kept = fresh.rows(~jumps)
    heights, wrong = _mended_heights(kept)
    notes = {REPEATED: len(reports) - len(fresh), JUMPS: int(jumps.sum()), ALTITUDES: int(wrong.sum())}
    return replace(kept, height=heights), {what: count for what, count in notes.items() if count}


def _repeats(reports: Reports) -> Array:
    """Whether a position was received with an earlier row's; without such times, is the same although in flight."""
    same = np.zeros(len(reports), dtype=np.bool_)
    if len(reports) < 2:
        return same
    of_one = np.diff(reports.target) == 0
    updated = reports.updated
    known = ~np.isnan(updated[1:]) & ~np.isnan(updated[:-1])
    still = (np.diff(reports.latitude) == 0) & (np.diff(reports.longitude) == 0)
    speed = np.hypot(reports.velocity[1:, 0], reports.velocity[1:, 1])
    # where the speed is unknown, that of the way to the position; in a run of repeats, to its first report
    came = _speeds(reports)[1:]
    last = np.maximum.accumulate(np.where(still & of_one, 0, np.arange(1, len(still) + 1)))
    came = np.where(last > 0, came[np.maximum(last, 1) - 1], 0.0)
    moving = np.where(np.isnan(speed), came, speed) > MOVES
    # copies from several receivers may be a few hundredths of a second apart
    same[1:] = of_one & np.where(known, np.diff(np.nan_to_num(updated)) < 0.05, still & moving)
    return same


def _speeds(reports: Reports) -> Array:
    """Speed from the report before to each, (n,), m/s; 0 for a target's first."""
    points = earth_centered(reports.latitude, reports.longitude, reports.height)
    away = np.zeros(len(reports))
    away[1:] = np.linalg.norm(np.diff(points, axis=0), axis=1) / np.maximum(np.diff(reports.time), 1e-3)
    away[1:][np.diff(reports.target) != 0] = 0.0
    return away


def _jumps(reports: Reports) -> Array:
    """Whether a target would fly too fast to and from a report, though not from the one before to the next."""
    level = replace(reports, height=np.zeros(len(reports)))
    fast = np.zeros(len(reports), dtype=np.bool_)
    if len(reports) < 3:
        return fast
    points = earth_centered(level.latitude, level.longitude, level.height)
    speed = _speeds(level)
    around = np.linalg.norm(points[2:] - points[:-2], axis=1) / np.maximum(reports.time[2:] - reports.time[:-2], 1e-3)
    whole = (reports.target[2:] == reports.target[1:-1]) & (reports.target[1:-1] == reports.target[:-2])
    fast[1:-1] = whole & (speed[1:-1] > FASTEST) & (speed[2:] > FASTEST) & (around <= FASTEST)
    return fast


def _mended_heights(reports: Reports) -> tuple[Array, Array]:
    """Heights, those far from their neighbours' interpolated between good ones; and which these were."""
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
    """Whether a height differs from the median of its neighbours by more than a target can climb, bool (n,)."""
    count = len(reports)
    heights, times = np.full((2 * _NEIGHBOURS, count), np.nan), np.full((2 * _NEIGHBOURS, count), np.nan)
    shifts = [shift for shift in range(-_NEIGHBOURS, _NEIGHBOURS + 1) if shift and abs(shift) < count]
    for row, shift in enumerate(shifts):
        here = slice(max(0, -shift), count - max(0, shift))
        there = slice(max(0, shift), count + min(0, shift))
        same = (reports.target[here] == reports.target[there]) & ~np.isnan(trusted[there])
        heights[row, here] = np.where(same, trusted[there], np.nan)
        times[row, here] = np.where(same, reports.time[there], np.nan)
    # with too few neighbours the last judgement stays
    off = np.isnan(trusted)
    enough = np.flatnonzero((~np.isnan(heights)).sum(axis=0) >= _FEWEST)
    level, middle = np.nanmedian(heights[:, enough], axis=0), np.nanmedian(times[:, enough], axis=0)
    allowed = _LEVEL + _STEEPEST * np.abs(middle - reports.time[enough])
    off[enough] = np.abs(reports.height[enough] - level) > allowed
    return off
