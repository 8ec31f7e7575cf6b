"""A radar of a recording in the frame of a scene, without the biases that are known of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from assoc._types import Array
from assoc.recordings.recording import Recording
from assoc.recordings.several import heights_above
from assoc.scene.geodesy import Origin, east_north_up, geodetic
from assoc.sensors import Radar2D

USUAL_ALTITUDE = 6_000.0
"""Of plots whose altitude is not known, metres."""


@dataclass(frozen=True)
class Bias:
    """What a radar states less what is true, in its own sense."""

    range: float = 0.0
    """Metres."""
    bearing: float = 0.0
    """Degrees, clockwise."""
    gain: float = 0.0
    """Metres in each km of the stated range."""
    time: float = 0.0
    """Seconds."""

    def off(self, recording: Recording) -> Recording:
        """The plots without it; a range that would be below 0 is 0."""
        ranges = np.maximum(recording.ranges * (1.0 - 1e-3 * self.gain) - self.range, 0.0)
        azimuths = recording.azimuths + math.radians(self.bearing)
        return replace(recording, times=recording.times - self.time, ranges=ranges, azimuths=azimuths)

    def and_then(self, further: Bias) -> Bias:
        """Add a bias that was found when this one was taken off."""
        left = 1.0 - 1e-3 * further.gain
        gain = 1e3 * (1.0 - (1.0 - 1e-3 * self.gain) * left)
        bearing = (self.bearing + further.bearing + 180.0) % 360.0 - 180.0
        return Bias(self.range * left + further.range, bearing, gain, self.time + further.time)


def placed(
    recording: Recording,
    radar: Radar2D,
    place: Origin,
    origin: Origin,
    height_noise: float | None = None,
    usual: float = USUAL_ALTITUDE,
) -> tuple[Recording, Radar2D]:
    """Put a radar that stands at its own origin, with its plots, where it stands in a scene.

    Bearings are from true north at the radar; ``place`` and ``origin`` (of the scene's frame) are latitude, longitude,
    radians, and height, metres. ``height_noise`` is the standard deviation of the heights by Mode C, metres; without it
    the radar measures none.

    Azimuths are then in the scene's plane: where the radar stands, north and up have other directions than at the
    origin. Of plots without an altitude, that of the others (their median) is assumed, or the ``usual`` one.
    """
    latitude, longitude, height = (np.array([value]) for value in place)
    here = east_north_up(latitude, longitude, height, origin)[0]
    altitudes = recording.trusted_altitudes
    known = altitudes[np.isfinite(altitudes)]
    assumed = float(np.median(known)) if len(known) else usual
    azimuths = azimuths_in_plane(recording.measurements, altitudes, place, origin, assumed)
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
    return replace(recording, azimuths=azimuths), radar


def azimuths_in_plane(z: Array, altitudes: Array, place: Origin, origin: Origin, assumed: float) -> Array:
    """Azimuths (n,) in a scene's plane of measurements (n, 2) in the plane of a radar; see `placed`.

    ``assumed`` stands for altitudes (n,) that are NaN, metres.
    """
    latitude, longitude, height = (np.array([value]) for value in place)
    here = east_north_up(latitude, longitude, height, origin)[0]
    ranges, known = z[:, 0], np.isfinite(altitudes)
    up = heights_above(z, np.where(known, altitudes, assumed), np.zeros(3), place)
    # straight above the radar a plot would lose its direction: by noise, or by an altitude that is only assumed
    most = ranges * np.where(known, 0.95, 0.5)
    up = np.clip(up, -most, most)
    ground = np.sqrt(ranges**2 - up**2)
    local = np.column_stack([ground * np.cos(z[:, 1]), ground * np.sin(z[:, 1]), up])
    latitude, longitude, height = geodetic(local, place).T
    away = east_north_up(latitude, longitude, height, origin) - here
    azimuths: Array = np.arctan2(away[:, 1], away[:, 0])
    return azimuths
