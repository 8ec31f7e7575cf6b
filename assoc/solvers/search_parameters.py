"""Parameters of all searches by components. Imports nothing slow: ``--help`` reads it."""

from __future__ import annotations

from dataclasses import dataclass

from assoc._parameters import Parameters, described

REFINEMENTS = ("none", "local", "full")


@dataclass(frozen=True)
class SearchParameters(Parameters):
    """How long `search_components` searches, and how it refines the metaheuristic's covers."""

    iterations: int = described(1000, "iterations on one component at the most")
    patience: int = described(150, "iterations without improvement before a component is left")
    refinement: str = described(
        "full",
        "what improves covers: none, local (insertion, dimensionwise search), or full (exact sub-steps and dives, too)",
    )
    clusters: int = described(
        5, "exact sub-steps on each new cover, and for every 30 measurements on the best (refinement full)"
    )
    workers: int = described(
        1, "searches of a component at a time, on threads, that exchange their best; results depend on the number"
    )

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
