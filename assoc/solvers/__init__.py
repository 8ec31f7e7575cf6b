"""Interchangeable solvers of the S-D assignment problem; ``assign`` is the front door.

What a solver of your own is written with: `Parameters`, `Run`, `Outcome`, and `Packing` and `Cover`; `pheromone` shows
the ants at work. The last three are loaded on first use, so that who only asks for names and parameters loads no
compiler.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from assoc._parameters import Parameters
from assoc.packing.run import Outcome, Run
from assoc.solvers.registry import names, parameters, register

if TYPE_CHECKING:
    from assoc.packing.neighbourhoods.cover import Cover
    from assoc.packing.packing import Packing
    from assoc.solvers.pheromone_history import pheromone

__all__ = ["Cover", "Outcome", "Packing", "Parameters", "Run", "names", "parameters", "pheromone", "register"]

_HOME = {
    "Cover": "assoc.packing.neighbourhoods.cover",
    "Packing": "assoc.packing.packing",
    "pheromone": "assoc.solvers.pheromone_history",
}


def __getattr__(name: str) -> Any:
    """Load a public name from its home on first use (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module 'assoc.solvers' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names, loaded or not."""
    return sorted({*globals(), *__all__})
