"""Which measurements, from several sensors, came from the same target, and which are false alarms?

The public names below are loaded on first use, so that ``import assoc`` stays quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from assoc._version import __version__
from assoc.errors import AssocError, InfeasibleError, InvalidInputError, LimitExceededError

if TYPE_CHECKING:
    from assoc import plotting, solvers, sweeps
    from assoc.association.associate import associate
    from assoc.association.association import Association
    from assoc.costs import build_problem
    from assoc.problem import AssignmentProblem
    from assoc.ranking.kbest import kbest
    from assoc.ranking.marginals import marginals
    from assoc.scene.scene import Scene
    from assoc.solution import Solution
    from assoc.solvers.assign import assign
    from assoc.solvers.warm_up import warm_up

__all__ = [
    "AssignmentProblem",
    "AssocError",
    "Association",
    "InfeasibleError",
    "InvalidInputError",
    "LimitExceededError",
    "Scene",
    "Solution",
    "__version__",
    "assign",
    "associate",
    "build_problem",
    "kbest",
    "marginals",
    "plotting",
    "solvers",
    "sweeps",
    "warm_up",
]

_HOME = {
    "AssignmentProblem": "assoc.problem",
    "Association": "assoc.association",
    "Scene": "assoc.scene",
    "Solution": "assoc.solution",
    "assign": "assoc.solvers.assign",
    "associate": "assoc.association",
    "build_problem": "assoc.costs",
    "kbest": "assoc.ranking.kbest",
    "marginals": "assoc.ranking.marginals",
    "warm_up": "assoc.solvers.warm_up",
}


def __getattr__(name: str) -> Any:
    """Load a public name from its home on first use (PEP 562)."""
    if name in _HOME:
        value = getattr(importlib.import_module(_HOME[name]), name)
    elif name in ("plotting", "solvers", "sweeps"):
        value = importlib.import_module(f"assoc.{name}")
    else:
        raise AttributeError(f"module 'assoc' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names, loaded or not."""
    return sorted({*globals(), *__all__})
