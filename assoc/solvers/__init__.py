"""Interchangeable solvers of the S-D assignment problem, called through ``assign``.

A solver of your own is written with `Parameters`, `Run`, `Outcome`, `Packing` and `Cover`; `pheromone` shows the ants
at work. The last three are loaded on first use: names and parameters of solvers need no compiler.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from assoc._parameters import Parameters
from assoc._system.imports import lazy_names
from assoc.packing.run import Outcome, Run
from assoc.solvers.registry import names, parameters, register

if TYPE_CHECKING:
    from assoc.packing.cover import Cover
    from assoc.packing.packing import Packing
    from assoc.solvers.aco.pheromone_history import pheromone

__all__ = ["Cover", "Outcome", "Packing", "Parameters", "Run", "names", "parameters", "pheromone", "register"]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "assoc.packing.cover": "Cover",
        "assoc.packing.packing": "Packing",
        "assoc.solvers.aco.pheromone_history": "pheromone",
    },
)
