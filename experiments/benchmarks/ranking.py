"""The k best: against one exact solve."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import assoc
from assoc.costs import build_problem
from assoc.problem import AssignmentProblem
from experiments.benchmarks.rows import Row
from experiments.benchmarks.run import timed
from experiments.common.checking import check_answer
from experiments.common.instances import FIRST_SEED, scenes, synthetic
from experiments.common.measuring import clocked, fresh, one_core

PLANAR, PLANAR_K = "2-D n=100 k=100", 100
SPATIAL, SPATIAL_K = "3x20 k=20", 20


def run(seeds: int | None, log: Callable[[str], None], spatial_k: int = SPATIAL_K) -> list[Row]:
    """Time both goals' instances."""
    rows: list[Row] = []
    for problem in (synthetic.planar_random(5, 0), build_problem(scenes.gated(3, 5, 0), 0)):
        assoc.kbest(problem, 3)
    for seed in range(FIRST_SEED, FIRST_SEED + (seeds or 5)):
        planar = synthetic.planar_random(100, seed)
        spatial = build_problem(scenes.gated(3, 20, seed), 0)
        for size, problem, k in ((PLANAR, planar, PLANAR_K), (SPATIAL, spatial, spatial_k)):
            one, best = _timed("exact", size, problem, 1, seed)
            many, costs = _timed("kbest", size, problem, k, seed)
            check_ranked(costs, best[0])
            log(f"kbest {size} seed {seed}: {1e3 * many.seconds:.3g} ms, exact {1e3 * one.seconds:.3g} ms")
            rows += [many, one]
    return rows


def _timed(solver: str, size: str, problem: AssignmentProblem, k: int, seed: int) -> tuple[Row, list[float]]:
    """Rank the k best, several times where that is short, as all runs of the benchmark; the row, and their costs."""
    costs: list[float] = []
    row = Row("kbest", size, seed, 0, problem.num_tuples, solver, False, 0.0, 0.0, 0.0, 0.0, "optimal", proven=True)

    def run_once() -> Row:
        given = fresh(problem)
        with one_core():
            found, seconds, cpu = clocked(
                lambda: assoc.kbest(given, k) if solver == "kbest" else [assoc.assign(given, solver)]
            )
        costs[:] = [check_answer(problem, solution.tuples) for solution in found]
        best = costs[0]
        return replace(row, cost=best, bound=best, reference=best, seconds=seconds, cpu=cpu, extra=float(len(costs)))

    return timed(run_once), costs


def check_ranked(costs: Sequence[float], best: float) -> None:
    """Raise AssertionError where a ranking is not ascending, or does not begin with the optimum."""
    # ties may differ in the last digit when they are summed in another order
    allowed = 1e-9 * max(1.0, abs(best))
    if abs(costs[0] - best) > allowed or any(a - b > allowed for a, b in pairwise(costs)):
        raise AssertionError(f"kbest: not ranked, or not from the optimum {best}: {costs}")
