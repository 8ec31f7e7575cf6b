"""Recordings of several radars, each turning at its own pace, as one scene."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from assoc._parameters import positive
from assoc._system.door import door
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.recordings.recording import Recording
from assoc.recordings.rotation import estimate_rotation
from assoc.recordings.windows import running_phase
from assoc.scene.scene import Scene
from assoc.sensors import Radar2D
from assoc.sensors.base import wrap_angle

FULL_TURN = 2.0 * math.pi
MOST_SCANS = 1_000_000


@door
def scene_of_radars(
    recordings: Sequence[Recording],
    radars: Sequence[Radar2D],
    *,
    rotations: Sequence[float] | None = None,
    interval: float | None = None,
) -> Scene:
    """Put the plots of several radars into one scene, each with its own time.

    A scan holds the measurements of all radars since the previous one. The sectors that a radar covered follow from its
    rotation and from the azimuths and times of its plots; before its first plot and after its last it is taken for
    switched off.

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

    Returns
    -------
    Scene

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
    for recording, turn in zip(recordings, turns, strict=True):
        # a plot on an edge belongs to the scan before it, but for the first
        cut = np.searchsorted(recording.times, edges[1:-1], side="right")
        measured.append(np.split(recording.measurements, cut))
        stamps.append(np.split(recording.times, cut))
        sectors.append(_sectors(recording, turn, edges))
    return Scene(
        radars,
        edges[1:],
        list(zip(*measured, strict=True)),
        measurement_times=list(zip(*stamps, strict=True)),
        sectors=np.stack(sectors, axis=1),
        name=" + ".join(recording.name for recording in recordings if recording.name),
    )


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
