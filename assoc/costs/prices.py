"""Prices: parts of a tuple's cost besides the residuals of its position, of range rates and of a prior of positions.

Equation 5 takes the likelihood at the best position, as if it were known that a target is there. A tuple of bearings
then costs the same whether they cross in a point or almost run along one another, although the second would explain
many more false measurements. With a prior the position is integrated out: targets are spread over the region with a
density of lambda per m^3, so that the likelihood ratio is

    lambda * integral of the likelihood over x  =  likelihood at the best x * lambda (2 pi)^(n/2) |P|^(1/2)

with P the covariance of the position (Laplace's approximation, exact for linear sensors), and the cost gains

    - ln( lambda (2 pi)^(n/2) |P|^(1/2) ).

A direction in which the measurements are less exact than the region integrates to the region's width, and the whole
to lambda V at most, the number of targets in the region. Where the best position lies outside of the region, the
nearest one inside counts, with what it costs the residuals at least.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.arrays import ScanArrays, SensorArrays
from assoc.costs.range_rates import RangeRates
from assoc.costs.range_rates import prices as range_rate_prices
from assoc.errors import InvalidInputError
from assoc.scene.scene import Scene


class PositionPrior(NamedTuple):
    """Targets spread evenly over the region."""

    log_density: float
    """ln of targets per m^3."""
    region: Array
    """Lower and upper bounds, (3, 2), metres."""
    log_targets: float
    """ln of the targets in the region, the most that an integral over it can be."""


def position_prior(scene: Scene, sensors: SensorArrays, target_density: float | str | None) -> PositionPrior | None:
    """Return the prior that a `target_density` stands for; None for None, which is equation 5."""
    if target_density is None:
        return None
    width, depth, height = (2.0 * sensors.half).tolist()
    region = sensors.middle[:, None] + sensors.half[:, None] * [-1.0, 1.0]
    if isinstance(target_density, str):
        if target_density != "auto":
            raise InvalidInputError(f"target_density must be a number, 'auto' or None, got {target_density!r}")
        log_targets = math.log(expected_targets(scene))
        return PositionPrior(log_targets - math.log(width * depth * height), region, log_targets)
    try:
        density = math.nan if isinstance(target_density, bool) else float(target_density)
    except (TypeError, ValueError):
        density = math.nan
    if not 0.0 < density < math.inf:
        raise InvalidInputError(f"target_density must be a number above 0, 'auto' or None, got {target_density!r}")
    # in the plane it is one per m^2, over the whole height
    log_density = math.log(density) - (0.0 if sensors.full.any() else math.log(height))
    return PositionPrior(log_density, region, log_density + math.log(width * depth * height))


def expected_targets(scene: Scene) -> float:
    """Estimate the number of targets from the numbers of measurements, at least one.

    The mean over scans and sensors of (measurements - false alarms) / P_d.
    """
    counts = np.array([[len(z) for z in scan] for scan in scene.measurements], dtype=np.float64)
    false = np.array([sensor.false_alarm_rate for sensor in scene.sensors])
    detected = np.array([sensor.detection_probability for sensor in scene.sensors])
    return max(1.0, float(((counts - false) / detected).mean()))


def with_prior(sensors: SensorArrays, prior: PositionPrior | None) -> SensorArrays:
    """Sensors whose base cost has the prior's most favourable share, so that prices are 0 or more."""
    return sensors if prior is None else sensors._replace(base=sensors.base - prior.log_targets)


def prices(
    sensors: SensorArrays, scan: ScanArrays, rows: Array, rates: RangeRates | None, prior: PositionPrior | None,
    positions: Array, covariances: Array,
) -> Array:  # fmt: skip
    """Twice the prices of tuples, (K,); 0 or more, and it hardly ever falls when a tuple grows.

    `rows`, int32 (K, S), are the row of `scan` for each sensor, or -1, `positions` (K, 3) and `covariances` (K, 3, 3)
    those of the tuples. Without `rates` or `prior` there is no such price.
    """
    total = np.zeros(len(rows))
    if rates is not None:
        total += range_rate_prices(sensors, scan, rates, rows, positions)
    if prior is not None:
        total += 2.0 * (prior.log_targets - log_expected(prior, positions, covariances))
    return total


def log_expected(prior: PositionPrior, positions: Array, covariances: Array) -> Array:
    """Ln of lambda (2 pi)^(n/2) |P|^(1/2) for positions (K, 3) and covariances (K, 3, 3), within the region."""
    widths = prior.region[:, 1] - prior.region[:, 0]
    plane = covariances[:, :2, :2]
    det = np.maximum(plane[:, 0, 0] * plane[:, 1, 1] - plane[:, 0, 1] ** 2, 1e-300)
    # the covariance as it is within the region: a normal density of the region's width has this variance
    edge = widths[:2] ** 2 / (2.0 * math.pi)
    trace = plane[:, 0, 0] / edge[0] + plane[:, 1, 1] / edge[1]
    within = det / (1.0 + trace + det / (edge[0] * edge[1]))
    upright = np.exp(0.5 * (np.linalg.slogdet(covariances)[1] - np.log(det)))
    height = np.minimum(math.sqrt(2.0 * math.pi) * upright, widths[2])
    outside = np.maximum(prior.region[:, 0] - positions, positions - prior.region[:, 1]).clip(min=0.0)[:, :2]
    away = (outside**2 / np.diagonal(plane, axis1=1, axis2=2)).max(axis=1)
    log_volume = math.log(2.0 * math.pi) + 0.5 * np.log(within) + np.log(height)
    return np.asarray(np.minimum(prior.log_density + log_volume, prior.log_targets) - 0.5 * away)
