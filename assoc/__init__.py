"""Which measurements, from several sensors, came from the same target, and which are false alarms?

The public names below are loaded on first use, so that ``import assoc`` is quick.
"""

from assoc._system import first_import as _first_import  # noqa: F401

# isort: split

from typing import TYPE_CHECKING

from assoc._system.imports import lazy_names
from assoc._version import __version__
from assoc.errors import AssocError, AssocWarning, InfeasibleError, InvalidInputError, LimitExceededError

if TYPE_CHECKING:
    from assoc import (
        filters,
        metrics,
        plotting,
        proofs,
        recordings,
        registration,
        sensors,
        simulation,
        solvers,
        sweeps,
        tracking,
    )
    from assoc.association.associate import associate
    from assoc.association.association import Association
    from assoc.association.link import link
    from assoc.association.source import load
    from assoc.costs import build_problem
    from assoc.problem import AssignmentProblem
    from assoc.ranking.kbest import kbest
    from assoc.ranking.marginals import marginals
    from assoc.scene.scene import Scene
    from assoc.solution import Solution
    from assoc.solvers.assign import assign
    from assoc.tracking.warm_up import warm_up

__all__ = [
    "AssignmentProblem",
    "AssocError",
    "AssocWarning",
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
    "filters",
    "kbest",
    "link",
    "load",
    "marginals",
    "metrics",
    "plotting",
    "proofs",
    "recordings",
    "registration",
    "sensors",
    "simulation",
    "solvers",
    "sweeps",
    "tracking",
    "warm_up",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "": "filters metrics plotting proofs recordings registration sensors simulation solvers sweeps tracking",
        "association": "Association associate link",
        "association.source": "load",
        "costs": "build_problem",
        "problem": "AssignmentProblem",
        "ranking.kbest": "kbest",
        "ranking.marginals": "marginals",
        "scene": "Scene",
        "solution": "Solution",
        "solvers.assign": "assign",
        "tracking.warm_up": "warm_up",
    },
)
