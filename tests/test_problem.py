"""Validation, canonical form, dense tensors, components and files of assignment problems."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from assoc.errors import AssocError, AssocWarning, InvalidInputError, LimitExceededError
from assoc.problem import AssignmentProblem
from tests.oracles import axial_problem, disconnected_problem, gated_problem, small_problems

INF, NAN = float("inf"), float("nan")

BAD_INPUTS = [
    # tuples, costs, sizes, dummy, what the message must say
    ([[1, 1]], [1.0], [], True, "sizes: expected at least one sensor"),
    ([[1, 1]], [1.0], [2, -1], True, "sizes: expected numbers >= 0, got -1"),
    ([[1, 1]], [1.0], [[2, 2]], True, "sizes: expected 1 dimension"),
    ([[1, 1]], [1.0], [2**31 - 1, 2**31 - 1], True, "sizes: more measurements"),
    ([[1, 1, 1]], [1.0], [2, 2], True, r"tuples: expected shape \(M, 2\)"),
    ([[1, 1], [1]], [1.0, 1.0], [2, 2], True, "tuples: "),
    ([[1.5, 1]], [1.0], [2, 2], True, "tuples: expected integers, got float64"),
    ([[1, 3]], [1.0], [2, 2], True, "tuples: row 0, sensor 2: index 3 is outside 0..2"),
    ([[1, 1], [-1, 1]], [1.0, 1.0], [2, 2], True, "tuples: row 1, sensor 1: index -1 is outside 0..2"),
    (np.array([[2**63, 1]], dtype=np.uint64), [1.0], [2, 2], True, "tuples: a value exceeds 64 bits"),
    ([[1, 1], [0, 0]], [1.0, 1.0], [2, 2], True, "tuples: row 1 is the all-dummy tuple: indices count from 1"),
    (np.ma.masked_equal([[1, 2]], 2), [1.0], [2, 2], True, "tuples: expected integers, got a masked array"),
    ([[1, 0]], [1.0], [2, 2], False, "tuples: row 0, sensor 2: index 0 is outside 1..2"),
    ([[1, 1]], [1.0, 2.0], [2, 2], True, r"costs: expected shape \(1,\), got \(2,\)"),
    ([[1, 1]], [NAN], [2, 2], True, "costs: row 0 is nan"),
    ([[1, 1], [1, 2]], [0.0, -INF], [2, 2], True, "costs: row 1 is -inf"),
    ([[1, 1], [1, 2]], [1e300, 1e300], [2, 2], True, "costs: the sum of magnitudes exceeds 1e"),
    ([[1, 1]], [1j], [2, 2], True, "costs: expected real numbers, got complex128"),
    ([[1, 1]], [1.0], [2, 2], "no", "dummy: expected True or False, got 'no'"),
]


@pytest.mark.parametrize(("tuples", "costs", "sizes", "dummy", "message"), BAD_INPUTS)
def test_bad_input_is_one_clear_line(tuples, costs, sizes, dummy, message):
    with pytest.raises(InvalidInputError, match=message) as caught:
        AssignmentProblem(tuples, costs, sizes, dummy=dummy)
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, AssocError)
    assert isinstance(caught.value, ValueError)


@pytest.mark.parametrize(
    ("tensor", "dummy", "message"),
    [
        (3.0, True, "tensor: expected one dimension per sensor, got a scalar"),
        (np.zeros((2, 0)), True, "tensor: each dimension needs its dummy"),
        (np.full((2, 2), NAN), True, r"costs\[0, 1\] is nan; expected a number, or inf"),
        (np.array([[1.0, INF], [2.0, -INF]]), False, r"costs\[1, 1\] is -inf"),
        (np.zeros((2, 2)), "no", "dummy: expected True or False, got 'no'"),
    ],
)
def test_bad_tensors(tensor, dummy, message):
    with pytest.raises(InvalidInputError, match=message) as caught:
        AssignmentProblem.from_dense(tensor, dummy=dummy)
    assert "\n" not in str(caught.value)


def test_canonical_form():
    problem = AssignmentProblem([[1, 2], [2, 1], [1, 0]], [1, INF, 5], [2, 2])
    assert problem.tuples.dtype == np.int32 and problem.costs.dtype == np.float64
    assert problem.sizes.dtype == np.int32
    # the forbidden tuple is gone, the listed singleton keeps its cost, the others are added at 0
    listed = {tuple(t): c for t, c in zip(problem.tuples.tolist(), problem.costs.tolist(), strict=True)}
    assert listed == {(1, 2): 1.0, (1, 0): 5.0, (2, 0): 0.0, (0, 1): 0.0, (0, 2): 0.0}
    assert problem.num_tuples == 5 and problem.num_sensors == 2
    for array in (problem.tuples, problem.costs, problem.sizes):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_layouts_and_types():
    """Whatever the layout and type of the arrays, the problem is the same."""
    tuples = np.array([[1, 2], [2, 1]])
    expected = AssignmentProblem(tuples, [1.0, 2.0], [2, 2])
    for given_tuples in (
        tuples.astype(np.uint8),
        np.asfortranarray(tuples),
        tuples.astype(">i8"),
        np.repeat(tuples, 2, axis=1)[:, ::2],
        tuples.tolist(),
    ):
        problem = AssignmentProblem(given_tuples, np.array([1, 2], dtype=np.float32), np.array([2, 2], np.uint16))
        assert problem.tuples.tolist() == expected.tuples.tolist()
        assert problem.tuples.flags.c_contiguous


def test_dense_with_dummies():
    tensor = np.array([[9.0, 1.0, INF], [INF, -2.0, INF]])
    with pytest.warns(AssocWarning, match="ignores the cost 9 at index 0 of every dimension"):
        problem = AssignmentProblem.from_dense(tensor)
    assert problem.sizes.tolist() == [1, 2]
    dense = problem.to_dense()
    # index (0, 0) is ignored and 0; missing singletons cost 0; a listed one keeps its cost
    assert dense.tolist() == [[0.0, 1.0, 0.0], [0.0, -2.0, INF]]


@given(st.integers(0, 2**31), st.booleans())
def test_dense_round_trip(seed, dummy):
    rng = np.random.default_rng(seed)
    sizes = tuple(rng.integers(1, 4, rng.integers(1, 4)).tolist())
    problem = gated_problem(rng, sizes, 0.6) if dummy else axial_problem(rng, sizes, 0.6)
    again = AssignmentProblem.from_dense(problem.to_dense(), dummy=dummy)
    assert again.sizes.tolist() == problem.sizes.tolist()
    assert sorted(zip(again.tuples.tolist(), again.costs.tolist(), strict=True)) == sorted(
        zip(problem.tuples.tolist(), problem.costs.tolist(), strict=True)
    )


def test_dense_guard():
    problem = AssignmentProblem([], [], [1000, 1000, 1000])
    with pytest.raises(LimitExceededError, match="elements exceeds"):
        problem.to_dense()


def test_components_partition_the_tuples():
    rng = np.random.default_rng(3)
    for number in range(40):
        problem = disconnected_problem(rng, 3) if number % 2 else gated_problem(rng, (4, 4, 4), 0.03)
        parts = problem.components()
        assert sorted(np.concatenate(parts).tolist()) == list(range(problem.num_tuples))
        assert [int(part[0]) for part in parts] == sorted(int(part.min()) for part in parts)
        seen = set()
        for part in parts:
            rows = {(s, i) for t in problem.tuples[part].tolist() for s, i in enumerate(t) if i}
            assert not rows & seen
            seen |= rows
            # connected: growing from the first tuple reaches all
            reached = {int(part[0])}
            while True:
                mine = {(s, i) for j in reached for s, i in enumerate(problem.tuples[j].tolist()) if i}
                more = {int(j) for j in part if mine & {(s, i) for s, i in enumerate(problem.tuples[j].tolist()) if i}}
                if more == reached:
                    break
                reached = more
            assert reached == set(part.tolist())
    assert AssignmentProblem([], [], [0, 0]).components() == []


def test_files_round_trip(tmp_path):
    for number, problem in enumerate(small_problems(12, seed=41)):
        path = tmp_path / f"{number}.npz"
        problem.save(path)
        again = AssignmentProblem.load(path)
        assert again.dummy == problem.dummy
        for name in ("tuples", "costs", "sizes"):
            assert np.array_equal(getattr(again, name), getattr(problem, name))
            assert getattr(again, name).dtype == getattr(problem, name).dtype
