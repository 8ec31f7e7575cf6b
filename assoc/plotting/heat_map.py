"""A parameter study as a heat map whose cells carry their intervals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.plotting.axes import axes_or_new
from assoc.plotting.study_figures import FACTORS, PANELS, limits_of, short
from assoc.plotting.study_figures import heat_map as draw_map
from assoc.sweeps.bootstrap import mean_interval, weighted_mean
from assoc.sweeps.summary import by_problem, measured, numbers, varied

if TYPE_CHECKING:
    import pandas as pd


MEASURES = {**dict(PANELS), "cost": "mean cost, nats", "correct": "correct, %"}


def plot_heat_map(
    study: pd.DataFrame, measure: str = "gap", parameters: Sequence[str] | None = None, *, ax: Any = None
) -> Any:
    """Draw the mean of a measure over two parameters, each with its 95 % interval.

    Parameters
    ----------
    study : DataFrame
        Runs, of ``assoc.sweeps.load``; of one solver.
    measure : str
        "gap", "optimal", "iterations", "time", "cost" or "correct".
    parameters : sequence of two str, optional
        Across and up; without them the first two that vary. Runs are averaged over all others.
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
    if measure not in MEASURES:
        raise InvalidInputError(f"measure: expected one of {', '.join(MEASURES)}, got {measure!r}")
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
    for place, value in np.ndenumerate(middle):
        if not np.isnan(value):
            texts[place] = f"{value:.3g}\n{low[place]:.3g} .. {high[place]:.3g}"
    known = middle[~np.isnan(middle)]
    image = draw_map(xs, ys, middle, limits_of(known) if known.size else (0.0, 1.0), ax=ax, texts=texts)
    ax.figure.colorbar(image, ax=ax, label=MEASURES[measure])
    ax.set_xlabel(across)
    ax.set_ylabel(up)
    return ax


def cells(study: pd.DataFrame, measure: str, across: str, up: str) -> tuple[Array, Array, Array, Array, Array]:
    """Means and 95 % intervals of a measure over two parameters, in the units in which it is shown.

    Returns
    -------
    xs, ys : arrays of the parameters' values
    middle, low, high : float arrays (ys, xs)
        NaN where there is no run.
    """
    factor = FACTORS.get(measure, 1.0)
    xs, ys = (np.array(sorted(study[name].dropna().unique().tolist()), dtype=object) for name in (across, up))
    middle, low, high = (np.full((len(ys), len(xs)), np.nan) for _ in range(3))
    for (x, y), runs in study.groupby([across, up]):
        place = [*ys].index(y), [*xs].index(x)
        # settings that differ in other parameters are further repeats here
        runs = runs.assign(repeat=runs.groupby(["setting", "repeat"]).ngroup())
        table = by_problem(runs, measured(runs, measure))
        weights = by_problem(runs, numbers(runs["true_tuples"])) if measure == "correct" else None
        middle[place] = factor * weighted_mean(table, weights)
        low[place], high[place] = (factor * end for end in mean_interval(table, weights))
    return xs, ys, middle, low, high


__all__ = ["MEASURES", "cells", "plot_heat_map", "short"]
