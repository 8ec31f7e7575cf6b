"""The report of a tracker: tracks over the truth, a metric over time, the life of each track."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.door import door
from assoc._text.html import warning_list
from assoc._text.times import moment
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.metrics import Gospa, Trajectories, gospa_over_time, mean_gospa
from assoc.metrics.trajectories import last_at_each_instant
from assoc.plotting.measured import positions_of
from assoc.plotting.report.page import Page, cards, controls, definitions, settings_section, sortable_table
from assoc.plotting.report.plotly_script import check_report
from assoc.plotting.report.plots import plot_data
from assoc.plotting.report.views import number, plain_numbers
from assoc.plotting.scene import truth_paths
from assoc.scene.scene import Scene
from assoc.sensors import BearingSensor
from assoc.tracking.offline.plots import PlotTracks
from assoc.tracking.track_table import against_truth

if TYPE_CHECKING:
    import pandas as pd


GOSPA_CUTOFF = 1_000.0

_NEEDED = ("track_id", "time", "x", "y")
_INSTANTS = 300
_DECIMALS = 4
_ON_EARTH = {"lat": "latitude", "lon": "longitude"}
_MOST_POINTS = 40_000
_MOST_MEASUREMENTS = 30_000

_SCENE = (
    controls("time")
    + """<div class="controls"><div class="buttons"><button type="button" id="nearer" disabled>Zoom to track</button>
<button type="button" id="whole">Whole scene</button>
<button type="button" id="legend" aria-pressed="true">Legend</button></div></div>
<div id="scene-plot" class="plot large"></div><p class="note" id="detail" aria-live="polite"></p>"""
)

_METRIC = '<div id="metric-plot" class="plot small"></div>'
_RATES = '<div id="rates-plot" class="plot small"></div>'
_ALTITUDES = '<div id="altitude-plot" class="plot small"></div>'
_COUNTS = '<div id="counts-plot" class="plot small"></div>'


@door
def write_tracking_report(
    path: str | os.PathLike[str],
    tracks: pd.DataFrame,
    scene: Scene | None = None,
    *,
    name: str = "",
    settings: Mapping[str, Any] | None = None,
    cutoff: float = GOSPA_CUTOFF,
    words: Sequence[str] | None = None,
    plots: PlotTracks | None = None,
) -> None:
    """Write tracks as one HTML file that works without a network.

    Parameters
    ----------
    path : path-like
        The file to write; it appears whole or not at all.
    tracks : DataFrame
        Columns track_id, time, x, y (seconds, metres) at least; other columns of a tracks.csv are used if present.
    scene : Scene, optional
        Scene that was tracked; its truth and measurements are drawn, and the truth gives the metric.
    name : str
        Heading, if the scene has no name.
    settings : mapping, optional
        Settings of the tracker, to be shown.
    cutoff : float
        Cutoff of GOSPA, metres.
    words : sequence of str, optional
        The command line of ``python -m assoc.track`` that made it, to be shown.
    plots : PlotTracks, optional
        The recording that was tracked, instead of a scene: its plots and aircraft are drawn, and CT, MT and IT over
        the windows.

    Raises
    ------
    MissingExtraError
        plotly is not installed; an ImportError that names the command.
    InvalidInputError
        A column is missing or holds values that are not finite numbers, or the file cannot be written.
    """
    check_report()
    _check_columns(tracks)
    frame = tracks.sort_values(["track_id", "time"], kind="stable")
    if "z" not in frame.columns:
        frame = frame.assign(z=0.0)
    truth = {} if scene is None else truth_paths(scene)
    known = scene is not None and bool(truth)
    times, values = _gospa(frame, scene, cutoff) if known and scene is not None else (np.zeros(0), [])
    rows = _lives(frame, values)
    shown = f"<h3>Tracker</h3>{definitions(settings)}" if settings else ""
    warnings = warning_list(() if scene is None else scene.warnings)
    sections = [("summary", "Summary", warnings + _summary(frame, len(rows), values, cutoff, plots))]
    if len(frame) or known or (plots is not None and plots.windows):
        sections.append(("scene", "Tracks over time", _SCENE))
    if known:
        sections.append(("metric", f"GOSPA over time, cutoff {cutoff:g} m", _METRIC))
    if plots is not None and plots.rates is not None:
        sections.append(("rates", "CT, MT and IT of the windows", _RATES))
    if "altitude" in frame.columns and frame["altitude"].notna().any():
        sections.append(("heights", "Altitude over time", _ALTITUDES))
    sections += [
        ("numbers", "Number of tracks over time", _COUNTS),
        ("life", "Life of the tracks", _table(rows, known)),
        ("settings", "Settings", settings_section(shown, "assoc.track", words)),
    ]
    title = (scene.name if scene is not None else "") or name or "Tracks"
    data = _data(frame, scene, truth, plots)
    data["gospa"] = {
        "times": plain_numbers(times, 6),
        "distance": plain_numbers([gospa.distance for gospa in values], 4),
        **{part: plain_numbers(np.sqrt([getattr(gospa, part) for gospa in values]), 4) for part in Gospa._fields[1:4]},
    }
    Page(title, f"{len(rows)} tracks", sections, data, ["tracks.js"]).write(path)


def _check_columns(tracks: pd.DataFrame) -> None:
    missing = [column for column in _NEEDED if column not in tracks.columns]
    if missing:
        raise InvalidInputError(f"tracks: the column {missing[0]!r} is missing")
    for column in _NEEDED:
        try:
            finite = bool(np.isfinite(tracks[column].to_numpy(dtype=float)).all())
        except (TypeError, ValueError):
            finite = False
        if not finite:
            raise InvalidInputError(f"tracks: the column {column!r} must hold finite numbers")


def _gospa(frame: pd.DataFrame, scene: Scene, cutoff: float) -> tuple[Array, list[Gospa]]:
    # of several scans at one time, the last row of a track
    times, ids = (frame[name].to_numpy(dtype=float) for name in ("time", "track_id"))
    frame = frame.iloc[last_at_each_instant(times, ids)]
    found = Trajectories(*(frame[name].to_numpy() for name in ("time", "track_id", ["x", "y", "z"])))
    return gospa_over_time(*against_truth(scene, found), cutoff)


def _data(
    frame: pd.DataFrame, scene: Scene | None, truth: Mapping[int, Array], plots: PlotTracks | None
) -> dict[str, Any]:
    """Times of the slider, paths of tracks and targets, measurements of the scans."""
    reach = np.abs(frame[["x", "y"]].to_numpy(dtype=float)).max() if len(frame) else 0.0
    decimals = 0 if reach > 20_000 else 1 if reach > 2_000 else 3
    step = max(1, len(frame) // _MOST_POINTS)
    paths = []
    for number_of, track in _by_track(frame):
        # thinned tracks keep their last point
        kept = np.unique(np.r_[np.arange(0, len(track), step), len(track) - 1])
        part = track.iloc[kept]
        path = {"id": number_of, **_path(part["time"], part[["x", "y", "z"]], decimals)}
        if "altitude" in part:
            path["h"] = plain_numbers(part["altitude"].to_numpy(dtype=float), 0)
        if "latitude" in part:
            path |= {key: plain_numbers(part[name].to_numpy(dtype=float), 5) for key, name in _ON_EARTH.items()}
        if "target" in part and str(part["target"].iloc[0]):
            path["target"] = str(part["target"].iloc[0])
        paths.append(path)
    ends = scene.times if scene is not None else np.zeros(0) if plots is None else plots.ends
    if 0 < len(ends) <= _INSTANTS:
        instants = ends
    elif len(frame):
        instants = np.linspace(frame["time"].min(), frame["time"].max(), min(_INSTANTS, len(frame)))
    else:
        instants = ends[:: max(1, len(ends) // _INSTANTS)]
    return {
        # as many decimals as the rows' times, so that both mean the same instant
        "instants": np.unique(np.round(instants, _DECIMALS)).tolist(),
        "tracks": paths,
        "truth": _truth(scene, truth, decimals),
        "measured": _measured(scene, decimals),
        "sensors": []
        if scene is None
        else [
            {"name": sensor.name or f"sensor {s + 1}", "place": plain_numbers(sensor.position, 1)}
            for s, sensor in enumerate(scene.at(float(scene.times[-1])).sensors)
        ],
        **({} if plots is None else plot_data(plots, decimals)),
    }


def _by_track(frame: pd.DataFrame) -> list[tuple[int, pd.DataFrame]]:
    return [(int(str(name)), rows) for name, rows in frame.groupby("track_id")]


def _path(times: Any, where: Any, decimals: int) -> dict[str, Any]:
    points = np.asarray(where, dtype=float)
    return {
        "t": plain_numbers(np.asarray(times, dtype=float), _DECIMALS),
        **{axis: plain_numbers(points[:, i], decimals) for i, axis in enumerate("xyz")},
    }


def _truth(scene: Scene | None, truth: Mapping[int, Array], decimals: int) -> list[dict[str, Any]]:
    if scene is None or scene.truth is None:
        return []
    seen: dict[int, list[float]] = {}
    for time, ids in zip(scene.times, scene.truth.target_ids, strict=True):
        for target in ids:
            seen.setdefault(int(target), []).append(float(time))
    step = max(1, sum(map(len, seen.values())) // _MOST_POINTS)
    names = scene.truth.names
    return [
        {"id": target, "name": names.get(target, ""), **_path(seen[target][::step], path[::step], decimals)}
        for target, path in truth.items()
    ]


def _measured(scene: Scene | None, decimals: int) -> list[dict[str, Any]]:
    """Positions of each scan's measurements; none for directions alone, or if there are too many."""
    if scene is None:
        return []
    count = sum(len(z) for scan in scene.measurements for z in scan)
    named = [s for s, sensor in enumerate(scene.sensors) if not isinstance(sensor, BearingSensor)]
    if not named or count > _MOST_MEASUREMENTS:
        return []
    middle = float(scene.region[2].mean())
    found = []
    for k in range(scene.num_scans):
        scan = scene.scan(k).aligned(scene.sensors)
        sensors = scene.at(scan.time).sensors
        at = np.concatenate([positions_of(sensors[s], scan.measurements[s], middle, 0.0)[:, :2] for s in named])
        found.append({"t": round(scan.time, _DECIMALS), "at": plain_numbers(at, decimals)})
    return found


def _lives(frame: pd.DataFrame, values: Sequence[Gospa]) -> list[dict[str, Any]]:
    """Summary of each track, with the target that it followed most if the truth is known."""
    pairs: dict[int, Counter[int]] = {}
    for gospa in values:
        for target, track in gospa.pairs.tolist():
            pairs.setdefault(int(track), Counter())[int(target)] += 1
    lives = []
    for number_of, track in _by_track(frame):
        where, times = track[["x", "y", "z"]].to_numpy(dtype=float), track["time"].to_numpy(dtype=float)
        length = float(np.linalg.norm(np.diff(where, axis=0), axis=1).sum())
        began, ended = float(times[0]), float(times[-1])
        life: dict[str, Any] = {"track": number_of, "first": began, "last": ended, "rows": len(track)}
        life["started"] = float(track["started"].iloc[0]) if "started" in track else began
        life["detected"] = float(track["last_detection"].iloc[-1]) if "last_detection" in track else None
        life["hits"] = int(track["hits"].iloc[-1]) if "hits" in track else None
        life["score"] = number(float(track["score"].iloc[-1])) if "score" in track else None
        life["speed"] = length / (ended - began) if ended > began else None
        life["heading"] = float(track["heading"].iloc[-1]) if "heading" in track else None
        known = track["altitude"].dropna().to_numpy(dtype=float) if "altitude" in track else np.zeros(0)
        life["altitude"] = float(known[-1]) if len(known) else None
        if "nis" in track:
            value = float(track["nis"].iloc[-1])
            life["nis"] = value if np.isfinite(value) else None
            life["consistent"] = "yes" if track["consistent"].all() else "no"
            life["by_sensor"] = " + ".join(str(int(track[name].iloc[-1])) for name in track.filter(like="hits_"))
        life["name"] = (str(track["target"].iloc[0]) or None) if "target" in track else None
        target, share = None, None
        if number_of in pairs:
            target, times_paired = pairs[number_of].most_common(1)[0]
            share = times_paired / len(np.unique(times))
        lives.append({**life, "target": target, "share": share})
    return lives


def _table(lives: Sequence[Mapping[str, Any]], known: bool) -> str:
    columns = [("track", "track", "d"), ("name", "name", "s"), ("started", "started", "t"), ("first", "first row", "t")]
    columns += [("detected", "last detection", "t"), ("last", "last row", "t"), ("rows", "rows", "d")]
    columns += [("hits", "hits", "d"), ("score", "score, nats", ".4g"), ("speed", "mean speed, m/s", ".4g")]
    columns += [("heading", "last heading, deg", ".0f"), ("altitude", "last altitude, m", ".0f")]
    columns += [("by_sensor", "hits by sensor", ""), ("nis", "NIS", ".2f"), ("consistent", "consistent", "")]
    columns += [("target", "target followed", "d"), ("share", "share of its rows", ".0%")] if known else []
    used = [
        column for column in columns if any(life.get(column[0]) is not None for life in lives) or column[0] == "track"
    ]
    rows = [
        [("" if life.get(key) is None else _shown(life[key], style), life.get(key)) for key, _, style in used]
        for life in lives
    ]
    note = '<p class="note">No track was made.</p>' if not lives else ""
    return note + sortable_table("track-table", [header for _, header, _ in used], rows, link="track")


def _shown(value: Any, style: str) -> str:
    return moment(value) if style == "t" else format(value, style)


def _summary(frame: pd.DataFrame, count: int, values: Sequence[Gospa], cutoff: float, plots: PlotTracks | None) -> str:
    content = {"Tracks": (f"{count:,}", f"{len(frame):,} rows")}
    if len(frame):
        spans = frame.groupby("track_id")["time"].agg(["min", "max"])
        middle = float((spans["max"] - spans["min"]).median())
        whole = float(frame["time"].max() - frame["time"].min())
        content["Median life"] = (f"{middle:.4g} s", f"of {whole:.4g} s")
    if plots is not None and plots.rates is not None:
        rates = plots.rates
        notes = {"CT": "plots in a track of their aircraft", "MT": "plots that kept their track"}
        for name, rate in (("CT", rates.ct), ("MT", rates.mt), ("IT", rates.it)):
            note = notes.get(name, "plots in a wrong or tentative track")
            shown = "-" if np.isnan(rate) else f"{rate:.1f} %"
            content[name] = (shown, f"mean of {len(rates.windows)} windows: {note}")
    if values:
        mean = mean_gospa(values)
        content["GOSPA"] = (
            f"{mean['distance']:.4g} m",
            f"root mean square of {len(values)} instants, cutoff {cutoff:g} m",
        )
        notes = {"localisation": "errors of tracks", "missed": "targets without a track", "false": "tracks of nothing"}
        for part, note in notes.items():
            content[part.capitalize()] = (f"{mean[part]:.4g} m", f"part of GOSPA: {note}")
    return cards(content)
