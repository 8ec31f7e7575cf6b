"""From latitude, longitude and height to a local plane and back: the plain WGS-84 formulas."""

from __future__ import annotations

import math

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.sensors.arrays import finite_array

SEMI_MAJOR_AXIS = 6_378_137.0
"""WGS-84 equatorial radius, metres."""
FLATTENING = 1 / 298.257223563
"""WGS-84 flattening."""

Origin = tuple[float, float, float]
"""Where a scene's plane touches the ellipsoid: latitude and longitude in radians, height in metres."""


def checked_origin(origin: object) -> Origin:
    """Return a position on the earth, radians and metres, as three floats; anything else is refused."""
    lat, lon, height = finite_array(origin, "origin", (3,)).tolist()
    for name, value, most in (("latitude", lat, math.pi / 2), ("longitude", lon, 2 * math.pi)):
        if abs(value) > most * (1 + 1e-12):
            raise InvalidInputError(f"origin: {name} must be within +-{most:.4g} rad, got {value:g} (degrees?)")
    if abs(height) > 1e6:
        raise InvalidInputError(f"origin: height must be within +-1e6 m, got {height:g}")
    return lat, lon, height


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


def east_north_up(latitude: Array, longitude: Array, height: Array, origin: Origin) -> Array:
    """Coordinates (n, 3), east, north and up in metres, in the plane that touches the ellipsoid at an origin.

    Latitudes and longitudes (n,) are geodetic, radians; heights metres above the ellipsoid.
    """
    away = earth_centered(latitude, longitude, height) - _place(origin)
    return away @ _axes(origin).T


def geodetic(positions: Array, origin: Origin) -> Array:
    """Latitude, longitude and height (n, 3) of positions (n, 3) in the tangent plane: the inverse of `east_north_up`.

    Radians, radians in (-pi, pi], metres above the ellipsoid; exact to 1e-6 m from 100 km below it on.
    """
    x, y, z = (np.asarray(positions, dtype=np.float64).reshape(-1, 3) @ _axes(origin) + _place(origin)).T
    squared_eccentricity = FLATTENING * (2 - FLATTENING)
    flat = np.hypot(x, y)
    # each round takes off a factor of about 150; the start is right to some 1e-5 rad
    latitude = np.arctan2(z, flat * (1 - squared_eccentricity))
    for _ in range(6):
        curvature = SEMI_MAJOR_AXIS / np.sqrt(1 - squared_eccentricity * np.sin(latitude) ** 2)
        latitude = np.arctan2(z + squared_eccentricity * curvature * np.sin(latitude), flat)
    curvature = SEMI_MAJOR_AXIS / np.sqrt(1 - squared_eccentricity * np.sin(latitude) ** 2)
    # along the normal: at the poles there is nothing to divide by
    sine, cosine = np.sin(latitude), np.cos(latitude)
    height = flat * cosine + z * sine - curvature * (1 - squared_eccentricity * sine**2)
    return np.stack([latitude, np.arctan2(y, x), height], axis=1)


def _place(origin: Origin) -> Array:
    return earth_centered(*(np.asarray(value, dtype=np.float64) for value in origin))


def _axes(origin: Origin) -> Array:
    """East, north and up in the earth's frame, one a row."""
    lat, lon, _ = origin
    return np.array(
        [
            [-math.sin(lon), math.cos(lon), 0.0],
            [-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)],
            [math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)],
        ]
    )
