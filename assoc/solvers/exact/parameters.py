"""Parameters of the exact solver."""

from __future__ import annotations

from dataclasses import dataclass, field

from assoc._parameters import Parameters


@dataclass(frozen=True)
class ExactParameters(Parameters):
    """Parameters of the exact solver.

    Attributes
    ----------
    nodes : int
        Nodes of branch and bound at the most; what is then open keeps its gap.
    patience : int
        Iterations of tabu search and breeding without improvement on an open component of 150 measurements and more,
        for every 60 of them, before branching starts. While it is branched on, one more iteration follows every three
        turns, and less often, down to every 30 turns, where they bring nothing. Smaller components are branched on
        alone for a hundred turns.
    """

    nodes: int = field(default=100_000_000, metadata={"help": "nodes of branch and bound at the most"})
    patience: int = field(
        default=1, metadata={"help": "iterations of tabu search without improvement before branching starts"}
    )

    def __post_init__(self) -> None:
        self._whole("nodes", "patience", least=0)
