"""What sensors can see: the share of a target's density in a sensor's view, and what a miss then says."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.special import ndtr

from assoc._types import Array
from assoc.filters.base import Filter
from assoc.sensors import Sensor

# shares nearer to 0 or 1 than this are 0 or 1
_SURE = 1e-6
_FULL_TURN = 2.0 * math.pi * (1.0 - 1e-9)
# places along each axis of a region at which a view is tried
_TRIED = (9, 9, 5)


def share_in_view(sensor: Sensor, positions: Array, covariances: Array | None, sector: Array | None = None) -> Array:
    """Probability that targets lie where a sensor looks.

    Each component of a measurement is taken as Gaussian, with the sensor's derivatives at the mean, and as independent
    of the others.

    Parameters
    ----------
    sensor : Sensor
    positions, covariances : arrays (B, 3), (B, 3, 3)
        Of the targets, metres; without covariances the positions are exact.
    sector : array (2,), optional
        First and last azimuth of this look; see `assoc.Scene`.

    Returns
    -------
    array (B,)
        0 or 1 where it is within 1e-6 of either.
    """
    share = np.ones(len(positions))
    if sector is not None and not sector[1] > sector[0]:
        return np.zeros(len(positions))
    limits = sensor.position_part.limits
    if len(positions) and limits:
        mean = sensor.position_part.measure(positions)
        spread = np.zeros_like(mean)
        if covariances is not None:
            slope = sensor.position_part.jacobian(positions)
            spread = np.sqrt(((slope @ covariances) * slope).sum(axis=2))
        for axis, low, high in limits:
            share *= _within(mean[:, axis], spread[:, axis], (low, high), sensor.angular[axis])
    if sector is not None and sector[1] - sector[0] < _FULL_TURN:
        away = positions - sensor.position
        across = np.zeros(len(positions))
        if covariances is not None:
            ground = np.maximum(away[:, 0] ** 2 + away[:, 1] ** 2, 1e-18)
            slope = np.stack([-away[:, 1], away[:, 0]], axis=1) / ground[:, None]
            across = np.sqrt(np.einsum("bi,bij,bj->b", slope, covariances[:, :2, :2], slope))
        share *= _within(np.arctan2(away[:, 1], away[:, 0]), across, (float(sector[0]), float(sector[1])), True)
    share[share < _SURE] = 0.0
    share[share > 1.0 - _SURE] = 1.0
    return share


def _within(mean: Array, spread: Array, limits: tuple[float, float], angular: bool) -> Array:
    """Probability of an interval under normal densities, (B,)."""
    low, high = limits[0] - mean, limits[1] - mean
    if angular:
        # the turn of the interval that lies nearest to the mean
        turn = 2.0 * math.pi * np.round((low + high) / (4.0 * math.pi))
        low, high = low - turn, high - turn
    spread = np.maximum(spread, 1e-12)
    return np.asarray(ndtr(high / spread) - ndtr(low / spread))


def places_of(filter: Filter[Any], states: Any) -> tuple[Array, Array]:
    """Positions (B, 3) and their covariances (B, 3, 3) of states; 0 along axes that the motion model lacks."""
    axes = list(filter.motion.position)
    positions, covariances = np.zeros((len(states), 3)), np.zeros((len(states), 3, 3))
    positions[:, : len(axes)] = states.mean[:, axes]
    covariances[:, : len(axes), : len(axes)] = states.covariance[:, axes][:, :, axes]
    return positions, covariances


def log_missed(miss: Array | float, share: Array) -> Array:
    """ln(1 - P_d share) of a sensor with ln(1 - P_d) = `miss`; exactly `miss` and 0 where the share is 1 and 0."""
    return np.where(share == 1.0, miss, np.log1p(share * np.expm1(miss)))


def blind_somewhere(sensors: Sequence[Sensor], region: Array) -> Array:
    """Which sensors do not see the whole region, tried on a grid; bool (S,)."""
    # not quite to its edge, where views often end
    inner = region + 0.01 * (region[:, 1:] - region[:, :1]) * np.array([1.0, -1.0])
    axes = [np.linspace(low, high, count) for (low, high), count in zip(inner, _TRIED, strict=True)]
    places = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3)
    return np.array([bool((share_in_view(sensor, places, None) < 1.0).any()) for sensor in sensors])
