"""Parameters of the genetic algorithm."""

from __future__ import annotations

from dataclasses import dataclass, field

from assoc._parameters import Parameters


@dataclass(frozen=True)
class GeneticParameters(Parameters):
    """Parameters of the genetic algorithm.

    Attributes
    ----------
    population : int
        Solutions that live at a time.
    offspring : int
        Children in a generation.
    tournament : int
        A parent is the best of so many drawn at random.
    mutation : float
        Share of a child's tuples that are given up before it is completed anew.
    iterations : int
        Generations on one component at the most.
    patience : int
        A component is left after so many generations without improvement.
    clusters : int
        Exact sub-steps on each child, and for every 30 measurements on the best solution after each generation
        (0: insertion with ejection alone).
    """

    population: int = field(default=20, metadata={"help": "solutions that live at a time"})
    offspring: int = field(default=10, metadata={"help": "children in a generation"})
    tournament: int = field(default=2, metadata={"help": "a parent is the best of so many"})
    mutation: float = field(default=0.05, metadata={"help": "share of a child's tuples that are given up"})
    iterations: int = field(default=1000, metadata={"help": "generations on one component at the most"})
    patience: int = field(default=150, metadata={"help": "generations without improvement before a component is left"})
    clusters: int = field(default=10, metadata={"help": "exact sub-steps on each child"})

    def __post_init__(self) -> None:
        self._require(2 <= self.population <= 100_000, "population", "a whole number from 2 to 100000")
        self._require(1 <= self.offspring <= 100_000, "offspring", "a whole number from 1 to 100000")
        self._require(1 <= self.tournament <= self.population, "tournament", "a whole number from 1 to population")
        self._require(0 <= self.mutation <= 1, "mutation", "a number from 0 to 1")
        self._require(self.iterations >= 1, "iterations", "a whole number >= 1")
        self._require(self.patience >= 1, "patience", "a whole number >= 1")
        self._require(self.clusters >= 0, "clusters", "a whole number >= 0")
