"""The report of a parameter study: table, heat maps, convergence, design."""

from __future__ import annotations

import itertools
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.door import door
from assoc._text.html import escape
from assoc.plotting.heat_map import LABELS, cells
from assoc.plotting.report.page import Page, cards, definitions, settings_section, sortable_table
from assoc.plotting.report.plotly_script import check_report
from assoc.plotting.report.views import number
from assoc.plotting.study_figures import setting_title
from assoc.sweeps.excess import mean_excess, with_excess
from assoc.sweeps.frame import RESULTS, load, load_traces
from assoc.sweeps.store import Store
from assoc.sweeps.summary import FACTORS, measured, summarize, varied

if TYPE_CHECKING:
    import pandas as pd

_MOST_VALUES = 15
_MOST_PARAMETERS = 5
_MOST_CURVES = 60

_MAPS = """<div class="controls"><label>show <select id="measure"></select></label>
<label>over <select id="parameters"></select></label></div>
<div id="map-plot" class="plot large"></div>
<p class="note">Means over all runs with these values; the 95 % interval by the bootstrap over scans and repeats is in
brackets, on a narrow screen where it is pointed at.</p>"""

_CURVES = """<div class="controls"><label>over <select id="trace-axis"><option value="iteration">iterations</option>
<option value="seconds">time</option></select></label><span id="chosen-setting"></span></div>
<div id="curves-plot" class="plot large"></div>
<p class="note">A run counts with the best it has found by then. The settings of least mean excess are in colour,
the one chosen in the table is black.</p>"""


@door
def write_sweep_report(
    path: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    frame: pd.DataFrame | None = None,
    *,
    words: Sequence[str] | None = None,
) -> None:
    """Write a study as one HTML file that works without a network.

    Parameters
    ----------
    path : path-like
        The file to write; it appears whole or not at all.
    folder : path-like
        Folder of the study.
    frame : DataFrame, optional
        The runs to show; default: all.
    words : sequence of str, optional
        The command line of ``python -m assoc.sweep`` that made it, to be shown.

    Raises
    ------
    MissingExtraError
        plotly is not installed; an ImportError that names the command.
    InvalidInputError
        There is no such study, or the file cannot be written.
    """
    check_report()
    frame = load(folder) if frame is None else frame
    with Store(folder) as store:
        manifest = store.manifest
    used = {
        "seed": manifest.seed,
        "time_limit": manifest.time_limit,
        "cpu_limit": manifest.cpu_limit,
        **manifest.gating,
    }
    sources = "".join(f"<li>{escape(name)}</li>" for name in manifest.sources.values())
    settings = f"<h3>Sources</h3><ul>{sources}</ul><h3>Study</h3>{definitions(used)}"
    settings += "".join(f"<h3>Parameters of {escape(solver)}</h3>{definitions(same)}" for solver, same in _fixed(frame))
    settings = settings_section(settings, "assoc.sweep", words)
    name = Path(folder).resolve().name
    lead = f"Parameter study of {', '.join(map(str, frame['solver'].unique())) or 'nothing yet'}"
    if frame.empty:
        sections = [("summary", "Summary", "<p>The study has no runs yet.</p>"), ("settings", "Settings", settings)]
        Page(name, lead, sections, {"settings": []}, ["sweep.js"]).write(path)
        return
    table = summarize(frame).sort_values(["excess", "time"], kind="stable").reset_index(drop=True)
    names = varied(frame)
    titles = [setting_title(row, names, frame["solver"].nunique() > 1) for row in table.to_dict("records")]
    sections = [
        ("summary", "Summary", _summary(frame, table, titles)),
        ("table", "Settings compared", _table(table, names)),
        ("maps", "Over the parameters", _MAPS),
        ("convergence", "Convergence", _CURVES),
        ("settings", "Study", settings),
    ]
    data = {
        "measures": {name: label for name, label in LABELS.items() if table[name].notna().any()},
        "settings": [_setting(row, text, names) for row, text in zip(table.to_dict("records"), titles, strict=True)],
        "maps": _maps(frame),
        "curves": _curves(frame, load_traces(folder), table),
    }
    Page(name, lead, sections, data, ["sweep.js"]).write(path)


def _fixed(frame: pd.DataFrame) -> list[tuple[str, dict[str, str]]]:
    """Parameters that are the same in all settings of a solver."""
    last = list(frame.columns).index("repeat")
    names = [str(name) for name in frame.columns[1:last] if name not in RESULTS]
    groups = frame.groupby("solver") if len(frame) else ()
    return [
        (str(solver), {name: _value(part[name].iloc[0])[0] for name in names if part[name].nunique() == 1})
        for solver, part in groups
    ]


def _summary(frame: pd.DataFrame, table: pd.DataFrame, titles: Sequence[str]) -> str:
    best = table.iloc[0]
    problems = frame.groupby(["scene", "scan"]).ngroups
    content = {
        "Settings": (f"{len(table):,}", "solvers with all their parameters"),
        "Runs": (f"{len(frame):,}", f"{problems:,} scans or problems, {frame['repeat'].nunique():,} repeats"),
        "Certified optimal": (f"{100 * frame['optimal'].astype(float).mean():.1f} %", "of all runs"),
        "Time": (f"{frame['time'].astype(float).sum():.3g} s", "in the solvers"),
        "Least mean excess": (f"{best['excess']:.3g}", "cost above the best known of each scan"),
        "Setting of it": (titles[0], "ties are broken by time; see whether intervals differ"),
    }
    return cards(content)


def _table(table: pd.DataFrame, names: Sequence[str]) -> str:
    headers = ["rank", "solver", *names, "runs"]
    shown = [name for name in LABELS if table[name].notna().any()]
    for name in shown:
        headers += [LABELS[name], "95 %"]
    rows = []
    for rank, row in enumerate(table.to_dict("records"), start=1):
        line: list[tuple[str, Any]] = [(str(rank), rank), (str(row["solver"]), str(row["solver"]))]
        line += [_value(row[name]) for name in names]
        line.append((str(row["runs"]), int(row["runs"])))
        for name in shown:
            middle, low, high = (FACTORS.get(name, 1.0) * row[f"{name}{end}"] for end in ("", "_low", "_high"))
            interval = "" if np.isnan(low) else f"{low:.4g} .. {high:.4g}"
            line += [(f"{middle:.4g}", number(middle)), (interval, number(high - low))]
        rows.append(line)
    return sortable_table("setting-table", headers, rows, link="setting")


def _value(value: Any) -> tuple[str, Any]:
    """Text and sort key of a parameter; a solver may not have it."""
    if value is None or value != value:
        return "", None
    plain = value.item() if isinstance(value, np.generic) else value
    return (f"{plain:.6g}" if isinstance(plain, float) else str(plain)), plain


def _setting(row: Mapping[Any, Any], text: str, names: Sequence[str]) -> dict[str, Any]:
    means = {}
    for name in LABELS:
        factor = FACTORS.get(name, 1.0)
        means[name] = [number(factor * row[f"{name}{end}"]) for end in ("", "_low", "_high")]
    return {"title": text, "values": {name: _value(row[name])[1] for name in names}, "means": means}


def _maps(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Means and intervals over all pairs of parameters with few values, for each solver."""
    maps: list[dict[str, Any]] = []
    several = frame["solver"].nunique() > 1
    for solver, part in frame.groupby("solver"):
        few = [name for name in varied(part) if part[name].nunique() <= _MOST_VALUES][:_MOST_PARAMETERS]
        for across, up in itertools.combinations(few, 2):
            shown: dict[str, Any] = {}
            for measure in LABELS:
                if np.isnan(measured(part, measure)).all():
                    continue
                xs, ys, *tables = cells(part, measure, across, up)
                shown[measure] = [[[number(value) for value in row] for row in table.tolist()] for table in tables]
            maps.append(
                {
                    "title": f"{solver}: {across}, {up}" if several else f"{across}, {up}",
                    "across": across,
                    "up": up,
                    "xs": [_value(x)[0] for x in xs],
                    "ys": [_value(y)[0] for y in ys],
                    "measures": shown,
                }
            )
    return maps


def _curves(frame: pd.DataFrame, traces: pd.DataFrame, table: pd.DataFrame) -> list[dict[str, Any]]:
    """Mean excess of the best settings over iterations and over time, in the order of the table."""
    traces = with_excess(frame, traces)
    curves = []
    for key in table["setting"][:_MOST_CURVES]:
        part = traces[traces["setting"] == key]
        entry = {}
        for column in ("iteration", "seconds") if len(part) else ():
            at, excess = mean_excess(part, column)
            entry[column] = [[float(f"{value:.5g}") for value in array.tolist()] for array in (at, excess)]
        curves.append(entry)
    return curves
