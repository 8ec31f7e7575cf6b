"""The k best: against one exact solve, against Murty's algorithm of a peer, and against brute force."""

from __future__ import annotations

import importlib.util
import math
import time
from collections.abc import Callable

import numpy as np

import assoc
from assoc.errors import InfeasibleError
from assoc.problem import AssignmentProblem
from experiments.benchmarks import FIRST_SEED
from experiments.benchmarks.rows import Row
from experiments.benchmarks.run import one_core
from experiments.common.checking import check_answer
from experiments.common.instances import scenes, synthetic

PLANAR, PLANAR_K = "2-D n=100 k=100", 100
SPATIAL, SPATIAL_K = "3x20 k=20", 20
SMALL = "200 small problems"


def run(quick: bool, seeds: int | None, log: Callable[[str], None]) -> list[Row]:
    """Time both goals' instances and check the ranking on small problems against enumeration."""
    from assoc.costs import build_problem

    rows: list[Row] = []
    assoc.kbest(synthetic.planar_random(5, 0), 3)
    assoc.kbest(build_problem(scenes.gated(3, 5, 0), 0), 3)
    for seed in range(FIRST_SEED, FIRST_SEED + (seeds or (2 if quick else 5))):
        planar = synthetic.planar_random(100, seed)
        spatial = build_problem(scenes.gated(3, 20, seed), 0)
        for size, problem, k in ((PLANAR, planar, PLANAR_K), (SPATIAL, spatial, SPATIAL_K)):
            found = [_kbest(size, problem, k, seed), _exact(size, problem, seed)]
            if size == PLANAR and importlib.util.find_spec("pytcl") is not None:
                found.append(_murty_peer(size, planar, k, seed))
            log(
                f"kbest {size} seed {seed}: "
                + ", ".join(f"{r.solver} {1e3 * r.seconds:.3g} ms" for r in found)
            )
            rows += found
    row = _small(200)
    log(f"kbest ranking equal to brute force on {row.extra:.0f} of 200 problems")
    return [*rows, row]


def _fresh(problem: AssignmentProblem) -> AssignmentProblem:
    return AssignmentProblem(problem.tuples, problem.costs, problem.sizes, dummy=problem.dummy)


def _row(
    size: str, problem: AssignmentProblem, solver: str, seed: int, seconds: float, costs: list[float]
) -> Row:
    """Return a row whose cost is the sum of the ranked costs (so that peers can be compared)."""
    cost = math.fsum(costs)
    peer = solver == "nrl_tracker"
    bound = -math.inf if peer else cost
    return Row(
        family="kbest",
        size=size,
        seed=seed,
        item=0,
        tuples=problem.num_tuples,
        solver=solver,
        peer=peer,
        limit=0.0,
        cost=cost,
        bound=bound,
        seconds=seconds,
        status="optimal",
        reference=cost,
        proven=True,
        extra=float(len(costs)),
    )


def _kbest(size: str, problem: AssignmentProblem, k: int, seed: int) -> Row:
    with one_core():
        start = time.perf_counter()
        ranked = assoc.kbest(_fresh(problem), k)
        seconds = time.perf_counter() - start
    costs = [check_answer(problem, solution.tuples) for solution in ranked]
    if costs != sorted(costs):
        # ties may differ in the last digit when they are summed in another order
        drop = max(a - b for a, b in zip(costs, costs[1:], strict=False))
        if drop > 1e-9 * max(1.0, abs(costs[0])):
            raise AssertionError(f"kbest: not ranked, falls by {drop}")
    return _row(size, problem, "kbest", seed, seconds, costs)


def _exact(size: str, problem: AssignmentProblem, seed: int) -> Row:
    with one_core():
        start = time.perf_counter()
        solution = assoc.assign(_fresh(problem), "exact")
        seconds = time.perf_counter() - start
    return _row(size, problem, "exact", seed, seconds, [solution.cost])


def _murty_peer(size: str, problem: AssignmentProblem, k: int, seed: int) -> Row:
    from pytcl.assignment_algorithms.two_dimensional.kbest import (  # type: ignore[import-untyped,unused-ignore]
        murty,
    )

    start = time.perf_counter()
    result = murty(problem.to_dense(), k)
    seconds = time.perf_counter() - start
    return _row(size, problem, "nrl_tracker", seed, seconds, np.asarray(result.costs).tolist())


def _small(count: int) -> Row:
    """Count the small problems whose ranking equals full enumeration; some have fewer than k solutions."""
    from experiments.common import oracles

    equal = 0
    start = time.perf_counter()
    for number, problem in enumerate(oracles.small_problems(count, seed=FIRST_SEED)):
        k = (3, 10, 40)[number % 3]
        expected = [solution.cost for solution in oracles.all_solutions(problem)[:k]]
        try:
            costs = [solution.cost for solution in assoc.kbest(problem, k)]
        except InfeasibleError:
            costs = []
        equal += len(costs) == len(expected) and bool(np.allclose(costs, expected, rtol=0.0, atol=1e-9))
    seconds = time.perf_counter() - start
    return Row(
        "kbest", SMALL, FIRST_SEED, 0, 0, "kbest", False, 0.0, 0.0, 0.0, seconds, "optimal", 0.0, True, equal
    )
