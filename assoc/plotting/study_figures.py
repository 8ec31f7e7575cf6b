"""Figures of a study: heat maps over its parameters, and convergence of its settings."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._files.output import write_atomically
from assoc._system.imports import load_extra
from assoc._types import Array, Floats
from assoc.errors import InvalidInputError
from assoc.plotting.axes import set_log_x
from assoc.plotting.colours import DASHES, colour
from assoc.sweeps.frame import load, load_traces, mean_excess, with_excess
from assoc.sweeps.summary import FACTORS, estimated, measured, summarize, varied

if TYPE_CHECKING:
    import pandas as pd

LABELS = {
    "excess": "mean excess",
    "gap": "mean gap",
    "optimal": "certified optimal, %",
    "iterations": "mean iterations",
    "time": "ms",
    "cost": "mean cost, nats",
    "correct": "correct, %",
}
"""Descriptions of the measures, in the units of `FACTORS`."""
_PANELS = ("excess", "gap", "optimal", "iterations", "time")
_MOST_CELLS = 12
_MOST_COLUMNS = 6
_MOST_CURVES = 8


def draw_heat_maps(frame: pd.DataFrame, path: str | os.PathLike[str]) -> list[Path]:
    """Draw the heat maps of a study's runs as PNG, PDF or SVG, by the file's ending; returns the files.

    With several solvers each has a file, with its name before the ending. None is drawn where no parameter varies.
    """
    _require_runs(frame)
    path, drawn = Path(path), []
    parts = [(str(solver), part) for solver, part in frame.groupby("solver")]
    for solver, part in parts:
        if varied(part):
            # the solver's name comes from a file: it must not lead to another folder
            name = path.stem + ("" if len(parts) == 1 else "-" + re.sub(r"[^\w.-]", "_", solver))
            drawn.append(save_figure(path.with_name(name + path.suffix), heat_maps(part, new_figure())))
    return drawn


def draw_convergence(
    folder: str | os.PathLike[str], path: str | os.PathLike[str], frame: pd.DataFrame | None = None
) -> Path:
    """Draw how the runs of a study, or those in `frame`, converged, as PNG, PDF or SVG; returns the file."""
    frame = load(folder) if frame is None else frame
    _require_runs(frame)
    return save_figure(Path(path), convergence(frame, load_traces(folder), new_figure()))


def _require_runs(frame: pd.DataFrame) -> None:
    if frame.empty:
        raise InvalidInputError("the study has no runs yet, there is nothing to draw")


def new_figure() -> Any:
    """Return an empty figure that needs no screen and no pyplot."""
    figure = load_extra("matplotlib.figure", "plot").Figure(layout="constrained")
    load_extra("matplotlib.backends.backend_agg", "plot").FigureCanvasAgg(figure)
    return figure


def save_figure(path: Path, figure: Any) -> Path:
    """Write a figure in the format of its file's ending, whole or not at all; returns the path."""
    write_atomically(path, lambda file: figure.savefig(file, format=path.suffix[1:].lower() or "png", dpi=130))
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
        tables = [_cells(part, measure, across, up) for _, part in groups]
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

    The eight settings with the smallest mean excess are named, the others are grey. Returns the figure.
    """
    traces = with_excess(frame, traces)
    summary = summarize(frame).sort_values(["excess", "time"], kind="stable")
    names = varied(frame)
    several = frame["solver"].nunique() > 1
    figure.set_size_inches(11, 4.5)
    axes = figure.subplots(1, 2, sharey=True)
    for ax, column, unit in zip(axes, ("iteration", "seconds"), ("iteration", "ms"), strict=True):
        # drawn from the last to the first, so that the best lie on top
        for rank, row in reversed([*enumerate(summary.to_dict("records"))]):
            style: dict[str, Any] = {"color": "0.8", "linewidth": 0.8, "zorder": 1}
            if rank < _MOST_CURVES:
                line = {"color": colour(rank), "linestyle": DASHES[rank % len(DASHES)]}
                style = {**line, "linewidth": 1.6, "zorder": 3}
                style["label"] = setting_title(row, names, several)
            own = traces[traces["setting"] == row["setting"]]
            if not own.empty:
                ax.plot(*mean_excess(own, column), drawstyle="steps-post", **style)
        if column == "seconds" or traces[column].max() > 30:
            set_log_x(ax)
        else:
            ax.xaxis.get_major_locator().set_params(integer=True, min_n_ticks=1)
        ax.set_xlabel(unit)
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


def _cells(study: pd.DataFrame, measure: str, across: str, up: str) -> tuple[Array, Array, Array]:
    """The values of two parameters of one solver's runs, and means of a measure (ys, xs), NaN where there is no run."""
    xs, ys = (np.array(sorted(study[name].dropna().unique().tolist()), dtype=object) for name in (across, up))
    means = np.full((len(ys), len(xs)), np.nan)
    for (x, y), runs in study.groupby([across, up]):
        # settings that differ only in other parameters count as repeats
        runs = runs.assign(repeat=runs.groupby(["setting", "repeat"]).ngroup())
        means[[*ys].index(y), [*xs].index(x)] = FACTORS.get(measure, 1.0) * estimated(runs, measure)
    return xs, ys, means


def is_constant(known: Floats) -> bool:
    """Whether values are equal up to rounding, so that they need no colour scale."""
    return bool(known.size) and float(np.ptp(known)) <= 1e-9 * float(np.abs(known).max())


def colour_limits(known: Floats) -> tuple[float, float]:
    """Ends of the colour scale for these values."""
    if not known.size:
        return 0.0, 1.0
    low, high = float(known.min()), float(known.max())
    # equal values get one colour in all maps
    return (low - 1.0, high + 1.0) if is_constant(known) else (low, high)


def draw_cells(xs: Array, ys: Array, values: Floats, limits: tuple[float, float], *, ax: Any) -> Any:
    """Draw values (rows: ``ys``) with their numbers into axes; returns the image."""
    # the lightness of cividis grows evenly, also for colour-blind readers and in greyscale
    image = ax.imshow(values, origin="lower", aspect="auto", cmap="cividis", vmin=limits[0], vmax=limits[1])
    ax.set_xticks(range(len(xs)), [short_text(x) for x in xs])
    ax.set_yticks(range(len(ys)), [short_text(y) for y in ys])
    middle = sum(limits) / 2
    for (i, j), value in np.ndenumerate(values):
        if not np.isnan(value):
            color = "black" if value > middle else "white"
            ax.text(j, i, f"{value:.3g}", ha="center", va="center", fontsize=8, color=color)
    return image


def short_text(value: Any) -> str:
    """Return a parameter's value with four digits."""
    return f"{value:.4g}" if isinstance(value, (float, np.floating)) else str(value)
