"""Validation, canonical form, dense tensors, components and files of assignment problems."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import assoc
from assoc.errors import AssocError, AssocWarning, InvalidInputError, LimitExceededError
from assoc.problem import AssignmentProblem
from tests.oracles import axial_problem, disconnected_problem, gated_problem, small_problems

INF, NAN = float("inf"), float("nan")

BAD_INPUTS = [
    # tuples, costs, sizes, dummy, what the message must say
    ([[1, 1]], [1.0], [], True, "sizes: expected at least one sensor"),
    ([[1, 1]], [1.0], [2, -1], True, "sizes: expected numbers >= 0, got -1"),
    ([[1, 1]], [1.0], [2.0, 2.0], True, "sizes: expected integers, got float64"),
    ([[1, 1]], [1.0], [[2, 2]], True, "sizes: expected 1 dimension"),
    ([[1, 1]], [1.0], 3, True, "sizes: expected 1 dimension"),
    ([[1, 1]], [1.0], [2**31 - 1, 2**31 - 1], True, "sizes: more measurements"),
    ([[1, 1]], [1.0], [True, True], True, "sizes: expected integers, got bool"),
    ([[1, 1]], [1.0], ["2", "2"], True, "sizes: expected integers"),
    ([[1, 1, 1]], [1.0], [2, 2], True, r"tuples: expected shape \(M, 2\)"),
    ([1, 1], [1.0], [2, 2], True, "tuples: expected 2 dimension"),
    ([[1, 1], [1]], [1.0, 1.0], [2, 2], True, "tuples: "),
    ([[1.5, 1]], [1.0], [2, 2], True, "tuples: expected integers, got float64"),
    ([["a", "b"]], [1.0], [2, 2], True, "tuples: expected integers"),
    ([[None, 1]], [1.0], [2, 2], True, "tuples: expected integers"),
    ([[1, 3]], [1.0], [2, 2], True, "tuples: row 0, sensor 2: index 3 is outside 0..2"),
    ([[1, 1], [-1, 1]], [1.0, 1.0], [2, 2], True, "tuples: row 1, sensor 1: index -1 is outside 0..2"),
    ([[2**40, 1]], [1.0], [2, 2], True, "tuples: row 0, sensor 1: index 1099511627776 is outside"),
    (np.array([[2**63, 1]], dtype=np.uint64), [1.0], [2, 2], True, "tuples: a value exceeds 64 bits"),
    ([[1, 1], [0, 0]], [1.0, 1.0], [2, 2], True, "tuples: row 1 is the all-dummy tuple: indices count from 1"),
    (np.ma.masked_equal([[1, 2]], 2), [1.0], [2, 2], True, "tuples: expected integers, got a masked array"),
    ([[1, 0]], [1.0], [2, 2], False, "tuples: row 0, sensor 2: index 0 is outside 1..2"),
    ([[1, 1]], [1.0], [2, 0], True, "tuples: row 0, sensor 2: index 1 is outside 0..0"),
    ([[1, 1]], [1.0, 2.0], [2, 2], True, r"costs: expected shape \(1,\), got \(2,\)"),
    ([[1, 1]], 1.0, [2, 2], True, r"costs: expected shape \(1,\), got \(\)"),
    ([[1, 1]], [NAN], [2, 2], True, "costs: row 0 is nan"),
    ([[1, 1], [1, 2]], [0.0, -INF], [2, 2], True, "costs: row 1 is -inf"),
    ([[1, 1], [1, 2]], [INF, NAN], [2, 2], True, "costs: row 1 is nan"),
    ([[1, 1], [1, 2]], [1e300, 1e300], [2, 2], True, "costs: the sum of magnitudes exceeds 1e"),
    ([[1, 1]], ["1"], [2, 2], True, "costs: expected real numbers"),
    ([[1, 1]], [1j], [2, 2], True, "costs: expected real numbers, got complex128"),
    ([[1, 1]], [None], [2, 2], True, "costs: expected real numbers, got object"),
    ([[1, 1]], [1.0], [2, 2], "no", "dummy: expected True or False, got 'no'"),
    ([[1, 1]], [1.0], [2, 2], 0, "dummy: expected True or False, got 0"),
    ([[1, 1]], [1.0], [2, 2], [False], "dummy: expected True or False, got list"),
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
        ([[1.0], [1.0, 2.0]], True, "tensor: "),
        ([["a"]], True, "tensor: expected real numbers"),
        (np.zeros((2, 2)), "no", "dummy: expected True or False, got 'no'"),
        (np.zeros((2, 2)), 0, "dummy: expected True or False, got 0"),
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


def test_input_arrays_are_copied():
    tuples, costs = np.array([[1, 1]], dtype=np.int32), np.array([1.0])
    problem = AssignmentProblem(tuples, costs, np.array([1, 1], dtype=np.int32), dummy=False)
    tuples[0, 0] = 7
    costs[0] = 9.0
    assert problem.tuples.tolist() == [[1, 1]] and problem.costs.tolist() == [1.0]


def test_forbidden_singleton_is_as_if_not_listed():
    problem = AssignmentProblem([[1, 0], [1, 1]], [INF, -1.0], [1, 1])
    assert sorted(zip(problem.tuples.tolist(), problem.costs.tolist(), strict=True)) == [
        ([0, 1], 0.0),
        ([1, 0], 0.0),
        ([1, 1], -1.0),
    ]


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


def test_empty_problems():
    for tuples in ([], np.zeros((0, 2)), np.zeros((0, 2), dtype=int)):
        problem = AssignmentProblem(tuples, [], [1, 2])
        assert problem.num_tuples == 3
    assert AssignmentProblem([], [], [0, 0]).num_tuples == 0
    assert AssignmentProblem([], [], [1, 2], dummy=False).num_tuples == 0


def test_dense_with_dummies():
    tensor = np.array([[9.0, 1.0, INF], [INF, -2.0, INF]])
    with pytest.warns(AssocWarning, match="ignores the cost 9 at index 0 of every dimension"):
        problem = AssignmentProblem.from_dense(tensor)
    assert problem.sizes.tolist() == [1, 2]
    dense = problem.to_dense()
    # index (0, 0) is ignored and 0; missing singletons cost 0; a listed one keeps its cost
    assert dense.tolist() == [[0.0, 1.0, 0.0], [0.0, -2.0, INF]]


def test_dense_without_dummies():
    tensor = np.array([[1.0, INF, 3.0], [4.0, 5.0, 6.0]])
    problem = AssignmentProblem.from_dense(tensor, dummy=False)
    assert problem.sizes.tolist() == [2, 3] and problem.num_tuples == 5
    assert problem.to_dense().tolist() == tensor.tolist()


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


def test_duplicates_count_with_the_smaller_cost():
    problem = AssignmentProblem([[1, 1], [1, 1]], [2.0, -3.0], [1, 1])
    assert problem.to_dense()[1, 1] == -3.0


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


def _archive(path, **changes):
    content = {
        "format": np.array("assoc.problem"),
        "version": np.array(1),
        "tuples": np.array([[1, 1]], dtype=np.int32),
        "costs": np.array([1.0]),
        "sizes": np.array([1, 1], dtype=np.int32),
        "dummy": np.array(True),
    }
    content.update(changes)
    np.savez(path, **{key: value for key, value in content.items() if value is not None})
    return path


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": np.array("assoc.scene")}, "format"),
        ({"format": None}, "format"),
        ({"version": np.array(2)}, "version"),
        ({"version": np.array("x")}, "version"),
        ({"tuples": None}, "tuples"),
        ({"costs": np.array([NAN])}, "costs: row 0 is nan"),
        ({"costs": np.array([1.0, 2.0])}, "costs: expected shape"),
        ({"tuples": np.array([[1, 5]])}, "index 5 is outside"),
        ({"tuples": np.array([[1, -5]])}, "index -5 is outside"),
        ({"tuples": np.array([[1.0, 1.0]])}, "tuples"),
        ({"sizes": np.array([], dtype=np.int32)}, "sizes"),
        ({"dummy": np.array([True, False])}, "dummy"),
        ({"dummy": np.array("yes")}, "dummy"),
        ({"costs": np.array([{"a": 1}], dtype=object)}, "costs"),
    ],
)
def test_bad_files_are_one_line_that_names_the_file(tmp_path, changes, message):
    path = _archive(tmp_path / "problem.npz", **changes)
    with pytest.raises(InvalidInputError, match=message) as caught:
        AssignmentProblem.load(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04broken"])
def test_files_that_are_no_archives(tmp_path, content):
    path = tmp_path / "problem.npz"
    path.write_bytes(content)
    with pytest.raises(InvalidInputError) as caught:
        AssignmentProblem.load(path)
    assert str(caught.value).startswith(str(path))


def test_missing_file_and_folder(tmp_path):
    for path in (tmp_path / "missing.npz", tmp_path):
        with pytest.raises(InvalidInputError) as caught:
            AssignmentProblem.load(path)
        assert str(caught.value).startswith(str(path))


def test_repr_and_public_name():
    assert assoc.AssignmentProblem is AssignmentProblem
    assert repr(AssignmentProblem([[1, 2]], [0.0], [2, 3])) == "AssignmentProblem(2 x 3 measurements, 6 tuples)"
    assert "no dummies" in repr(AssignmentProblem([[1, 2]], [0.0], [2, 3], dummy=False))
