"""Parameters of tabu search."""

from __future__ import annotations

from dataclasses import dataclass

from assoc._parameters import described
from assoc.solvers.search_parameters import SearchParameters


@dataclass(frozen=True)
class TabuParameters(SearchParameters):
    """Parameters of the tabu search, beside those of `SearchParameters`."""

    tenure: int = described(7, "moves for which an ejected tuple may not return, and a random number of up to as many")
    moves: int = described(100, "moves in one iteration")
    restart: int = described(
        5, "iterations without improvement before it goes back to the best solution and perturbs it"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self._whole("tenure", least=0, most=1_000_000)
        self._whole("moves", most=100_000)
        self._whole("restart")
