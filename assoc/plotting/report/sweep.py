"""The report of a parameter study: table, heat maps, convergence."""

from __future__ import annotations

import itertools
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._text.html import escape
from assoc.plotting.colours import SERIES
from assoc.plotting.report.figures import FAINT, Choices, Dicts, layout, line, menu, plain_numbers, scatter
from assoc.plotting.report.page import Part, cards, check_report, definitions, note, settings_part, table, write_page
from assoc.plotting.study_figures import LABELS, cells, setting_title
from assoc.sweeps.frame import load, load_traces, mean_excess, with_excess
from assoc.sweeps.store import Store
from assoc.sweeps.summary import FACTORS, measured, parameter_columns, parameter_text, summarize, varied

if TYPE_CHECKING:
    import pandas as pd

_MOST_VALUES = 15
_MOST_PARAMETERS = 5
_MOST_CURVES = 60
_MOST_MAPS = 10

_NOTE_MAPS = "Means over all runs with these values; point at a cell for the 95 % interval, by the bootstrap."
_NOTE_CURVES = (
    "Mean cost above the best known. A run counts with the best it has found by then. The settings of least mean "
    "excess come first."
)


@explains_wrong_types
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
    about = settings_part(settings, "assoc.sweep", words)
    name = Path(folder).resolve().name
    lead = f"Parameter study of {', '.join(map(str, frame['solver'].unique())) or 'nothing yet'}"
    if frame.empty:
        write_page(path, name, lead, [Part("Summary", "<p>The study has no runs yet.</p>"), about])
        return
    summary = summarize(frame).sort_values(["excess", "time"], kind="stable").reset_index(drop=True)
    names = varied(frame)
    titles = [setting_title(row, names, frame["solver"].nunique() > 1) for row in summary.to_dict("records")]
    measures = [measure for measure in LABELS if summary[measure].notna().any()]
    # begin with what differs
    measures.sort(key=lambda measure: summary[measure].nunique() < 2)
    parts = [Part("Summary", _summary(frame, summary, titles)), Part("Settings compared", _table(summary, names))]
    figures = [_map(*one, measures) for one in _pairs(frame)]
    if figures:
        parts.append(Part("Over two parameters", note(_NOTE_MAPS), figures))
    curves = _curves(frame, load_traces(folder), summary, titles)
    parts += [Part("Convergence", note(_NOTE_CURVES), curves), about]
    write_page(path, name, lead, parts)


def _fixed(frame: pd.DataFrame) -> list[tuple[str, dict[str, str]]]:
    """Parameters that are the same in all settings of a solver."""
    names = parameter_columns(frame)
    groups = frame.groupby("solver") if len(frame) else ()
    return [
        (str(solver), {name: parameter_text(part[name].iloc[0]) for name in names if part[name].nunique() == 1})
        for solver, part in groups
    ]


def _summary(frame: pd.DataFrame, summary: pd.DataFrame, titles: Sequence[str]) -> str:
    best = summary.iloc[0]
    problems = frame.groupby(["scene", "scan"]).ngroups
    content = {
        "Settings": (f"{len(summary):,}", "solvers with all their parameters"),
        "Runs": (f"{len(frame):,}", f"{problems:,} scans or problems, {frame['repeat'].nunique():,} repeats"),
        "Certified optimal": (f"{100 * frame['optimal'].astype(float).mean():.1f} %", "of all runs"),
        "Time": (f"{frame['time'].astype(float).sum():.3g} s", "in the solvers"),
        "Least mean excess": (f"{best['excess']:.3g}", "cost above the best known of each scan"),
        "Setting of it": (titles[0], "ties are broken by time; see whether intervals differ"),
    }
    return cards(content)


def _table(summary: pd.DataFrame, names: Sequence[str]) -> str:
    headers = ["rank", "solver", *names, "runs"]
    shown = [name for name in LABELS if summary[name].notna().any()]
    for name in shown:
        headers += [LABELS[name], "95 %"]
    rows = []
    for rank, row in enumerate(summary.to_dict("records"), start=1):
        line = [str(rank), str(row["solver"]), *(parameter_text(row[name]) for name in names), str(row["runs"])]
        for name in shown:
            middle, low, high = (FACTORS.get(name, 1.0) * row[f"{name}{end}"] for end in ("", "_low", "_high"))
            line += [f"{middle:.4g}", "" if np.isnan(low) else f"{low:.4g} .. {high:.4g}"]
        rows.append(line)
    return table(headers, rows, rest="; --csv writes all")


def _pairs(frame: pd.DataFrame) -> list[tuple[str, pd.DataFrame, str, str]]:
    """Title, runs of a solver, and two of its parameters with few values."""
    pairs = []
    for solver, part in frame.groupby("solver"):
        few = [name for name in varied(part) if part[name].nunique() <= _MOST_VALUES][:_MOST_PARAMETERS]
        pairs += [(str(solver), part, *two) for two in itertools.combinations(few, 2)]
    return pairs[:_MOST_MAPS]


def _map(solver: str, part: pd.DataFrame, across: str, up: str, measures: Sequence[str]) -> Dicts:
    """Means of a measure over two parameters, with a menu of the measures."""
    data: list[Dicts] = []
    for measure in measures:
        if np.isnan(measured(part, measure)).all():
            continue
        xs, ys, middle, low, high = cells(part, measure, across, up)
        texts = [
            [
                "" if np.isnan(value) else f"{value:.3g} ({low[i, j]:.3g} .. {high[i, j]:.3g})"
                for j, value in enumerate(row)
            ]
            for i, row in enumerate(middle)
        ]
        data.append(
            {
                "type": "heatmap", "name": LABELS[measure], "x": [escape(parameter_text(x)) for x in xs],
                "y": [escape(parameter_text(y)) for y in ys], "z": plain_numbers(middle, 6), "hovertext": texts,
                "texttemplate": "%{z:.3g}", "colorscale": "Cividis", "colorbar": {"thickness": 12},
                "hovertemplate": "%{hovertext}<extra></extra>", "visible": not data,
            }
        )  # fmt: skip
    choices: Choices = [(one["name"], [{"visible": [other is one for other in data]}]) for one in data]
    shown = layout(
        f"{across} ({escape(solver)})", up, showlegend=False, updatemenus=[menu(choices)], margin={"t": 50},
        xaxis={"type": "category"}, yaxis={"type": "category"},
    )  # fmt: skip
    return {"data": data, "layout": shown}


def _curves(frame: pd.DataFrame, traces: pd.DataFrame, summary: pd.DataFrame, titles: Sequence[str]) -> list[Dicts]:
    """Mean excess of the best settings over iterations and over time, in the order of the table."""
    traces = with_excess(frame, traces)
    figures = []
    for column, label in (("iteration", "iteration"), ("seconds", "time (ms)")):
        data = []
        for i, (key, title) in enumerate(zip(summary["setting"][:_MOST_CURVES], titles, strict=False)):
            part = traces[traces["setting"] == key]
            if len(part):
                at, excess = mean_excess(part, column)
                x, y = (plain_numbers(values, 6) for values in (at, excess))
                style = {**line(i), "shape": "hv"} if i < len(SERIES) else {"color": FAINT, "width": 1, "shape": "hv"}
                data.append(scatter(title, "lines", x=x, y=y, line=style, showlegend=i < len(SERIES)))
        axes: Dicts = {"xaxis": {"type": "log"}, "yaxis": {"rangemode": "tozero"}}
        figures.append({"data": data, "layout": layout(label, "excess cost (nats)", **axes)})
    return figures
