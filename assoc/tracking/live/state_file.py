"""A live tracker's state as a file.

It holds what `Tracker.save` writes, as of the oldest scan that late plots can reach, and the plots since then, which
are processed again when it is read.
"""

from __future__ import annotations

import json
import math
import os
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._files.npz import Field, load_npz, save_npz
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.tracking.file import FORMAT, VERSION, file_arrays
from assoc.tracking.live.late_plots import LatePlots
from assoc.tracking.live.pictures import Antenna, SoundPlot

if TYPE_CHECKING:
    from assoc.tracking.live.live_tracker import LiveTracker

_FIELDS = {
    "live.settings": Field("str", 0),
    "live.counts": Field("str", 0),
    "live.clock": Field("float", 1),  # end of the open interval, time of the newest plot
    "live.next_id": Field("int", 0),
    "live.names": Field("int", 2),  # ids in the tracker, and those handed out
    "live.confirmed": Field("int", 1),
    "live.antennas": Field("float", 2),
    "live.scans": Field("float", 1),
    "live.sectors": Field("float", 3),
    "live.plots": Field("float", 2),  # scan (-1: it waits), sensor, time, code, address, values
}
_BEFORE_VALUES = 5


def save(path: str | os.PathLike[str], live: LiveTracker, next_id: int) -> None:
    """Write the state; the file appears whole or not at all. New tracks will have ids from `next_id` on."""
    state, late = live.state, live.state.tracker
    inner, past = late.tracker, late.past
    width = max(sensor.dim for sensor in inner.sensors)
    plots = [
        _row(k, SoundPlot(s, *one), width)
        for k, scan in enumerate(past)
        for s, rows in enumerate(scan.by_sensor())
        for one in zip(*rows, strict=True)
    ]
    plots += [_row(-1, one, width) for one in state.pending]
    arrays: dict[str, Any] = {
        "live.settings": _settings(live),
        "live.counts": json.dumps(live.counts),
        "live.clock": np.array([state.end, state.newest]),
        "live.next_id": next_id,
        "live.names": np.array([*late.names.items()], dtype=np.int64).reshape(-1, 2),
        "live.confirmed": np.array(sorted(live.confirmed), dtype=np.int64),
        "live.antennas": np.array([(a.last, a.plots, a.phase.real, a.phase.imag, a.silent) for a in state.antennas]),
        "live.scans": np.array([one.time for one in past]),
        "live.sectors": np.array([one.sectors for one in past]).reshape(-1, len(inner.sensors), 2),
        "live.plots": np.array(plots).reshape(-1, _BEFORE_VALUES + width),
    }
    first = past[0].before if past else inner.state
    save_npz(path, FORMAT, VERSION, {**file_arrays(inner.settings, first), **arrays})


def restore(path: str | os.PathLike[str], live: LiveTracker) -> None:
    """Read the state into a live tracker of the same settings that has had no plots.

    Raises
    ------
    InvalidInputError
        The file is not such a state, or of other settings.
    """
    inner = live.settings.make()
    inner.restore(path)
    found = load_npz(path, FORMAT, VERSION, _FIELDS)
    if str(found["live.settings"]) != _settings(live):
        raise InvalidInputError(f"{path}: was saved with {found['live.settings']}, not {_settings(live)}")
    try:
        _fill(live, LatePlots(inner, live.settings.horizon, first_id=int(found["live.next_id"])), found)
    except (ValueError, TypeError, IndexError, OverflowError) as error:
        raise InvalidInputError(f"{path}: is damaged ({error})") from None


def _fill(live: LiveTracker, late: LatePlots, found: dict[str, Array]) -> None:
    sensors, plots, state = live.settings.scene.sensors, found["live.plots"], live.state
    if not np.isfinite(plots[:, :_BEFORE_VALUES]).all():
        raise ValueError("a plot has no sensor or time")
    late.names = dict(found["live.names"].tolist())
    scan, sensor = plots[:, 0].astype(int), plots[:, 1].astype(int)
    by_sensor = [(sensor == s, _BEFORE_VALUES + one.dim) for s, one in enumerate(sensors)]
    for k, (time, sectors) in enumerate(zip(found["live.scans"], found["live.sectors"], strict=True)):
        rows = [plots[(scan == k) & own, :end] for own, end in by_sensor]
        stamps, codes = [part[:, 2] for part in rows], [part[:, 3:5].astype(np.int64) for part in rows]
        late.step(float(time), [part[:, _BEFORE_VALUES:] for part in rows], stamps, sectors, codes)
    kept = [
        SoundPlot(s, float(row[2]), row[_BEFORE_VALUES : _BEFORE_VALUES + sensors[s].dim], row[3:5].astype(np.int64))
        for row, s in zip(plots, sensor.tolist(), strict=True)
    ]
    state.tracker = late
    state.end, state.newest = found["live.clock"].tolist()
    state.pending = [one for one, k in zip(kept, scan.tolist(), strict=True) if k < 0]
    state.recent = {one.key: None for one in kept}
    known = zip(state.antennas, found["live.antennas"].tolist(), strict=True)
    state.antennas = [Antenna(last, int(n), complex(re, im), bool(silent)) for _, (last, n, re, im, silent) in known]
    live.confirmed = {*found["live.confirmed"].tolist()}
    live.counts = Counter({str(kind): int(count) for kind, count in json.loads(str(found["live.counts"])).items()})


def _row(scan: int, plot: SoundPlot, width: int) -> list[float]:
    values = [*plot.z.tolist(), *[math.nan] * (width - len(plot.z))]
    return [scan, plot.sensor, plot.time, *plot.identity.tolist(), *values]


def _settings(live: LiveTracker) -> str:
    settings = live.settings
    return f"interval {settings.interval}, turns {settings.turns}, horizon {settings.horizon}"
