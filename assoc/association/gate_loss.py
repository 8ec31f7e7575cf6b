"""Bound of the loss by gating: cost of an association above the optimum of all tuples, gated or not."""

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


def bound_without_gates(scene: Scene, scan: Scan, gating: Mapping[str, Any], time_limit: float | None) -> float:
    """Lower bound of the cost of an association of any tuples of negative cost, gated or not.

    The cost of an association above it bounds the loss by gating (``ScanAssociation.gate_loss``). It is valid after any
    time, and better after a longer one (10 s without ``time_limit``); -infinite if there are more tuples than
    ``max_tuples`` without gates. ``gating`` is as for `assoc.build_problem`; its ``gate_probability`` has no effect.
    """
    try:
        everything = build_problem(scene, scan, **{**gating, "gate_probability": 1.0})
    except LimitExceededError:
        return -math.inf
    limit = _SECONDS if time_limit is None else time_limit
    return assign(everything, "exact", time_limit=limit, advise=False).lower_bound
