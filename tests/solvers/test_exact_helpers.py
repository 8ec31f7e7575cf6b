"""When `exact` lets metaheuristics help its branching."""

import numpy as np
import pytest

from assoc.costs import build_problem
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.component import split_components
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.packing.turns import Turns
from assoc.solvers.exact import search as exact
from assoc.solvers.methods import EXACT_METHODS
from experiments.common.instances.scenes import ghost
from tests.solvers.pieces import with_greedy_cover


@pytest.mark.parametrize(("age", "joins"), [(0, False), (exact._ALONE - 1, True)])
def test_they_join_a_long_search_of_a_small_component(age, joins):
    """After so many turns of branching, and not before; the optimum is the same."""
    prepared = prepare(build_problem(ghost(20, 2018), 0))
    packing, run = prepared.packing, Run(0, methods=EXACT_METHODS)
    components = split_components(packing, dual_bound(packing), np.arange(packing.num_columns))
    searches = exact._Searches(run=run, node_limit=10**6, patience=10)
    weight, joined = prepared.offset, False
    for component in components:
        with_greedy_cover(component)
        task = exact._Task(component, searches, age=age)
        while not component.closed and not task.turn():
            pass
        assert component.weight - component.lower_bound <= 1e-6
        weight += component.weight
        joined |= task.improver is not None
    assert weight == pytest.approx(-315.9909, abs=1e-4) and joined == joins


def test_bounds_of_many_components_are_added_up_exactly():
    run = Run(0)
    parts = [1e16, 1.0, -1e16, 1.0] * 500
    Turns(run=run, iterations=3, weights=parts, bounds=[-part for part in parts]).record()
    assert (run.trace[-1].cost, run.trace[-1].lower_bound) == (1000.0, -1000.0)
