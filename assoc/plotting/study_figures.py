"""Figures of a study: heat maps over its parameters, and convergence of its settings."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._files.output import write_atomically
from assoc._files.reading import check_regular
from assoc._system.imports import load_extra
from assoc.errors import InvalidInputError
from assoc.plotting.colours import DASHES, colour
from assoc.plotting.heat_map import LABELS, cells, colour_limits, draw_cells, is_constant, short_text
from assoc.sweeps.excess import mean_excess, with_excess
from assoc.sweeps.frame import load, load_traces
from assoc.sweeps.summary import FACTORS, measured, summarize, varied

if TYPE_CHECKING:
    import pandas as pd

_PANELS = ("gap", "optimal", "iterations", "time")
_MOST_CELLS = 12
_MOST_COLUMNS = 6
_MOST_CURVES = 8


def draw_study(folder: str | os.PathLike[str], frame: pd.DataFrame | None = None) -> list[Path]:
    """Draw the heat maps and the convergence curves of a study, or of the runs in `frame`, into its folder.

    The files are ``heatmap.png`` (one for each solver, with its name, if there are several) and ``convergence.png``. A
    study without runs is refused.
    """
    frame = load(folder) if frame is None else frame
    if frame.empty:
        raise InvalidInputError(f"{folder}: the study has no runs yet, there is nothing to draw")
    parts = [(str(solver), part) for solver, part in frame.groupby("solver")]
    drawn = []
    for solver, part in parts:
        if not varied(part):
            continue
        # the solver's name comes from a file: it must not lead to another folder
        name = "heatmap.png" if len(parts) == 1 else "heatmap-" + re.sub(r"[^\w.-]", "_", solver) + ".png"
        drawn.append(_save(folder, name, heat_maps(part, new_figure())))
    drawn.append(_save(folder, "convergence.png", convergence(frame, load_traces(folder), new_figure())))
    return drawn


def new_figure() -> Any:
    """Return an empty figure that needs no screen and no pyplot."""
    figure = load_extra("matplotlib.figure", "plot").Figure(layout="constrained")
    load_extra("matplotlib.backends.backend_agg", "plot").FigureCanvasAgg(figure)
    return figure


def _save(folder: Any, name: str, figure: Any) -> Path:
    path = Path(folder) / name
    check_regular(path)  # the folder may contain a symbolic link, which must not be followed
    return save_png(path, figure)


def save_png(path: Path, figure: Any) -> Path:
    """Write a figure, whole or not at all; returns the path."""
    write_atomically(path, lambda file: figure.savefig(file, format="png", dpi=130))
    return path


def heat_maps(frame: pd.DataFrame, figure: Any) -> Any:
    """Draw each measure over two parameters of one solver's runs, side by side for the values of the others.

    With one parameter, or too many values for a map, the measures are drawn over each parameter. Returns the figure.
    """
    names = varied(frame)
    panels = [name for name in _PANELS if not np.isnan(measured(frame, name)).all()]
    numeric = [name for name in names if frame[name].dtype.kind in "iuf"]
    if len(numeric) < 2 or any(frame[name].nunique() > _MOST_CELLS for name in names):
        return _over_each(summarize(frame), names, panels, figure)
    across, up = numeric[0], numeric[1]
    others = [name for name in names if name not in (across, up)]
    groups: list[tuple[str, pd.DataFrame]] = [("", frame)]
    if others and frame.groupby(others).ngroups <= _MOST_COLUMNS:
        groups = [
            (", ".join(f"{n} {short_text(v)}" for n, v in zip(others, values, strict=True)), part)
            for values, part in frame.groupby(others)
        ]
    elif others:
        groups = [(f"mean over {', '.join(others)}", frame)]
    figure.set_size_inches(1.6 + 2.6 * len(groups), 0.6 + 2.3 * len(panels))
    axes = figure.subplots(len(panels), len(groups), squeeze=False)
    for row, measure in zip(axes, panels, strict=True):
        tables = [cells(part, measure, across, up, intervals=False)[:3] for _, part in groups]
        known = np.concatenate([values[~np.isnan(values)] for _, _, values in tables])
        limits = colour_limits(known)
        for ax, (label, _), (xs, ys, values) in zip(row, groups, tables, strict=True):
            image = draw_cells(xs, ys, values, limits, ax=ax)
            ax.set_xlabel(across)
            ax.set_ylabel(up)
            ax.set_title(label, fontsize=9)
        if is_constant(known):
            row[0].annotate(
                f"{LABELS[measure]}: {known[0]:.4g} everywhere", (0, 1), (0, 16), xycoords="axes fraction",
                textcoords="offset points", fontsize=9,
            )  # fmt: skip
        else:
            figure.colorbar(image, ax=list(row), label=LABELS[measure])
    return figure


def _over_each(summary: pd.DataFrame, names: list[str], panels: list[str], figure: Any) -> Any:
    """Draw each measure with its interval over each parameter."""
    figure.set_size_inches(0.6 + 3.2 * len(names), 0.6 + 2.3 * len(panels))
    axes = figure.subplots(len(panels), len(names), squeeze=False, sharex="col", sharey="row")
    for row, measure in zip(axes, panels, strict=True):
        factor = FACTORS.get(measure, 1.0)
        middle = factor * summary[measure].to_numpy(dtype=float)
        low, high = (factor * summary[f"{measure}_{end}"].to_numpy(dtype=float) for end in ("low", "high"))
        spread = np.maximum(0.0, np.stack([middle - low, high - middle]))
        for ax, name in zip(row, names, strict=True):
            column = summary[name]
            across = column if column.dtype.kind in "iuf" else column.astype(str)
            ax.errorbar(across, middle, yerr=spread, fmt="o", markersize=4, linewidth=1, capsize=2)
            ax.grid(alpha=0.3)
        row[0].set_ylabel(LABELS[measure])
    for ax, name in zip(axes[-1], names, strict=True):
        ax.set_xlabel(name)
    return figure


def convergence(frame: pd.DataFrame, traces: pd.DataFrame, figure: Any) -> Any:
    """Draw the mean cost above the best known, over iterations and over time, one curve for each setting.

    The eight settings with the smallest mean gaps are named, the others are grey. Returns the figure.
    """
    traces = with_excess(frame, traces)
    summary = summarize(frame).sort_values(["gap", "time"], kind="stable")
    names = varied(frame)
    several = frame["solver"].nunique() > 1
    figure.set_size_inches(11, 4.5)
    axes = figure.subplots(1, 2, sharey=True)
    for ax, column, label in zip(axes, ("iteration", "seconds"), ("iteration", "ms"), strict=True):
        # drawn from the last to the first, so that the best lie on top
        for rank, row in reversed([*enumerate(summary.to_dict("records"))]):
            style: dict[str, Any] = {"color": "0.8", "linewidth": 0.8, "zorder": 1}
            if rank < _MOST_CURVES:
                label = setting_title(row, names, several)
                line = {"color": colour(rank), "linestyle": DASHES[rank % len(DASHES)]}
                style = {**line, "linewidth": 1.6, "zorder": 3, "label": label}
            draw_curve(traces[traces["setting"] == row["setting"]], column, ax=ax, **style)
        if column == "seconds" or traces[column].max() > 30:
            ax.set_xscale("log")
        ax.set_xlabel(label)
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("mean cost above the best known")
    axes[0].set_yscale("symlog", linthresh=1e-3)
    # if all settings find the best solution at once, all curves are 0, and the axis still needs an extent
    axes[0].set_ylim(-1e-4, None if traces["excess"].max() > 0.0 else 1e-2)
    handles, labels = axes[1].get_legend_handles_labels()
    axes[1].legend(handles[::-1], labels[::-1], fontsize=7)
    return figure


def setting_title(row: Mapping[Any, Any], names: Sequence[str], several: bool) -> str:
    """Title of a setting (a row of a summary) in its study."""
    words = [str(row["solver"])] if several or not names else []
    words += [f"{n} {short_text(row[n])}" for n in names if row[n] == row[n] and row[n] is not None]
    return ", ".join(words)


def draw_curve(traces: pd.DataFrame, column: str, *, ax: Any, **style: Any) -> None:
    """Draw the mean excess of runs over iterations or milliseconds; see `mean_excess`."""
    if not traces.empty:
        ax.plot(*mean_excess(traces, column), drawstyle="steps-post", **style)
