"""A metric over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._text.times import UNIX
from assoc.errors import InvalidInputError
from assoc.plotting.axes import axes_or_new, legend
from assoc.plotting.colours import DASHES, colour, marker


@explains_wrong_types
def plot_metric(times: Any, values: Any, *, name: str, unit: str, ax: Any = None) -> Any:
    """Draw a metric, or several of one unit, over time.

    Parameters
    ----------
    times : array_like (K,)
        Seconds.
    values : array_like (K,), or mapping of names to such
        NaN where unknown.
    name, unit : str
        Labels of the vertical axis, such as "GOSPA" and "m".
    ax : matplotlib Axes, optional
        Where to draw; new ones without it.

    Returns
    -------
    Axes

    Raises
    ------
    InvalidInputError
        Values and times differ in length.
    """
    ax = axes_or_new(ax, (7.0, 3.5))
    at = np.asarray(times, dtype=np.float64)
    dated = at.size > 0 and bool(at.min() > UNIX)
    axis = (1e3 * at).round().astype("datetime64[ms]") if dated else at
    named = values.items() if isinstance(values, Mapping) else [("", values)]
    for number, (label, measured) in enumerate(named):
        series = np.asarray(measured, dtype=np.float64)
        if series.shape != at.shape or at.ndim != 1:
            raise InvalidInputError(f"values: expected the shape of times, {at.shape}, got {series.shape}")
        ax.plot(
            axis,
            series,
            linestyle=DASHES[number % len(DASHES)],
            color=colour(number),
            marker=marker(number),
            markersize=4,
            markevery=max(1, len(at) // 15),
            linewidth=1.4,
            label=label or None,
        )
    ax.set_xlabel("time (UTC)" if dated else "time (s)")
    ax.set_ylabel(f"{name} ({unit})")
    ax.grid(alpha=0.25, linewidth=0.6)
    legend(ax, bbox_to_anchor=(0.5, -0.2))
    return ax
