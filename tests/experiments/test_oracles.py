"""The oracles agree with each other, with published numbers and with hand counts."""

import math

import pytest

from assoc.errors import InfeasibleError
from assoc.problem import AssignmentProblem
from experiments.common.checking import InfeasibleAnswerError, check_answer
from tests import oracles
from tests.reliability.exact import exact_marginals
from tests.solvers.test_against_brute_force import blackman_popoli


def test_blackman_popoli_ranking() -> None:
    ranked = oracles.all_solutions(blackman_popoli())
    best = [-34.7, -31.7, -31.1, -29.1, -28.6, -28.0, -27.6, -26.9]
    assert [s.cost for s in ranked[:8]] == pytest.approx(best)
    assert ranked[0].tuples == ((1, 1, 1), (2, 2, 2))
    assert oracles.brute_force(blackman_popoli()) == pytest.approx(-34.7)


@pytest.mark.slow
def test_oracles_agree_and_answers_check() -> None:
    shapes, infeasible = set(), 0
    for problem in oracles.small_problems(250, seed=1):
        shapes.add((problem.dummy, problem.num_sensors))
        try:
            best = oracles.brute_force(problem)
        except InfeasibleError:
            infeasible += 1
            assert oracles.all_solutions(problem) == []
            with pytest.raises(InfeasibleError):
                oracles.milp_optimum(problem)
            continue
        assert oracles.milp_optimum(problem) == pytest.approx(best, abs=1e-7)
        ranked = oracles.all_solutions(problem)
        assert ranked[0].cost == pytest.approx(best, abs=1e-9)
        assert len({s.tuples for s in ranked}) == len(ranked)
        for solution in (ranked[0], ranked[-1]):
            assert check_answer(problem, solution.tuples) == pytest.approx(solution.cost, abs=1e-9)
    assert {(True, s) for s in range(2, 7)} <= shapes
    assert {(False, s) for s in range(2, 7)} <= shapes
    assert 0 < infeasible < 50


def test_marginals_are_those_of_the_enumeration() -> None:
    for problem in (blackman_popoli(), *oracles.small_problems(20, seed=4, dummy=True)):
        solutions = oracles.all_solutions(problem)
        weights = [math.exp(solutions[0].cost - one.cost) for one in solutions]
        for key, found in exact_marginals(problem).items():
            holding = (weight for one, weight in zip(solutions, weights, strict=True) if key in one.tuples)
            assert found == pytest.approx(sum(holding) / sum(weights), abs=1e-9)


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ([[1, 1], [2, 3]], "not in the problem"),
        ([[1, 1], [1, 2], [2, 0]], "measurement 1 is in 2"),
        ([[1, 1], [0, 2]], "measurement 2 is in 0"),
    ],
)
def test_checker_refuses(answer: list[list[int]], words: str) -> None:
    problem = AssignmentProblem([[1, 1], [1, 2], [2, 2]], [-1.0, -2.0, -3.0], [2, 2])
    assert check_answer(problem, [[1, 1], [2, 2]]) == -4.0
    with pytest.raises(InfeasibleAnswerError, match=words):
        check_answer(problem, answer)
