"""The goals of the benchmark, each read off the rows: what was asked, what was measured, met or not."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import median

from experiments.benchmarks import ranking
from experiments.benchmarks.rows import Row
from experiments.common.contestants import HEURISTICS
from experiments.common.results import as_percent

# median seconds of `exact` in this table before it had linear programs at its nodes
_FORMER = {("known optimum", "n=30"): 0.180, ("known optimum", "n=50"): 6.03, ("random axial", "n=26"): 0.265}
EXACT = ("exact",)
LONG = 60.0
"""Seconds that peers have at the most in what is compared with ours."""
PROVING_PEERS = ("cp_sat", "cp_sat_1", "highs", "scip", "scip_1")


@dataclass(frozen=True)
class Verdict:
    """A goal of one family and size.

    family, size, goal: What was asked.
    measured: What was measured, with the numbers.
    """

    family: str
    size: str
    goal: str
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
            if row.family == family and (size is None or row.size == size) and (solver is None or row.solver == solver)
        ]

    def sizes(self, family: str) -> list[str]:
        """Return the sizes measured, in order."""
        return list(dict.fromkeys(row.size for row in self.of(family)))

    def fastest_peer(self, row: Row, peers: Sequence[str] = PROVING_PEERS) -> float:
        """Return the least time in which one of these peers proved the optimum of the row's instance."""
        times = [
            other.taken
            for other in self._same_instance(row)
            if other.peer and other.solver in peers and other.status == "optimal"
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

    def least_of_peers(self, row: Row, peers: Sequence[str]) -> float:
        """Return that time, or where none of them proved it the longest limit that one had: less it was not."""
        limits = [other.limit for other in self._same_instance(row) if other.peer and other.solver in peers]
        return min(self.fastest_peer(row, peers), max(limits, default=math.inf))

    def best_peer(self, row: Row, within: float) -> float:
        """Return the least cost that any peer had on the row's instance within some seconds."""
        costs = [
            other.cost
            for other in self._same_instance(row)
            if other.peer and (other.limit <= within or other.seconds <= within)
        ]
        return min(costs, default=math.inf)

    def best_peers(self, family: str, size: str, within: float) -> list[Row]:
        """Return, for each instance, the row of a peer with the least cost, of those given so many seconds or less."""
        rows = [row for row in self.of(family, size) if row.peer and row.limit <= within]
        return list({(row.seed, row.item): row for row in sorted(rows, key=lambda row: -row.cost)}.values())

    def _same_instance(self, row: Row) -> list[Row]:
        return [o for o in self.of(row.family, row.size) if (o.seed, o.item) == (row.seed, row.item)]


Judged = Callable[[list[Row], Results], tuple[str, bool]]
"""From the rows of one solver, and all rows, to what was measured, and whether that is enough."""


def _spread(values: Sequence[float]) -> str:
    return f"median {as_percent(median(values))} %, worst {as_percent(max(values))} %"


def _proved(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if row.status == "optimal"]


def _share(needed: float = 1.0) -> Judged:
    """The reference is found on a share of the runs."""

    def judged(rows: list[Row], results: Results) -> tuple[str, bool]:
        hits = sum(row.hit for row in rows)
        return f"{hits} of {len(rows)}", hits / len(rows) >= needed

    return judged


def _in_time(seconds: float, *, ms: bool = False) -> Judged:
    """The median time is no longer."""

    def judged(rows: list[Row], results: Results) -> tuple[str, bool]:
        time = median(row.taken for row in rows)
        return f"median {1e3 * time:.3g} ms" if ms else f"median {time:.3g} s", time <= seconds

    return judged


def _within(allowed: float) -> Judged:
    """No excess is larger."""

    def judged(rows: list[Row], results: Results) -> tuple[str, bool]:
        excess = [row.excess for row in rows]
        return f"{_spread(excess)} above", max(excess) <= allowed

    return judged


def _ahead(times: float, least: float, peers: Sequence[str] = PROVING_PEERS) -> Judged:
    """So many times as fast as the fastest of these peers, in the median and at the least.

    Where a solver proves nothing it is not faster; where no peer does, the longest limit of these peers stands for
    their time: they are slower than that.
    """

    def judged(rows: list[Row], results: Results) -> tuple[str, bool]:
        theirs = {row: results.least_of_peers(row, peers) for row in rows}
        ratios = [
            time / row.taken if row.status == "optimal" else 0.0 for row, time in theirs.items() if math.isfinite(time)
        ]
        if not ratios:
            return "not measured", False
        text = f"proves {len(_proved(rows))} of {len(rows)}, median {median(ratios):.3g} times, least {min(ratios):.3g}"
        return text, median(ratios) >= times and min(ratios) >= least

    return judged


def _optimum(rows: list[Row], results: Results) -> tuple[str, bool]:
    found = all(row.hit and row.status == "optimal" for row in rows)
    return f"worst excess {max(row.excess for row in rows):.2g}", found


def _all_proved(rows: list[Row], results: Results) -> tuple[str, bool]:
    proved = len(_proved(rows))
    return f"{proved} of {len(rows)}, at most {max(row.taken for row in rows):.3g} s", proved == len(rows)


def _lagrangian_speed(rows: list[Row], results: Results) -> tuple[str, bool]:
    family, size = rows[0].family, rows[0].size
    theirs = results.of(family, size, "cp_sat") or results.of(family, size, "cp_sat_1")
    peer = {row.seed: row.taken for row in theirs}
    ratio = median(peer.get(row.seed, 0.0) / row.taken for row in rows)
    text = f"worst gap {as_percent(max(row.gap for row in rows))} %, median 1/{ratio:.3g} of its time"
    return text, ratio >= 50 and all(row.gap <= 1e-3 for row in rows)


def _small_gaps_in_time(rows: list[Row], results: Results) -> tuple[str, bool]:
    """None of the scenes whose linear program is less than 0.2 % below the optimum takes longer than 3 s."""
    near = [row.taken if row.status == "optimal" else math.inf for row in rows if 0 < row.extra < 2e-3]
    most = max(near, default=math.inf)
    return f"at most {most:.3g} s on the {len(near)} of gap below 0.2 %", most <= 3.0


def _proofs_and_gaps(share: float = 0.0, middle: float = math.inf, most: float = math.inf) -> Judged:
    """A share is proved; the median and the widest gap are no wider."""

    def judged(rows: list[Row], results: Results) -> tuple[str, bool]:
        proved, gaps = len(_proved(rows)), [row.gap for row in rows]
        met = proved >= share * len(rows) and median(gaps) <= middle and max(gaps) <= most
        return f"proves {proved} of {len(rows)}; gap {_spread(gaps)}", met

    return judged


def _above_peers(within: float, summary: Callable[[Sequence[float]], float]) -> Judged:
    """The median or largest cost, relative to the best of any peer within so many seconds, is no higher."""

    def judged(rows: list[Row], results: Results) -> tuple[str, bool]:
        best = [results.best_peer(row, within) for row in rows]
        excess = [
            (row.cost - other) / max(1.0, abs(other)) if math.isfinite(other) else -math.inf
            for row, other in zip(rows, best, strict=True)
        ]
        return f"{_spread(excess)} above", summary(excess) <= 1e-9

    return judged


def _beside_exact(rows: list[Row], results: Results) -> tuple[str, bool]:
    exact = {row.seed: row.seconds for row in results.of("kbest", rows[0].size, "exact")}
    times = median(row.seconds / exact[row.seed] for row in rows)
    return f"median {times:.3g} times", times <= 20


_ANY, _ALL = "any size", "all"
_BOUND = "lagrangian@0.1%"
_FAST = "times faster (median) than the fastest peer, never slower"
GOALS: tuple[tuple[str, str, Sequence[str], str, Judged], ...] = (
    ("paper", _ANY, ("exact", "lagrangian", *HEURISTICS), "optimal on every scan", _share()),
    ("paper", _ANY, HEURISTICS, "a scan in less than 1 ms", _in_time(1e-3, ms=True)),
    ("gated", _ANY, EXACT, "the optimum, proven", _optimum),
    *(("gated", size, EXACT, f"{20 + 10 * (size == '3x300')} {_FAST}", _ahead(20 + 10 * (size == "3x300"), 1.0))
      for size in ("3x100", "3x300", "3x1000", "4x300", "5x200")),
    ("gated", _ANY, (_BOUND,), "gap <= 0.1 % in 1/50 of CP-SAT's time", _lagrangian_speed),
    ("gated", "3x300", HEURISTICS, "within 0.01 % of the optimum in 1 s", _within(1e-4)),
    ("ghost", "20", EXACT, "faster than every peer on each seed", _ahead(0.0, 1.0)),
    ("ghost", "40", EXACT, "5 times as fast as HiGHS (median), never slower", _ahead(5.0, 1.0, ("highs",))),
    ("ghost", "40", EXACT, "at most 3 s where the linear program's gap is below 0.2 %", _small_gaps_in_time),
    ("ghost", "60", EXACT, "proof in 60 s on 3 of 5", _proofs_and_gaps(share=0.6)),
    ("ghost", "100", EXACT, "gap at most 0.01 % in 30 s (median)", _proofs_and_gaps(middle=1e-4)),
    ("ghost", "100", EXACT, "gap at most 0.01 % in 30 s (each seed)", _proofs_and_gaps(most=1e-4)),
    ("ghost", _ANY, HEURISTICS, "in 5 s at or below any peer after 5 s (each seed)", _above_peers(5.0, max)),
    ("ghost", _ANY, HEURISTICS, f"in 5 s at or below any peer after {LONG:g} s (median)", _above_peers(LONG, median)),
    ("ghost", _ANY, HEURISTICS, f"in 5 s at or below any peer after {LONG:g} s (each seed)", _above_peers(LONG, max)),
    ("wide gap", _ANY, EXACT, "faster than SCIP and HiGHS", _ahead(0.0, 1.0, ("highs", "scip", "scip_1"))),
    ("wide gates", _ANY, EXACT, "3 times as fast as HiGHS, 5 in the median", _ahead(5.0, 3.0, ("highs",))),
    *(("known optimum", size, EXACT, "proof in 20 s", _all_proved) for size in ("n=30", "n=50")),
    *((family, size, EXACT, f"no slower than it was ({time:.3g} s)", _in_time(time))
      for (family, size), time in _FORMER.items()),
    ("known optimum", "n=10", HEURISTICS, "the optimum, always", _share()),
    ("known optimum", "n=20", HEURISTICS, "the optimum in 90 % of runs, 5 s", _share(0.9)),
    ("known optimum", "n=30", HEURISTICS, "within 1 %, 5 s", _within(0.01)),
    ("random axial", _ALL, EXACT, "proof in 60 s", _all_proved),
    ("random axial", "n=12", HEURISTICS, "the optimum, always, 5 s", _share()),
    ("planted", _ANY, ("exact", "lagrangian", *HEURISTICS, "milp"), "optimal", _share()),
    ("kbest", ranking.PLANAR, ("kbest",), "under 15 ms", _in_time(0.015, ms=True)),
    ("kbest", ranking.SPATIAL, ("kbest",), "at most 20 times one exact solve", _beside_exact),
)  # fmt: skip
"""Family, size, solvers, what is asked, and what judges it; each size and solver is a goal of its own."""


def judge(rows: Iterable[Row]) -> list[Verdict]:
    """Return the verdict on every goal whose rows were measured."""
    results = Results(rows)
    found = []
    for family, which, solvers, goal, judged in GOALS:
        for size in results.sizes(family) if which == _ANY else [which]:
            for solver in solvers:
                if own := results.of(family, None if size == _ALL else size, solver):
                    words = f"{solver.partition('@')[0]}: {goal}"
                    found.append(Verdict(family, size, words, *judged(own, results)))
    order = [*dict.fromkeys(family for family, *_ in GOALS)]
    return sorted(found, key=lambda verdict: (order.index(verdict.family), verdict.size))
