"""Costs far above or below what doubles order well: answers, bounds and ranks in exact arithmetic."""

import numpy as np
import pytest

import assoc
from assoc.ranking.kbest import rank
from assoc.solution import TracePoint
from tests.reliability.exact import exact_cost, exact_ranks


def _problem(seed, sizes, dummy, change):
    rng = np.random.default_rng(seed)
    tuples = np.stack(np.meshgrid(*[np.arange(not dummy, n + 1) for n in sizes], indexing="ij"), -1)
    tuples = tuples.reshape(-1, len(sizes))[int(dummy) :]
    costs = change(rng, rng.integers(-3, 4, len(tuples)) + rng.integers(0, 3, len(tuples)) * 1e-9)
    return assoc.AssignmentProblem(tuples, costs, sizes, dummy=dummy)


def _some(large):
    return lambda rng, costs: np.where(rng.random(costs.size) < 0.4, large(rng, costs.size), costs)


CHANGES = {
    **{f"{big:.0e}": _some(lambda _rng, n, big=big: np.full(n, big)) for big in (1e9, 1e13, 1e18, 1e100, 1e298)},
    "many decades": _some(lambda rng, n: 10.0 ** rng.uniform(9, 298, n)),
    "2e5 times": lambda rng, costs: _some(lambda _rng, n: np.full(n, 2e5))(rng, costs * 1e-3),
    "1e-14": lambda _rng, costs: 1e-14 * costs,
    "denormal": lambda _rng, costs: 5e-324 * np.round(costs),
    "1e-200 and 1e30": lambda rng, costs: _some(lambda _rng, n: np.full(n, 1e30))(rng, 1e-200 * costs),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize(("sizes", "dummy"), [((3, 4), True), ((3, 3, 2), True), ((4, 4), False), ((3, 3, 3), False)])
def test_answers_and_ranks_are_those_of_exact_arithmetic(sizes, dummy, change):
    for seed in range(4):
        problem = _problem(seed, sizes, dummy, CHANGES[change])
        truth = exact_ranks(problem, 4)
        for solver in ("exact", "tabu", "milp"):
            points: list[TracePoint] = []
            answer = assoc.assign(problem, solver, advise=False, callback=points.append)
            near = 1e-9 * abs(float(truth[0])) + 1e-300
            assert all(point.lower_bound - near <= truth[0] <= point.cost + near for point in points)
            assert answer.lower_bound <= truth[0] <= exact_cost(problem, answer.indices) == pytest.approx(answer.cost)
            assert answer.cost == pytest.approx(float(truth[0]), rel=1e-6, abs=0.0) and answer.status == "optimal"
        ranks = assoc.kbest(problem, 4)
        assert [one.cost for one in ranks] == pytest.approx([float(one) for one in truth], rel=1e-11, abs=0.0)
        assert [one.parameters["rank"] for one in ranks] == [1, 2, 3, 4]
        assert all(one.lower_bound <= true for one, true in zip(ranks, truth, strict=True))


def test_ranks_are_optimal_only_where_they_are():
    """With a cost of 1e100, a reduced cost of -1 counted as rounding, and costs of -2, -1, 0 as optimal."""
    tuples = [[2, 2, 1], [1, 2, 1], [3, 2, 1], [3, 1, 1], [2, 1, 1], [1, 1, 1]]
    problem = assoc.AssignmentProblem(tuples, [-1.0, -1.0, -2.0, 1.0, 0.0, 1e100], [3, 2, 1], dummy=False)
    # without the conditioning
    for one, true in zip(rank(problem, 3, None).solutions, [-2.0, -1.0, -1.0], strict=True):
        assert one.lower_bound <= true and (one.status != "optimal" or one.cost == true)


def test_a_search_that_is_cut_off_costs_no_more_than_its_start():
    for seed in range(20):
        problem = _problem(seed, (3, 3, 3), False, _some(lambda rng, n: 10.0 ** rng.uniform(9, 20, n)))
        start = assoc.kbest(problem, 3)[-1]
        answer = assoc.assign(problem, "aco", start=start, callback=lambda point: True, advise=False)
        assert answer.cost <= start.cost


def test_large_costs_that_cancel_are_told_of():
    """Three measurements whose only assignments cost 1e18 and -1e18: the difference below is lost in their digits."""
    tuples = [(i, j, j) for i in (1, 2, 3) for j in (1, 2, 3)]
    shift = np.array([1e18, -1e18, 0.0])
    costs = [shift[i - 1] - shift[j - 1] + (i * j) % 4 for i, j, _ in tuples]
    problem = assoc.AssignmentProblem(tuples, costs, (3, 3, 3), dummy=False)
    with pytest.warns(assoc.AssocWarning, match=r"costs\[\d+\] = .*e\+18: too large for doubles"):
        answer = assoc.assign(problem)
    truth = exact_ranks(problem, 1)[0]
    assert answer.lower_bound <= truth <= exact_cost(problem, answer.indices) and answer.status == "feasible"


def test_a_large_cost_beside_a_best_solution_without_it():
    """A cost of 3e11 beside relevant ones of 1e6 and less left the answer unproved."""
    costs = [2.0792, 5366891.56, -1.03e-6, 320338333561.1274, -1304173.4258, -8.3e-10, -2.9e-5, -3.8e-10]
    tuples = [[1, 1, 2], [2, 1, 2], [1, 1, 1], [2, 1, 1], [1, 2, 1], [1, 2, 2], [2, 2, 1], [2, 2, 2]]
    answer = assoc.assign(assoc.AssignmentProblem(tuples, costs, (2, 2, 2), dummy=False))
    assert answer.gap < 1e-3
