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
        Most nodes of branch and bound; components that are open then keep their gap.
    patience : int
        Iterations of tabu search and breeding without improvement before branching starts, on an open component of 150
        measurements and more, for every 60 of them. During branching one more iteration follows every three
        turns, and less often, down to every 30 turns, if they bring nothing. Smaller components are branched on
        alone for a hundred turns.
    gap : float
        Relative gap, of a component's weight, at which open components of 2,000 measurements and more end. They get no
        linear program, whose memory grows with the square of the measurements, and may be left with a wider gap. 0:
        components are searched to the proof, whatever their size.
    """

    nodes: int = field(default=100_000_000, metadata={"help": "largest number of nodes of branch and bound"})
    patience: int = field(
        default=1, metadata={"help": "iterations of tabu search without improvement before branching starts"}
    )

    gap: float = field(default=0.0, metadata={"help": "relative gap at which components of 2,000 measurements end"})

    def __post_init__(self) -> None:
        self._whole("nodes", "patience", least=0)
        self._number("gap", least=0.0)
