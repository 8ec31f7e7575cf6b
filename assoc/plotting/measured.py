"""Where to draw a measurement: a point, or a ray along a bearing."""

from __future__ import annotations

import math

import numpy as np

from assoc._types import Array
from assoc.association.scan import ScanAssociation
from assoc.errors import InvalidInputError
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.sensors import BearingSensor, PositionSensor, Radar2D, Sensor

# of an ellipse
_CORNERS = 49


def scan_of(scene: Scene, association: ScanAssociation) -> Scan:
    """The scan of a scene to which an association belongs; refused where there is none, or its measurements differ."""
    scan = scene.scan(association.scan)
    if tuple(scan.sizes) != tuple(association.sizes):
        had, has = list(map(int, association.sizes)), scan.sizes.tolist()
        raise InvalidInputError(
            f"association: is not one of this scene, whose scan {association.scan} has {has} measurements, not {had}"
        )
    return scan


def positions_of(sensor: Sensor, measurements: Array, heights: Array | float, distances: Array | float) -> Array:
    """Positions (n, 3), metres, of measurements (n, d), given the coordinates that a sensor does not measure.

    These are heights above the plane z = 0 and, for a bearing alone, ground distances; each a number or (n,), metres.
    """
    z = np.asarray(measurements, dtype=np.float64)
    height = np.broadcast_to(np.asarray(heights, dtype=np.float64), (len(z),))
    if isinstance(sensor, PositionSensor):
        return np.column_stack([z, height]) if sensor.dim == 2 else np.array(z)
    if isinstance(sensor, BearingSensor):
        ground, azimuth = np.broadcast_to(np.asarray(distances, dtype=np.float64), (len(z),)), z[:, 0]
    elif isinstance(sensor, Radar2D):
        if sensor.dim == 3:
            height = z[:, 2]
        # a height above the slant range gives no ground distance: the target is drawn above the radar
        ground, azimuth = np.sqrt(np.maximum(z[:, 0] ** 2 - (height - sensor.position[2]) ** 2, 0.0)), z[:, 1]
    else:
        ground, azimuth = z[:, 0] * np.cos(z[:, 2]), z[:, 1]
        height = sensor.position[2] + z[:, 0] * np.sin(z[:, 2])
    x, y = sensor.position[0] + ground * np.cos(azimuth), sensor.position[1] + ground * np.sin(azimuth)
    return np.column_stack([x, y, height])


def distances_to_border(sensor: Sensor, bearings: Array, region: Array) -> Array:
    """Distance (n,), metres, at which rays of these azimuths leave the region (3, 2); 0 if they do not intersect."""
    direction = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (region[None, :2, :] - sensor.position[None, :2, None]) / direction[:, :, None]
    # parallel to a side: never crosses it
    ends = np.where(np.isnan(ends), np.inf, ends)
    leave = ends.max(axis=2).min(axis=1)
    return np.where(np.isfinite(leave), np.maximum(leave, 0.0), 0.0)


def ellipses(centres: Array, covariances: Array, probability: float) -> tuple[Array, Array]:
    """Ellipses that contain normal distributions with a probability, as one line x, y (n * 50,) with NaN between them.

    Of centres (n, 2 or more) and covariances (n, 2 or more, 2 or more) the first two count.
    """
    values, vectors = np.linalg.eigh(covariances[:, :2, :2])
    # the chi-square distribution of two degrees of freedom has a closed form
    reach = np.sqrt(np.maximum(values, 0.0) * -2.0 * math.log1p(-probability))
    angle = np.linspace(0.0, 2.0 * math.pi, _CORNERS)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    outline = centres[:, :2, None] + np.einsum("nij,nj,jk->nik", vectors, reach, circle)
    gaps = np.concatenate([outline, np.full((len(centres), 2, 1), np.nan)], axis=2)
    return gaps[:, 0].ravel(), gaps[:, 1].ravel()
