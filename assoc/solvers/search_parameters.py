"""Parameters of all searches by components. Imports nothing slow: ``--help`` reads it."""

from __future__ import annotations

from dataclasses import dataclass, field

from assoc._parameters import Parameters

REFINEMENTS = ("none", "local", "full")


@dataclass(frozen=True)
class SearchParameters(Parameters):
    """How long `search_components` searches, and how it refines the metaheuristic's covers.

    Attributes
    ----------
    iterations : int
        Most iterations (cycles, generations) on one component.
    patience : int
        The search of a component ends after this many iterations without improvement.
    refinement : str
        What improves the metaheuristic's covers. "none": nothing; "local": insertion with ejection, and dimensionwise
        search; "full": exact sub-steps and dives, too.
    clusters : int
        With refinement "full": number of exact sub-steps on each new cover, and for every 30 measurements on the best
        cover after each iteration.
    workers : int
        Number of parallel searches on each component, in threads, which exchange their best covers after every
        iteration. The result depends on the seed and on this number.
    """

    iterations: int = field(default=1000, metadata={"help": "iterations on one component at the most"})
    patience: int = field(default=150, metadata={"help": "iterations without improvement before a component is left"})
    refinement: str = field(
        default="full", metadata={"help": "what improves covers: none, local search, or full (exact sub-steps, too)"}
    )
    clusters: int = field(default=5, metadata={"help": "exact sub-steps on each new cover (refinement full)"})
    workers: int = field(default=1, metadata={"help": "searches at a time, on threads, that exchange their best"})

    def __post_init__(self) -> None:
        self._whole("iterations", "patience")
        self._whole("clusters", most=100_000)
        self._whole("workers", most=1000)
        self._require(self.refinement in REFINEMENTS, "refinement", ", ".join(REFINEMENTS))

    def memory(self, num_columns: int, num_rows: int) -> tuple[float, str, str] | None:
        """Bytes for the stack of each further worker, and for its copy of a search's data."""
        if self.workers == 1:
            return None
        needed = (10e6 + 200.0 * num_columns) * (self.workers - 1)
        return needed, f"workers = {self.workers}", "take fewer workers"
