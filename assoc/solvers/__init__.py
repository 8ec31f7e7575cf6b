"""Interchangeable solvers of the S-D assignment problem; ``assign`` is the front door."""

from assoc._parameters import Parameters
from assoc.packing.run import Outcome, Run
from assoc.solvers.registry import names, parameters, register

__all__ = ["Outcome", "Parameters", "Run", "names", "parameters", "register"]
