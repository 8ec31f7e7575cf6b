"""Parameters of the integer program."""

from __future__ import annotations

from dataclasses import dataclass

from assoc._parameters import Parameters, described

BACKENDS = ("scip", "highs")


# bytes for each tuple of three sensors, measured on 1e5 tuples (docs/reliability.md)
_MODEL = {"scip": 7_000.0, "highs": 2_300.0}


@dataclass(frozen=True)
class MilpParameters(Parameters):
    """Parameters of ``milp``."""

    backend: str = described("scip", "solver of OR-Tools: scip or highs")
    workers: int = described(
        1,
        "threads of scip, with more than one of which answers of the same cost may differ; highs chooses its own "
        "number",
    )

    def __post_init__(self) -> None:
        self._require(self.backend in BACKENDS, "backend", "one of " + ", ".join(BACKENDS))
        self._whole("workers", most=1024)

    def memory(self, num_columns: int, num_rows: int) -> tuple[float, str, str] | None:
        """Memory of the backend's model."""
        if num_columns == 0:
            return None
        what = f"milp: backend {self.backend} on {num_columns} tuples"
        return _MODEL[self.backend] * num_columns, what, "take solver exact, which needs less"
