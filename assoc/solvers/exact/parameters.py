"""Parameters of the exact solver."""

from __future__ import annotations

from dataclasses import dataclass

from assoc._parameters import Parameters, described


@dataclass(frozen=True)
class ExactParameters(Parameters):
    """Parameters of the exact solver."""

    nodes: int = described(
        100_000_000, "largest number of nodes of branch and bound; components that are open then keep their gap"
    )
    patience: int = described(
        1,
        "iterations of tabu search and breeding without improvement before branching starts, for every 60 measurements "
        "of a component of 150 and more",
    )

    gap: float = described(
        0.0,
        "relative gap at which components of 2,000 measurements and more end, without their linear program; 0: search "
        "to the proof",
    )

    def __post_init__(self) -> None:
        self._whole("nodes", "patience", least=0)
        self._number("gap", least=0.0)
