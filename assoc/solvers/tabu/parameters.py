"""Parameters of tabu search."""

from __future__ import annotations

from dataclasses import dataclass, field

from assoc.solvers.search_parameters import SearchParameters


@dataclass(frozen=True)
class TabuParameters(SearchParameters):
    """Parameters of the tabu search, beside those of `SearchParameters`.

    Attributes
    ----------
    tenure : int
        Moves for which an ejected tuple may not return; a random number of up to as many is added.
    moves : int
        Moves of one iteration.
    restart : int
        Iterations without improvement after which the search goes back to the best solution and perturbs it.
    """

    tenure: int = field(default=7, metadata={"help": "moves for which an ejected tuple may not return"})
    moves: int = field(default=100, metadata={"help": "moves in one iteration"})
    restart: int = field(default=5, metadata={"help": "iterations without improvement before a restart"})

    def __post_init__(self) -> None:
        super().__post_init__()
        self._whole("tenure", least=0, most=1_000_000)
        self._whole("moves", most=100_000)
        self._whole("restart")
