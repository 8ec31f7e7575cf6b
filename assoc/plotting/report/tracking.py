"""The report of a tracker: tracks over the truth, a metric over time, the life of each track."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._text.html import warning_list
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.metrics import Gospa, Trajectories, gospa_over_time, mean_gospa
from assoc.metrics.trajectories import last_at_each_instant
from assoc.plotting.report.figures import Dicts, over_time
from assoc.plotting.report.lives import life_table
from assoc.plotting.report.page import Part, cards, check_report, definitions, note, settings_part, write_page
from assoc.plotting.report.paths import Paths, counts_over_time, paths_of, tracks_figure, truth_of
from assoc.scene.scene import Scene
from assoc.tracking.offline.plots import PlotTracks
from assoc.tracking.track_table import against_truth

if TYPE_CHECKING:
    import pandas as pd


GOSPA_CUTOFF = 1_000.0

_NEEDED = ("track_id", "time", "x", "y")
_MOST_ALTITUDES = 30


@explains_wrong_types
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
    known = scene is not None and scene.truth is not None
    times, values = _gospa(frame, scene, cutoff) if known and scene is not None else (np.zeros(0), [])
    drawn, truth = paths_of(frame), truth_of(scene, plots)
    warnings = warning_list(() if scene is None else scene.warnings)
    parts = [Part("Summary", warnings + _summary(frame, len(drawn), values, cutoff, plots))]
    figure, left_out = tracks_figure(drawn, truth, scene, plots)
    if figure is not None:
        parts.append(Part("Tracks over time", "".join(map(note, left_out)), [figure]))
    parts += _histories(drawn, truth, (times, values), cutoff, plots)
    shown = f"<h3>Tracker</h3>{definitions(settings)}" if settings else ""
    parts += [
        Part("Life of the tracks", life_table(frame, values, known)),
        settings_part(shown, "assoc.track", words),
    ]
    title = (scene.name if scene is not None else "") or name or "Tracks"
    write_page(path, title, f"{len(drawn)} tracks", parts)


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


def _histories(
    drawn: Paths, truth: Paths, metric: tuple[Array, list[Gospa]], cutoff: float, plots: PlotTracks | None
) -> list[Part]:
    """Number of tracks, GOSPA, rates and altitudes over time, as far as they are known."""
    parts = []
    counts = counts_over_time({"tracks": drawn, **({"targets": truth} if truth else {})})
    if counts:
        parts.append(Part("Number of tracks over time", "", [over_time(counts, "tracks (number)")]))
    times, values = metric
    if values:
        curves = [("GOSPA", times, np.array([gospa.distance for gospa in values]))]
        for part in Gospa._fields[1:4]:
            curves.append((part, times, np.sqrt([getattr(gospa, part) for gospa in values])))
        parts.append(Part(f"GOSPA over time, cutoff {cutoff:g} m", "", [over_time(curves, "GOSPA (m)")]))
    if plots is not None and plots.rates is not None:
        at = np.asarray(plots.ends, dtype=float)[plots.rates.windows]
        rates = zip(("CT", "MT", "IT"), plots.rates.per_window.T, strict=True)
        parts.append(
            Part(
                "CT, MT and IT of the windows", "", [over_time([(name, at, row) for name, row in rates], "percent", 1)]
            )
        )
    told = [one for one in drawn if one.altitude is not None and np.isfinite(one.altitude).any()]
    if told:
        longest = sorted(told, key=lambda one: -len(one.times))[:_MOST_ALTITUDES]
        said = note(f"The {_MOST_ALTITUDES} longest of {len(told)} tracks.") if len(told) > len(longest) else ""
        parts.append(Part("Altitude over time", said, [_altitudes(longest)]))
    return parts


def _altitudes(longest: Paths) -> Dicts:
    heights = [np.zeros(0) if one.altitude is None else one.altitude for one in longest]
    step = max(1, sum(map(len, heights)) // 20_000)
    curves = [
        (f"track {one.name}", one.times[::step], height[::step]) for one, height in zip(longest, heights, strict=True)
    ]
    return over_time(curves, "altitude (m)", 0)


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
