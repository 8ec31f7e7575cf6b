"""Parameters of the ant colony."""

from __future__ import annotations

from dataclasses import dataclass

from assoc._parameters import described, is_number
from assoc.solvers.search_parameters import SearchParameters

MODES = ("mmas", "paper")
TRANSFORMS = ("exponential", "shifted", "reciprocal")


@dataclass(frozen=True)
class AcoParameters(SearchParameters):
    """Parameters of the ant colony, named as in the paper.

    Those of `SearchParameters` apply to mode mmas, except ``iterations``, which applies to both. Mode paper is the
    published rule alone, on the whole problem.
    """

    mode: str = described("mmas", "mmas (strong) or paper (equations 7-11)")
    ants: int = described(15, "ants in a cycle; 15 in the paper")
    divers: int = described(
        2, "mode mmas, refinement full: more ants in a cycle, which build covers in the linear program"
    )
    alpha: float = described(2.0, "exponent of the pheromone, eq. 8; 2 in the paper")
    beta: float = described(1.0, "exponent of the visibility, eq. 8; 1 in the paper")
    rho: float = described(0.3, "share of pheromone that stays after a cycle, eq. 9; 0.3 in the paper")
    visibility: str = described(
        "exponential",
        "mode paper: costs in eq. 7 are exp((c - c_min) / scale): exponential; c - c_min + scale: shifted; or, if all "
        "are positive, as they are: reciprocal",
    )
    scale: float = described(10.0, "mode paper: scale of the visibility transform, in units of cost")
    start_on: str = described(
        "own", "mode paper: whose last tour an ant starts on: its own, or that of any, drawn at random"
    )
    tuples: str = described(
        "useful",
        "mode paper: tuples that ants may visit beside false alarms: useful (cheaper than their measurements as false "
        "alarms) or all",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require(self.mode in MODES, "mode", " or ".join(MODES))
        self._whole("ants", most=100_000)
        self._whole("divers", least=0, most=100_000)
        self._number("alpha", "beta", least=0.0, most=20.0)
        self._require(is_number(self.rho) and 0 < self.rho < 1, "rho", "a number between 0 and 1, both excluded")
        self._require(self.visibility in TRANSFORMS, "visibility", ", ".join(TRANSFORMS))
        self._number("scale", above=0.0)
        self._require(self.start_on in ("own", "any"), "start_on", "own or any")
        self._require(self.tuples in ("useful", "all"), "tuples", "useful or all")

    @property
    def every_tuple(self) -> bool:
        """Whether ants are to see tuples, too, that cost no less than false alarms."""
        return self.mode == "paper" and self.tuples == "all"

    def memory(self, num_columns: int, num_rows: int) -> tuple[float, str, str] | None:
        """Mode paper: the ants' tours, and the owners of rows from which they are made."""
        if self.mode != "paper":
            return super().memory(num_columns, num_rows)
        return 8.0 * self.ants * num_rows, f"ants = {self.ants} on {num_rows} measurements", "take fewer ants"
