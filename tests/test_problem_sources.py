"""Problems from tables and sparse arrays are those of the tuples and tensors they hold."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.sparse import coo_array

from assoc.errors import AssocWarning, InvalidInputError
from assoc.problem import AssignmentProblem


def same(one, other):
    """Whether two problems have the same tuples with the same costs."""

    def content(problem):
        return sorted(zip(map(tuple, problem.tuples.tolist()), problem.costs.tolist(), strict=True))

    return content(one) == content(other) and one.sizes.tolist() == other.sizes.tolist() and one.dummy == other.dummy


@pytest.mark.parametrize("dummy", [True, False])
@pytest.mark.parametrize("shape", [(3, 4), (3, 2, 4), (2, 3, 2, 3)])
def test_a_sparse_array_is_its_tensor(shape, dummy):
    rng = np.random.default_rng(3)
    tensor = np.where(rng.random(shape) < 0.6, rng.normal(size=shape), np.inf)
    if dummy:
        tensor[(0,) * len(shape)] = 0.0
    # a stored 0 is a cost, what is not stored is forbidden
    tensor[(1,) * len(shape)] = 0.0
    where = np.nonzero(np.isfinite(tensor))
    sparse = coo_array((tensor[where], where), shape=shape)
    assert same(AssignmentProblem.from_sparse(sparse, dummy=dummy), AssignmentProblem.from_dense(tensor, dummy=dummy))


def test_a_table_is_its_tuples():
    frame = pd.DataFrame({"north": [1, 2, 0], "cost": [-1.5, 0.25, -3.0], "south": [1.0, None, 3.0]})
    told = AssignmentProblem([[1, 1], [2, 0], [0, 3]], [-1.5, 0.25, -3.0], [2, 3])
    assert same(AssignmentProblem.from_frame(frame), told)
    wider = AssignmentProblem([[1, 1], [2, 0], [0, 3]], [-1.5, 0.25, -3.0], [4, 5])
    assert same(AssignmentProblem.from_frame(frame, [4, 5]), wider)
    renamed = frame.rename(columns={"cost": "price"})
    assert same(AssignmentProblem.from_frame(renamed, cost="price"), told)


@pytest.mark.parametrize(
    "make,message",
    [
        (lambda: AssignmentProblem.from_frame(pd.DataFrame({"a": [1]})), "frame: has no column 'cost', only a"),
        (lambda: AssignmentProblem.from_frame(pd.DataFrame({"cost": [1.0]})), "expected a column for each sensor"),
        (lambda: AssignmentProblem.from_frame(pd.DataFrame({"a": [1.5], "cost": [1.0]})), "column 'a': expected whole"),
        (lambda: AssignmentProblem.from_frame(pd.DataFrame({"a": [1], "cost": ["x"]})), "column 'cost'"),
        (
            lambda: AssignmentProblem.from_frame(pd.DataFrame([[1, 1, -1.0]], columns=["a", "a", "cost"])),
            "frame: expected columns of different names, got 'a' twice",
        ),
        (
            lambda: AssignmentProblem.from_sparse(
                SimpleNamespace(coords=[[1.5], [1.0]], data=np.array([1.0]), shape=(2, 2))
            ),
            "array: coords: expected integers, got float64",
        ),
        (lambda: AssignmentProblem.from_sparse(np.zeros((2, 2))), r"array: expected a sparse array \(scipy.sparse\)"),
        (lambda: AssignmentProblem.from_sparse(coo_array(([np.nan], ([1], [1])), shape=(2, 2))), "costs: row 0 is nan"),
    ],
)
def test_what_is_none_of_them_is_refused(make, message):
    with pytest.raises(InvalidInputError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("dummy", [True, False])
def test_what_is_masked_is_forbidden(dummy):
    rng = np.random.default_rng(3)
    tensor = np.ma.masked_less(rng.integers(1, 9, size=(3, 4)), 4)
    tensor[0, 0] = 0
    open_one = AssignmentProblem.from_dense(tensor.astype(float).filled(np.inf), dummy=dummy)
    assert same(AssignmentProblem.from_dense(tensor, dummy=dummy), open_one)


@pytest.mark.parametrize("read", [np.asarray, coo_array])
def test_a_plain_cost_matrix_read_with_dummies_is_doubted(read):
    make = AssignmentProblem.from_dense if read is np.asarray else AssignmentProblem.from_sparse
    with pytest.warns(AssocWarning, match="ignores the cost 7 at index 0 of every dimension"):
        make(read([[7.0, 1.0], [2.0, -3.0]]))
    make(read([[0.0, 1.0], [2.0, -3.0]]))
