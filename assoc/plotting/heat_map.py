"""A measure of a parameter study over two parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._types import Array, Floats
from assoc.sweeps.bootstrap import mean_interval, weighted_mean
from assoc.sweeps.summary import FACTORS, by_problem, measured, numbers

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
