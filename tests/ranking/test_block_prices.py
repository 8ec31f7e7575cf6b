"""Bounds by priced blocks against enumeration and exact sums."""

import numpy as np
import pytest

import assoc
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.ranking.block_prices import block_bounds
from assoc.ranking.columns import price_all_columns
from assoc.ranking.tuple_sums import sums_and_bounds
from experiments.common.instances import scenes
from tests.reliability.exact import exact_marginals
from tests.sizes import few_or_all


def drawn(rng):
    """A problem of three or four short lists whose tuples weigh more than false alarms, or about as much."""
    sizes = rng.integers(1, 5, rng.integers(3, 5))
    tuples = np.unique(rng.integers(0, sizes + 1, (int(rng.integers(4, 30)), len(sizes))), axis=0)
    tuples = tuples[np.count_nonzero(tuples, axis=1) > 1]
    size = np.count_nonzero(tuples, axis=1)
    return AssignmentProblem(tuples, rng.normal(-rng.choice([0.0, 1.0, 4.0]) * size, rng.choice([0.3, 2.0])), sizes)


@few_or_all("count", 30, 2_000)
def test_bounds_contain_the_truth(count):
    rng = np.random.default_rng(71)
    narrow = 0
    for _ in range(count):
        problem = drawn(rng)
        if not len(problem.tuples):
            continue
        columns = price_all_columns(problem, Run(0))
        num = len(columns.weights)
        estimate, lower, upper = block_bounds(columns, np.arange(num), int(rng.integers(7)), Run(0))
        truth = exact_marginals(problem)
        keys = problem.tuples[columns.origin].tolist()
        exact = np.array([truth[tuple(key)] for key in keys])
        assert (lower[:num] <= exact + 1e-12).all() and (exact <= upper[:num] + 1e-12).all()
        # in no tuple of several: a false alarm
        alone = np.array([1.0 - exact[(columns.rows == r).any(axis=1)].sum() for r in range(columns.slack.size)])
        assert (lower[num:] <= alone + 1e-9).all() and (alone <= upper[num:] + 1e-9).all()
        assert (lower <= estimate).all() and (estimate <= upper).all()
        narrow += ((upper - lower)[:num] < 0.5).sum() > num / 2
    assert narrow > count / 10


def test_bounds_of_a_scene_are_narrow_and_contain_exact_sums():
    problem = assoc.build_problem(scenes.gated(4, 60, 5), 0)
    columns = price_all_columns(problem, Run(0))
    exact, least, most = sums_and_bounds(columns, Run(0), 22, True)
    assert (most - least).max() < 1e-8
    num = len(columns.weights)
    _, lower, upper = block_bounds(columns, np.arange(num), 14, Run(0))
    assert (lower <= exact + 1e-9)[:num].all() and (exact <= upper + 1e-9)[:num].all()
    assert (upper - lower)[:num].mean() < 0.05


def test_clusters_too_wide_for_sums_have_narrow_intervals():
    problem = assoc.build_problem(scenes.gated(4, 150, 1_000), 0)
    found = assoc.marginals(problem, method="certified")
    assert (found.upper - found.lower).mean() < 0.02


@pytest.mark.parametrize("cost", [-1e8, -100.0, 1e8])
def test_weights_beyond_floats_leave_everything_open(cost):
    problem = AssignmentProblem(np.array([[1, 1, 1], [1, 1, 0], [0, 1, 1]]), np.full(3, cost), (1, 1, 1))
    columns = price_all_columns(problem, Run(0))
    _, lower, upper = block_bounds(columns, np.arange(3), 14, Run(0))
    assert (lower <= upper).all() and (cost > 0.0 or (upper[:3] == 1.0).all())


@pytest.mark.parametrize("n", [6, 10])
def test_weights_that_vanish_beside_sums_that_overflow(n):
    """All triples weigh as much as each other, so each is true with probability 1 / n^2; the pairs weigh nothing."""
    triples = np.array(list(np.ndindex(n, n, n))) + 1
    pairs = np.unique(triples * [1, 1, 0], axis=0)
    costs = np.repeat([-89.0, 2_000.0], [len(triples), len(pairs)])
    columns = price_all_columns(AssignmentProblem(np.concatenate([triples, pairs]), costs, (n, n, n)), Run(0))
    num = len(costs)
    _, lower, upper = block_bounds(columns, np.arange(num), 14, Run(0))
    truth = np.where(columns.weights < 0.0, n**-2.0, 0.0)
    assert (lower[:num] <= truth + 1e-9).all() and (truth <= upper[:num] + 1e-9).all()
    # no measurement is a false alarm
    assert (lower[num:] <= 1e-9).all()


def test_tuples_of_many_sensors_need_no_tables_of_all_sensors():
    rng = np.random.default_rng(0)
    tuples = np.zeros((60, 40), dtype=int)
    for row in tuples:
        row[rng.choice(40, 3, replace=False)] = rng.integers(1, 5, 3)
    tuples[0] = 1
    columns = price_all_columns(AssignmentProblem(tuples, rng.normal(-6.0, 1.0, 60), [4] * 40), Run(0))
    _, lower, upper = block_bounds(columns, np.arange(len(columns.weights)), 14, Run(0))
    assert (lower <= upper).all() and (upper[: len(columns.weights)] < 1.0).any()


def test_without_time_left_nothing_is_narrowed():
    problem = assoc.build_problem(scenes.gated(4, 60, 5), 0)
    columns = price_all_columns(problem, Run(0))
    run = Run(0, time_limit=1e-9)
    _, lower, upper = block_bounds(columns, np.arange(len(columns.weights)), 14, run)
    assert (lower == 0.0).all() and (upper == 1.0).all()
