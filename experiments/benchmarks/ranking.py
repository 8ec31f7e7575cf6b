"""The k best: against one exact solve and against Murty's algorithm of a peer."""

import importlib.util
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

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
PEER = "nrl_tracker"

Rank = Callable[[AssignmentProblem, int], Callable[[AssignmentProblem], list[float]]]
"""Ranks the k best; what it returns checks them against the problem and returns their costs, and is not timed."""


class Ranking(NamedTuple):
    """A row, whose cost is that of the first solution, and the costs of all, in their order."""

    row: Row
    costs: list[float]


def run(seeds: int | None, log: Callable[[str], None], spatial_k: int = SPATIAL_K) -> list[Row]:
    """Time both goals' instances."""
    rows: list[Row] = []
    spatial = build_problem(scenes.gated(3, 5, 0), 0)
    for problem in (synthetic.planar_random(5, 0), spatial):
        assoc.kbest(problem, 3)
    for seed in range(FIRST_SEED, FIRST_SEED + (seeds or 5)):
        planar = synthetic.planar_random(100, seed)
        spatial = build_problem(scenes.gated(3, 20, seed), 0)
        for size, problem, k in ((PLANAR, planar, PLANAR_K), (SPATIAL, spatial, spatial_k)):
            ways = {"kbest": _kbest, "exact": _exact}
            if size == PLANAR and importlib.util.find_spec("pytcl") is not None:
                ways[PEER] = _murty_peer
            found = compared([_ranked(solver, rank, size, problem, k, seed) for solver, rank in ways.items()])
            log(f"kbest {size} seed {seed}: " + ", ".join(f"{r.solver} {1e3 * r.seconds:.3g} ms" for r in found))
            rows += found
    return rows


def _ranked(solver: str, rank: Rank, size: str, problem: AssignmentProblem, k: int, seed: int) -> Ranking:
    """Rank the k best, several times where that is short, as all runs of the benchmark."""
    costs: list[float] = []

    def run_once() -> Row:
        given = fresh(problem)
        with one_core():
            found, seconds, cpu = clocked(lambda: rank(given, k))
        costs[:] = found(problem)
        best, peer = costs[0], solver == PEER
        return Row(
            "kbest", size, seed, 0, problem.num_tuples, solver, peer, 0.0, best,
            -math.inf if peer else best, seconds, "optimal", best, True, cpu=cpu,
        )  # fmt: skip

    return Ranking(timed(run_once), costs)


def compared(rankings: Sequence[Ranking]) -> list[Row]:
    """Rows of the rankings of one problem, `kbest` first, each with how many of its solutions are the next best.

    AssertionError: `kbest` is not ascending, or another one has something better, or more.
    """
    ours = rankings[0].costs
    allowed = 1e-9 * max(1.0, abs(ours[0]))
    # ties may differ in the last digit when they are summed in another order
    if any(a - b > allowed for a, b in pairwise(ours)):
        raise AssertionError(f"kbest: not ranked: {ours}")
    rows = []
    for row, costs in rankings:
        if len(costs) > len(ours):
            raise AssertionError(f"kbest: {row.solver} has {len(costs)} solutions, not {len(ours)}")
        above = np.asarray(ours[: len(costs)]) - np.sort(costs)
        if above.max() > allowed:
            raise AssertionError(f"kbest: {row.solver} has better: {costs}, not {ours}")
        rows.append(replace(row, extra=float(np.count_nonzero(above >= -allowed))))
    return rows


def _kbest(problem: AssignmentProblem, k: int) -> Callable[[AssignmentProblem], list[float]]:
    found = assoc.kbest(problem, k)
    return lambda original: [check_answer(original, solution.tuples) for solution in found]


def _exact(problem: AssignmentProblem, k: int) -> Callable[[AssignmentProblem], list[float]]:
    """The first alone."""
    found = assoc.assign(problem, "exact")
    return lambda original: [check_answer(original, found.tuples)]


def _murty_peer(problem: AssignmentProblem, k: int) -> Callable[[AssignmentProblem], list[float]]:
    from pytcl.assignment_algorithms.two_dimensional.kbest import murty

    found = murty(problem.to_dense(), k)
    return lambda original: np.asarray(found.costs).tolist()
