"""When `exact` lets metaheuristics help its branching."""

from functools import partial

import numpy as np
import pytest

from assoc import assign
from assoc.costs import build_problem
from assoc.packing.branching.counts import Splitting
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.components import closing
from assoc.packing.components.turns import Turns
from assoc.packing.run import Run
from assoc.solvers.exact import search as exact
from experiments.common.instances.scenes import ghost


@pytest.mark.parametrize("alone", [3, 10**9])
def test_they_join_a_long_search_of_a_small_component(monkeypatch, alone):
    """After so many turns of branching, and not before; the optimum is the same."""
    joined = []
    usual = exact._Task._search_better

    def noted(task):
        joined.append(task.age)
        usual(task)

    monkeypatch.setattr(exact, "_ALONE", alone)
    # not split on counts: then it is over at once
    monkeypatch.setattr(closing, "BranchAndBound", partial(BranchAndBound, splitting=Splitting(10**9)))
    monkeypatch.setattr(exact._Task, "_search_better", noted)
    solution = assign(build_problem(ghost(20, 2018), 0), "exact")
    assert solution.status == "optimal" and solution.cost == pytest.approx(-315.9909, abs=1e-4)
    assert bool(joined) == (alone == 3) and all(age >= alone for age in joined)


@pytest.mark.slow
def test_a_long_search_says_from_the_beginning_what_it_knows():
    """The first solution and bound come in the first tenth of a search of forty nodes, and better ones after them."""
    trace = assign(build_problem(ghost(60, 7001), 0), "exact", nodes=40).trace
    first, last = trace[0], trace[-1]
    assert np.isfinite([first.cost, first.lower_bound]).all()
    assert first.seconds < 0.1 * last.seconds
    assert first.cost > last.cost and first.lower_bound < last.lower_bound
    silences = np.diff([point.seconds for point in trace])
    assert len(trace) > 4 and silences.max() < 0.7 * last.seconds


def test_bounds_of_many_components_are_added_up_exactly():
    run = Run(0)
    parts = [1e16, 1.0, -1e16, 1.0] * 500
    Turns(run=run, iterations=3, weights=parts, bounds=[-part for part in parts]).record()
    assert (run.trace[-1].cost, run.trace[-1].lower_bound) == (1000.0, -1000.0)
