"""The pheromone of the ant colony over its cycles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from assoc.plotting.axes import axes_or_new, legend
from assoc.plotting.colours import VERMILION

if TYPE_CHECKING:
    from assoc.solvers.aco.pheromone_history import PheromoneHistory

_NAMED = 40


def plot_pheromone(history: PheromoneHistory, *, nodes: int = 25, ax: Any = None) -> Any:
    """Draw how the pheromone increases on some tuples and evaporates from the others.

    Parameters
    ----------
    history : PheromoneHistory
        Of ``assoc.solvers.aco.pheromone_history.pheromone_history``.
    nodes : int
        So many nodes are shown, those with the most pheromone in the end and those chosen first.
    ax : matplotlib Axes, optional
        Where to draw; new ones without it.

    Returns
    -------
    Axes
    """
    ax = axes_or_new(ax)
    last = history.pheromone[-1] if len(history.pheromone) else np.zeros(len(history.tuples))
    shown = np.lexsort((-last, ~history.chosen))[:nodes]
    # on top what was chosen, in the order of its pheromone
    shown = shown[::-1]
    share = history.pheromone[:, shown] / np.maximum(history.pheromone.sum(axis=1, keepdims=True), 1e-300)
    cycles = history.cycles
    edges = (float(cycles[0]) - 0.5, float(cycles[-1]) + 0.5) if len(cycles) else (0.5, 1.5)
    image = ax.imshow(
        100.0 * share.T,
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        cmap="cividis",
        extent=(*edges, -0.5, len(shown) - 0.5),
    )
    ax.figure.colorbar(image, ax=ax, label="share of all pheromone (%)")
    chosen = np.flatnonzero(history.chosen[shown])
    ax.plot(np.full(chosen.size, edges[1]), chosen, "<", color=VERMILION, markersize=7, clip_on=False, label="chosen")
    if len(shown) <= _NAMED:
        names = [f"({', '.join(map(str, row))})" for row in history.tuples[shown].tolist()]
        ax.set_yticks(range(len(shown)), names, fontsize=7)
    ax.xaxis.get_major_locator().set_params(integer=True)
    ax.set_xlabel("cycle (number)")
    ax.set_ylabel("tuple (measurement of each sensor, 0: missed)")
    legend(ax)
    return ax
