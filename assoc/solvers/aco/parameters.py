"""Parameters of the ant colony."""

from __future__ import annotations

from dataclasses import dataclass, field

from assoc._parameters import is_number
from assoc.solvers.search_parameters import SearchParameters

MODES = ("mmas", "paper")
TRANSFORMS = ("exponential", "shifted", "reciprocal")


@dataclass(frozen=True)
class AcoParameters(SearchParameters):
    """Parameters of the ant colony, named as in the paper.

    Those of `SearchParameters` apply to mode mmas, except ``iterations``, which applies to both. Mode paper is the
    published rule alone, on the whole problem.

    Attributes
    ----------
    mode : str
        "mmas" (max-min ant system with reduced costs and local search) or "paper" (eqs. 7-11).
    ants : int
        Ants in a cycle; 15 in the paper.
    divers : int
        Mode mmas with refinement "full": additional ants of each cycle, which build covers in the linear program.
    alpha, beta : float
        Exponents of pheromone and visibility in eq. 8; 2 and 1 in the paper.
    rho : float
        Share of the pheromone that stays, eq. 9; 0.3 in the paper.
    visibility : str
        Mode paper: transform of the costs, which eq. 7 needs positive. "exponential": exp((c - c_min) / scale);
        "shifted": c - c_min + scale; "reciprocal": c itself, only for positive costs.
    scale : float
        The transform's scale, in units of cost.
    start_on : str
        Mode paper: on a point of whose last tour an ant starts: its "own", or that of "any" ant, drawn at random.
    tuples : str
        Mode paper: the tuples that ants may visit beside false alarms: "useful", which cost less than their
        measurements as false alarms, or "all" of the problem.
    """

    mode: str = field(default="mmas", metadata={"help": "mmas (strong) or paper (equations 7-11)"})
    ants: int = field(default=15, metadata={"help": "ants in a cycle"})
    divers: int = field(default=2, metadata={"help": "mode mmas: ants in a cycle that dive in the linear program"})
    alpha: float = field(default=2.0, metadata={"help": "exponent of the pheromone, eq. 8"})
    beta: float = field(default=1.0, metadata={"help": "exponent of the visibility, eq. 8"})
    rho: float = field(default=0.3, metadata={"help": "share of pheromone that stays after a cycle, eq. 9"})
    visibility: str = field(
        default="exponential", metadata={"help": "mode paper: exponential, shifted or reciprocal costs in eq. 7"}
    )
    scale: float = field(default=10.0, metadata={"help": "mode paper: scale of the visibility transform"})
    start_on: str = field(default="own", metadata={"help": "mode paper: whose last tour an ant starts on: own or any"})
    tuples: str = field(
        default="useful",
        metadata={"help": "mode paper: tuples that ants visit: useful (cheaper than false alarms) or all"},
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
