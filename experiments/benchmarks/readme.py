"""The tables of README.md and paper.md, written from the same rows as docs/benchmarks.md."""

import math
from collections.abc import Sequence
from statistics import median

from experiments.benchmarks.goals import LONG, PROVING_PEERS, Results, judge
from experiments.benchmarks.rows import Row
from experiments.common.contestants import HEURISTICS
from experiments.common.results import as_percent, as_time, table

BEGIN = "<!-- from here to the end mark: written by python -m experiments.benchmarks -->"
END = "<!-- end mark -->"

PEERS = {"cp_sat": "CP-SAT", "cp_sat_1": "CP-SAT", "highs": "HiGHS", "scip": "SCIP", "scip_1": "SCIP"}
TIMED = {
    ("gated", "3x100"): "3 sensors, 100 targets",
    ("gated", "3x300"): "3 sensors, 300 targets",
    ("gated", "3x1000"): "3 sensors, 1,000 targets",
    ("gated", "4x300"): "4 sensors, 300 targets",
    ("gated", "5x200"): "5 sensors, 200 targets",
    ("ghost", "20"): "bearings only, 20 targets",
    ("ghost", "40"): "bearings only, 40 targets",
    ("random axial", "n=26"): "axial, random costs, 26 x 26 x 26",
}
"""Family and size -> how the table of times calls it."""
GHOSTS = ("20", "40", "60", "100")
"""Sizes of family ghost in the second table."""
_SHORT = 5.0
_FAR = 1.0


def insert(page: str, rows: Sequence[Row]) -> str:
    """Return a page's text with the part between the marks written anew.

    Raises ValueError: The marks are not there, each once and in order.
    """
    if page.count(BEGIN) != 1 or page.count(END) != 1 or page.index(BEGIN) > page.index(END):
        raise ValueError(f"expected the marks {BEGIN} and {END}, each once")
    before, rest = page.split(BEGIN)
    after = rest.split(END)[1]
    return f"{before}{BEGIN}\n\n{render(rows)}\n\n{END}{after}"


def render(rows: Sequence[Row]) -> str:
    """Return the tables and the number of goals met."""
    results = Results(rows)
    met = [verdict.met for verdict in judge(rows)]
    head = ["", "`exact`", "fastest other solver with a proof", "assigning one sensor at a time"]
    parts = [
        table(head, [_timed(results, *key, name) for key, name in TIMED.items() if results.of(*key)], tight=True),
        _ghosts(results),
        f"{sum(met)} of {len(met)} goals are met; [benchmarks](docs/benchmarks.md) lists those that are not.",
    ]
    return "\n\n".join(parts)


def _timed(results: Results, family: str, size: str, name: str) -> list[str]:
    """One instance family: median times to a proven optimum, and the excess cost of one sensor at a time."""
    mine = results.of(family, size, "exact")
    proved = all(row.status == "optimal" for row in mine)
    ours = as_time(median(row.taken for row in mine)) if proved else "no proof"
    fastest = results.fastest_proof(family, size)
    other = "no proof" if fastest is None else f"{as_time(fastest[0])} ({PEERS[fastest[1]]})"
    return [name, ours, other, _excess(results.of(family, size, "sequential"))]


def _excess(rows: Sequence[Row]) -> str:
    if not rows:
        return "-"
    middle = median(row.excess if math.isfinite(row.cost) else math.inf for row in rows)
    return f"{as_percent(middle)} %" if middle < _FAR else f"{1 + middle:.0f} times the cost"


def _ghosts(results: Results) -> str:
    """Bearings only: what is reached in a short time, as the worst excess over the best cost known."""
    limits = [row.limit for row in results.of("ghost") if row.solver in PROVING_PEERS and row.limit <= LONG]
    longest = max(limits, default=LONG)
    head = ["bearings only", *(f"`{name}`, {_SHORT:g} s" for name in HEURISTICS)]
    head += [f"best other solver, {longest:g} s", "optimum"]
    lines = []
    for size in GHOSTS:
        rows = results.of("ghost", size)
        if not rows:
            continue
        runs = [results.of("ghost", size, name) for name in HEURISTICS]
        runs.append(results.best_peers("ghost", size, LONG))
        known = "proven" if all(row.proven for row in rows) else "best known"
        lines.append([f"{size} targets", *map(_worst, runs), known])
    return table(head, lines, lambda column: 0 < column < len(head) - 1, tight=True)


def _worst(rows: Sequence[Row]) -> str:
    """Largest excess of any run."""
    return f"{as_percent(max(row.excess for row in rows))} %" if rows else "-"
