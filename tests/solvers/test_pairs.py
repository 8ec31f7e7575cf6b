"""Two lists, from a matrix of costs or from pairs: the exact solver's answers by one matching."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

import assoc
from assoc import AssignmentProblem, assign
from assoc.packing.kernels.matching import match

KINDS = ("uniform", "negative", "ties", "whole numbers", "products", "all equal")
SHAPES = [(1, 1), (1, 7), (7, 1), (2, 2), (12, 12), (12, 17), (17, 12), (60, 60), (60, 45), (240, 240)]


def matrix_of(kind, shape, seed=0):
    rng = np.random.default_rng([KINDS.index(kind), *shape, seed])
    if kind == "products":
        return np.outer(np.arange(1.0, shape[0] + 1), np.arange(1.0, shape[1] + 1))
    if kind in ("ties", "whole numbers"):
        return rng.integers(0, 5 if kind == "ties" else 1000, shape).astype(float)
    return np.full(shape, -2.5) if kind == "all equal" else rng.normal(-5.0 * (kind == "negative"), 1.0, shape)


def listed(matrix):
    """The same problem from its tuples."""
    return AssignmentProblem(np.argwhere(np.ones(matrix.shape)) + 1, matrix.ravel(), matrix.shape, dummy=False)


def edges(matrix):
    """All pairs as edges of `match`, and slacks with which all rows are matched."""
    n, m = matrix.shape
    slacks = np.full(n, np.inf), np.full(m, np.inf if n == m else 0.0)
    return np.arange(0, n * m + 1, m), np.tile(np.arange(m), n), matrix.ravel(), *slacks


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shape", SHAPES)
def test_the_optimum_with_its_proof(kind, shape):
    matrix = matrix_of(kind, shape)
    problem = AssignmentProblem.from_dense(matrix, dummy=False)
    solution = assign(problem)
    assert problem._listed is None
    assert solution.status == "optimal" and solution.solver == "exact" and solution.stopped_by == "converged"
    assert solution.cost == pytest.approx(matrix[linear_sum_assignment(matrix)].sum(), abs=1e-9)
    rows, columns = solution.tuples.T - 1
    assert len(rows) == min(shape) and len(set(rows)) == len(set(columns)) == min(shape)
    assert (np.diff(rows) > 0).all()
    assert np.array_equal(problem.tuples[solution.indices], solution.tuples)
    assert problem.costs[solution.indices].sum() == pytest.approx(solution.cost, abs=1e-9)
    u, v = solution.duals
    assert (u[:, None] + v <= matrix + 1e-9).all()
    # indices of the longer list may stay unused
    assert shape[0] <= shape[1] or (u <= 0.0).all()
    assert shape[1] <= shape[0] or (v <= 0.0).all()
    assert u.sum() + v.sum() == pytest.approx(solution.lower_bound, abs=1e-8)
    assert [point.cost for point in solution.trace] == [solution.cost]
    other = assign(listed(matrix))
    assert other.cost == pytest.approx(solution.cost, abs=1e-9) and other.tuples.shape == solution.tuples.shape


@given(st.integers(0, 2**31), st.sampled_from([(6, 6), (5, 9)]), st.sampled_from([0.0, 4.0, 9.0]))
def test_the_bound_holds_in_exact_arithmetic(seed, shape, decades):
    rng = np.random.default_rng(seed)
    matrix = rng.normal(size=shape) * 10.0 ** rng.uniform(0.0, decades, shape)
    found = match(*edges(matrix))
    prices = [Fraction(price) for price in found.column_duals.tolist()]
    assert shape[0] == shape[1] or max(prices) <= 0
    rows = [min(Fraction(cost) - price for cost, price in zip(row, prices, strict=True)) for row in matrix.tolist()]
    assert Fraction(found.bound) <= sum(rows) + sum(prices)
    # to the last digit: nothing that was updated in place is left in it
    assert np.array_equal(found.row_duals, (matrix - found.column_duals).min(axis=1))
    cost = matrix.ravel()[found.row_edge].sum()
    assert found.bound == pytest.approx(cost, rel=1e-9, abs=1e-9)


def test_what_rounding_leaves_open_is_solved_from_the_tuples():
    matrix = np.array([[1e15, 0.0], [0.0, 0.5 - 1e15]])
    problem = AssignmentProblem.from_dense(matrix, dummy=False)
    solution = assign(problem)
    assert solution.cost == 0.0 and solution.gap < 1e-6
    assert match(*edges(matrix)).bound < -0.1 and problem._listed is not None


@pytest.mark.parametrize("solver", ["greedy", "lagrangian", "milp"])
def test_other_solvers_list_the_pairs(solver):
    matrix = matrix_of("uniform", (8, 9))
    dense, tuples = AssignmentProblem.from_dense(matrix, dummy=False), listed(matrix)
    assert assign(dense, solver).cost == assign(tuples, solver).cost
    start = assign(tuples, "greedy")
    assert assign(dense, start=start).cost == pytest.approx(assign(tuples).cost)


def test_a_callback_sees_the_answer_and_a_proof_is_written(tmp_path):
    problem, seen = AssignmentProblem.from_dense(matrix_of("ties", (9, 11)), dummy=False), []
    solution = assign(problem, callback=seen.append, proof=tmp_path / "proof.json")
    assert [point.cost for point in seen] == [solution.cost]
    problem.save(tmp_path / "problem.txt")
    assert assoc.check.main([str(tmp_path / "problem.txt"), str(tmp_path / "proof.json")]) == 0


@pytest.mark.parametrize("shape", [(20, 20), (20, 30), (30, 20)])
@pytest.mark.parametrize("seed", range(3))
def test_pairs_in_any_order_some_listed_twice(shape, seed):
    rng = np.random.default_rng(seed)
    matrix = np.where(rng.random(shape) < 0.2, rng.normal(size=shape), np.inf)
    matrix[np.arange(20), rng.permutation(20)] = rng.normal(size=20)
    pairs = np.argwhere(np.isfinite(matrix))
    costs = matrix[tuple(pairs.T)]
    # the dearer copies come first
    order = np.concatenate([rng.permutation(len(pairs)), rng.permutation(len(pairs))])
    dear = np.repeat([5.0, 0.0], len(pairs))
    problem = AssignmentProblem(pairs[order] + 1, costs[order] + dear, shape, dummy=False)
    solution = assign(problem)
    rows, columns = linear_sum_assignment(np.where(np.isfinite(matrix), matrix, 1e6))
    assert solution.cost == pytest.approx(matrix[rows, columns].sum())
    assert solution.status == "optimal"
    assert np.array_equal(problem.tuples[solution.indices], solution.tuples)
    assert (np.diff(solution.tuples[:, 0]) > 0).all()
    assert problem.costs[solution.indices].sum() == pytest.approx(solution.cost)
    u, v = solution.duals
    first, second = problem.tuples.T - 1
    assert (u[first] + v[second] <= problem.costs + 1e-9).all()
    assert shape[0] <= shape[1] or (u <= 0.0).all()


def expected_with_dummies(pairs, costs, alone):
    """Least cost by scipy: each measurement has a partner of its own, for staying alone."""
    n, m = len(alone[0]), len(alone[1])
    matrix = np.full((n + m, n + m), 1e6)
    np.minimum.at(matrix, tuple(pairs.T), costs)
    matrix[np.arange(n), m + np.arange(n)] = alone[0]
    matrix[n + np.arange(m), np.arange(m)] = alone[1]
    matrix[n:, m:] = 0.0
    return matrix[linear_sum_assignment(matrix)].sum()


@pytest.mark.parametrize("shape", [(1, 1), (6, 9), (30, 20), (40, 40)])
@pytest.mark.parametrize("kind", ["likelihoods", "whole numbers", "no pairs"])
@pytest.mark.parametrize("seed", range(4))
def test_false_alarms_and_misses(shape, kind, seed):
    rng = np.random.default_rng(seed)
    pairs = np.argwhere(rng.random(shape) < (0.0 if kind == "no pairs" else 0.3))
    costs = rng.normal(-1.0, 3.0, len(pairs))
    alone = [np.where(rng.random(size) < 0.5, rng.normal(size=size), 0.0) for size in shape]
    if kind == "whole numbers":
        costs, alone = np.round(costs), [np.round(own) for own in alone]
    singles = [np.stack([np.arange(1, shape[0] + 1), np.zeros(shape[0], int)], axis=1),
               np.stack([np.zeros(shape[1], int), np.arange(1, shape[1] + 1)], axis=1)]  # fmt: skip
    # each twice, the dearer one first or last
    tuples = np.concatenate([pairs + 1, *singles])
    prices, dear = np.concatenate([costs, *alone]), rng.random(len(pairs) + sum(shape))
    order = rng.permutation(2 * len(tuples))
    problem = AssignmentProblem(
        np.concatenate([tuples, tuples])[order], np.concatenate([prices + dear, prices])[order], shape
    )
    solution = assign(problem)
    assert solution.cost == pytest.approx(expected_with_dummies(pairs, costs, alone), abs=1e-9)
    assert solution.status == "optimal" and solution.lower_bound <= solution.cost
    assert np.array_equal(problem.tuples[solution.indices], solution.tuples)
    assert problem.costs[solution.indices].sum() == pytest.approx(solution.cost, abs=1e-9)
    assert np.array_equal(solution.tuples, solution.tuples[np.lexsort(solution.tuples.T[::-1])])
    for s, size in enumerate(shape):
        assert sorted(solution.tuples[:, s][solution.tuples[:, s] > 0]) == list(range(1, size + 1))
    prices = [np.concatenate([[0.0], own]) for own in solution.duals]
    assert (prices[0][problem.tuples[:, 0]] + prices[1][problem.tuples[:, 1]] <= problem.costs + 1e-9).all()
    assert sum(own.sum() for own in solution.duals) == pytest.approx(solution.lower_bound, abs=1e-8)


def test_a_measurement_in_no_pair_is_told():
    with pytest.raises(assoc.InfeasibleError, match="2 measurement"):
        assign(AssignmentProblem([[1, 1], [1, 2], [2, 2]], [0.0, 1.0, 2.0], [3, 3], dummy=False))
    with pytest.raises(assoc.InfeasibleError):
        assign(AssignmentProblem([[1, 1], [2, 1], [3, 2]], [0.0, 1.0, 2.0], [3, 4], dummy=False))
