"""A radar of a recording in the frame of a scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from assoc.recordings.recording import Recording
from assoc.recordings.several import heights_above
from assoc.scene.geodesy import Origin, east_north_up, geodetic
from assoc.sensors import Radar2D

_USUAL_ALTITUDE = 6_000.0


def placed(
    recording: Recording, radar: Radar2D, place: Origin, origin: Origin, height_noise: float | None = None
) -> tuple[Recording, Radar2D]:
    """Put a radar that stands at its own origin, with its plots, where it stands in a scene.

    Bearings are from true north at the radar; ``place`` and ``origin`` (of the scene's frame) are latitude, longitude,
    radians, and height, metres. ``height_noise`` is the standard deviation of the heights by Mode C, metres; without it
    the radar measures none.

    Azimuths are then in the scene's plane: where the radar stands, north and up have other directions than at the
    origin. Of plots without an altitude, that of the others (their median) is assumed.
    """
    latitude, longitude, height = (np.array([value]) for value in place)
    here = east_north_up(latitude, longitude, height, origin)[0]
    altitudes = recording.trusted_altitudes
    known = np.isfinite(altitudes)
    altitudes = np.where(known, altitudes, np.median(altitudes[known]) if known.any() else _USUAL_ALTITUDE)
    up = heights_above(recording.measurements, altitudes, replace(radar, position=np.zeros(3)), place)
    # straight above the radar a plot would lose its direction: by noise, or by an altitude that is only assumed
    most = recording.ranges * np.where(known, 0.95, 0.5)
    up = np.clip(up, -most, most)
    ground = np.sqrt(recording.ranges**2 - up**2)
    local = np.column_stack([ground * np.cos(recording.azimuths), ground * np.sin(recording.azimuths), up])
    latitude, longitude, height = geodetic(local, place).T
    away = east_north_up(latitude, longitude, height, origin) - here
    radar = replace(radar, position=here)
    if height_noise is not None:
        reach = float(radar.field_of_view[0, 1]) + float(np.hypot(*here[:2]))
        heights = [float(here[2]) - reach**2 / 1e7 - 1e3, float(here[2]) + 20_000.0]
        radar = replace(
            radar,
            noise=np.sqrt([*np.diagonal(radar.covariance), height_noise**2]),
            field_of_view=np.vstack([radar.field_of_view, heights]),
            # heights are what transponders say, of echoes that are two already
            resolution=None if radar.resolution is None else np.append(radar.resolution, np.inf),
        )
    return replace(recording, azimuths=np.arctan2(away[:, 1], away[:, 0])), radar
