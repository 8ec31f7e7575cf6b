"""Cluster search: never worse, always feasible, exact when the cluster is the whole problem."""

import numpy as np
import pytest

from assoc._system.compiled import draws
from assoc.errors import InfeasibleError
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.bounds.priced import Priced
from assoc.packing.cover import Cover
from assoc.packing.neighbourhoods.cluster import ClusterSearch
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.solvers.methods import EXACT_METHODS
from tests.oracles import brute_force, gated_problem, small_problems
from tests.packing.test_dimensionwise import feasible
from tests.sizes import few_or_all


def _searched(problem, steps, size, rng):
    prepared = prepare(problem)
    packing = prepared.packing
    duals = dual_bound(packing)
    total = prepared.offset
    for c in range(packing.num_components):
        piece = packing.component(c)
        own = duals[packing.row_start[c] : packing.row_start[c + 1]]
        search = ClusterSearch(Priced.of(piece, own))
        search.size = size
        cover = Cover.empty(piece)
        cover.add_greedily(np.argsort(piece.weights, kind="stable"))
        if not cover.complete(Run(rng, methods=EXACT_METHODS)):
            raise InfeasibleError("no solution")
        before = cover.weight
        change, _ = search.search(piece.arrays, cover.owner, rng, steps, nodes=10**6)
        assert change <= 1e-9
        assert cover.weight == pytest.approx(before + change, abs=1e-9)
        feasible(piece, cover.owner)
        total += cover.weight
    return total


@few_or_all("count", 30, 300)
def test_whole_problem_is_solved(count):
    rng = draws(np.random.default_rng(0))
    for problem in small_problems(count, seed=4):
        try:
            expected = brute_force(problem)
        except InfeasibleError:
            continue
        # a cluster as large as the problem may grow from any row, but stops short of rows it cannot reach
        assert _searched(problem, 12, 10**6, rng) == pytest.approx(expected, abs=1e-8)


def test_small_clusters_never_lie():
    rng = draws(np.random.default_rng(1))
    for number in range(60):
        problem = gated_problem(rng, (5, 6, 4), 0.3, ("mixed", "ties")[number % 2])
        found = _searched(problem, 30, 6, rng)
        assert found >= brute_force(problem) - 1e-9
