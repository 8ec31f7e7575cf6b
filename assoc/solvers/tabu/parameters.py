"""Parameters of tabu search."""

from __future__ import annotations

from dataclasses import dataclass, field

from assoc._parameters import Parameters


@dataclass(frozen=True)
class TabuParameters(Parameters):
    """Parameters of the tabu search.

    Attributes
    ----------
    tenure : int
        Moves for which an ejected tuple may not return; a random number up to as many again is added.
    moves : int
        Moves in one iteration.
    iterations : int
        Iterations on one component at the most.
    patience : int
        A component is left after so many iterations without improvement.
    restart : int
        After so many iterations without improvement the search goes back to the best solution and perturbs it.
    clusters : int
        Exact sub-steps at the end of an iteration on its best solution, and for every 30 measurements on the best
        of all (0: moves alone).
    """

    tenure: int = field(default=7, metadata={"help": "moves for which an ejected tuple may not return"})
    moves: int = field(default=100, metadata={"help": "moves in one iteration"})
    iterations: int = field(default=1000, metadata={"help": "iterations on one component at the most"})
    patience: int = field(default=150, metadata={"help": "iterations without improvement before a component is left"})
    restart: int = field(default=5, metadata={"help": "iterations without improvement before a restart"})
    clusters: int = field(default=10, metadata={"help": "exact sub-steps at the end of an iteration"})

    def __post_init__(self) -> None:
        self._whole("tenure", least=0, most=1_000_000)
        self._whole("moves", "iterations", "patience", "restart")
        self._whole("clusters", least=0)
