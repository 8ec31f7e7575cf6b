"""Pictures: functions that draw into matplotlib axes (extra ``[plot]``), and the HTML reports (extra ``[report]``).

Each function takes ``ax=None`` and returns the axes; nothing is shown or saved. Loaded on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from assoc._system.imports import lazy_names

if TYPE_CHECKING:
    from assoc.plotting.convergence import plot_convergence
    from assoc.plotting.pheromone import plot_pheromone
    from assoc.plotting.scene import plot_scene
    from assoc.plotting.solution import plot_solution
    from assoc.plotting.tracks import plot_tracks

__all__ = [
    "plot_convergence",
    "plot_pheromone",
    "plot_scene",
    "plot_solution",
    "plot_tracks",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "convergence": "plot_convergence",
        "pheromone": "plot_pheromone",
        "scene": "plot_scene",
        "solution": "plot_solution",
        "tracks": "plot_tracks",
    },
)
