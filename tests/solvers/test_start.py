"""Warm starts: every solver takes one, none answers worse, and what is no solution is refused at the door."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import assoc
from assoc.simulation import simulate
from assoc.solvers import Outcome, registry

WAYS = [
    ("greedy", {}),
    ("exact", {}),
    ("aco", {"iterations": 2}),
    ("aco", {"mode": "paper", "iterations": 2}),
    ("genetic", {"iterations": 1}),
    ("tabu", {"iterations": 1}),
    ("lagrangian", {"iterations": 1, "polish": False}),
    ("milp", {"backend": "scip"}),
    ("milp", {"backend": "cp_sat"}),
    ("milp", {"backend": "highs"}),
]


@pytest.fixture(scope="module")
def problem():
    return assoc.build_problem(simulate("bearing-only", seed=5, scans=1, targets=7), 0)


@pytest.fixture(scope="module")
def axial():
    return assoc.AssignmentProblem.from_dense(np.random.default_rng(1).normal(size=(5, 5, 5)), dummy=False)


@pytest.mark.parametrize(("solver", "parameters"), WAYS, ids=["-".join(map(str, [a, *b.values()])) for a, b in WAYS])
@pytest.mark.parametrize("kind", ["problem", "axial"])
def test_no_answer_is_worse_than_its_start(request, kind, solver, parameters):
    given = request.getfixturevalue(kind)
    best = assoc.assign(given, "exact")
    assert best.status == "optimal"
    again = assoc.assign(given, solver, start=best, **parameters)
    assert again.cost == pytest.approx(best.cost, abs=1e-9) and again.lower_bound <= best.cost + 1e-9
    assert again.solver == solver and again.trace[-1].cost == pytest.approx(best.cost, abs=1e-6)
    # a poor one does no harm
    poor = assoc.assign(given, "greedy")
    assert assoc.assign(given, solver, start=poor, **parameters).cost <= poor.cost + 1e-9


def test_it_is_the_incumbent_of_the_search():
    """With the optimum given, the paper's ants keep it, where without it they end far above."""
    given = assoc.build_problem(simulate("bearing-only", seed=2, scans=1, targets=15), 0)
    best = assoc.assign(given, "exact")
    alone = assoc.assign(given, "aco", mode="paper", ants=2, iterations=1)
    warm = assoc.assign(given, "aco", mode="paper", ants=2, iterations=1, start=best)
    assert warm.cost == pytest.approx(best.cost) and best.cost < alone.cost - 1.0
    # and the solvers see it: their own incumbents are not set on top of it afterwards
    for solver in ("aco", "genetic", "tabu", "lagrangian", "exact"):
        costs = [point.cost for point in assoc.assign(given, solver, start=best).trace]
        assert max(costs) <= best.cost + 1e-6, solver


def test_a_solver_of_ones_own_gets_it(problem):
    best = assoc.assign(problem, "exact")
    seen = []

    def nothing(packing, parameters, run):
        seen.append(run.start)
        return Outcome(np.zeros(0, dtype=int), 1)

    registry.register("nothing", registry.parameters("greedy"), nothing)
    try:
        assert assoc.assign(problem, "nothing").cost > best.cost
        assert assoc.assign(problem, "nothing", start=best).cost == pytest.approx(best.cost)
    finally:
        registry._REGISTERED.pop("nothing")
    assert seen[0] is None and len(seen[1]) == np.count_nonzero((best.tuples > 0).sum(axis=1) > 1)


def test_a_solution_of_the_same_tuples_at_other_costs(problem):
    """What was the optimum yesterday is a start today, and its tuples may not be worth it any more."""
    rng = np.random.default_rng(0)
    other = assoc.AssignmentProblem(problem.tuples, problem.costs + rng.normal(0, 5, problem.num_tuples), problem.sizes)
    start = assoc.assign(problem)
    warm = assoc.assign(other, "aco", start=start)
    assert warm.cost == pytest.approx(assoc.assign(other).cost)
    costly = assoc.AssignmentProblem(problem.tuples, np.abs(problem.costs), problem.sizes)
    assert assoc.assign(costly, "tabu", start=start).cost == pytest.approx(assoc.assign(costly).cost)


def test_what_is_no_solution_is_refused(problem, axial):
    best = assoc.assign(problem)

    def refused(start, message, of=problem):
        with pytest.raises(assoc.InvalidInputError, match=message):
            assoc.assign(of, start=start)

    refused(best.tuples, "start: expected a Solution, got ndarray")
    refused(best, "start: names measurements that the problem does not have", axial)
    refused(replace(best, tuples=best.tuples[:, :2]), "start: expected tuples of 3 sensors")
    refused(replace(best, tuples=best.tuples[1:]), "every measurement exactly once; .* is in 0 tuples")
    refused(replace(best, tuples=np.vstack([best.tuples, best.tuples[-1:]])), "is in 2 tuples")
    pair = best.tuples[(best.tuples > 0).sum(axis=1) > 1][0]
    keep = ~(problem.tuples == pair).all(axis=1)
    fewer = assoc.AssignmentProblem(problem.tuples[keep], problem.costs[keep], problem.sizes)
    refused(best, rf"start: the tuple \({', '.join(map(str, pair))}\) is no candidate of this problem", fewer)
    # without dummies the smallest sensors' measurements must be used, and only they
    some = assoc.assign(axial)
    refused(replace(some, tuples=some.tuples[1:]), "every measurement exactly once; .* is in 0 tuples", axial)
    wide = assoc.AssignmentProblem.from_dense(np.random.default_rng(1).normal(size=(3, 4, 5)), dummy=False)
    best = assoc.assign(wide)
    assert assoc.assign(wide, "tabu", start=best).cost == pytest.approx(best.cost)
    refused(replace(best, tuples=best.tuples[1:]), "every measurement exactly once; .* is in 0 tuples", wide)
