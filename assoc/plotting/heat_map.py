"""A measure of a parameter study over two parameters, as a heat map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array, Floats
from assoc.errors import InvalidInputError
from assoc.plotting.axes import axes_or_new
from assoc.sweeps.bootstrap import mean_interval, weighted_mean
from assoc.sweeps.summary import FACTORS, by_problem, measured, numbers, varied

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


@explains_wrong_types
def plot_heat_map(
    study: pd.DataFrame, measure: str = "gap", parameters: Sequence[str] | None = None, *, ax: Any = None
) -> Any:
    """Draw the mean of a measure over two parameters, each with its 95 % interval.

    Parameters
    ----------
    study : DataFrame
        Runs of one solver, from ``assoc.sweeps.load``.
    measure : str
        "excess" (over the best known cost), "gap", "optimal", "iterations", "time", "cost" or "correct".
    parameters : sequence of two str, optional
        Horizontal and vertical; default: the first two that vary. Means are over all others.
    ax : matplotlib Axes, optional
        Where to draw; new ones without it.

    Returns
    -------
    Axes

    Raises
    ------
    InvalidInputError
        There is no such measure or parameter, or fewer than two parameters vary.
    """
    if measure not in LABELS:
        raise InvalidInputError(f"measure: expected one of {', '.join(LABELS)}, got {measure!r}")
    names = [*(varied(study) if parameters is None else parameters)]
    if len(names) < 2 or (parameters is not None and len(names) != 2):
        raise InvalidInputError(f"parameters: a heat map needs two that vary, got {names}")
    across, up = names[:2]
    for name in (across, up):
        if name not in study.columns:
            raise InvalidInputError(f"parameters: the study has no {name!r}")
    xs, ys, middle, low, high = cells(study, measure, across, up)
    ax = axes_or_new(ax)
    texts = np.full(middle.shape, "", dtype=object)
    for cell, value in np.ndenumerate(middle):
        if not np.isnan(value):
            texts[cell] = f"{value:.3g}\n{low[cell]:.3g} .. {high[cell]:.3g}"
    known = middle[~np.isnan(middle)]
    image = draw_cells(xs, ys, middle, colour_limits(known), ax=ax, texts=texts)
    if is_constant(known):
        ax.set_title(f"{LABELS[measure]}: {known[0]:.4g} everywhere", fontsize=10)
    else:
        ax.figure.colorbar(image, ax=ax, label=LABELS[measure])
    ax.set_xlabel(across)
    ax.set_ylabel(up)
    return ax


def cells(
    study: pd.DataFrame, measure: str, across: str, up: str, *, intervals: bool = True
) -> tuple[Array, Array, Array, Array, Array]:
    """Means and 95 % intervals of a measure over two parameters of one solver's runs, in displayed units.

    Returns the parameters' values, and middle, low and high (ys, xs), NaN where there is no run. Intervals take most of
    the time; without them they are NaN.
    """
    factor = FACTORS.get(measure, 1.0)
    xs, ys = (np.array(sorted(study[name].dropna().unique().tolist()), dtype=object) for name in (across, up))
    middle, low, high = (np.full((len(ys), len(xs)), np.nan) for _ in range(3))
    for (x, y), runs in study.groupby([across, up]):
        cell = [*ys].index(y), [*xs].index(x)
        # settings that differ only in other parameters count as repeats
        runs = runs.assign(repeat=runs.groupby(["setting", "repeat"]).ngroup())
        table = by_problem(runs, measured(runs, measure))
        weights = by_problem(runs, numbers(runs["true_tuples"])) if measure == "correct" else None
        middle[cell] = factor * weighted_mean(table, weights)
        if intervals:
            low[cell], high[cell] = (factor * end for end in mean_interval(table, weights))
    return xs, ys, middle, low, high


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


def draw_cells(
    xs: Array, ys: Array, values: Floats, limits: tuple[float, float], *, ax: Any, texts: Array | None = None
) -> Any:
    """Draw values (rows: ``ys``) with their numbers, or with given texts, into axes; returns the image."""
    # the lightness of cividis grows evenly, also for colour-blind readers and in greyscale
    image = ax.imshow(values, origin="lower", aspect="auto", cmap="cividis", vmin=limits[0], vmax=limits[1])
    ax.set_xticks(range(len(xs)), [short_text(x) for x in xs])
    ax.set_yticks(range(len(ys)), [short_text(y) for y in ys])
    middle = sum(limits) / 2
    for (i, j), value in np.ndenumerate(values):
        if not np.isnan(value):
            color = "black" if value > middle else "white"
            text = f"{value:.3g}" if texts is None else texts[i, j]
            ax.text(j, i, text, ha="center", va="center", fontsize=8, color=color)
    return image


def short_text(value: Any) -> str:
    """Return a parameter's value with four digits."""
    return f"{value:.4g}" if isinstance(value, (float, np.floating)) else str(value)
