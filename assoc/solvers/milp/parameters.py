"""Parameters of the integer program."""

from __future__ import annotations

from dataclasses import dataclass, field

from assoc._parameters import Parameters

BACKENDS = ("scip", "cp_sat", "highs")


@dataclass(frozen=True)
class MilpParameters(Parameters):
    """Parameters of ``milp``.

    Attributes
    ----------
    backend : {"scip", "cp_sat", "highs"}
        Which solver of OR-Tools.
    workers : int
        Threads of scip and cp_sat; with more than one the answer may be another of the same cost.
        HiGHS takes no number from OR-Tools and decides for itself.
    """

    backend: str = field(default="scip", metadata={"help": "scip, cp_sat or highs"})
    workers: int = field(default=1, metadata={"help": "threads of scip, cp_sat; with 1 runs repeat exactly"})

    def __post_init__(self) -> None:
        self._require(self.backend in BACKENDS, "backend", "one of " + ", ".join(BACKENDS))
        self._whole("workers", most=1024)
