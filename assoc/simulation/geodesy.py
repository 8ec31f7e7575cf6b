"""From latitude, longitude and height to a local plane: the plain WGS-84 formulas."""

from __future__ import annotations

import math

import numpy as np

from assoc._types import Array

SEMI_MAJOR_AXIS = 6_378_137.0
"""WGS-84 equatorial radius, metres."""
FLATTENING = 1 / 298.257223563
"""WGS-84 flattening."""


def earth_centered(latitude: Array, longitude: Array, height: Array) -> Array:
    """Earth-centered, earth-fixed coordinates (n, 3) in metres of geodetic ones (rad, rad, m)."""
    squared_eccentricity = FLATTENING * (2 - FLATTENING)
    sine, cosine = np.sin(latitude), np.cos(latitude)
    curvature = SEMI_MAJOR_AXIS / np.sqrt(1 - squared_eccentricity * sine**2)
    return np.stack(
        [
            (curvature + height) * cosine * np.cos(longitude),
            (curvature + height) * cosine * np.sin(longitude),
            (curvature * (1 - squared_eccentricity) + height) * sine,
        ],
        axis=-1,
    )


def east_north_up(
    latitude: Array, longitude: Array, height: Array, origin: tuple[float, float, float]
) -> Array:
    """Coordinates in the tangent plane at an origin.

    Parameters
    ----------
    latitude, longitude, height : arrays (n,)
        Geodetic, radians and metres above the ellipsoid.
    origin : tuple of latitude, longitude, height
        Where the plane touches.

    Returns
    -------
    array (n, 3)
        East (x), north (y), up (z) in metres.
    """
    lat, lon, _ = origin
    place = earth_centered(*(np.asarray(value, dtype=np.float64) for value in origin))
    away = earth_centered(latitude, longitude, height) - place
    rotation = np.array(
        [
            [-math.sin(lon), math.cos(lon), 0.0],
            [-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)],
            [math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)],
        ]
    )
    result: Array = away @ rotation.T
    return result
