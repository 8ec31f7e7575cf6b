"""The two-dimensional assignment against scipy's and its own duality."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from assoc.errors import InfeasibleError
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
        with pytest.raises(InfeasibleError):
            match(indptr, indices, costs, row_slack, column_slack)
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


def test_larger_sparse_ones():
    rng = np.random.default_rng(2)
    feasible = 0
    for n, m, degree, must in [(60, 80, 5, 0.0), (150, 150, 8, 0.0), (120, 200, 12, 1.0), (200, 120, 6, 0.2)]:
        keep = rng.random((n, m)) < degree / m
        row_slack = np.where(rng.random(n) < must, np.inf, 0.0)
        feasible += _check(rng.normal(-2, 3, (n, m)), keep, row_slack, np.zeros(m))
    assert feasible >= 3


def test_parallel_edges():
    found = match([0, 3], [0, 0, 0], [3.0, -1.0, 2.0], [0.0], [0.0])
    assert found.row_edge.tolist() == [1]
    assert found.cost == -1.0
    found = match([0, 2, 4], [0, 0, 0, 0], [-1.0, -1.0, -3.0, -2.0], [0.0, 0.0], [0.0])
    assert found.row_edge.tolist() == [-1, 2]
