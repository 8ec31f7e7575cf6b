"""The radar that made a recording, as a sensor."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.recordings.recording import Recording
from assoc.recordings.survey import Survey
from assoc.sensors.radar import Radar2D

HEIGHT_NOISE = 50.0
"""Standard deviation of heights by Mode C, metres: steps of 100 ft, and climbs between reply and plot."""
HEIGHTS = (-1_000.0, 20_000.0)
"""Heights at which aircraft are sought, metres."""
_LEAST_SHARE, _FALSE_SHARE = 0.02, 0.1
"""Least share of plots with an altitude, or without one, that counts; the share of false plots with an altitude."""


@explains_wrong_types
def radar_of(
    recording: Recording | Survey,
    *,
    range_noise: float | None = None,
    azimuth_noise: float | None = None,
    detection_probability: float = 0.8,
    false_alarm_rate: float = 2.5,
    name: str = "radar",
) -> Radar2D:
    """Describe the radar of a recording, at the origin.

    Parameters
    ----------
    recording : Recording or Survey
    range_noise, azimuth_noise : float, optional
        Standard deviations, metres and radians. Without them they are taken from the steps in which the plots
        come: step / sqrt(12), the deviation of rounding.
    detection_probability : float, default 0.8
    false_alarm_rate : float, default 2.5
        False plots in a rotation.
    name : str

    Returns
    -------
    Radar2D
        Its field of view is the full circle, out to the farthest plot and two steps more.

    Raises
    ------
    InvalidInputError
        The plots do not come in steps, and no noise is given.
    """
    seen = recording if isinstance(recording, Survey) else Survey([recording])
    steps = [
        _noise("range_noise", range_noise, seen.ranges, seen.count),
        _noise("azimuth_noise", azimuth_noise, seen.bearings, seen.count),
    ]
    reach = seen.farthest + 8.0 * steps[0] if seen.count else 1.0
    return Radar2D(
        position=np.zeros(3),
        noise=np.array(steps),
        detection_probability=detection_probability,
        false_alarm_rate=false_alarm_rate,
        field_of_view=np.array([[0.0, reach], [-math.pi, math.pi]]),
        name=name,
    )


@explains_wrong_types
def with_heights(radar: Radar2D, recording: Recording | Survey) -> list[Radar2D]:
    """The radar of a recording as two sensors at one place: its plots with an altitude that is not garbled, and others.

    The first measures heights, too (`Window.heights`). Only the radar itself where hardly any plot has an altitude.
    """
    seen = recording if isinstance(recording, Survey) else Survey([recording])
    share = seen.high / seen.count if seen.count else 0.0
    if share < _LEAST_SHARE:
        return [radar]
    share = min(share, 1.0 - _LEAST_SHARE)
    noise = np.append(np.sqrt(np.diagonal(radar.covariance)), HEIGHT_NOISE)
    high = replace(
        radar, noise=noise, field_of_view=np.array([*radar.field_of_view, HEIGHTS]), name=f"{radar.name}, Mode C",
        detection_probability=share * radar.detection_probability,
        false_alarm_rate=_FALSE_SHARE * radar.false_alarm_rate,
    )  # fmt: skip
    return [high, replace(radar, detection_probability=(1.0 - share) * radar.detection_probability)]


def _noise(name: str, given: float | None, distinct: Array, count: int) -> float:
    if given is not None:
        if isinstance(given, bool) or not 0 < given < math.inf:
            raise InvalidInputError(f"{name}: expected a number > 0, got {given!r}")
        return float(given)
    step = resolution(distinct, count)
    if step == 0.0:
        raise InvalidInputError(f"{name}: the plots do not come in steps, from which it could be estimated: give it")
    return step / math.sqrt(12.0)


def resolution(distinct: Array, count: int) -> float:
    """Step in which so many values come, by the distinct ones in ascending order; 0 if they do not come in steps.

    It is the smallest difference between two of them, if all are its multiples within 5 % of it.
    """
    if len(distinct) < 3:
        return 0.0
    gaps = np.diff(distinct)
    # printed with a few digits, one value is two that differ in the last of them
    gaps = gaps[gaps > 1e-4 * gaps.max()]
    step = float(gaps.min())
    # the step itself is rounded: let the farthest multiples correct it
    for _ in range(4):
        counts = np.round(distinct / step)
        if not counts.any():
            return 0.0
        step = float(distinct @ counts / (counts @ counts))
    off = np.abs(distinct - np.round(distinct / step) * step)
    return step if (off <= 0.05 * step).all() and len(distinct) < 20 * count**0.5 + 20 else 0.0
