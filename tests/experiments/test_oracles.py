"""The oracles agree with each other, with published numbers and with hand counts."""

import itertools
import math

import numpy as np
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


def test_axial_enumeration_is_all_permutations() -> None:
    rng = np.random.default_rng(5)
    dense = rng.normal(size=(3, 4, 3))
    problem = AssignmentProblem.from_dense(dense, dummy=False)
    ranked = oracles.all_solutions(problem)
    by_hand = sorted(
        sum(dense[i, j[i], k[i]] for i in range(3))
        for j in itertools.permutations(range(4), 3)
        for k in itertools.permutations(range(3))
    )
    assert [s.cost for s in ranked] == pytest.approx(by_hand)


def test_dense_dummy_problem_has_the_right_number_of_solutions() -> None:
    rng = np.random.default_rng(0)
    two = oracles.gated_problem(rng, (3, 4), density=1.0)
    # Two sensors: partial matchings, sum over k of C(3,k) C(4,k) k!.
    expected = sum(math.comb(3, k) * math.comb(4, k) * math.factorial(k) for k in range(4))
    assert len(oracles.all_solutions(two)) == expected


def test_the_next_best_is_the_optimum_once_those_before_are_forbidden() -> None:
    seen = 0
    for problem in oracles.small_problems(60, seed=2):
        ranked = oracles.all_solutions(problem)
        if not 4 <= len(ranked) or len({tuple(row) for row in problem.tuples.tolist()}) < problem.num_tuples:
            continue
        known = [tuple(row) for row in problem.tuples.tolist()]
        forbidden = [np.array([known.index(one) for one in solution.tuples]) for solution in ranked[:3]]
        assert oracles.milp_optimum(problem, forbidden=forbidden) == pytest.approx(ranked[3].cost, abs=1e-7)
        seen += 1
    assert seen > 10


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


def test_checker_axial_covers_only_the_smallest_dimension() -> None:
    problem = AssignmentProblem([[1, 1], [1, 3], [2, 2]], [1.0, 1.0, 1.0], [2, 3], dummy=False)
    assert check_answer(problem, [[1, 3], [2, 2]]) == 2.0
    with pytest.raises(InfeasibleAnswerError):
        check_answer(problem, [[1, 3]])
