"""The report of a parameter study: table, and the figures of `assoc.plotting.study_figures`."""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.imports import check_extra
from assoc._system.wrong_types import explains_wrong_types
from assoc._text.html import escape
from assoc.plotting.report.page import Part, cards, definitions, note, settings_part, table, write_page
from assoc.plotting.study_figures import LABELS, convergence, heat_maps, new_figure, setting_title
from assoc.sweeps.frame import load, load_traces
from assoc.sweeps.store import Store
from assoc.sweeps.summary import FACTORS, parameter_columns, parameter_text, summarize, varied

if TYPE_CHECKING:
    import pandas as pd

_NOTE_MAPS = "Means over all runs with these values; the table has the 95 % intervals, by the bootstrap."
_NOTE_CURVES = "A run counts with the best it has found by then."


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
        matplotlib is not installed; an ImportError that names the command.
    InvalidInputError
        There is no such study, or the file cannot be written.
    """
    check_extra("matplotlib", "plot")
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
    parts = [Part("Summary", _summary(frame, summary, titles)), Part("Settings compared", _table(summary, names))]
    maps = [(solver, part) for solver, part in frame.groupby("solver") if varied(part)]
    if maps:
        drawn = [_picture(f"Heat maps of {solver}", heat_maps(part, new_figure())) for solver, part in maps]
        parts.append(Part("Over the parameters", note(_NOTE_MAPS) + "".join(drawn)))
    curves = _picture("Convergence", convergence(frame, load_traces(folder), new_figure()))
    write_page(path, name, lead, [*parts, Part("Convergence", note(_NOTE_CURVES) + curves), about])


def _picture(title: str, figure: Any) -> str:
    """A figure of matplotlib as an element, which scrolls where it is wider than the page."""
    file = io.BytesIO()
    figure.savefig(file, format="svg")
    data = base64.b64encode(file.getvalue()).decode()
    return f'<h3>{escape(title)}</h3><div class="drawn"><img alt="" src="data:image/svg+xml;base64,{data}"></div>'


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
