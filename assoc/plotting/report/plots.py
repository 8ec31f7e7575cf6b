"""A recording in the report of a tracker: plots, aircraft, and CT, MT and IT over the windows."""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc._types import Array
from assoc.plotting.report.views import plain_numbers
from assoc.tracking.offline.plots import PlotTracks

_MOST = 30_000


def plot_data(shown: PlotTracks, decimals: int) -> dict[str, Any]:
    """Plots of each window, each aircraft's own plots as its truth, and the rates, as plain numbers."""
    recording = shown.recording
    positions, aircraft = recording.positions, recording.aircraft
    few = len(recording) <= _MOST
    measured = [
        {"t": round(float(end), 4), "at": plain_numbers(positions[window.rows], decimals)}
        for end, window in zip(shown.ends, shown.windows, strict=True)
        if few
    ]
    truth = []
    if aircraft is not None:
        height = np.nan_to_num(recording.trusted_altitudes)
        for name in np.unique(aircraft[aircraft >= 0]).tolist():
            rows = np.flatnonzero(aircraft == name)
            rows = rows[:: max(1, len(recording) // _MOST)]
            columns = zip("xyz", (*positions[rows].T, height[rows]), strict=True)
            path = {axis: plain_numbers(values, decimals) for axis, values in columns}
            truth.append({"id": name, "t": plain_numbers(recording.times[rows], 4), **path})
    # positions of plots are relative to their radar
    radar = {"name": "radar", "place": [0, 0, 0]}
    return {"measured": measured, "truth": truth, "rates": _rates(shown), "sensors": [radar]}


def _rates(shown: PlotTracks) -> dict[str, Any] | None:
    if shown.rates is None:
        return None
    times: Array = np.asarray(shown.ends, dtype=float)[shown.rates.windows]
    columns = zip(("CT", "MT", "IT"), shown.rates.per_window.T, strict=True)
    return {"times": plain_numbers(times, 4), **{name: plain_numbers(values, 1) for name, values in columns}}
