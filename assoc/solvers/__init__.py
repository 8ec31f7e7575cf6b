"""Interchangeable solvers of the S-D assignment problem; ``assign`` is the front door."""

from assoc.solvers.registry import names, parameters, register
from assoc.solvers.run import Outcome, Parameters, Run

__all__ = ["Outcome", "Parameters", "Run", "names", "parameters", "register"]
