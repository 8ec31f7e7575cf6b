"""Which solver where, and what was measured there: made from the rows of the benchmarks."""

from pathlib import Path
from statistics import mean, median
from typing import NamedTuple

from experiments.benchmarks.goals import Results
from experiments.benchmarks.readme import LONG
from experiments.benchmarks.rows import Row, load
from experiments.common.contestants import HEURISTICS
from experiments.common.results import as_percent, as_time, table

ROWS = Path(__file__).resolve().parents[2] / "docs" / "benchmarks.csv"
"""What the benchmarks wrote."""


# mean excesses (shares) that differ by less are alike
_ALIKE = 1e-5


class _Scene(NamedTuple):
    """A family and size of the benchmarks, and how the page calls it."""

    family: str
    size: str
    words: str


SCENES = (
    _Scene("paper", "3 radars", "3 radars, 3 targets (the ant colony paper)"),
    _Scene("gated", "3x100", "gated, 3 sensors x 100"),
    _Scene("gated", "3x300", "gated, 3 x 300"),
    _Scene("gated", "3x1000", "gated, 3 x 1,000"),
    _Scene("gated", "4x300", "gated, 4 x 300"),
    _Scene("ghost", "20", "bearings only, 20 targets"),
    _Scene("ghost", "40", "bearings only, 40 targets"),
    _Scene("wide gap", "40", "the same where the linear program is 1 % off"),
    _Scene("ghost", "60", "bearings only, 60 targets"),
    _Scene("ghost", "100", "bearings only, 100 targets"),
    _Scene("known optimum", "n=30", "axial, known optimum, n = 30"),
    _Scene("random axial", "n=26", "axial, random costs, n = 26"),
)


def which_solver() -> str:
    """What each solver needs on each kind of scene."""
    results = Results(load(ROWS))
    heads = ["scenes", "`exact`", "`aco`, `genetic`, `tabu`", "`lagrangian`", "best peer", "so take"]
    return table(heads, [_row(results, scene) for scene in SCENES], lambda column: False)


def _row(results: Results, scene: _Scene) -> list[str]:
    def of(solver: str) -> list[Row]:
        return results.of(scene.family, scene.size, solver)

    heuristics = {solver: of(solver) for solver in HEURISTICS if of(solver)}
    return [
        scene.words, _exact(of("exact")), _heuristics(list(heuristics.values())),
        _lagrangian(of("lagrangian@0.1%"), of("lagrangian")), _peer(results, scene), _take(of("exact"), heuristics),
    ]  # fmt: skip


def _take(exact: list[Row], heuristics: dict[str, list[Row]]) -> str:
    """`exact` where it proved all; else, for a short time, what was best in the mean."""
    if all(row.status == "optimal" for row in exact) or not heuristics:
        return "`exact`"
    excess = {solver: mean(row.excess for row in rows) for solver, rows in heuristics.items()}
    least = min(excess.values())
    best = [f"`{solver}`" for solver in heuristics if excess[solver] <= least + _ALIKE]
    limit = next(iter(heuristics.values()))[0].limit
    return f"`exact`; with {limit:g} s only, {' or '.join(best)}"


def _exact(rows: list[Row]) -> str:
    proved = [row for row in rows if row.status == "optimal"]
    limit = rows[0].limit
    if not proved:
        return f"not proved in {limit:g} s, gap {as_percent(median(row.gap for row in rows))} %"
    if len(proved) < len(rows):
        return f"proved in {len(proved)} of {len(rows)} within {limit:g} s"
    longest = max(row.taken for row in rows)
    return f"{_middle(rows)}, proved" + (f" (at most {as_time(longest)})" if longest > 1.0 else "")


def _heuristics(solvers: list[list[Row]]) -> str:
    if not solvers:
        return "-"
    rows = [row for own in solvers for row in own]
    if all(row.hit for row in rows):
        times = sorted(median(row.taken for row in own) for own in solvers)
        return f"{as_time(times[0])} to {as_time(times[-1])}, optimal"
    excess = [row.excess for row in rows]
    return f"{rows[0].limit:g} s: {as_percent(median(excess))} %, at worst {as_percent(max(excess))} %"


def _lagrangian(stopped: list[Row], whole: list[Row]) -> str:
    if stopped:
        return f"{_middle(stopped)} to a gap of 0.1 %"
    if not whole:
        return "-"
    worst = max(row.excess for row in whole)
    return f"{_middle(whole)}, " + ("optimal" if all(row.hit for row in whole) else f"at worst {as_percent(worst)} %")


def _peer(results: Results, scene: _Scene) -> str:
    fastest = results.fastest_proof(scene.family, scene.size)
    if fastest is not None:
        return as_time(fastest[0])
    rows = [row for row in results.of(scene.family, scene.size) if row.peer and row.limit <= LONG]
    proved = {(row.seed, row.item) for row in rows if row.status == "optimal"}
    best = [row.excess for row in results.best_peers(scene.family, scene.size, LONG)]
    how = "proved by none" if not proved else f"proved in {len(proved)} of {len(best)}"
    limit = max(row.limit for row in rows)
    return f"{limit:g} s: {as_percent(median(best))} %, at worst {as_percent(max(best))} %, {how}"


def _middle(rows: list[Row]) -> str:
    return as_time(median(row.taken for row in rows))


TABLES = {"which-solver": which_solver}
