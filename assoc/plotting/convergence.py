"""Convergence of cost and lower bound."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InvalidInputError
from assoc.plotting.axes import axes_or_new, legend, set_log_x
from assoc.plotting.colours import colour, marker
from assoc.solution import Solution

_ROUNDING = 1e-6
_UNITS = {"iteration": "iteration (number)", "time": "time (ms)"}


@explains_wrong_types
def plot_convergence(
    solutions: Solution | Mapping[str, Solution], *, over: Literal["iteration", "time"] = "iteration", ax: Any = None
) -> Any:
    """Draw the cost of the best solution known and the lower bound; the optimum lies between them.

    Parameters
    ----------
    solutions : Solution, or mapping of names to solutions
        Several solutions must belong to one problem; they share the axes.
    over : {"iteration", "time"}
    ax : matplotlib Axes, optional
        Where to draw; new ones without it.

    Returns
    -------
    Axes
    """
    if over not in _UNITS:
        raise InvalidInputError(f"over: expected iteration or time, got {over!r}")
    named = {solutions.solver: solutions} if isinstance(solutions, Solution) else dict(solutions)
    if not named:
        raise InvalidInputError("solutions: expected at least one, got none")
    ax = axes_or_new(ax)
    for number, (name, solution) in enumerate(named.items()):
        # the final bound belongs to the end of the run
        last = (solution.iterations, solution.runtime, solution.cost, solution.lower_bound)
        points = np.array([*solution.trace, last], dtype=np.float64)
        x = points[:, 0] if over == "iteration" else 1e3 * points[:, 1]
        # a solver may report a weaker bound later: the best one so far counts
        bound = np.maximum.accumulate(np.where(np.isfinite(points[:, 3]), points[:, 3], -np.inf))
        bound[~np.isfinite(bound)] = np.nan
        style = {"color": colour(number), "markersize": 4, "drawstyle": "steps-post", "marker": marker(number)}
        style["markevery"] = max(1, len(x) // 15)
        ax.plot(x, points[:, 2], "-", label=f"{name}: cost", **style)
        ax.plot(x, bound, "--", label=f"{name}: lower bound", markerfacecolor="none", **style)
        ax.fill_between(x, bound, points[:, 2], step="post", color=colour(number), alpha=0.12, linewidth=0)
    low, high = ax.dataLim.intervaly
    if high - low <= _ROUNDING * max(1.0, abs(low), abs(high)):
        # the optimum was certified at once: rounding errors must not fill the axis
        ax.set_ylim(low - 1.0, high + 1.0)
    ax.ticklabel_format(axis="y", useOffset=False)
    if over == "iteration":
        ax.xaxis.get_major_locator().set_params(integer=True)
    else:
        set_log_x(ax)
    ax.set_xlabel(_UNITS[over])
    ax.set_ylabel("cost (nats)")
    ax.grid(alpha=0.25, linewidth=0.6)
    legend(ax)
    return ax
