"""Pheromone, visibility and probability of tuples over the cycles of the ant colony."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InvalidInputError
from assoc.plotting.axes import axes_or_new, legend
from assoc.plotting.colours import VERMILION

if TYPE_CHECKING:
    from assoc.solvers.aco.pheromone_history import PheromoneHistory

_NAMED = 40
_LABELS = {
    "pheromone": "share of all pheromone (%)",
    "visibility": "share of all visibility (%)",
    "probability": "probability to be drawn (%)",
}


@explains_wrong_types
def plot_pheromone(history: PheromoneHistory, *, of: str = "pheromone", nodes: int = 25, ax: Any = None) -> Any:
    """Draw how the pheromone increases on some tuples and evaporates from the others.

    Parameters
    ----------
    history : PheromoneHistory
        From ``assoc.solvers.pheromone``.
    of : {"pheromone", "visibility", "probability"}
        tau_j or eta_j, as shares of their sums over all tuples, or p_j of eq. 8.
    nodes : int
        Number of tuples shown: first the chosen ones, then those with the most pheromone in the end.
    ax : matplotlib Axes, optional
        Where to draw; new ones without it.

    Returns
    -------
    Axes

    Raises
    ------
    InvalidInputError
        ``of`` is not one of the three.
    """
    if of not in _LABELS:
        raise InvalidInputError(f"of: expected {', '.join(_LABELS)}, got {of!r}")
    ax = axes_or_new(ax)
    shown = history.top(nodes)
    values = getattr(shown, of)
    if of != "probability":
        values = values / np.maximum(np.nansum(getattr(history, of), axis=1, keepdims=True), 1e-300)
    # chosen tuples on top, sorted by pheromone
    values, chosen = values[:, ::-1], np.flatnonzero(shown.chosen[::-1])
    cycles = history.cycles
    edges = (float(cycles[0]) - 0.5, float(cycles[-1]) + 0.5) if len(cycles) else (0.5, 1.5)
    count = len(shown.tuples)
    image = ax.imshow(
        100.0 * values.T,
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        cmap="cividis",
        extent=(*edges, -0.5, count - 0.5),
    )
    ax.figure.colorbar(image, ax=ax, label=_LABELS[of])
    ax.plot(np.full(chosen.size, edges[1]), chosen, "<", color=VERMILION, markersize=7, clip_on=False, label="chosen")
    if count <= _NAMED:
        names = [f"({', '.join(map(str, row))})" for row in shown.tuples[::-1].tolist()]
        ax.set_yticks(range(count), names, fontsize=7)
    ax.xaxis.get_major_locator().set_params(integer=True)
    ax.set_xlabel("cycle (number)")
    ax.set_ylabel("tuple (measurement of each sensor, 0: missed)")
    legend(ax)
    return ax
