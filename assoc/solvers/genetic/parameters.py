"""Parameters of the genetic algorithm."""

from __future__ import annotations

from dataclasses import dataclass

from assoc._parameters import described, is_whole
from assoc.solvers.search_parameters import SearchParameters


@dataclass(frozen=True)
class GeneticParameters(SearchParameters):
    """Parameters of the genetic algorithm, beside those of `SearchParameters`."""

    population: int = described(20, "solutions that live at a time")
    offspring: int = described(5, "children in a generation")
    tournament: int = described(2, "a parent is the best of so many members drawn at random")

    def __post_init__(self) -> None:
        super().__post_init__()
        self._whole("population", least=2, most=100_000)
        self._whole("offspring", most=100_000)
        good = is_whole(self.tournament, 1, self.population)
        self._require(good, "tournament", "a whole number from 1 to population")

    def memory(self, num_columns: int, num_rows: int) -> tuple[float, str, str] | None:
        """Memory of the members, as a list and as an array, for every worker."""
        what = f"population = {self.population} on {num_rows} measurements"
        members = 8.0 * self.population * num_rows * self.workers
        threads = super().memory(num_columns, num_rows)
        if threads is None:
            return members, what, "take a smaller population"
        return members + threads[0], f"{what} with {threads[1]}", f"take a smaller population, or {threads[2][5:]}"
