"""What is common to all solvers: one seed one answer, and that they stop when told and say why."""

import numpy as np
import pytest

from assoc.costs import build_problem
from assoc.problem import AssignmentProblem
from assoc.simulation import simulate
from assoc.solvers.assign import assign
from tests.oracles import check_answer, gated_problem
from tests.sizes import sample
from tests.solvers.test_against_brute_force import installed

QUICK = [name for name in installed() if name != "milp"]


@pytest.mark.parametrize("name", installed())
def test_same_seed_same_answer(name):
    rng = np.random.default_rng(9)
    problem = gated_problem(rng, (8, 8, 8), 0.4, "ties")
    first, second = (
        assign(AssignmentProblem(problem.tuples, problem.costs, problem.sizes), name, seed=7) for _ in range(2)
    )
    assert first.tuples.tolist() == second.tuples.tolist()
    assert first.cost == second.cost
    assert first.lower_bound == second.lower_bound
    assert first.iterations == second.iterations
    generator = assign(problem, name, seed=np.random.default_rng(7))
    assert generator.tuples.tolist() == first.tuples.tolist()


@pytest.fixture(scope="module")
def hard():
    """Random axial costs: far too hard to prove in a second, and full of near-optimal solutions."""
    return AssignmentProblem.from_dense(np.random.default_rng(10).integers(0, 100, (26, 26, 26)), dummy=False)


@pytest.mark.parametrize("name", [name for name in QUICK if name != "greedy"])
def test_time_limit(name, hard):
    endless = {key: 10**8 for key in ("iterations", "patience") if key in _fields(name)}
    assign(hard, name, time_limit=0.4, **endless)  # what must be compiled is compiled
    solution = assign(hard, name, time_limit=0.4, **endless)
    check_answer(hard, solution.tuples)
    assert solution.lower_bound <= solution.cost
    assert -1.0 <= solution.lower_bound <= 2.0
    if solution.status != "optimal":
        assert solution.stopped_by == "time_limit"


@pytest.mark.parametrize("name", [name for name in QUICK if name != "greedy"])
def test_callback_stops(name, hard):
    points = []
    solution = assign(hard, name, time_limit=20.0, callback=lambda point: points.append(point) or True)
    assert solution.stopped_by == "callback"
    assert points and points == list(solution.trace[: len(points)])
    check_answer(hard, solution.tuples)


@sample(
    "name, chosen",
    [(name, {}) for name in ("aco", "genetic", "tabu", "lagrangian")] + [("aco", {"mode": "paper"})],
    every=3,
)
def test_the_limit_of_iterations_is_named(name, chosen, hard):
    solution = assign(hard, name, iterations=1, time_limit=20.0, **chosen)
    assert solution.stopped_by == "iterations" and solution.iterations >= 1
    check_answer(hard, solution.tuples)
    # a search that ends by itself is not said to be cut off
    easy = gated_problem(np.random.default_rng(3), (3, 3, 3), 0.5)
    assert assign(easy, name, **chosen).stopped_by in ("converged", "gap")


def test_a_limit_of_nodes_is_kept_and_named():
    """What is known then holds."""
    problem = build_problem(simulate("bearing-only", seed=12, targets=24, scans=1), 0)
    best = assign(problem)
    assert best.status == "optimal"
    for nodes in (1, 5, 30):
        cut = assign(problem, nodes=nodes)
        assert cut.stopped_by == "iterations" and cut.iterations <= nodes
        assert cut.lower_bound - 1e-9 <= best.cost <= cut.cost + 1e-9 and cut.lower_bound < best.cost - 1e-3
        check_answer(problem, cut.tuples)


@pytest.mark.parametrize("name", QUICK)
def test_trace_never_gets_worse(name):
    problem = gated_problem(np.random.default_rng(12), (9, 9, 9), 0.5, "mixed")
    trace = assign(problem, name).trace
    assert trace
    costs = [point.cost for point in trace if np.isfinite(point.cost)]
    assert all(b <= a + 1e-6 for a, b in zip(costs, costs[1:], strict=False))
    seconds = [point.seconds for point in trace]
    assert seconds == sorted(seconds)
    assert all(point.lower_bound <= costs[-1] + 1e-6 for point in trace)


@pytest.mark.parametrize("name", QUICK)
def test_solving_leaves_the_problem_as_it_was(name):
    problem = gated_problem(np.random.default_rng(13), (5, 5, 5), 0.5)
    before = [array.copy() for array in _arrays(problem)]
    first = assign(problem, name)
    assert all(np.array_equal(a, b) for a, b in zip(before, _arrays(problem), strict=True))
    assert assign(problem, name).tuples.tolist() == first.tuples.tolist()


def _arrays(problem):
    return problem.tuples, problem.costs, problem.sizes


def _fields(name):
    from dataclasses import fields

    from assoc.solvers import parameters

    return {field.name for field in fields(parameters(name))}
