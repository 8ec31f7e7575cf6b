"""Two lists from a matrix, with thresholds and as many pairs as possible, against enumeration and scipy."""

import math
from itertools import combinations, permutations

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_array

import assoc
from assoc import AssignmentProblem
from assoc.errors import AssocWarning, InfeasibleError, InvalidInputError


def choices(shape):
    """Every way to pair rows with columns, as lists of (row, column)."""
    n, m = shape
    for k in range(min(n, m) + 1):
        for rows in combinations(range(n), k):
            for columns in permutations(range(m), k):
                yield list(zip(rows, columns, strict=True))


def matrices(seed, count=40):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        matrix = rng.normal(size=rng.integers(1, 5, 2)) * 10.0
        yield rng, np.where(rng.random(matrix.shape) < 0.3, np.inf, matrix)


def test_what_is_left_unassigned_costs_what_is_said():
    for rng, matrix in matrices(0):
        n, m = matrix.shape
        rows, columns = rng.normal(size=n) * 5.0, rng.normal(size=m) * 5.0
        least = min(
            sum(matrix[i, j] - rows[i] - columns[j] for i, j in pairs) + rows.sum() + columns.sum()
            for pairs in choices(matrix.shape)
        )
        solution = assoc.assign(AssignmentProblem.from_matrix(matrix, [rows, columns]))
        assert solution.cost == pytest.approx(least) and solution.status == "optimal"
        i, j = solution.pairs
        left = rows.sum() - rows[i].sum() + columns.sum() - columns[j].sum()
        assert matrix[i, j].sum() + left == pytest.approx(solution.cost)


def test_one_number_is_a_threshold():
    matrix = np.array([[1.0, 7.0], [7.0, 5.0]])
    assert [one.tolist() for one in assoc.assign(AssignmentProblem.from_matrix(matrix, 3.0)).pairs] == [[0, 1], [0, 1]]
    assert [one.tolist() for one in assoc.assign(AssignmentProblem.from_matrix(matrix, 2.0)).pairs] == [[0], [0]]


def test_as_many_pairs_as_possible_and_then_the_cheapest():
    for _, matrix in matrices(1):
        most, least = min(
            (-len(pairs), sum(matrix[i, j] for i, j in pairs))
            for pairs in choices(matrix.shape)
            if all(np.isfinite(matrix[i, j]) for i, j in pairs)
        )
        rows, columns = assoc.assign(AssignmentProblem.from_matrix(matrix, math.inf)).pairs
        assert len(rows) == -most and matrix[rows, columns].sum() == pytest.approx(least)


def test_without_costs_of_leaving_it_is_that_of_scipy():
    matrix = np.random.default_rng(2).normal(size=(20, 30))
    for costs in (matrix, matrix.T):
        solution = assoc.assign(AssignmentProblem.from_matrix(costs))
        for ours, scipys in zip(solution.pairs, linear_sum_assignment(costs), strict=True):
            np.testing.assert_array_equal(ours, scipys)
    with pytest.raises(InfeasibleError):
        assoc.assign(AssignmentProblem.from_matrix([[np.inf, np.inf], [1.0, 2.0]]))


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (0, 0)])
def test_nobody_to_assign(shape):
    rows, columns = assoc.assign(AssignmentProblem.from_matrix(np.zeros(shape), 1.0)).pairs
    assert len(rows) == len(columns) == 0


@pytest.mark.parametrize(
    "costs,unassigned,message",
    [
        ([1.0, 2.0], None, "costs: expected a matrix, got shape"),
        ([[1.0, 2.0], [3.0]], None, "costs: expected rows of the same length; inf forbids an entry"),
        ([[1.0, 1.7e308]], None, "inf forbids a tuple"),
        ([[1.0, 2.0]], [[1.0], [1.0]], "unassigned: columns: expected 2 numbers"),
        ([[1.0, 2.0]], [1.0, 2.0, 3.0], "unassigned: expected a number, or costs of the rows and of the columns"),
        ([[1.0, 2.0]], math.nan, "unassigned: rows: expected numbers, got nan"),
        ([[1.0, 2.0]], "cheap", "unassigned: expected a number"),
    ],
)
def test_what_is_wrong_is_named(costs, unassigned, message):
    with pytest.raises(InvalidInputError, match=message):
        AssignmentProblem.from_matrix(costs, unassigned)


def test_tables_and_sparse_arrays():
    costs = np.array([[1.0, 9.0, 2.0], [4.0, 1.0, 8.0]])
    table = pd.DataFrame(costs, index=["a", "b"])
    with pytest.warns(AssocWarning, match="is taken as by scipy"):
        assert [each.tolist() for each in assoc.assign(table).pairs] == [[0, 1], [0, 1]]
        assert [solution.cost for solution in assoc.kbest(table, 2)] == [2.0, 3.0]
    with pytest.raises(InvalidInputError, match="is sparse; AssignmentProblem.from_sparse"):
        AssignmentProblem.from_matrix(csr_array(costs))


def test_nobody_within_a_threshold_is_no_mistake():
    """Warnings are errors here; without a price of leaving they are meant."""
    far = np.full((2, 3), 50.0)
    assert not len(assoc.assign(AssignmentProblem.from_matrix(far, unassigned=5.0)).pairs[0])
    with pytest.warns(AssocWarning, match="none of the 6 tuples"):
        assoc.assign(AssignmentProblem.from_matrix(far, unassigned=0.0))


def test_pairs_are_of_two_lists():
    solution = assoc.assign(AssignmentProblem(np.ones((1, 3), dtype=int), [-1.0], [1, 1, 1]))
    with pytest.raises(InvalidInputError, match="pairs: expected a solution of two lists, got 3"):
        _ = solution.pairs
