"""What is told of the rows: the report of docs/benchmarks.md, and the tables of README.md and paper.md."""

import math
import os
import platform
import re
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from statistics import median

from experiments.benchmarks.families import cases
from experiments.benchmarks.rows import PROVING_PEERS, Results, Row
from experiments.common.contestants import HEURISTICS
from experiments.common.results import as_percent, as_time, plain_table, table

ABOUT = {
    "paper": "The 100 scans of the ant colony paper's scene: three targets, three radars, P_d 0.9.",
    "gated": "Position sensors (0.1 km, P_d 0.9) over a box, 10 % false alarms; sensors x targets.",
    "ghost": "Three bearing-only sensors (5 mrad, P_d 0.95) over 100 x 100 km, whose lines cross in many "
    "places without a target; number of targets.",
    "wide gap": "Scenes of family ghost whose linear program is about 1 % below the optimum (0.7 % or more): the first "
    "five such seeds from 2000 on.",
    "wide gates": "Points in the plane seen by three sensors, with gates so wide that one component has nearly all "
    "tuples; number of targets.",
    "known optimum": "Axial n x n x n with a known unique optimum (Grundel & Pardalos).",
    "random axial": "Axial n x n x n, integer costs uniform in 0..99.",
    "planted": "With dummies and a planted optimum, by number of sensors.",
    "kbest": "The k best solutions; the time for one optimum (exact) beside it.",
}

HOW = """\
Instances are code and seed (`experiments/common/instances`); the seeds here, from 1000 on, were not used for tuning.
Times are medians, from the tuples to the Solution, after warm-up; that of the processor where it is shorter than the
wall's: what else ran on the machine does not count. Our solvers have one core. Peers (other solvers) get the same
tuples in the same process: CP-SAT (costs times 1e6, rounded), SCIP, HiGHS (gap 1e-9), independent sets (`chils`,
`branch_reduce`, `mmwis`, which prove nothing). With `--processes` in the command above everybody had one core. *One by
one* assigns one sensor at a time with scipy, as most trackers do.
Independent code checks the feasibility and cost of every answer.

The reference is the optimum (by construction, or proven by any solver) or else
the best cost that any solver found; an excess is relative to it. aco, genetic and tabu stop when they reach a known
optimum."""


def render(rows: Sequence[Row], head: str | None) -> str:
    """Return the report.

    head: What `head` says of the run; None: nothing.
    """
    results = Results(rows)
    parts = ["# Benchmarks", *([head] if head else []), HOW]
    missing = _missing(rows)
    parts += [f"**Not in these rows** (not run): {missing}."] if missing else []
    parts += ["## Families"]
    families = [family for family in dict.fromkeys(row.family for row in rows) if family != "kbest"]
    parts += ["\n".join(f"- **{family}**: {ABOUT[family]}" for family in families)]
    parts += [plain_table(HEAD, [_line(results, one, size) for one in families for size in _shown(results, one)])]
    if ranked := results.of("kbest"):
        parts += ["## The k best", ABOUT["kbest"], _rankings(ranked)]
    return "\n\n".join(parts) + "\n"


def head_of(report: str) -> str | None:
    """What a report written by `render` says of its run."""
    said = re.search(r"^(Written by .*)$", report, re.MULTILINE)
    return said and said[1]


def _missing(rows: Sequence[Row]) -> str:
    """Sizes of families of the full run that no row is about."""
    there = {(row.family, row.size) for row in rows}
    families = {row.family for row in rows}
    absent = [f"{case.family} {case.size}" for case in cases() if (case.family, case.size) not in there]
    return ", ".join(absent + ["kbest"] * ("kbest" not in families))


def head(minutes: float | None, command: str) -> str:
    """Say how to repeat a run, how long it took, and on what machine."""
    names = ("numpy", "scipy", "numba", "ortools")
    versions = ", ".join(f"{name} {version}" for name in names if (version := _version(name)))
    took = "" if minutes is None else f" in {minutes:.1f} minutes"
    return (
        f"Written by `{command}`{took}, on {os.cpu_count()} cores of {_processor()}, "
        f"Python {platform.python_version()}, {versions}. Do not edit; raw numbers in the CSV beside it."
    )


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def _shown(results: Results, family: str) -> list[str]:
    """Sizes of a family, of those at which metaheuristics ran where there are some."""
    sizes = results.sizes(family)
    return [size for size in sizes if any(results.of(family, size, name) for name in HEURISTICS)] or sizes


def _line(results: Results, family: str, size: str) -> list[str]:
    """One size of a family: what `exact`, the metaheuristics, the bound of `lagrangian` and the others reach."""
    rows = results.of(family, size)
    exact = results.of(family, size, "exact")
    ants = [row for name in HEURISTICS for row in results.of(family, size, name)]
    duals = [row for row in rows if row.solver.startswith("lagrangian")]
    return [
        family, size, f"{median(row.tuples for row in rows):,.0f}",
        _proofs(exact), _speed(results, exact), _excess(ants), as_percent(max(r.gap for r in duals)) if duals else "-",
        _fastest(results, family, size), _excess(results.of(family, size, "sequential")),
    ]  # fmt: skip


HEAD = [
    "family", "size", "tuples", "`exact`", "times as fast as the fastest peer",
    "`aco`, `genetic`, `tabu`: worst excess %", "`lagrangian`: worst gap %",
    "fastest peer, or its proofs", "one by one: worst excess %",
]  # fmt: skip


def _proofs(rows: Sequence[Row]) -> str:
    """Median time, and how many were proved where not all were."""
    if not rows:
        return "-"
    proved = sum(row.status == "optimal" for row in rows)
    time = as_time(median(row.taken for row in rows))
    if proved == len(rows):
        return time
    return f"{time}, {proved} of {len(rows)} proved, worst gap {as_percent(max(row.gap for row in rows))} %"


def _speed(results: Results, rows: Sequence[Row]) -> str:
    ratios = [results.fastest_peer(row) / row.taken for row in rows]
    return f"{median(ratios):.3g}" if ratios and math.isfinite(median(ratios)) else "-"


def _fastest(results: Results, family: str, size: str) -> str:
    """Median time of the fastest peer that proved all, else the instances that any of them proved."""
    if fastest := results.fastest_proof(family, size):
        return f"{as_time(fastest[0])} ({fastest[1]})"
    peers = [row for row in results.of(family, size) if row.peer]
    proved = {(row.seed, row.item) for row in peers if row.status == "optimal"}
    return f"{len(proved)} of {len({(row.seed, row.item) for row in peers})} proved" if peers else "-"


def _excess(rows: Sequence[Row]) -> str:
    return as_percent(max(row.excess if math.isfinite(row.cost) else math.inf for row in rows)) if rows else "-"


def _rankings(rows: Sequence[Row]) -> str:
    """Times of the rankings, and how many solutions each has."""
    kinds = dict.fromkeys((row.size, row.solver) for row in rows)
    lines = []
    for size, solver in kinds:
        mine = [row for row in rows if (row.size, row.solver) == (size, solver)]
        cells = as_time(median(row.taken for row in mine)), f"{median(row.extra for row in mine):.0f}"
        lines.append([size, f"`{solver}`", *cells])
    return plain_table(["problem", "solver", "median time", "ranked"], lines)


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
_SHORT, LONG = 5.0, 60.0
_FAR = 1.0


def insert(page: str, rows: Sequence[Row]) -> str:
    """Return a page's text with the part between the marks written anew.

    Raises ValueError: The marks are not there, each once and in order.
    """
    if page.count(BEGIN) != 1 or page.count(END) != 1 or page.index(BEGIN) > page.index(END):
        raise ValueError(f"expected the marks {BEGIN} and {END}, each once")
    before, rest = page.split(BEGIN)
    after = rest.split(END)[1]
    return f"{before}{BEGIN}\n\n{tables(rows)}\n\n{END}{after}"


def tables(rows: Sequence[Row]) -> str:
    """Return the tables."""
    results = Results(rows)
    head = ["", "`exact`", "fastest other solver with a proof", "assigning one sensor at a time"]
    parts = [
        table(head, [_timed(results, *key, name) for key, name in TIMED.items() if results.of(*key)], tight=True),
        _ghosts(results),
        "More families and sizes, and where no proof is found: [benchmarks](docs/benchmarks.md).",
    ]
    return "\n\n".join(parts)


def _timed(results: Results, family: str, size: str, name: str) -> list[str]:
    """One instance family: median times to a proven optimum, and the excess cost of one sensor at a time."""
    mine = results.of(family, size, "exact")
    proved = all(row.status == "optimal" for row in mine)
    ours = as_time(median(row.taken for row in mine)) if proved else "no proof"
    fastest = results.fastest_proof(family, size)
    other = "no proof" if fastest is None else f"{as_time(fastest[0])} ({PEERS[fastest[1]]})"
    return [name, ours, other, _typical(results.of(family, size, "sequential"))]


def _typical(rows: Sequence[Row]) -> str:
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
