"""Tracks and targets over time in a report: paths, a slider over the instants, how many there are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from assoc._text.html import escape
from assoc._text.times import moment
from assoc._types import Array
from assoc.plotting.axes import Unit, box_around, stacked, unit_of
from assoc.plotting.colours import BLACK, GREY, SERIES
from assoc.plotting.measured import positions_of
from assoc.plotting.report.figures import FAINT, MOST_STEPS, Dicts, joined, line, plan, points, scatter, sliding
from assoc.plotting.report.lives import by_track
from assoc.scene.scene import Scene
from assoc.sensors import BearingSensor
from assoc.tracking.offline.plots import PlotTracks

if TYPE_CHECKING:
    import pandas as pd

_MOST_POINTS = 40_000
_MOST_MARKS = 20_000
_MOST_MEASUREMENTS = 30_000
_MOST_COUNTS = 2_000
_MOST_NAMES = 40
_CROWD = 60
# instants are the same up to a tenth of a millisecond
_SAME = 1e-4


@dataclass(frozen=True)
class Path:
    """A track or a target: where it was (n, 3) at its times (n,), ascending; what else is known at these times."""

    name: str
    times: Array
    where: Array
    sigma: Array | None = None
    altitude: Array | None = None
    degrees: Array | None = None

    def lives(self, time: float) -> bool:
        """Whether it lives at a time: between its first and last row, whether or not it has one just there."""
        return bool(self.times[0] - _SAME <= time <= self.times[-1] + _SAME)

    def row(self, time: float) -> int:
        """Its last row up to a time."""
        return max(0, int(np.searchsorted(self.times, time + _SAME, "right")) - 1)

    def at(self, time: float) -> Array:
        """Where it was (3,), on the straight line between two rows."""
        return np.array([np.interp(time, self.times, axis) for axis in self.where.T])


Paths = list[Path]


def paths_of(frame: pd.DataFrame) -> Paths:
    """Paths of the tracks of a table, sorted by track and time."""
    paths = []
    for number, rows in by_track(frame):
        given = {
            name: rows[columns].to_numpy(dtype=float) if {*columns} <= {*rows.columns} else None
            for name, columns in (
                ("sigma", ["sigma_x", "sigma_y"]), ("degrees", ["latitude", "longitude"]), ("altitude", ["altitude"])
            )
        }  # fmt: skip
        height = given.pop("altitude")
        name = str(rows["target"].iloc[0]) if "target" in rows else ""
        times, where = rows["time"].to_numpy(dtype=float), rows[["x", "y", "z"]].to_numpy(dtype=float)
        altitude = None if height is None else height[:, 0]
        paths.append(Path(name or str(number), times, where, altitude=altitude, **given))
    return paths


def truth_of(scene: Scene | None, plots: PlotTracks | None) -> Paths:
    """Paths of the targets of a scene; of a recording, the plots of each aircraft."""
    seen: dict[str, list[tuple[float, Array]]] = {}
    if scene is not None and scene.truth is not None:
        truth = scene.truth
        for time, ids, where in zip(scene.times, truth.target_ids, truth.positions, strict=True):
            for target, place in zip(ids, where, strict=True):
                seen.setdefault(truth.names.get(int(target), "") or str(target), []).append((float(time), place))
    elif plots is not None and plots.recording.aircraft is not None:
        recording, aircraft = plots.recording, plots.recording.aircraft
        places = np.column_stack([recording.positions, np.nan_to_num(recording.trusted_altitudes)])
        for row in np.flatnonzero(aircraft >= 0):
            seen.setdefault(str(aircraft[row]), []).append((float(recording.times[row]), places[row]))
    paths = []
    for name, rows in seen.items():
        times, where = np.array([time for time, _ in rows]), np.array([place for _, place in rows])
        order = np.argsort(times, kind="stable")
        paths.append(Path(name, times[order], where[order]))
    return paths


def counts_over_time(groups: Mapping[str, Paths]) -> list[tuple[str, Array, Array]]:
    """How many of each group live at each instant at which any of them has a row: (name, times, numbers)."""
    everyone = [path.times for paths in groups.values() for path in paths]
    if not everyone:
        return []
    times = np.unique(np.round(np.concatenate(everyone), 4))
    times = times[np.unique(np.linspace(0, len(times) - 1, min(len(times), _MOST_COUNTS)).astype(int))]
    return [(name, times, _living(paths, times)) for name, paths in groups.items()]


def _living(paths: Paths, times: Array) -> Array:
    """How many paths live at each time (n,)."""
    began, ended = (np.sort([path.times[end] for path in paths]) for end in (0, -1))
    return np.searchsorted(began, times + _SAME, "right") - np.searchsorted(ended, times - _SAME, "left")


def tracks_figure(
    tracks: Paths, truth: Paths, scene: Scene | None, plots: PlotTracks | None
) -> tuple[Dicts | None, list[str]]:
    """The tracks with a slider over the instants, and sentences that say what was left out to keep the file small."""
    instants, left_out = _instants(tracks, truth, scene, plots)
    if not len(instants):
        return None, []
    sites = stacked([] if scene is None else [one.position for one in scene.at(float(scene.times[-1])).sensors])
    if plots is not None:
        sites = np.zeros((1, 3))  # positions of plots are relative to their radar
    measured = _measured(instants, scene, plots)
    if measured is None and (scene is not None or plots is not None):
        left_out.append("Measurements are left out: there are too many, or they are directions alone.")
    crowded = max(len(tracks), len(truth)) > _CROWD
    everything = stacked(path.where for path in tracks)
    near = np.concatenate([sites[: 0 if crowded else None], stacked(path.where for path in truth)])
    if not len(truth):
        near = np.concatenate([near, everything])
    box, unit = box_around(near, everything), unit_of(np.concatenate([near, everything]))
    size = 0.6 if crowded else 1.0
    data = []
    step = max(1, sum(len(path.times) for path in [*tracks, *truth]) // _MOST_POINTS)
    if step > 1:
        left_out.append(f"Paths are drawn with every {step}th of their points, and the last.")
    if truth:
        path = points(joined(_thinned(one, step) for one in truth), unit)
        data.append(scatter("truth", "lines", **path, line={"color": FAINT, "width": 5 * size}, hoverinfo="skip"))
    for c in range(min(len(SERIES), len(tracks))):
        path = points(joined(_thinned(one, step) for one in tracks[c :: len(SERIES)]), unit)
        group = {"legendgroup": "paths", "showlegend": c == 0, "hoverinfo": "skip"}
        data.append(scatter("whole tracks", "lines", **path, line={**line(c), "width": 1.2}, **group))
    where = points(sites, unit)
    names = ["radar"] if scene is None else [one.name or f"sensor {s + 1}" for s, one in enumerate(scene.sensors)]
    symbol = {"symbol": "triangle-up", "size": 11, "color": GREY}
    data.append(scatter("sensors", **where, text=list(map(escape, names)), hoverinfo="text", marker=symbol))
    first = len(data)
    data += _styles(size, bool(truth), measured is not None)
    steps = []
    for k, time in enumerate(instants.tolist()):
        live, here = ([one for one in group if one.lives(time)] for group in (tracks, truth))
        text = f"t = {moment(time)}: {len(live)} tracks" + (f", {len(here)} targets" if truth else "")
        traces = [] if measured is None else [points(measured[k], unit)]
        traces += [_targets(here, time, unit)] if truth else []
        colours = [SERIES[i % len(SERIES)] for i, one in enumerate(tracks) if one.lives(time)]
        steps.append((text, [*traces, _marks(live, colours, time, unit, 9 * size)]))
    return sliding({"data": data, "layout": plan(box, unit)}, steps, first=first, last=True), left_out


def _thinned(path: Path, step: int) -> Array:
    last = len(path.times) - 1
    return path.where[np.unique(np.r_[0 : last + 1 : step, last])]


def _instants(tracks: Paths, truth: Paths, scene: Scene | None, plots: PlotTracks | None) -> tuple[Array, list[str]]:
    """Times of the slider: those of scans or windows, else of rows; fewer where there are many tracks."""
    if scene is not None:
        times = scene.times
    elif plots is not None and len(plots.ends):
        times = np.asarray(plots.ends, dtype=float)
    else:
        times = np.concatenate([np.zeros(0), *(path.times for path in tracks)])
    times = np.unique(np.round(times, 4))
    marks = int(sum(_living(paths, times).sum() for paths in (tracks, truth) if paths))
    most = min(len(times), MOST_STEPS, max(2, int(len(times) * _MOST_MARKS / max(marks, 1))))
    if len(times) <= most:
        return times, []
    # evenly spaced, the first and the last among them
    kept = np.unique(np.linspace(0, len(times) - 1, most).round().astype(int))
    return times[kept], [f"The slider has {len(kept)} of {len(times):,} instants: all would make this too large."]


def _styles(size: float, known: bool, measured: bool) -> list[Dicts]:
    """What changes from instant to instant."""
    cross = {"symbol": "x-thin", "size": 6 * size, "line": {"width": 1, "color": GREY}}
    target = {"symbol": "cross-thin", "size": 14 * size, "line": {"width": 2 * size, "color": BLACK}}
    styles = [scatter("measurements", marker=cross, hoverinfo="skip")] if measured else []
    styles += [scatter("targets", marker=target, hoverinfo="text")] if known else []
    return [*styles, scatter("tracks", "markers+text", textposition="top right", hoverinfo="text")]


def _targets(here: Paths, time: float, unit: Unit) -> Dicts:
    places = stacked(one.at(time) for one in here)
    return {**points(places, unit), "hovertext": [f"target {escape(one.name)}" for one in here]}


def _marks(live: Paths, colours: list[str], time: float, unit: Unit, size: float) -> Dicts:
    """Tracks at a time, with two standard deviations where they are known."""
    hovers, spreads = [], np.zeros((len(live), 2))
    for number, one in enumerate(live):
        row = one.row(time)
        lines = [
            f"<b>track {escape(one.name)}</b>",
            *(f"{axis} {one.where[row, i]:,.1f} m" for i, axis in enumerate("xyz")),
        ]
        if one.sigma is not None and np.isfinite(one.sigma[row]).all():
            spreads[number] = 2.0 * one.sigma[row]
            lines[1:3] = [f"{text[:-2]} \u00b1 {sd:.3g} m" for text, sd in zip(lines[1:3], one.sigma[row], strict=True)]
        if one.altitude is not None and np.isfinite(one.altitude[row]):
            lines.append(f"altitude {one.altitude[row]:,.0f} m")
        if one.degrees is not None:
            lines.append(f"{one.degrees[row, 0]:.5f}\u00b0, {one.degrees[row, 1]:.5f}\u00b0")
        hovers.append("<br>".join([*lines, f"row of {moment(float(one.times[row]))}"]))
    bars = {
        f"error_{axis}": {"array": np.round(unit.factor * spreads[:, i], 6).tolist(), "width": 0, "thickness": 1}
        for i, axis in enumerate("xy")
        if spreads.any()
    }
    names = [escape(one.name) for one in live] if len(live) <= _MOST_NAMES else [""] * len(live)
    where = points(stacked(one.at(time) for one in live), unit)
    return {**where, "text": names, "hovertext": hovers, "marker": {"color": colours, "size": size}, **bars}


def _measured(instants: Array, scene: Scene | None, plots: PlotTracks | None) -> list[Array] | None:
    """Positions (n, 2) of the measurements of each instant; None for directions alone, or if there are too many."""
    if plots is not None:
        ends = np.round(np.asarray(plots.ends, dtype=float), 4).tolist()
        windows = {end: window.rows for end, window in zip(ends, plots.windows, strict=True)}
        found = [plots.recording.positions[windows[one]] if one in windows else np.zeros((0, 2)) for one in instants]
        return found if sum(map(len, found)) <= _MOST_MEASUREMENTS else None
    named = [] if scene is None else [s for s, one in enumerate(scene.sensors) if not isinstance(one, BearingSensor)]
    if scene is None or not named:
        return None
    numbers: dict[float, list[int]] = {time: [] for time in instants.tolist()}
    for k, time in enumerate(np.round(scene.times, 4).tolist()):
        if time in numbers:
            numbers[time].append(k)
    if sum(len(z) for scans in numbers.values() for k in scans for z in scene.measurements[k]) > _MOST_MEASUREMENTS:
        return None
    middle = float(scene.region[2].mean())
    found = []
    for scans in numbers.values():
        parts = [np.zeros((0, 2))]
        for k in scans:
            scan = scene.scan(k).aligned(scene.sensors)
            sensors = scene.at(scan.time).sensors
            parts += [positions_of(sensors[s], scan.measurements[s], middle, 0.0)[:, :2] for s in named]
        found.append(np.concatenate(parts))
    return found
