"""Parameters of the greedy solver."""

from __future__ import annotations

from dataclasses import dataclass

from assoc._parameters import Parameters


@dataclass(frozen=True)
class GreedyParameters(Parameters):
    """Greedy has no parameters."""
