"""The k best against full enumeration, by every method."""

import numpy as np
import pytest

import assoc
from assoc.errors import InfeasibleError, InvalidInputError
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.ranking.columns import price_all_columns
from assoc.ranking.component_ranking import ComponentRanking
from assoc.ranking.kbest import kbest, rank
from assoc.ranking.murty.murty import Murty
from assoc.solvers.methods import EXACT_METHODS
from tests.oracles import (
    all_solutions,
    check_answer,
    small_problems,
)
from tests.packings import all_covers, weights_of
from tests.sizes import few_or_all
from tests.solvers.test_against_brute_force import blackman_popoli


def check(problem, k, **options):
    """Ranked as by enumeration: distinct solutions, each valid as a Solution."""
    expected = all_solutions(problem, limit=4000)
    if not expected:
        with pytest.raises(InfeasibleError):
            kbest(problem, k)
        return 0
    found = rank(problem, k, Run(0, methods=EXACT_METHODS), **options)
    costs = [check_answer(problem, solution.tuples) for solution in found]
    scale = max(1.0, float(np.abs(problem.costs).sum()))
    assert len(found) == min(k, len(expected))
    assert np.allclose(costs, [s.cost for s in expected[:k]], rtol=0.0, atol=1e-11 * scale)
    assert costs == pytest.approx([solution.cost for solution in found], abs=1e-12 * scale)
    assert [s.cost for s in found] == sorted(s.cost for s in found)
    keys = [tuple(map(tuple, solution.tuples.tolist())) for solution in found]
    assert len(set(keys)) == len(keys)
    assert keys == [key for _, key in sorted((s.cost, key) for s, key in zip(found, keys, strict=True))]
    for number, solution in enumerate(found):
        assert solution.status == "optimal"
        assert solution.solver == "kbest"
        assert solution.lower_bound <= expected[number].cost + 1e-12 * scale
        assert np.array_equal(problem.tuples[solution.indices], solution.tuples)
        assert solution.parameters == {"k": k, "rank": number + 1}
    return len(found)


def test_sums_that_differ_by_rounding_are_all_listed():
    """Solutions far above a bound of nearly nothing: each is one or two halves, and a billionth of a thousandth."""
    tuples = [
        [0, 0, 1], [0, 0, 2], [0, 1, 0], [0, 1, 1], [0, 1, 2], [0, 2, 0], [0, 2, 1], [1, 0, 0], [1, 0, 1], [1, 0, 2],
        [1, 1, 1], [1, 1, 2], [1, 2, 0], [1, 2, 1], [2, 0, 0], [2, 0, 1], [2, 1, 0], [2, 1, 2], [2, 2, 2],
    ]  # fmt: skip
    half = [(0, 1, 2), (0, 2, 1), (1, 1, 1), (1, 1, 2), (2, 0, 1), (2, 1, 0), (2, 1, 2), (2, 2, 2)]
    tiny = [(0, 1, 1), (1, 0, 1), (1, 0, 2), (1, 2, 0), (1, 2, 1)]
    costs = [0.5 if tuple(row) in half else -1e-12 if tuple(row) in tiny else 0.0 for row in tuples]
    problem = AssignmentProblem(tuples, costs, (2, 2, 2))
    expected = all_solutions(problem)
    assert len(expected) == 40
    for k in (1, 9, 24, 30, 39, 40, 100):
        found = [solution.cost for solution in kbest(problem, k)]
        np.testing.assert_allclose(found, [solution.cost for solution in expected[:k]], rtol=0.0, atol=1e-15)


def test_a_huge_cost_that_no_good_solution_has_blurs_no_ties():
    for number, problem in enumerate(small_problems(60, seed=5, dummy=True)):
        several = np.flatnonzero(np.count_nonzero(problem.tuples, axis=1) > 1)
        costs = problem.costs.copy()
        costs[several[number % max(several.size, 1) : number % max(several.size, 1) + 1]] = 10.0 ** (9 + number % 7)
        dear = AssignmentProblem(problem.tuples, costs, problem.sizes)
        expected = [solution.cost for solution in all_solutions(dear)[:10]]
        found = kbest(dear, 10)
        assert [one.cost for one in found] == pytest.approx(expected, rel=1e-15, abs=1e-9)
        assert found[0].status == "optimal"


def test_murty_finds_them_in_order():
    """Even before sorting: this reveals a bound that is too large."""
    rng = np.random.default_rng(3)
    for number in range(60):
        shape = (4, 4) if number % 2 else (3, 5)
        rows, columns = np.nonzero(rng.random(shape) < 0.8)
        free = number % 3 == 0
        murty = Murty(
            rows.astype(np.int32),
            columns.astype(np.int32),
            rng.normal(-0.5, 1.0, rows.size),
            np.full(shape[0], free),
            np.full(shape[1], free or shape[0] < shape[1]),
            400,
        )
        while murty.feasible and not murty.done:
            murty.run(7)
        costs = [murty._graph.costs[murty.edges(place)].sum() for place in range(murty.num_found)]
        assert costs == pytest.approx(sorted(costs), abs=1e-12)
        if costs:
            assert murty.rest >= costs[-1] - 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("budget", [0, 5])
@few_or_all("count", 30, 120)
def test_branching_instead_of_enumeration(count, budget):
    """The same lists almost without enumeration: branch and bound down to the leaves."""
    branched = 0
    for number, problem in enumerate(small_problems(count, seed=52)):
        packing = price_all_columns(problem, Run(np.random.default_rng(0))).keep(np.inf)
        if packing.num_columns > 40 or (~packing.slack & (np.diff(packing.row_ptr) == 0)).any():
            continue
        duals = dual_bound(packing)
        for c in range(packing.num_components):
            piece = packing.component(c)
            own = duals[packing.row_start[c] : packing.row_start[c + 1]]
            expected = np.sort(weights_of(piece, all_covers(piece)))
            k = (1, 5, 400)[number % 3]
            ranking = ComponentRanking(piece, own, k, np.inf, 1e-12, budget=budget)
            while not ranking.done:
                before = ranking.proven
                ranking.run(3)
                assert ranking.proven >= before - 1e-9 or len(ranking.solutions()[0]) == k
            weights, chosen = ranking.solutions()
            branched += ranking.nodes > 1
            assert len(weights) == min(k, len(expected))
            assert np.allclose(weights, expected[:k], rtol=0.0, atol=1e-9)
            assert len({tuple(columns.tolist()) for columns in chosen}) == len(chosen)
            for weight, columns in zip(weights, chosen, strict=True):
                assert piece.weights[columns].sum() == pytest.approx(weight, abs=1e-9)
            if len(expected) < k:
                assert ranking.proven == np.inf
            else:
                assert ranking.proven == pytest.approx(expected[k - 1], abs=1e-9)
    assert branched > count // 6


def test_bounds_allow_for_what_weights_have_lost():
    """With false alarms of 1e16 that cancel, a tuple of -0.9 weighs 0, as much as its measurements alone."""
    problem = AssignmentProblem([[1, 1, 1], [1, 0, 0], [0, 0, 1]], [-0.9, 1e16, -1e16], [1, 1, 1])
    (solution,) = kbest(problem, 1)
    assert solution.lower_bound <= -0.9


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0,), "k: expected a whole number >= 1, got 0"),
        ((2.0,), "k: expected a whole number >= 1, got 2.0"),
        ((True,), "k: expected"),
        (("3",), "k: expected"),
    ],
)
def test_bad_k(arguments, message):
    with pytest.raises(InvalidInputError, match=message):
        assoc.kbest(blackman_popoli(), *arguments)
