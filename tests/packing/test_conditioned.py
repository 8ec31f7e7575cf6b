"""Costs far above or below what doubles order well: answers, bounds and ranks in exact arithmetic."""

import numpy as np
import pytest

import assoc
from tests.reliability.exact import exact_cost, exact_ranks


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
