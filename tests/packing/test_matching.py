"""The two-dimensional assignment against scipy's and its own duality."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

import assoc
from assoc.packing.kernels.matching import match


def _sparse(matrix, keep):
    rows, columns = np.nonzero(keep)
    indptr = np.concatenate([[0], np.cumsum(keep.sum(axis=1))])
    return indptr, columns, matrix[rows, columns]


def _expected(matrix, keep, row_slack, column_slack):
    """Solve by scipy: every row and column gets a private partner for staying unmatched."""
    n, m = matrix.shape
    far = 1e7
    big = np.full((n + m, n + m), far)
    big[:n, :m] = np.where(keep & np.isfinite(matrix), matrix, far)
    big[np.arange(n), m + np.arange(n)] = np.where(np.isfinite(row_slack), row_slack, far)
    big[n + np.arange(m), np.arange(m)] = np.where(np.isfinite(column_slack), column_slack, far)
    big[n:, m:] = 0.0
    chosen = big[linear_sum_assignment(big)]
    return None if (chosen >= far).any() else chosen.sum()


def _check(matrix, keep, row_slack, column_slack):
    n, m = matrix.shape
    indptr, indices, costs = _sparse(matrix, keep)
    expected = _expected(matrix, keep, row_slack, column_slack)
    if expected is None:
        assert match(indptr, indices, costs, row_slack, column_slack) is None
        return False
    found = match(indptr, indices, costs, row_slack, column_slack)
    assert found.cost == pytest.approx(expected, abs=1e-8)
    edges = found.row_edge[found.row_edge >= 0]
    rows = np.flatnonzero(found.row_edge >= 0)
    assert ((indptr[rows] <= edges) & (edges < indptr[rows + 1])).all()
    columns = indices[edges]
    assert np.unique(columns).size == columns.size
    alone = np.setdiff1d(np.arange(m), columns)
    total = costs[edges].sum() + row_slack[found.row_edge < 0].sum() + column_slack[alone].sum()
    assert found.cost == pytest.approx(total, abs=1e-9)
    u, v = found.row_duals, found.column_duals
    assert (u <= row_slack + 1e-9).all()
    assert (v <= column_slack + 1e-9).all()
    from_row = np.repeat(np.arange(n), np.diff(indptr))
    assert (u[from_row] + v[indices] <= costs + 1e-8).all()
    assert u.sum() + v.sum() == pytest.approx(expected, abs=1e-7)
    return True


@settings(deadline=None, max_examples=300)
@given(st.data())
def test_against_scipy(data):
    n, m = data.draw(st.integers(0, 7)), data.draw(st.integers(0, 7))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**31)))
    style = data.draw(st.sampled_from(["mixed", "ties", "positive"]))
    draw = {
        "mixed": lambda *shape: rng.normal(-1, 5, shape),
        "ties": lambda *shape: rng.integers(-2, 3, shape).astype(float),
        "positive": lambda *shape: rng.random(shape),
    }[style]
    matrix = draw(n, m)
    matrix[rng.random((n, m)) < 0.1] = np.inf
    keep = rng.random((n, m)) < data.draw(st.sampled_from([0.2, 0.6, 1.0]))
    must = data.draw(st.sampled_from([0.0, 0.3, 1.0]))
    row_slack = np.where(rng.random(n) < must, np.inf, draw(n))
    column_slack = np.where(rng.random(m) < data.draw(st.sampled_from([0.0, 0.3])), np.inf, draw(m))
    _check(matrix, keep, row_slack, column_slack)


def test_parallel_edges():
    found = match([0, 3], [0, 0, 0], [3.0, -1.0, 2.0], [0.0], [0.0])
    assert found.row_edge.tolist() == [1]
    assert found.cost == -1.0
    found = match([0, 2, 4], [0, 0, 0, 0], [-1.0, -1.0, -3.0, -2.0], [0.0, 0.0], [0.0])
    assert found.row_edge.tolist() == [-1, 2]
    # as many edges as a complete matrix, in its order, but the last row has one of the row before
    n = 30
    indptr, indices, matrix = np.arange(n + 1) * n, np.tile(np.arange(n), n), np.random.default_rng(1).random((n, n))
    matrix[-2] = matrix[0]
    matrix[-2, -1], indptr[-2] = -1.0, indptr[-2] - 1
    costs = matrix.ravel().copy()
    matrix[-2, -1], matrix[-1, -1] = 1e6, -1.0
    found = match(indptr, indices, costs, np.full(n, np.inf), np.full(n, np.inf))
    assert found.cost == pytest.approx(matrix[linear_sum_assignment(matrix)].sum())


def test_large_lists_are_proved_by_multipliers_alone():
    """Ten candidates each, tied many times: the reduction leaves a gap that branching took a minute to close."""
    rng = np.random.default_rng(7)
    n = 2000
    tuples = np.stack([np.repeat(np.arange(n), 10), rng.integers(0, n, 10 * n)], axis=1) + 1
    costs = rng.integers(-9, 3, 10 * n) * 0.1
    answer = assoc.assign(assoc.AssignmentProblem(tuples, costs, (n, n)), nodes=0)
    assert answer.status == "optimal"
    one, two = (np.minimum(duals, 0.0) for duals in answer.duals)
    assert (one[tuples[:, 0] - 1] + two[tuples[:, 1] - 1] <= costs + 1e-9).all()
    assert one.sum() + two.sum() == pytest.approx(answer.cost, rel=1e-9)


def test_a_component_of_two_sides_needs_no_branching():
    """Sensor 2 pairs with sensors 1 and 3, who do not pair with each other; other targets have all three."""
    rng = np.random.default_rng(3)
    n = 600
    pairs = rng.integers(1, n + 1, (8 * n, 2))
    first = rng.random(8 * n) < 0.5
    tuples = np.stack([np.where(first, pairs[:, 0], 0), pairs[:, 1], np.where(first, 0, pairs[:, 0])], axis=1)
    tuples = np.concatenate([tuples, [[n + 1, n + 1, n + 1]]])
    costs = np.append(rng.integers(-9, 0, 8 * n) * 0.1, -1.0)
    answer = assoc.assign(assoc.AssignmentProblem(tuples, costs, (n + 1, n + 1, n + 1)), nodes=0)
    assert answer.status == "optimal" and answer.iterations == 0


def _costs(kind, n, rng):
    """Random costs, whole numbers, or few different ones."""
    matrix = rng.random((n, n))
    return np.floor(matrix * (100 if kind == "whole" else 3)) if kind in ("whole", "few") else matrix


@pytest.mark.parametrize("kind", ["any", "whole", "few", "excluding", "narrow"])
def test_an_auction_leaves_optimal_duals(kind):
    rng = np.random.default_rng(5)
    n = 120
    matrix = _costs(kind, n, rng)
    if kind == "excluding":
        matrix[rng.random((n, n)) < 0.3] = 1e6
    # narrow: many rows of one edge or two, for whose columns others bid long
    keep = rng.random((n, n)) < (0.01 if kind == "narrow" else 0.06)
    keep[np.arange(n), rng.permutation(n)] = True
    forced = np.full(n, np.inf)
    assert _check(matrix, keep, forced, forced)
    found = match(*_sparse(matrix, keep), forced, forced)
    if kind in ("whole", "few"):
        assert (found.row_duals == np.round(found.row_duals)).all()
        assert (found.column_duals == np.round(found.column_duals)).all()


@pytest.mark.parametrize("n, share", [(90, 1.0), (90, 0.8), (240, 1.0), (240, 0.9), (240, 0.2)])
@pytest.mark.parametrize("kind", ["any", "whole", "few", "product", "like columns"])
def test_wide_rows_are_matched_by_their_cheapest_edges_first(kind, n, share):
    rng = np.random.default_rng(7)
    matrix = _costs(kind, n, rng)
    if kind == "product":
        matrix = np.outer(np.arange(1.0, n + 1), np.arange(1.0, n + 1))
    if kind == "like columns":
        # all rows have the same cheapest columns, which cannot match them
        matrix += 10.0 * np.arange(n)
    keep = (rng.random((n, n)) < share) | np.eye(n, dtype=np.bool_)
    forced = np.full(n, np.inf)
    assert _check(matrix, keep, forced, forced)
