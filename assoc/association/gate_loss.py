"""What gates may have cost: how far an association can be above the optimum of all tuples, gated or not."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from assoc.costs import build_problem
from assoc.errors import LimitExceededError
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.solvers.assign import assign

# seconds for the bound where the user set no limit
_SECONDS = 10.0


def gate_loss(scene: Scene, scan: Scan, cost: float, gating: Mapping[str, Any], time_limit: float | None) -> float:
    """Bound from above what an association of this cost loses to the best one of all tuples of negative cost.

    Parameters
    ----------
    scene, scan
    cost : float
        Of the association that was found with the gates.
    gating : mapping
        Options of `assoc.build_problem`, of which ``gate_probability`` has no effect.
    time_limit : float, optional
        Seconds for the bound; 10 without one. It is valid after any time, and better after a longer one.

    Returns
    -------
    float
        In the unit of costs, 0 or more; infinite if there are more tuples than ``max_tuples`` without gates.
    """
    try:
        everything = build_problem(scene, scan, **{**gating, "gate_probability": 1.0})
    except LimitExceededError:
        return math.inf
    limit = _SECONDS if time_limit is None else time_limit
    return max(0.0, cost - assign(everything, "exact", time_limit=limit, advise=False).lower_bound)
