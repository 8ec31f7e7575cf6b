"""Figures of a study: where in the design it is good, and how its settings converge."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assoc._files.output import write_atomically
from assoc._system.extras import load_extra
from assoc.errors import InvalidInputError
from assoc.sweeps.excess import mean_excess, with_excess
from assoc.sweeps.frame import load, load_traces
from assoc.sweeps.summary import measured, summarize, varied

if TYPE_CHECKING:
    import pandas as pd

PANELS = (("gap", "mean gap"), ("optimal", "certified optimal, %"), ("iterations", "mean iterations"), ("time", "ms"))
FACTORS = {"optimal": 100.0, "correct": 100.0, "time": 1e3}
_MOST_CELLS = 12
_MOST_COLUMNS = 6
_MOST_CURVES = 8


def draw(folder: str | os.PathLike[str], frame: pd.DataFrame | None = None) -> list[Path]:
    """Draw the heat maps and the convergence curves of a study into its folder.

    Parameters
    ----------
    folder : path-like
    frame : DataFrame, optional
        The runs to show; all of the study without it.

    Returns
    -------
    list of Path
        ``heatmap.png`` (one a solver, with its name, if there are several) and ``convergence.png``.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    InvalidInputError
        A file cannot be written, or the study has no runs.
    """
    frame = load(folder) if frame is None else frame
    if frame.empty:
        raise InvalidInputError(f"{folder}: the study has no runs yet, there is nothing to draw")
    parts = [(str(solver), part) for solver, part in frame.groupby("solver")]
    drawn = []
    for solver, part in parts:
        if not varied(part):
            continue
        name = "heatmap.png" if len(parts) == 1 else f"heatmap-{solver}.png"
        drawn.append(_save(Path(folder) / name, heat_maps(part, new_figure())))
    drawn.append(_save(Path(folder) / "convergence.png", convergence(frame, load_traces(folder), new_figure())))
    return drawn


def new_figure() -> Any:
    """Return an empty figure that belongs to nobody's screen: no pyplot in a program.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    figure = load_extra("matplotlib.figure", "plot").Figure(layout="constrained")
    load_extra("matplotlib.backends.backend_agg", "plot").FigureCanvasAgg(figure)
    return figure


def _save(path: Path, figure: Any) -> Path:
    write_atomically(path, lambda file: figure.savefig(file, format="png", dpi=130))
    return path


def heat_maps(frame: pd.DataFrame, figure: Any) -> Any:
    """Draw each measure over two parameters, side by side for the values of the others.

    With one parameter, or with more values than a map can hold, the measures are drawn over each parameter.

    Parameters
    ----------
    frame : DataFrame
        Runs of one solver.
    figure : matplotlib.figure.Figure
        Empty.

    Returns
    -------
    Figure
        The same.
    """
    names = varied(frame)
    panels = [(name, title) for name, title in PANELS if not np.isnan(measured(frame, name)).all()]
    numeric = [name for name in names if frame[name].dtype.kind in "iuf"]
    if len(numeric) < 2 or any(frame[name].nunique() > _MOST_CELLS for name in names):
        return _over_each(summarize(frame), names, panels, figure)
    across, up = numeric[0], numeric[1]
    others = [name for name in names if name not in (across, up)]
    groups: list[tuple[str, pd.DataFrame]] = [("", frame)]
    if others and frame.groupby(others).ngroups <= _MOST_COLUMNS:
        groups = [
            (", ".join(f"{n} {short(v)}" for n, v in zip(others, values, strict=True)), part)
            for values, part in frame.groupby(others)
        ]
    elif others:
        groups = [(f"mean over {', '.join(others)}", frame)]
    figure.set_size_inches(1.6 + 2.6 * len(groups), 0.6 + 2.3 * len(panels))
    axes = figure.subplots(len(panels), len(groups), squeeze=False)
    for row, (measure, title) in zip(axes, panels, strict=True):
        tables = [_table(part, measure, across, up) for _, part in groups]
        known = np.concatenate([values[~np.isnan(values)] for _, _, values in tables])
        limits = limits_of(known)
        for ax, (label, _), (xs, ys, values) in zip(row, groups, tables, strict=True):
            image = heat_map(xs, ys, values, limits, ax=ax)
            ax.set_xlabel(across)
            ax.set_ylabel(up)
            ax.set_title(label, fontsize=9)
        figure.colorbar(image, ax=list(row), label=title)
    return figure


def limits_of(values: NDArray[np.float64]) -> tuple[float, float]:
    """Ends of the colour scale for values of which at least one is known."""
    low, high = float(values.min()), float(values.max())
    # equal values get one colour in all maps
    return (low, high) if low < high else (low - 0.5, high + 0.5)


def heat_map(
    xs: NDArray[Any],
    ys: NDArray[Any],
    values: NDArray[np.float64],
    limits: tuple[float, float],
    *,
    ax: Any,
    texts: NDArray[Any] | None = None,
) -> Any:
    """Draw values (rows: ``ys``) with their numbers, or with given texts, into axes; returns the image."""
    # cividis grows lighter evenly, also to colour-blind eyes and on grey paper
    image = ax.imshow(values, origin="lower", aspect="auto", cmap="cividis", vmin=limits[0], vmax=limits[1])
    ax.set_xticks(range(len(xs)), [short(x) for x in xs])
    ax.set_yticks(range(len(ys)), [short(y) for y in ys])
    middle = sum(limits) / 2
    for (i, j), value in np.ndenumerate(values):
        if not np.isnan(value):
            color = "black" if value > middle else "white"
            text = f"{value:.3g}" if texts is None else texts[i, j]
            ax.text(j, i, text, ha="center", va="center", fontsize=8, color=color)
    return image


def _table(frame: pd.DataFrame, measure: str, across: str, up: str) -> tuple[Any, Any, NDArray[np.float64]]:
    values = frame.assign(value=FACTORS.get(measure, 1.0) * measured(frame, measure))
    table = values.pivot_table(index=up, columns=across, values="value", aggfunc="mean", dropna=False)
    return table.columns.to_numpy(), table.index.to_numpy(), table.to_numpy(dtype=float)


def _over_each(summary: pd.DataFrame, names: list[str], panels: list[tuple[str, str]], figure: Any) -> Any:
    """Draw each measure with its interval over each parameter."""
    figure.set_size_inches(0.6 + 3.2 * len(names), 0.6 + 2.3 * len(panels))
    axes = figure.subplots(len(panels), len(names), squeeze=False, sharex="col", sharey="row")
    for row, (measure, title) in zip(axes, panels, strict=True):
        factor = FACTORS.get(measure, 1.0)
        middle = factor * summary[measure].to_numpy(dtype=float)
        low, high = (factor * summary[f"{measure}_{end}"].to_numpy(dtype=float) for end in ("low", "high"))
        spread = np.maximum(0.0, np.stack([middle - low, high - middle]))
        for ax, name in zip(row, names, strict=True):
            column = summary[name]
            places = column if column.dtype.kind in "iuf" else column.astype(str)
            ax.errorbar(places, middle, yerr=spread, fmt="o", markersize=4, linewidth=1, capsize=2)
            ax.grid(alpha=0.3)
        row[0].set_ylabel(title)
    for ax, name in zip(axes[-1], names, strict=True):
        ax.set_xlabel(name)
    return figure


def convergence(frame: pd.DataFrame, traces: pd.DataFrame, figure: Any) -> Any:
    """Draw the mean cost above the best known, over iterations and over time, one curve a setting.

    The eight settings of least mean gap are named, the others are grey.

    Parameters
    ----------
    frame, traces : DataFrame
        Of `load` and `load_traces`.
    figure : matplotlib.figure.Figure
        Empty.

    Returns
    -------
    Figure
        The same.
    """
    traces = with_excess(frame, traces)
    summary = summarize(frame).sort_values(["gap", "time"], kind="stable")
    names = varied(frame)
    several = frame["solver"].nunique() > 1
    figure.set_size_inches(11, 4.5)
    axes = figure.subplots(1, 2, sharey=True)
    for ax, column, label in zip(axes, ("iteration", "seconds"), ("iteration", "ms"), strict=True):
        # drawn from the last to the first, so that the best lie on top
        for place, row in reversed([*enumerate(summary.to_dict("records"))]):
            style: dict[str, Any] = {"color": "0.8", "linewidth": 0.8, "zorder": 1}
            if place < _MOST_CURVES:
                style = {"color": f"C{place}", "linewidth": 1.6, "zorder": 3, "label": title(row, names, several)}
            curve(traces[traces["setting"] == row["setting"]], column, ax=ax, **style)
        if column == "seconds" or traces[column].max() > 30:
            ax.set_xscale("log")
        ax.set_xlabel(label)
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("mean cost above the best known")
    axes[0].set_yscale("symlog", linthresh=1e-3)
    # where all settings find the best at once the curves lie on the axis, which still needs a height
    axes[0].set_ylim(-1e-4, None if traces["excess"].max() > 0.0 else 1e-2)
    handles, labels = axes[1].get_legend_handles_labels()
    axes[1].legend(handles[::-1], labels[::-1], fontsize=7)
    return figure


def title(row: Mapping[Any, Any], names: Sequence[str], several: bool) -> str:
    """Return what a setting (a row of a summary) is called among the others of its study."""
    words = [str(row["solver"])] if several or not names else []
    words += [f"{n} {short(row[n])}" for n in names if row[n] == row[n] and row[n] is not None]
    return ", ".join(words)


def curve(traces: pd.DataFrame, column: str, *, ax: Any, **style: Any) -> None:
    """Draw the mean excess of runs over iterations or milliseconds; see `mean_excess`."""
    if not traces.empty:
        ax.plot(*mean_excess(traces, column), drawstyle="steps-post", **style)


def short(value: Any) -> str:
    """Return a parameter's value with four digits."""
    return f"{value:.4g}" if isinstance(value, (float, np.floating)) else str(value)
