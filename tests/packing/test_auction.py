"""What the auction leaves to the augmenting paths."""

import numpy as np
import pytest

from assoc.packing.kernels.auction import hold_auction, solve_core
from assoc.packing.kernels.partial_matching import Costs, State


@pytest.mark.parametrize("most", [100, 3])
def test_ties_leave_few_rows(most):
    """Without steps the prices stall at ties, and a fourth of the rows is left; most are matched, at their least."""
    rng = np.random.default_rng(3)
    n, degree = 200, 8
    indices = np.concatenate([np.append(rng.integers(0, n, degree - 1), other) for other in rng.permutation(n)])
    costs = rng.integers(0, most, indices.size).astype(float)
    indptr = np.arange(n + 1) * degree
    problem = Costs(indptr, indices, indices.astype(np.uint64), costs, np.full(n, np.inf), costs)
    state = State(np.full(n, -1), np.zeros(n), np.zeros(n), np.full(n, -1), np.arange(n))
    left = hold_auction(problem, state, n)
    assert left <= n // 8
    chosen = state.row_edge[state.row_edge >= 0]
    assert chosen.size == n - left and np.unique(indices[chosen]).size == chosen.size
    reduced = (costs - state.v[indices]).reshape(n, degree)
    assert (reduced.min(axis=1) == state.u).all()
    assert (costs[chosen] - state.v[indices[chosen]] == state.u[chosen // degree]).all()


def test_rows_of_equal_costs_keep_other_columns():
    """If all rows kept the same of their equal edges, only these columns could be matched."""
    n = 100
    indptr, indices, costs = np.arange(n + 1) * n, np.tile(np.arange(n), n), np.ones(n * n)
    problem = Costs(indptr, indices, indices.view(np.uint64), costs, np.full(n, np.inf), costs)
    state = State(np.full(n, -1), np.zeros(n), np.zeros(n), np.full(n, -1), np.arange(n))
    assert solve_core(problem, state) == 0


def test_the_row_reduction_after_it_leaves_few_rows():
    """After the last step a fourth of the rows are above their least."""
    rng = np.random.default_rng(4)
    n, degree = 200, 8
    indices = np.concatenate([np.append(rng.integers(0, n, degree - 1), other) for other in rng.permutation(n)])
    costs = rng.random(indices.size)
    problem = Costs(np.arange(n + 1) * degree, indices, indices.view(np.uint64), costs, np.full(n, np.inf), costs)
    state = State(np.full(n, -1), np.zeros(n), np.zeros(n), np.full(n, -1), np.arange(n))
    assert hold_auction(problem, state, n) <= n // 12
    chosen = state.row_edge[state.row_edge >= 0]
    least = (costs - state.v[indices]).reshape(n, degree).min(axis=1)
    assert costs[chosen] - state.v[indices[chosen]] == pytest.approx(least[chosen // degree], abs=1e-12)
