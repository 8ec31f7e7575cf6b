"""Parameters of the integer program."""

from __future__ import annotations

from dataclasses import dataclass, field

from assoc._parameters import Parameters

BACKENDS = ("scip", "highs")


# bytes for each tuple of three sensors, measured on 1e5 tuples (docs/reliability.md)
_MODEL = {"scip": 7_000.0, "highs": 2_300.0}


@dataclass(frozen=True)
class MilpParameters(Parameters):
    """Parameters of ``milp``.

    Attributes
    ----------
    backend : {"scip", "highs"}
        Backend of OR-Tools.
    workers : int
        Threads of scip; with more than one the answer may be another of the same cost. HiGHS ignores it and chooses
        its own number.
    """

    backend: str = field(default="scip", metadata={"help": "scip or highs"})
    workers: int = field(default=1, metadata={"help": "threads of scip; with 1 runs repeat exactly"})

    def __post_init__(self) -> None:
        self._require(self.backend in BACKENDS, "backend", "one of " + ", ".join(BACKENDS))
        self._whole("workers", most=1024)

    def memory(self, num_columns: int, num_rows: int) -> tuple[float, str, str] | None:
        """Memory of the backend's model."""
        if num_columns == 0:
            return None
        what = f"milp: backend {self.backend} on {num_columns} tuples"
        return _MODEL[self.backend] * num_columns, what, "take solver exact, which needs less"
