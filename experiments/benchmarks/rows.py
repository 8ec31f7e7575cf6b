"""One measurement is one row; rows go to CSV and come back."""

import csv
import io
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from statistics import median

from assoc._files.output import write_text

HIT = 1e-6
PROVING_PEERS = ("cp_sat", "cp_sat_1", "highs", "scip", "scip_1")


@dataclass(frozen=True)
class Row:
    """What one solver did on one instance.

    family, size: The instance family and its size, as in ``gated``, ``3x300``.
    seed, item: Seed of the instance, and its number where a seed gives several (scans).
    tuples: M of the problem.
    solver: Name; variants carry a suffix, as in ``lagrangian@0.1%``.
    peer: Whether it is somebody else's.
    limit: Time limit it was given, seconds.
    cost, bound: Cost as our checker reads it (``inf``: no solution in time), and the solver's lower bound (``-inf``:
        none).
    seconds: Wall time from the tuples to the answer.
    cpu: Processor time of that, all threads together; 0: not measured.
    status: "optimal" where the solver itself proves it, "feasible", or "none".
    reference: The optimum where it is known by construction or was proven, else the best cost anyone found.
    proven: Whether the reference is the optimum.
    extra: Solutions ranked (family kbest), share of the optimum by which the linear program's bound is below it
        (families of ghosts); 0 elsewhere.
    """

    family: str
    size: str
    seed: int
    item: int
    tuples: int
    solver: str
    peer: bool
    limit: float
    cost: float
    bound: float
    seconds: float
    status: str
    reference: float = math.nan
    proven: bool = False
    extra: float = 0.0
    cpu: float = 0.0

    @property
    def taken(self) -> float:
        """Seconds of wall time, or of processor time where these are fewer: others may have used the machine, too."""
        return min(self.seconds, self.cpu) if self.cpu > 0.0 else self.seconds

    @property
    def gap(self) -> float:
        """Cost less bound, relative to max(1, abs(cost))."""
        return (self.cost - self.bound) / max(1.0, abs(self.cost)) if math.isfinite(self.cost) else math.inf

    @property
    def excess(self) -> float:
        """Cost above the reference, relative to max(1, abs(reference))."""
        return (self.cost - self.reference) / max(1.0, abs(self.reference))

    @property
    def hit(self) -> bool:
        """Whether the cost is the reference, to 1e-6 relative."""
        return self.excess <= HIT


class Results:
    """Rows with the look-ups that tables need."""

    def __init__(self, rows: Iterable[Row]) -> None:
        self.rows = list(rows)

    def of(self, family: str, size: str | None = None, solver: str | None = None) -> list[Row]:
        """Return the rows of a family, a size and a solver."""
        return [
            row
            for row in self.rows
            if row.family == family and (size is None or row.size == size) and (solver is None or row.solver == solver)
        ]

    def sizes(self, family: str) -> list[str]:
        """Return the sizes measured, in order."""
        return list(dict.fromkeys(row.size for row in self.of(family)))

    def fastest_peer(self, row: Row) -> float:
        """Return the least time in which a peer proved the optimum of the row's instance."""
        times = [
            other.taken
            for other in self.of(row.family, row.size)
            if (other.seed, other.item) == (row.seed, row.item)
            and other.solver in PROVING_PEERS
            and other.status == "optimal"
        ]
        return min(times, default=math.inf)

    def fastest_proof(self, family: str, size: str) -> tuple[float, str] | None:
        """Return the median time of the fastest peer that proved every instance, and its name; None: none did."""
        runs: dict[tuple[str, float], list[Row]] = {}
        for row in self.of(family, size):
            if row.solver in PROVING_PEERS:
                runs.setdefault((row.solver, row.limit), []).append(row)
        times = [
            (median(row.taken for row in rows), peer)
            for (peer, _), rows in runs.items()
            if all(row.status == "optimal" for row in rows)
        ]
        return min(times, default=None)

    def best_peers(self, family: str, size: str, within: float) -> list[Row]:
        """Return, for each instance, the row of a peer with the least cost, of those given so many seconds or less."""
        rows = [row for row in self.of(family, size) if row.peer and row.limit <= within]
        return list({(row.seed, row.item): row for row in sorted(rows, key=lambda row: -row.cost)}.values())


def with_common_reference(rows: list[Row]) -> list[Row]:
    """Rows of several runs with the best reference that any of them has for their instance."""
    best: dict[tuple[str, str, int, int], tuple[float, bool]] = {}
    for row in rows:
        instance = (row.family, row.size, row.seed, row.item)
        reference, proven = best.get(instance, (math.inf, False))
        best[instance] = min(reference, row.reference), proven or row.proven
    result = []
    for row in rows:
        reference, proven = best[row.family, row.size, row.seed, row.item]
        result.append(row if math.isnan(row.reference) else replace(row, reference=reference, proven=proven))
    return result


_DERIVED = ("gap", "excess")


def save(path: Path, rows: Iterable[Row]) -> None:
    """Write rows as CSV, with gap and excess as columns for readers."""
    names = [field.name for field in fields(Row)]
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow([*names, *_DERIVED])
    for row in rows:
        values = [*asdict(row).values(), *(getattr(row, name) for name in _DERIVED)]
        writer.writerow([f"{value:.10g}" if isinstance(value, float) else value for value in values])
    write_text(path, text.getvalue())


def load(path: Path) -> list[Row]:
    """Read rows written by `save`."""
    rows = []
    with path.open(newline="", encoding="utf-8") as file:
        for record in csv.DictReader(file):
            values: dict[str, object] = {}
            for field in fields(Row):
                text = record.get(field.name) or "0"
                values[field.name] = text == "True" if field.type is bool else field.type(text)
            rows.append(Row(**values))
    return rows
