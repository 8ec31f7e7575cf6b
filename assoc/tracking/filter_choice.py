"""Filters by name, and the default filter of trackers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from assoc import filters
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.base import Filter
from assoc.sensors import Radar2D, Sensor

PROCESS_NOISE = 30.0
"""Process noise of filters with one motion model: root of the acceleration's spectral density, m/s^1.5."""

MANOEUVRE_NOISE = 50.0
"""Process noise of the manoeuvring model of `two_speeds`: turns of 5 g at a scan a second."""

# imm-cv: the quiet model's share of the process noise, and the probability that a model gives way in this many seconds,
# a turn of a radar's antenna
_QUIET = 0.1
_CHANGE, _TURN = 0.1, 4.0

_TURN_NOISE = 0.03
"""Standard deviation of a turn rate's increment in a step, rad/s."""


def two_speeds(
    noise: float = MANOEUVRE_NOISE, dimensions: int = 3, *, unscented: bool = False, falls: bool = False
) -> Filter[Any]:
    """Interacting multiple models: nearly constant velocity, and manoeuvres with process noise, m/s^1.5.

    The quiet model has a tenth of the process noise. Each model changes to the other within four seconds with
    probability 0.1, and lasts for 36 seconds on average. Unscented filters instead of extended ones are for
    `open_heights`: linearised at a height that is kilometres off, slant ranges seem to determine it better than they
    do. Targets that `falls` fly free under gravity instead of at nearly constant velocity, in three dimensions.
    """
    kind: Any = filters.UnscentedKalmanFilter if unscented else filters.ExtendedKalmanFilter
    modes: list[Any] = [
        kind(filters.FreeFlight(share * noise) if falls and dimensions == 3 else _velocity(share * noise, dimensions))
        for share in (_QUIET, 1.0)
    ]
    transition = np.array([[1 - _CHANGE, _CHANGE], [_CHANGE, 1 - _CHANGE]])
    return filters.InteractingMultipleModel(modes, transition, interval=_TURN)


def pace_of(times: Array) -> float:
    """Usual seconds from one scan to the next; 1 if there is only one scan."""
    steps = np.diff(np.unique(times))
    return float(np.median(steps)) if len(steps) else 1.0


def manoeuvre_noise(pace: float) -> float:
    """Process noise of `two_speeds` for scans `pace` seconds apart, m/s^1.5.

    From scan to scan a velocity changes by 50 m/s (standard deviation) in a manoeuvre: turns of 5 g at a scan a
    second, as fighters fly, and gentler turns, as airliners fly, where scans are 10 s apart, because nobody turns
    with 5 g for so long.
    """
    return MANOEUVRE_NOISE / math.sqrt(max(pace, 1.0))


def measures_heights(sensors: Sequence[Sensor]) -> bool:
    """Whether any sensor measures heights or elevations."""
    return any(sensor.dim >= 3 or "elevation" in sensor.components[: sensor.dim] for sensor in sensors)


def open_heights(sensors: Sequence[Sensor]) -> bool:
    """Whether slant ranges depend on heights that no sensor measures."""
    return not measures_heights(sensors) and any(isinstance(sensor, Radar2D) for sensor in sensors)


def planar(sensors: Sequence[Sensor], region: Array | None = None) -> bool:
    """Whether two-dimensional states suffice.

    A planar state cannot fit slant ranges from several places, or one and other measurements. It suffices where only
    one place measures slant ranges and nothing is known of heights, or where those of the region (3, 2) change a slant
    range by less than its noise; and without slant ranges, if no sensor measures heights.
    """
    if not open_heights(sensors):
        return not measures_heights(sensors)
    if not all(isinstance(sensor, Radar2D) for sensor in sensors) or len({tuple(s.position) for s in sensors}) > 1:
        return False
    if region is None:
        return True
    reach = max(float(sensor.field_of_view[0, 1]) for sensor in sensors)
    least = min(float(sensor.covariance[0, 0]) for sensor in sensors)
    highest = float(np.abs(region[2] - sensors[0].position[2]).max())
    return math.hypot(reach, highest) - reach < math.sqrt(least)


def height_note(sensors: Sequence[Sensor], axes: int) -> str | None:
    """How tracks in so many dimensions get their heights, a line for people; None where that needs no word."""
    if not open_heights(sensors):
        return None
    if axes < 3:
        return "heights are not measured: tracks are flat (z = 0), slant ranges are taken for ground ranges"
    return "heights are not measured: z comes from slant ranges and the region's heights, sigma_z says how well"


def _velocity(noise: float, dimensions: int) -> filters.ConstantVelocity:
    return filters.ConstantVelocity(noise, dimensions=dimensions, kind="continuous")


def _turn(noise: float, flat: bool, name: str) -> filters.CoordinatedTurn:
    if flat:
        raise InvalidInputError(f"filter: {name!r} needs a sensor that measures heights; use ekf, ukf or enkf")
    return filters.CoordinatedTurn(noise, _TURN_NOISE)


def _imm(noise: float, flat: bool, seed: int) -> Filter[Any]:
    turn = _turn(noise, flat, "imm")
    straight = filters.Padded(_velocity(0.25 * noise, 3), _TURN_NOISE)
    modes: list[Any] = [filters.ExtendedKalmanFilter(straight), filters.ExtendedKalmanFilter(turn)]
    return filters.InteractingMultipleModel(modes, np.array([[0.95, 0.05], [0.1, 0.9]]))


_MAKERS: dict[str, Callable[[float, bool, int], Filter[Any]]] = {
    "ekf": lambda noise, flat, seed: filters.ExtendedKalmanFilter(_velocity(noise, 2 if flat else 3)),
    "kalman": lambda noise, flat, seed: filters.KalmanFilter(_velocity(noise, 2 if flat else 3)),
    "modified-ekf": lambda noise, flat, seed: filters.ModifiedEKF(_velocity(noise, 2 if flat else 3)),
    "ukf": lambda noise, flat, seed: filters.UnscentedKalmanFilter(_velocity(noise, 2 if flat else 3)),
    "enkf": lambda noise, flat, seed: filters.EnsembleKalmanFilter(_velocity(noise, 2 if flat else 3), 100, seed),
    "imm": _imm,
    "fuzzy": lambda noise, flat, seed: filters.FuzzyAdaptiveEKF.from_data(
        _turn(noise, flat, "fuzzy"), filters.tuned_data()
    ),
}

FILTERS = ("imm-cv", *_MAKERS)
"""Names of the filters."""


def make_filter(
    name: str,
    sensors: Sequence[Sensor],
    process_noise: float | None = None,
    seed: int = 0,
    pace: float = 1.0,
    region: Array | None = None,
    falls: bool = False,
) -> Filter[Any]:
    """Make one of the `FILTERS` with nearly constant velocity (imm and fuzzy: with turns) that suits the sensors.

    The sensors decide, with the region (3, 2), whether states are `planar`. `process_noise` is the root of the
    acceleration's spectral density, m/s^1.5; for imm-cv that of its manoeuvring model, for imm and fuzzy the
    acceleration, m/s^2. Default: `manoeuvre_noise` of the pace (seconds from scan to scan) for imm-cv, 30 for all
    others. Targets that `falls` fly under gravity, of imm-cv. The seed is that of the ensemble filter's noise. A filter
    that does not suit the sensors is refused.
    """
    if name not in FILTERS:
        raise InvalidInputError(f"filter: unknown name {name!r}; known: {', '.join(FILTERS)}")
    if process_noise is None:
        process_noise = manoeuvre_noise(pace) if name == "imm-cv" else PROCESS_NOISE
    flat = planar(sensors, region)
    if name == "imm-cv":
        made = two_speeds(process_noise, 2 if flat else 3, unscented=not flat and open_heights(sensors), falls=falls)
    else:
        made = _MAKERS[name](process_noise, flat, seed)
    for sensor in sensors:
        made.observe(sensor)
    return made
