"""A live tracker's state as a file.

It holds what `Tracker.save` writes, as of the oldest scan that late plots can reach, and the plots since then, which
are processed again when it is read.
"""

from __future__ import annotations

import json
import math
import os
from collections import Counter
from typing import Any

import numpy as np

from assoc._files.npz import Field, load_npz, save_npz
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.tracking.file import FORMAT, VERSION, file_arrays
from assoc.tracking.live.late_plots import LatePlots
from assoc.tracking.live.own_positions import OwnPositions
from assoc.tracking.live.pictures import Antenna, CheckedPlot
from assoc.tracking.live.state import LiveSettings, LiveState

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
    "live.own": Field("float", 2, required=False),  # platform, time, x, y, z, heading
    "live.plots": Field("float", 2),  # scan (-1: it waits), sensor, time, code, address, values
}
_BEFORE_VALUES = 5


def save(
    path: str | os.PathLike[str],
    settings: LiveSettings,
    state: LiveState,
    confirmed: set[int],
    counts: Counter[str],
    reserve: int,
) -> None:
    """Write the state; the file appears whole or not at all. New tracks will not get the next `reserve` ids."""
    late = state.tracker
    inner, past = late.tracker, late.past
    width = max(sensor.dim for sensor in inner.sensors)
    plots = [
        _row(k, CheckedPlot(s, *row), width)
        for k, scan in enumerate(past)
        for s, rows in enumerate(scan.by_sensor())
        for row in zip(*rows, strict=True)
    ]
    plots += [_row(-1, plot, width) for plot in state.pending]
    arrays: dict[str, Any] = {
        "live.settings": _described(settings),
        "live.counts": json.dumps(counts),
        "live.clock": np.array([state.end, state.newest]),
        "live.next_id": late.next_id + reserve,
        "live.names": np.array([*late.names.items()], dtype=np.int64).reshape(-1, 2),
        "live.confirmed": np.array(sorted(confirmed), dtype=np.int64),
        "live.antennas": np.array([(a.last, a.plots, a.phase.real, a.phase.imag, a.silent) for a in state.antennas]),
        "live.scans": np.array([scan.time for scan in past]),
        "live.own": state.own_positions.rows(),
        "live.sectors": np.array([scan.sectors for scan in past]).reshape(-1, len(inner.sensors), 2),
        "live.plots": np.array(plots).reshape(-1, _BEFORE_VALUES + width),
    }
    first = past[0].before if past else inner.state
    save_npz(path, FORMAT, VERSION, {**file_arrays(inner.settings, first), **arrays})


def restore(path: str | os.PathLike[str], settings: LiveSettings) -> tuple[LiveState, set[int], Counter[str]]:
    """Read what `save` wrote with the same settings: state, confirmed tracks, counts; anything else is refused."""
    inner = settings.make()
    inner.restore(path)
    found = load_npz(path, FORMAT, VERSION, _FIELDS)
    if str(found["live.settings"]) != _described(settings):
        raise InvalidInputError(f"{path}: was saved with {found['live.settings']}, not {_described(settings)}")
    try:
        late = LatePlots(inner, settings.horizon, first_id=int(found["live.next_id"]))
        return _filled(settings, late, found)
    except (ValueError, TypeError, IndexError, OverflowError) as error:
        raise InvalidInputError(f"{path}: is damaged ({error})") from None


def _filled(
    settings: LiveSettings, late: LatePlots, found: dict[str, Array]
) -> tuple[LiveState, set[int], Counter[str]]:
    sensors, plots = settings.scene.sensors, found["live.plots"]
    if not (np.abs(plots[:, :_BEFORE_VALUES]) < 2.0**53).all():
        raise ValueError("a plot has no sensor or time")
    late.names = dict(found["live.names"].tolist())
    scan, sensor = plots[:, 0].astype(int), plots[:, 1].astype(int)
    kept = [
        CheckedPlot(s, float(row[2]), row[_BEFORE_VALUES : _BEFORE_VALUES + sensors[s].dim], row[3:5].astype(np.int64))
        for row, s in zip(plots, sensor.tolist(), strict=True)
    ]
    known = zip(sensors, found["live.antennas"].tolist(), strict=True)
    antennas = [Antenna(last, int(n), complex(re, im), bool(silent)) for _, (last, n, re, im, silent) in known]
    end, newest = found["live.clock"].tolist()
    pending = [plot for plot, k in zip(kept, scan.tolist(), strict=True) if k < 0]
    own = OwnPositions(settings.scene)
    own.restore(found.get("live.own", np.zeros((0, 6))))
    state = LiveState(late, antennas, own, end, newest, pending, recent={plot.key: None for plot in kept})
    by_sensor = [(sensor == s, _BEFORE_VALUES + model.dim) for s, model in enumerate(sensors)]
    with state.under_way(settings):
        for k, (time, sectors) in enumerate(zip(found["live.scans"], found["live.sectors"], strict=True)):
            rows = [plots[(scan == k) & of_sensor, :last] for of_sensor, last in by_sensor]
            stamps, codes = [part[:, 2] for part in rows], [part[:, 3:5].astype(np.int64) for part in rows]
            late.step(float(time), [part[:, _BEFORE_VALUES:] for part in rows], stamps, sectors, codes)
    counts = Counter({str(kind): int(count) for kind, count in json.loads(str(found["live.counts"])).items()})
    return state, {*found["live.confirmed"].tolist()}, counts


def _row(scan: int, plot: CheckedPlot, width: int) -> list[float]:
    values = [*plot.z.tolist(), *[math.nan] * (width - len(plot.z))]
    return [scan, plot.sensor, plot.time, *plot.identity.tolist(), *values]


def _described(settings: LiveSettings) -> str:
    return f"interval {settings.interval}, turns {settings.turns}, horizon {settings.horizon}"
