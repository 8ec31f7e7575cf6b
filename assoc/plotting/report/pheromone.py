"""The ants in a report: tau_j, eta_j and p_j of some tuples, cycle by cycle."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.association.scan import ScanAssociation
from assoc.plotting.report.views import number
from assoc.solvers.aco.pheromone_history import PheromoneHistory

# limits: cycles shown of a scan, and bytes of all scans
_CYCLES = 60
_BUDGET = 900_000


def add_pheromone(views: Sequence[dict[str, Any]], scans: Sequence[ScanAssociation]) -> None:
    """Attach what is shown of the ants to the views of scans, of fewer cycles where the budget asks for it."""
    most = _CYCLES
    shown = [_view(scan.pheromone, most) for scan in scans]
    while most > 2 and sum(len(json.dumps(view, separators=(",", ":"))) for view in shown) > _BUDGET:
        most //= 2
        shown = [_view(scan.pheromone, most) for scan in scans]
    for view, history in zip(views, shown, strict=True):
        view["ants"] = history


def _view(history: PheromoneHistory | None, most: int) -> dict[str, Any] | None:
    if history is None:
        return None
    count = len(history.cycles)
    # evenly spaced, the first and the last among them
    kept = np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int)) if count else np.zeros(0, int)
    return {
        "tuples": [f"({', '.join(map(str, row))})" for row in history.tuples.tolist()],
        "chosen": history.chosen.tolist(),
        "cycles": history.cycles[kept].tolist(),
        "pheromone": _numbers(history.pheromone[kept]),
        "visibility": _numbers(history.visibility[kept]),
        "probability": _numbers(100.0 * history.probability[kept]),
    }


def _numbers(values: Array) -> list[list[float | None]]:
    """Numbers with three digits; None where no ant has walked."""
    return [[number(float(f"{value:.3g}")) for value in row] for row in values.tolist()]
