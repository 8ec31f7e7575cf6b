"""Every solver against exhaustive search on small problems of every shape and temper."""

import importlib

import numpy as np
import pytest

from assoc import solvers
from assoc.errors import InfeasibleError
from assoc.problem import AssignmentProblem
from assoc.solution import OPTIMALITY_TOLERANCE
from assoc.solvers.assign import assign
from tests.oracles import brute_force, check_answer, gated_problem, milp_optimum, small_problems
from tests.sizes import few_or_all

# milp has a test file of its own, and its backends take their time
PROVING = ("exact", "milp")

# Blackman & Popoli, tables 7.4-7.6: 3 sensors x 2, dummy index 0, cost = -score
SCORES = (
    "011:10.2 021:4.7 022:5.5 101:6.8 102:5.2 110:6.8 120:10.9 111:18 112:14.8 121:17 122:9.9 201:13.2 "
    "202:10.6 210:4.5 220:11.1 212:14.1 221:9 222:16.7"
)


def installed():
    """Solvers of the registry whose module exists."""
    found = []
    for name in solvers.names():
        try:
            importlib.import_module(f"assoc.solvers.{name}")
        except ModuleNotFoundError:
            continue
        found.append(name)
    return found


def blackman_popoli():
    """The textbook's problem; singletons that are not listed cost 0."""
    entries = [entry.split(":") for entry in SCORES.split()]
    tuples = [[int(digit) for digit in key] for key, _ in entries]
    return AssignmentProblem(tuples, [-float(score) for _, score in entries], [2, 2, 2])


def check(problem, solution, optimum):
    """What every answer owes, whatever the solver."""
    cost = check_answer(problem, solution.tuples)
    scale = max(1.0, float(np.abs(problem.costs).sum()))
    assert cost == pytest.approx(solution.cost, abs=1e-12 * scale)
    assert solution.lower_bound <= optimum + 1e-12 * scale
    assert optimum <= cost + 1e-12 * scale
    assert solution.gap >= 0.0
    if solution.status == "optimal":
        assert cost <= optimum + OPTIMALITY_TOLERANCE * max(1.0, abs(cost)) + 1e-12 * scale
    assert np.array_equal(problem.tuples[solution.indices], solution.tuples)
    assert problem.costs[solution.indices].sum() == pytest.approx(cost, abs=1e-12 * scale)


@pytest.mark.parametrize("name", installed())
@few_or_all("share", 0.2, 1.0)
def test_small_problems(share, name):
    # searches take a tenth of a second for each; thousands more are in tests.reliability.differential
    count = int(share * {"milp": 90, "genetic": 200, "tabu": 200, "aco": 200}.get(name, 450))
    infeasible = 0
    for problem in small_problems(count, seed=21):
        try:
            optimum = brute_force(problem)
        except InfeasibleError:
            infeasible += 1
            with pytest.raises(InfeasibleError):
                assign(problem, name)
            continue
        solution = assign(problem, name)
        check(problem, solution, optimum)
        if name in PROVING:
            assert solution.status == "optimal"
    # the first of them is the sixty-fourth problem
    assert infeasible > 0 or count < 64


@pytest.mark.parametrize("name", [name for name in installed() if name != "greedy"])
@few_or_all("count", 20, 60)
def test_metaheuristics_find_most_optima_of_small_problems(count, name):
    missed = 0
    problems = list(small_problems(count, seed=22, dummy=True))
    for problem in problems:
        solution = assign(problem, name)
        missed += solution.cost > brute_force(problem) + 1e-9
    assert missed <= len(problems) // 20


@pytest.mark.parametrize("seed", range(12))
def test_exact_on_problems_too_large_for_enumeration(seed):
    """Many competing tuples of nearly equal cost, so that branching is needed; against MILP."""
    rng = np.random.default_rng([5, seed])
    sizes = tuple(int(n) for n in rng.integers(6, 11, rng.integers(3, 5)))
    style = ("mixed", "negative", "ties")[seed % 3]
    problem = gated_problem(rng, sizes, 0.3 if len(sizes) == 3 else 0.05, style, listed_singletons=0.3)
    solution = assign(problem, "exact")
    check(problem, solution, milp_optimum(problem))
    assert solution.status == "optimal"


@pytest.mark.parametrize("name", installed())
def test_nothing_to_choose(name):
    empty = np.zeros((0, 3), dtype=int)
    solution = assign(AssignmentProblem(empty, [], [2, 0, 1]), name)
    assert solution.cost == solution.lower_bound == 0.0
    assert solution.tuples.tolist() == [[0, 0, 1], [1, 0, 0], [2, 0, 0]]
    nothing = assign(AssignmentProblem(empty, [], [0, 0, 0]), name)
    assert len(nothing.tuples) == 0 and nothing.status == "optimal"
    no_duty = assign(AssignmentProblem(empty, [], [0, 2, 3], dummy=False), name)
    assert len(no_duty.tuples) == 0 and no_duty.status == "optimal"
    with pytest.raises(InfeasibleError):
        assign(AssignmentProblem(empty, [], [1, 2, 3], dummy=False), name)
