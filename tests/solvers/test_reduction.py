"""The reduction's answers on small problems, against HiGHS, and the combination of two covers."""

import numpy as np
import pytest

import assoc
from assoc import AssignmentProblem
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.solvers.exact.reduction import Reduction, best_of_both
from assoc.solvers.exact.search import search_to_the_end


def _problem(seed: int, whole: bool) -> AssignmentProblem:
    rng = np.random.default_rng(seed)
    sizes = rng.integers(2, 8, size=3)
    tuples = np.stack([rng.integers(0, n + 1, size=80) for n in sizes], axis=1)
    costs = rng.integers(-9, 3, size=80).astype(float) if whole else rng.normal(-2.0, 4.0, size=80)
    used = tuples.any(axis=1)
    return AssignmentProblem(tuples[used], costs[used], sizes)


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize("seed", range(40))
def test_closed_and_open_parts_bracket_the_optimum(seed, whole):
    problem = _problem(seed, whole)
    prepared = prepare(problem)
    reduction = Reduction(prepared.packing, Run(np.random.default_rng(0)))
    parts = reduction.reduce()
    optimum = assoc.assign(problem, "milp").cost - prepared.offset
    bound = reduction.closed_bound + sum(part.bound for part in parts)
    weight = reduction.closed_weight + sum(part.weight for part in parts)
    assert bound <= optimum + 1e-6
    assert weight >= optimum - 1e-6
    if not parts:
        chosen = np.concatenate(reduction.closed_columns)
        assert prepared.packing.weights[chosen].sum() == pytest.approx(optimum, abs=1e-6)
        rows = prepared.packing.cols[chosen]
        assert np.bincount(rows[rows >= 0]).max(initial=0) <= 1


def test_two_covers_give_the_better_of_both_wherever_they_differ():
    # rows 0..3 and 4..7: columns 0, 1 against 2, 3; then 4, 5 against 6, 7
    cols = np.array([[0, 2], [1, 3], [0, 3], [1, 2], [4, 6], [5, 7], [4, 7], [5, 6]], dtype=np.int32)
    weights = np.array([-1.0, -1.0, -2.0, -2.0, -5.0, -5.0, -3.0, -3.0])
    one = np.array([0, 1, 0, 1, 4, 5, 4, 5], dtype=np.int32)
    other = np.array([2, 3, 3, 2, 6, 7, 7, 6], dtype=np.int32)
    weight = best_of_both(cols, weights, 0, 8, one, other, np.empty(8, dtype=np.int32), np.empty(8))
    assert weight == -14.0
    assert one.tolist() == [2, 3, 3, 2, 4, 5, 4, 5]


def test_columns_are_dropped_by_reduced_costs_computed_anew():
    """Those that the passes had updated were wrong beside 1e18: the optimum was dropped, 0.2 called optimal."""
    tuples = [[1, 1, 1], [1, 2, 1], [2, 1, 1], [2, 2, 1], [3, 1, 1]]
    problem = AssignmentProblem(tuples, [1e18, 1.0, 0.2, 0.4, 0.0], [3, 2, 1], dummy=False)
    assert search_to_the_end(prepare(problem).packing, 1000, 10, Run(0)).lower_bound <= 0.0
