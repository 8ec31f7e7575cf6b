"""Large neighbourhoods: never worse, always feasible, the optimum when all rows are free."""

import numpy as np
import pytest

from assoc.errors import InfeasibleError
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.components.splitting import split_components
from assoc.packing.neighbourhoods.cover import Cover
from assoc.packing.neighbourhoods.large import LargeNeighbourhood
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from experiments.common.oracles import brute_force, gated_problem, small_problems


def _tried(problem, share, tries, rng):
    """Cost after some tries on every component, each from the greedy cover."""
    prepared = prepare(problem)
    packing = prepared.packing
    total = prepared.offset
    for component in split_components(packing, dual_bound(packing), np.arange(packing.num_columns)):
        cover = Cover.empty(component.packing)
        cover.add_greedily(np.argsort(component.packing.weights, kind="stable"))
        if not cover.complete(Run(rng)):
            raise InfeasibleError("no solution")
        neighbourhood = LargeNeighbourhood(component)
        owner, weight = cover.owner, cover.weight
        for _ in range(tries):
            neighbourhood.share = share
            found = neighbourhood.improve(component, owner, weight, rng, 1)
            assert found <= weight
            assert component.weight_of(owner) == pytest.approx(found, abs=1e-9)
            # what the owners say is a cover: every row of a chosen column is its own
            columns = np.unique(owner[owner >= 0])
            np.testing.assert_array_equal(Cover.of(component.packing, columns).owner, owner)
            assert (owner[~component.packing.slack] >= 0).all()
            weight = found
        total += weight
    return total


def test_all_rows_free_is_the_optimum():
    rng = np.random.default_rng(0)
    solved = 0
    for problem in small_problems(150, seed=8):
        try:
            expected = brute_force(problem)
        except InfeasibleError:
            continue
        assert _tried(problem, 1.0, 1, rng) == pytest.approx(expected, abs=1e-8)
        solved += 1
    assert solved > 100


def test_tries_never_lie_and_get_better():
    rng = np.random.default_rng(1)
    start = end = 0.0
    for number in range(30):
        problem = gated_problem(rng, (5, 6, 4), 0.3, ("mixed", "ties")[number % 2])
        start += _tried(problem, 0.5, 0, rng)
        found = _tried(problem, 0.5, 20, rng)
        assert found >= brute_force(problem) - 1e-9
        end += found
    assert end < start
