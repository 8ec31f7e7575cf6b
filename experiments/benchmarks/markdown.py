"""The Markdown report: goals first, then one table for each family."""

import math
import os
import platform
import re
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from statistics import median

from experiments.benchmarks.families import cases
from experiments.benchmarks.goals import Results, judge
from experiments.benchmarks.rows import Row
from experiments.common.results import as_percent, as_time, plain_table

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
Instances are code and seed (`experiments/common/instances`); the seeds here, from 1000 on, were not used
for tuning. Times are wall times, from the tuples to the Solution, after warm-up; beside them the processor's, all
threads together. A run of less than 0.1 s is made five times, ours and theirs, and the median time counts. Our
solvers have one core. Peers (other solvers) get the same tuples in the same process: CP-SAT (`cp_sat`; costs times
1e6, rounded) and `scip` on both cores, `cp_sat_1`, `scip_1` and HiGHS (scipy, gap 1e-9) on one. With `--processes`
in the command above everybody had one core, several seeds at a time. `sequential` assigns one sensor at a time with
scipy, as most trackers do; `nrl_tracker` needs a dense tensor and takes part if that has at most 8 million elements.
`chils`, `branch_reduce` and `mmwis` search for the heaviest independent set of the conflict graph, on all cores
that they have (the last two up to 40 targets: their graphs are too large beyond; none of the three proves anything, and
at 20 targets they have 10 s); `kap` knows costs of pairs alone.
Independent code checks the feasibility and cost of every answer.

*Found*: runs whose cost is the reference: the optimum (by construction, or proven by any solver) or else,
marked ~, the best cost that any solver found. *Excess* is relative to it. aco, genetic and tabu stop when they reach a
known optimum, so their time is the time to it; `lagrangian@0.1%` stops at that gap. *Speed* is the median
over instances of the fastest peer's time to a proven optimum divided by this solver's time; it is given if this
solver found the reference in every run. For it, and for the goals, a time is that of the processor where this is the
shorter one, ours and theirs: what else ran on the machine does not count."""


def render(rows: Sequence[Row], head: str | None, remark: str | None = None) -> str:
    """Return the report.

    head: What `head` says of the run; None: nothing.
    remark: What readers should know of these rows.
    """
    results = Results(rows)
    parts = ["# Benchmarks", *([head] if head else []), HOW]
    parts += [f"**These rows**: {remark}"] if remark else []
    missing = _missing(rows)
    parts += [f"**Not in these rows** (not run): {missing}."] if missing else []
    parts += ["## Goals", _goals(rows)]
    for family in dict.fromkeys(row.family for row in rows):
        parts += [f"## {family}", ABOUT.get(family, ""), _table(results, family)]
    return "\n\n".join(parts) + "\n"


def head_and_remark(report: str) -> tuple[str | None, str | None]:
    """What a report written by `render` says of its run, and its remark."""
    patterns = r"^(Written by .*)$", r"^\*\*These rows\*\*: (.*)$"
    said, remark = (re.search(pattern, report, re.MULTILINE) for pattern in patterns)
    return said and said[1], remark and remark[1]


def _missing(rows: Sequence[Row]) -> str:
    """Sizes of families of the full run that no row is about."""
    there = {(row.family, row.size) for row in rows}
    families = {row.family for row in rows}
    absent = [f"{case.family} {case.size}" for case in cases() if (case.family, case.size) not in there]
    return ", ".join(absent + ["kbest"] * ("kbest" not in families))


def head(minutes: float | None, command: str) -> str:
    """Say how to repeat a run, how long it took, and on what machine."""
    names = ("numpy", "scipy", "numba", "ortools", "nrl-tracker")
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


def _goals(rows: Sequence[Row]) -> str:
    verdicts = judge(rows)
    firm, stretch = ([v.met for v in verdicts if v.stretch == kind] for kind in (False, True))
    said = [
        [v.family, v.size, f"* {v.goal}" if v.stretch else v.goal, v.measured, "yes" if v.met else "**no**"]
        for v in verdicts
    ]
    return (
        f"{sum(firm)} of {len(firm)} goals met, and {sum(stretch)} of {len(stretch)} stretch goals (marked *).\n\n"
        + plain_table(["family", "size", "goal", "measured", "met"], said)
    )


def _table(results: Results, family: str) -> str:
    head = ["size", "tuples", "solver", "limit s", "runs", "found", "excess median %", "excess worst %",
            "gap median %", "median time", "median CPU", "speed"]  # fmt: skip
    head += ["ranked"] if family == "kbest" else []
    lines = []
    for size in results.sizes(family):
        rows = results.of(family, size)
        tuples = median(row.tuples for row in rows)
        # ours first
        for solver, limit in dict.fromkeys((row.solver, row.limit) for row in sorted(rows, key=lambda row: row.peer)):
            mine = [row for row in rows if (row.solver, row.limit) == (solver, limit)]
            cells = [size, f"{tuples:,.0f}", solver, f"{limit:g}" if limit else "", str(len(mine))]
            ranked = [f"{median(row.extra for row in mine):.0f}"] if family == "kbest" else []
            lines.append([*cells, *_figures(results, mine), *ranked])
    return plain_table(head, lines)


def _figures(results: Results, rows: Sequence[Row]) -> list[str]:
    excess = [row.excess if math.isfinite(row.cost) else math.inf for row in rows]
    found = f"{sum(row.hit for row in rows)}" + ("" if all(row.proven for row in rows) else "~")
    speeds = [results.fastest_peer(row) / row.taken for row in rows]
    speed = median(speeds)
    return [
        found,
        as_percent(median(excess)),
        as_percent(max(excess)),
        as_percent(median(row.gap for row in rows)),
        as_time(median(row.seconds for row in rows)),
        as_time(cpu) if (cpu := median(row.cpu for row in rows)) else "-",
        f"{speed:.3g}" if math.isfinite(speed) and all(row.hit for row in rows) else "-",
    ]
