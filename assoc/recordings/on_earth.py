"""A radar of a recording in the frame of a scene."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from assoc.recordings.recording import Recording
from assoc.scene.geodesy import Origin, east_north_up
from assoc.sensors import Radar2D


def placed(
    recording: Recording, radar: Radar2D, place: Origin, origin: Origin, height_noise: float | None = None
) -> tuple[Recording, Radar2D]:
    """Put a radar that stands at its own origin, with its plots, where it stands in a scene.

    Parameters
    ----------
    recording : Recording
        Bearings from true north at the radar.
    radar : Radar2D
        Of `assoc.recordings.radar_of`.
    place, origin : tuple of latitude, longitude, height
        Of the radar and of the scene's frame, radians and metres.
    height_noise : float, optional
        Standard deviation of the heights by Mode C, metres; without it the radar measures none.

    Returns
    -------
    recording, radar
        Azimuths from the scene's east: where the radar stands, north has another direction than at the origin.
    """
    latitude, longitude, height = place
    longitudes = np.array([longitude, longitude + 1e-6])
    here, east = east_north_up(np.full(2, latitude), longitudes, np.full(2, height), origin)
    turn = math.atan2(east[1] - here[1], east[0] - here[0])
    radar = replace(radar, position=here)
    if height_noise is not None:
        reach = float(radar.field_of_view[0, 1]) + float(np.hypot(*here[:2]))
        heights = [float(here[2]) - reach**2 / 1e7 - 1e3, float(here[2]) + 20_000.0]
        radar = replace(
            radar,
            noise=np.sqrt([*np.diagonal(radar.covariance), height_noise**2]),
            field_of_view=np.vstack([radar.field_of_view, heights]),
        )
    return replace(recording, azimuths=recording.azimuths + turn), radar
