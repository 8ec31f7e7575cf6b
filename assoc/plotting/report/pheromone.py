"""The ants in a report: tau_j, eta_j and p_j of some tuples over the cycles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.plotting.report.figures import Dicts, evenly, layout, menu, sliding, within_budget
from assoc.solvers.aco.pheromone_history import PheromoneHistory

_CYCLES = 60
_TUPLES = 25
_BUDGET = 900_000
_KINDS = {"pheromone": "pheromone", "visibility": "visibility", "probability": "probability to be drawn, %"}


def pheromone_figure(histories: Sequence[tuple[str, PheromoneHistory]]) -> Dicts:
    """Heat maps over tuples and cycles, with a slider over the scans (their names, and what the ants did)."""
    steps = [(name, _maps(history)) for name, history in histories]
    bar = {"thickness": 12}
    data: list[Dicts] = [
        {"type": "heatmap", "name": kind, "visible": kind == "pheromone", "colorscale": "Cividis", "colorbar": bar,
         "hovertemplate": "%{y}<br>cycle %{x}: %{z:.3g}<extra></extra>"}
        for kind in _KINDS
    ]  # fmt: skip
    choices = [(text, [{"visible": [kind == one for one in _KINDS]}]) for kind, text in _KINDS.items()]
    chosen = menu(choices, 0.0) | {"y": -0.16, "yanchor": "top", "direction": "up"}
    shown = layout(
        "cycle", "tuple", height="high", showlegend=False, updatemenus=[chosen],
        yaxis={"type": "category", "autorange": "reversed"}, margin={"b": 80},
    )  # fmt: skip
    kept = [steps[i] for i in evenly(len(steps))]
    return sliding({"data": data, "layout": shown}, within_budget(kept, _BUDGET))


def _maps(history: PheromoneHistory) -> list[Dicts]:
    top = history.top(_TUPLES)
    count = len(history.cycles)
    # evenly spaced, the first and the last among them
    kept = np.unique(np.linspace(0, count - 1, min(count, _CYCLES)).round().astype(int)) if count else np.zeros(0, int)
    rows = zip(top.tuples.tolist(), top.chosen.tolist(), strict=True)
    names = [f"({', '.join(map(str, row))}){' chosen' if chosen else ''}" for row, chosen in rows]
    x: list[Any] = top.cycles[kept].tolist()
    values = (top.pheromone, top.visibility, 100.0 * top.probability)
    return [{"x": x, "y": names, "z": _numbers(value[kept].T)} for value in values]


def _numbers(values: Array) -> list[list[float | None]]:
    """Numbers with three digits; None where no ant has walked."""
    return [[float(f"{value:.3g}") if np.isfinite(value) else None for value in row] for row in values.tolist()]
