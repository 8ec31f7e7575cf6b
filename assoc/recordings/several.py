"""Recordings of several radars, each turning at its own pace, as one scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from assoc._parameters import positive
from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.recordings.recording import Recording
from assoc.recordings.rotation import estimate_rotation
from assoc.recordings.windows import running_phase
from assoc.scene.geodesy import Origin, geodetic
from assoc.scene.scene import Scene
from assoc.sensors import Radar2D
from assoc.sensors.base import wrap_angle

NO_HEIGHT = ", no height"
"""Ends the name of the sensor that is a radar's plots without heights."""
FULL_TURN = 2.0 * math.pi
MOST_SCANS = 1_000_000
EARTH = 6.37e6
"""Radius, metres."""


@explains_wrong_types
def scene_of_radars(
    recordings: Sequence[Recording],
    radars: Sequence[Radar2D],
    *,
    rotations: Sequence[float] | None = None,
    interval: float | None = None,
    origin: Origin | None = None,
) -> Scene:
    """Put the plots of several radars into one scene, each with its own time.

    A scan holds the measurements of all radars since the previous one. The sectors that a radar covered follow from its
    rotation and from the azimuths and times of its plots; before its first plot and after its last it is taken for
    switched off.

    A radar of three components measures heights: those of its plots' altitudes that are not garbled. Its plots without
    one become a sensor of their own, and both share its detections as the plots do.

    Parameters
    ----------
    recordings : sequence of Recording
        Of one clock.
    radars : sequence of Radar2D
        The radar of each, in the scene's frame; `assoc.recordings.radar_of` reads noise and reach off a recording.
    rotations : sequence of float, optional
        Seconds for a turn of each; left out, they are estimated.
    interval : float, optional
        Seconds from scan to scan, at most the shortest turn; by default half of it.
    origin : tuple of latitude, longitude, height, optional
        Of the scene's frame, radians and metres. Altitudes are then heights above the ellipsoid, else above z = 0.

    Returns
    -------
    Scene
        Its sensors are those of `parts_of_radars`.

    Raises
    ------
    InvalidInputError
        There are no plots, or arguments are not as described.
    """
    if not len(recordings) or len(recordings) != len(radars) or not all(len(recording) for recording in recordings):
        raise InvalidInputError(
            f"recordings: expected at least one, each with plots and a radar, got {len(recordings)} with "
            f"{len(radars)} radars"
        )
    if rotations is not None and len(rotations) != len(recordings):
        raise InvalidInputError(f"rotations: expected one for each of {len(recordings)} recordings")
    given = [estimate_rotation(recording) for recording in recordings] if rotations is None else rotations
    turns = [positive(turn, "rotations") for turn in given]
    pace = 0.5 * min(turns) if interval is None else positive(interval, "interval")
    if pace > min(turns) * (1 + 1e-9):
        raise InvalidInputError(f"interval: expected at most the shortest turn, {min(turns):g} s, got {pace:g}")
    start = min(float(recording.times[0]) for recording in recordings)
    end = max(float(recording.times[-1]) for recording in recordings)
    if (end - start) / pace > MOST_SCANS:
        raise InvalidInputError(f"interval: {pace:g} s makes more than {MOST_SCANS} scans of {end - start:g} s")
    edges = start + pace * np.arange(math.floor((end - start) / pace) + 2)
    measured, stamps, sectors = [], [], []
    parts = parts_of_radars(recordings, radars)
    swept = [_sectors(recording, turn, edges) for recording, turn in zip(recordings, turns, strict=True)]
    for part in parts:
        # a plot on an edge belongs to the scan before it, but for the first
        cut = np.searchsorted(part.recording.times, edges[1:-1], side="right")
        measured.append(np.split(_measured(part, origin), cut))
        stamps.append(np.split(part.recording.times, cut))
        sectors.append(swept[part.number])
    return Scene(
        [part.radar for part in parts],
        edges[1:],
        list(zip(*measured, strict=True)),
        region=None if origin is None else _region(radars),  # type: ignore[arg-type]  # always an array once made
        measurement_times=list(zip(*stamps, strict=True)),
        sectors=np.stack(sectors, axis=1),
        name=" + ".join(recording.name for recording in recordings if recording.name),
        origin=origin,
    )


def _measured(part: Part, origin: Origin | None) -> Array:
    """The measurements of a part's plots, with heights where its radar measures them."""
    z = part.recording.measurements
    if part.radar.dim < 3:
        return z
    heights = part.recording.trusted_altitudes
    return np.column_stack([z, heights if origin is None else heights_above(z, heights, part.radar.position, origin)])


class Part(NamedTuple):
    """Plots of a radar that are one sensor of a scene."""

    number: int
    """Of the radar."""
    recording: Recording
    radar: Radar2D


def parts_of_radars(recordings: Sequence[Recording], radars: Sequence[Radar2D]) -> list[Part]:
    """The sensors of a scene: plots with heights, where the radar measures them, and without."""
    parts = []
    for number, (recording, radar) in enumerate(zip(recordings, radars, strict=True)):
        known = np.isfinite(recording.trusted_altitudes) & (radar.dim == 3)
        # of the plots of aircraft: false ones have no transponder
        named = (recording.identities > 0) | (recording.addresses > 0)
        share = float(known[named].mean() if named.any() else known.mean())
        if not known.all() and known.any():
            share = min(max(share, 0.05), 0.95)
        if share < 1.0:
            plain = replace(
                radar,
                noise=radar.covariance[:2, :2],
                field_of_view=radar.field_of_view[:2],
                resolution=None if radar.resolution is None else radar.resolution[:2],
                detection_probability=radar.detection_probability * (1.0 - share),
                name=f"{radar.name}{NO_HEIGHT}" if share else radar.name,
            )
            parts.append(Part(number, recording.take(~known), plain))
        if share > 0.0:
            # but for a few
            rate = radar.false_alarm_rate * (0.1 if share < 1.0 else 1.0)
            heard = replace(radar, detection_probability=radar.detection_probability * share, false_alarm_rate=rate)
            parts.append(Part(number, recording.take(known), heard))
    return parts


def identities_of_radars(
    recordings: Sequence[Recording], radars: Sequence[Radar2D], times: Array
) -> list[tuple[Array, ...]]:
    """Mode 3/A codes and addresses (n, 2) of each sensor's plots, for each scan of the scene of these `times`."""
    found = []
    for part in parts_of_radars(recordings, radars):
        cut = np.searchsorted(part.recording.times, times[:-1], side="right")
        found.append(np.split(np.stack([part.recording.identities, part.recording.addresses], axis=1), cut))
    return list(zip(*found, strict=True))


def heights_above(z: Array, altitudes: Array, place: Array, origin: Origin) -> Array:
    """Heights above a scene's plane (n,) of measurements (n, 2) from a place (3,), of altitudes above the ellipsoid."""
    heights = altitudes - origin[2]
    directions = np.stack([np.cos(z[:, 1]), np.sin(z[:, 1])], axis=1)
    # two rounds leave centimetres
    for _ in range(3):
        ground = np.sqrt(np.maximum(z[:, 0] ** 2 - (heights - place[2]) ** 2, 0.0))
        places = np.column_stack([place[:2] + ground[:, None] * directions, heights])
        heights = heights + altitudes - geodetic(places, origin)[:, 2]
    return heights


def _region(radars: Sequence[Radar2D]) -> Array:
    """The box around all that the radars see: far from the origin the ground lies below the plane."""
    places = np.array([radar.position for radar in radars])
    reach = np.array([radar.field_of_view[0, 1] for radar in radars])[:, None]
    plane = np.stack([(places - reach).min(axis=0), (places + reach).max(axis=0)], axis=1)[:2]
    farthest = float(np.hypot(*np.abs(plane).max(axis=1)))
    return np.vstack([plane, [places[:, 2].min() - farthest**2 / (2.0 * EARTH), places[:, 2].max() + 20_000.0]])


def _sectors(recording: Recording, turn: float, edges: Array) -> Array:
    """First and last azimuth that an antenna covered between the edges, (K, 2)."""
    times = recording.times
    phase = running_phase(times, times / turn - recording.bearings / FULL_TURN, turn)
    # a recording may end within a scan
    ends = np.minimum(edges[1:], times[-1])
    # bearings go clockwise from north, azimuths from +x towards +y: the lowest is that of the end
    ahead = ends / turn - np.interp(ends, times, phase)
    low = wrap_angle(math.pi / 2 - FULL_TURN * np.mod(ahead, 1.0))
    swept = np.clip(ends - np.maximum(edges[:-1], times[0]), 0.0, None)
    return np.stack([low, low + np.minimum(FULL_TURN * swept / turn, FULL_TURN)], axis=1)
