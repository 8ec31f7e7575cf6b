"""Warm starts: every solver takes one, none answers worse, and what is no solution is refused at the door."""

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


def test_what_is_no_solution_is_refused(problem, axial):
    best = assoc.assign(problem)

    def refused(start, message, of=problem):
        with pytest.raises(assoc.InvalidInputError, match=message):
            assoc.assign(of, start=start)

    refused(best.tuples, "start: expected a Solution, got ndarray")
    refused(replace(best, tuples=best.tuples[:, :2]), "start: expected tuples of 3 sensors")
    refused(replace(best, tuples=np.vstack([best.tuples, best.tuples[-1:]])), "is in 2 tuples")
    for wrong in (best.tuples * 1.0, best.tuples * np.nan, best.tuples.astype(str), best.tuples.astype(object)):
        refused(
            replace(best, tuples=wrong), f"start: expected tuples of whole numbers, 0 for a miss, got {wrong.dtype}"
        )
    refused(replace(best, tuples=-best.tuples), "start: expected tuples of whole numbers, 0 for a miss, got -")


def told_to_a_solver(problem, start):
    """Tuples of the columns that a solver gets to begin with."""
    seen = []

    def look(packing, parameters, run):
        seen.append(None if run.start is None else sorted(packing.origin[run.start].tolist()))
        return Outcome(packing.arrays.cols[:0, 0] if run.start is None else run.start, 1)

    name = f"look {len(registry.names())}"
    registry.register(name, registry.parameters("greedy"), look)
    assoc.assign(problem, name, start=start)
    return seen[0] if seen[0] is None else problem.tuples[seen[0]].tolist()


def test_a_start_is_used_as_far_as_it_goes(problem, axial):
    """A target is gone, or a measurement is new: the other tuples are still a start."""
    best = assoc.assign(problem)
    targets = best.tuples[(best.tuples > 0).sum(axis=1) > 1].tolist()
    gone = ~(problem.tuples == targets[0]).all(axis=1)
    fewer = assoc.AssignmentProblem(problem.tuples[gone], problem.costs[gone], problem.sizes)
    assert sorted(told_to_a_solver(fewer, best)) == targets[1:]
    assert sorted(told_to_a_solver(problem, replace(best, tuples=best.tuples[1:]))) == sorted(
        one for one in targets if one != best.tuples[0].tolist()
    )
    # measurements that the problem does not have, up to the largest number
    far = np.vstack([best.tuples, np.full((1, 3), np.iinfo(np.int64).max)])
    assert sorted(told_to_a_solver(problem, replace(best, tuples=far))) == targets
    # without dummies the rest is covered anew
    some = assoc.assign(axial)
    assert len(told_to_a_solver(axial, replace(some, tuples=some.tuples[1:]))) == 5
    assert assoc.assign(axial, "tabu", start=best).status == "optimal"
