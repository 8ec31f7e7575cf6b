"""Radar plots to a CSV file."""

from __future__ import annotations

import csv
import io
import math
import os

import numpy as np

from assoc._files.output import write_text
from assoc._system.wrong_types import explains_wrong_types
from assoc._text.times import decimals
from assoc._types import Array
from assoc.recordings.columns import FLIGHT_LEVEL, NAUTICAL_MILE
from assoc.recordings.recording import Recording


@explains_wrong_types
def write_plots(path: str | os.PathLike[str], recording: Recording) -> None:
    """Write plots for `read_plots`.

    Columns are time (s), range_nmi, bearing_deg, mode3, altitude_fl, and aircraft where the sources are known; ICAO
    addresses are left out. The file appears whole or not at all.

    Parameters
    ----------
    path : path-like
    recording : Recording
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    known = recording.sources is not None
    writer.writerow(["time", "range_nmi", "bearing_deg", "mode3", "altitude_fl", *(["aircraft"] if known else [])])
    columns = [
        [decimals(value, 6) for value in recording.times],
        [decimals(value, 6) for value in recording.ranges / NAUTICAL_MILE],
        [decimals(value, 8) for value in np.degrees(recording.bearings)],
        recording.identities.tolist(),
        ["" if math.isnan(value) else decimals(value, 3) for value in recording.altitudes / FLIGHT_LEVEL],
    ]
    if recording.sources is not None:
        columns.append(recording.sources.tolist())
    writer.writerows(zip(*columns, strict=True))
    write_text(path, text.getvalue())


@explains_wrong_types
def write_tracks(path: str | os.PathLike[str], ids: Array, times: Array, positions: Array, velocities: Array) -> None:
    """Write tracks, or the truth, as CSV with the columns track_id, time, x, y, z, vx, vy, vz.

    Parameters
    ----------
    path : path-like
    ids, times : arrays (n,)
    positions, velocities : arrays (n, 3)
        Metres, m/s.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["track_id", "time", "x", "y", "z", "vx", "vy", "vz"])
    for target, time, position, velocity in zip(ids.tolist(), times, positions, velocities, strict=True):
        writer.writerow([target, decimals(time, 6), *(decimals(value, 3) for value in (*position, *velocity))])
    write_text(path, text.getvalue())
