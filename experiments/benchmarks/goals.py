"""The goals of the benchmark, each read off the rows: what was asked, what was measured, met or not."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median

from experiments.benchmarks import ranking
from experiments.benchmarks.families import HEURISTICS
from experiments.benchmarks.rows import Row

PROVING_PEERS = ("cp_sat", "highs", "scip", "scip_1")


@dataclass(frozen=True)
class Verdict:
    """A goal of one family and size.

    Attributes
    ----------
    family, size, goal : str
        What was asked.
    stretch : bool
        Whether it is a stretch goal (marked * in the report).
    measured : str
        What was measured, with the numbers.
    met : bool
    """

    family: str
    size: str
    goal: str
    stretch: bool
    measured: str
    met: bool


class Results:
    """Rows with the look-ups that the goals need."""

    def __init__(self, rows: Iterable[Row]) -> None:
        self.rows = list(rows)

    def of(self, family: str, size: str | None = None, solver: str | None = None) -> list[Row]:
        """Return the rows of a family, a size and a solver."""
        return [
            row
            for row in self.rows
            if row.family == family
            and (size is None or row.size == size)
            and (solver is None or row.solver == solver)
        ]

    def sizes(self, family: str) -> list[str]:
        """Return the sizes measured, in order."""
        return list(dict.fromkeys(row.size for row in self.of(family)))

    def fastest_peer(self, row: Row) -> float:
        """Return the least time in which any peer proved the optimum of the row's instance."""
        times = [
            other.seconds
            for other in self._same_instance(row)
            if other.peer and other.solver in PROVING_PEERS and other.status == "optimal"
        ]
        return min(times, default=math.inf)

    def best_peer(self, row: Row, within: float) -> float:
        """Return the least cost that any peer had on the row's instance within some seconds."""
        costs = [
            other.cost
            for other in self._same_instance(row)
            if other.peer and (other.limit <= within or other.seconds <= within)
        ]
        return min(costs, default=math.inf)

    def _same_instance(self, row: Row) -> list[Row]:
        return [o for o in self.of(row.family, row.size) if (o.seed, o.item) == (row.seed, row.item)]


def judge(rows: Iterable[Row]) -> list[Verdict]:
    """Return the verdict on every goal whose rows were measured."""
    results = Results(rows)
    verdicts: list[Verdict] = []
    for rule in (_paper, _gated, _ghost, _known_optimum, _random_axial, _planted, _scale, _kbest):
        verdicts += rule(results)
    return verdicts


def _hits(rows: Sequence[Row]) -> str:
    return f"{sum(row.hit for row in rows)} of {len(rows)}"


def _percent(value: float) -> str:
    return "0 %" if abs(value) < 1e-9 else f"{100 * value:.3g} %"


def _always(results: Results, family: str, size: str, solvers: Iterable[str], goal: str) -> list[Verdict]:
    """One verdict per solver: it found the reference on every run."""
    verdicts = []
    for solver in solvers:
        rows = results.of(family, size, solver)
        if rows:
            met = all(row.hit for row in rows)
            verdicts.append(Verdict(family, size, f"{solver}: {goal}", False, _hits(rows), met))
    return verdicts


def _share(
    results: Results, family: str, size: str, needed: float, goal: str, *, stretch: bool
) -> list[Verdict]:
    verdicts = []
    for solver in HEURISTICS:
        rows = results.of(family, size, solver)
        if rows:
            share = sum(row.hit for row in rows) / len(rows)
            verdicts.append(Verdict(family, size, f"{solver}: {goal}", stretch, _hits(rows), share >= needed))
    return verdicts


def _within(
    results: Results, family: str, size: str, allowed: float, goal: str, *, stretch: bool
) -> list[Verdict]:
    verdicts = []
    for solver in HEURISTICS:
        rows = results.of(family, size, solver)
        if rows:
            excess = [row.excess for row in rows]
            text = f"median {_percent(median(excess))}, worst {_percent(max(excess))} above"
            verdicts.append(Verdict(family, size, f"{solver}: {goal}", stretch, text, max(excess) <= allowed))
    return verdicts


def _paper(results: Results) -> list[Verdict]:
    verdicts = []
    for size in results.sizes("paper"):
        solvers = ("exact", "lagrangian", *HEURISTICS)
        verdicts += _always(results, "paper", size, solvers, "optimal on every scan")
    return verdicts


def _gated(results: Results) -> list[Verdict]:
    verdicts = []
    for size in results.sizes("gated"):
        exact = results.of("gated", size, "exact")
        if exact:
            same = all(row.hit and row.status == "optimal" for row in exact)
            worst = max(row.excess for row in exact)
            verdicts.append(
                Verdict("gated", size, "exact: the optimum, proven", False, f"worst excess {worst:.2g}", same)
            )
            ratios = [results.fastest_peer(row) / row.seconds for row in exact]
            ratios = [ratio for ratio in ratios if math.isfinite(ratio)]
            if ratios:
                text = f"median {median(ratios):.3g} times, least {min(ratios):.3g}"
                goal = "exact: 20 times faster (median) than the fastest peer, never slower"
                met = median(ratios) >= 20 and min(ratios) >= 1
                verdicts.append(Verdict("gated", size, goal, False, text, met))
        verdicts += _lagrangian_speed(results, size)
        if size == "3x300":
            goal = "within 0.01 % of the optimum in 1 s"
            verdicts += _within(results, "gated", size, 1e-4, goal, stretch=False)
    return verdicts


def _lagrangian_speed(results: Results, size: str) -> list[Verdict]:
    rows = results.of("gated", size, "lagrangian@0.1%")
    peer = {row.seed: row.seconds for row in results.of("gated", size, "cp_sat")}
    ratios = [peer[row.seed] / row.seconds for row in rows if row.seed in peer]
    if not ratios:
        return []
    text = f"worst gap {_percent(max(row.gap for row in rows))}, median 1/{median(ratios):.3g} of its time"
    met = median(ratios) >= 50 and all(row.gap <= 1e-3 for row in rows)
    goal = "lagrangian: gap <= 0.1 % in 1/50 of CP-SAT's time"
    return [Verdict("gated", size, goal, False, text, met)]


def _ghost(results: Results) -> list[Verdict]:
    verdicts = []
    for row_size in results.sizes("ghost"):
        exact = results.of("ghost", row_size, "exact")
        highs = {
            row.seed: row.seconds for row in results.of("ghost", row_size, "highs") if row.status == "optimal"
        }
        if row_size == "40" and exact:
            ratios = [highs[row.seed] / row.seconds for row in exact if row.seed in highs]
            proven = sum(row.status == "optimal" for row in exact)
            text = f"proves {proven} of {len(exact)}"
            if ratios:
                text += f", median {median(ratios):.3g} times as fast, least {min(ratios):.3g}"
            met = proven == len(exact) and bool(ratios) and median(ratios) > 1
            verdicts.append(Verdict("ghost", row_size, "exact: proves faster than HiGHS", False, text, met))
        if row_size == "60" and exact:
            gaps = [row.gap for row in exact]
            text = f"gap median {_percent(median(gaps))}, worst {_percent(max(gaps))}"
            goal = "exact: closed or gap <= 0.05 % in 30 s"
            verdicts.append(Verdict("ghost", row_size, goal, True, text, max(gaps) <= 5e-4))
        for solver in HEURISTICS:
            verdicts += _ghost_heuristic(results, row_size, solver)
    return verdicts


def _ghost_heuristic(results: Results, size: str, solver: str) -> list[Verdict]:
    rows = results.of("ghost", size, solver)
    if not rows:
        return []

    def above(row: Row, within: float) -> float:
        other = results.best_peer(row, within)
        return (row.cost - other) / max(1.0, abs(other)) if math.isfinite(other) else -math.inf

    early = [above(row, 5.0) for row in rows]
    late = [above(row, 60.0) for row in rows]

    def text(values: list[float]) -> str:
        return f"median {_percent(median(values))}, worst {_percent(max(values))} above"

    return [
        Verdict("ghost", size, f"{solver}: in 5 s at or below any peer after 5 s", False, text(early),
                max(early) <= 1e-9),
        Verdict("ghost", size, f"{solver}: in 5 s within 0.05 % of any peer after 60 s", False, text(late),
                max(late) <= 5e-4),
        Verdict("ghost", size, f"{solver}: in 5 s at or below any peer after 60 s", True, text(late),
                max(late) <= 1e-9),
    ]  # fmt: skip


def _known_optimum(results: Results) -> list[Verdict]:
    family = "known optimum"
    return [
        *_always(results, family, "n=10", HEURISTICS, "the optimum, always"),
        *_share(results, family, "n=20", 0.9, "the optimum in 90 % of runs, 5 s", stretch=False),
        *_within(results, family, "n=30", 0.01, "within 1 %, 5 s", stretch=False),
        *_share(results, family, "n=30", 0.8, "the optimum in 80 % of runs, 5 s", stretch=True),
        *_within(results, family, "n=50", 0.005, "within 0.5 %, 10 s", stretch=True),
    ]


def _random_axial(results: Results) -> list[Verdict]:
    goal = "the optimum in 80 % of runs, 10 s"
    return [
        *_always(results, "random axial", "n=12", HEURISTICS, "the optimum, always, 5 s"),
        *_share(results, "random axial", "n=26", 0.8, goal, stretch=True),
    ]


def _planted(results: Results) -> list[Verdict]:
    verdicts = []
    for size in results.sizes("planted"):
        solvers = ("exact", "lagrangian", *HEURISTICS, "milp")
        verdicts += _always(results, "planted", size, solvers, "optimal")
    return verdicts


def _scale(results: Results) -> list[Verdict]:
    rows = results.of("scale")
    if not rows:
        return []
    worst = max(row.gap for row in rows)
    verdicts = [Verdict("scale", "all", "gap <= 0.01 %", False, f"worst {_percent(worst)}", worst <= 1e-4)]
    times = {
        int(size): median(r.seconds for r in results.of("scale", size)) for size in results.sizes("scale")
    }
    least, most = min(times), max(times)
    if most > least:
        factor = (times[most] / times[least]) / (most / least)
        goal = "time grows at most 1.5 times linearly"
        text = f"{least} to {most}: {factor:.3g} times linear"
        verdicts.append(Verdict("scale", "all", goal, False, text, factor <= 1.5))
    largest = results.of("scale", str(most))
    peak = max(row.extra for row in largest)
    verdicts.append(Verdict("scale", str(most), "under 2 GB", False, f"{peak:.0f} MB", peak < 2000))
    return verdicts


def _kbest(results: Results) -> list[Verdict]:
    verdicts = []
    planar = results.of("kbest", ranking.PLANAR, "kbest")
    if planar:
        time = 1e3 * median(row.seconds for row in planar)
        verdicts.append(
            Verdict("kbest", ranking.PLANAR, "under 15 ms", False, f"median {time:.3g} ms", time < 15)
        )
    exact = {row.seed: row.seconds for row in results.of("kbest", ranking.SPATIAL, "exact")}
    spatial = [row.seconds / exact[row.seed] for row in results.of("kbest", ranking.SPATIAL, "kbest")]
    if spatial:
        text = f"median {median(spatial):.3g} times"
        goal = "at most 20 times one exact solve"
        verdicts.append(Verdict("kbest", ranking.SPATIAL, goal, False, text, median(spatial) <= 20))
    for row in results.of("kbest", ranking.SMALL):
        text = f"{row.extra:.0f} of 200"
        verdicts.append(
            Verdict("kbest", ranking.SMALL, "ranking equal to brute force", False, text, row.extra == 200)
        )
    return verdicts
