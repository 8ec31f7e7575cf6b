"""Parameters of the genetic algorithm."""

from __future__ import annotations

from dataclasses import dataclass, field

from assoc._parameters import is_whole
from assoc.solvers.search_parameters import SearchParameters


@dataclass(frozen=True)
class GeneticParameters(SearchParameters):
    """Parameters of the genetic algorithm, beside those of `SearchParameters`.

    Attributes
    ----------
    population : int
        Size of the population.
    offspring : int
        Children in a generation.
    tournament : int
        A parent is the best of so many members drawn at random.
    """

    population: int = field(default=20, metadata={"help": "solutions that live at a time"})
    offspring: int = field(default=5, metadata={"help": "children in a generation"})
    tournament: int = field(default=2, metadata={"help": "size of the tournaments whose winners are parents"})

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
