"""Intervals of association probabilities against full enumeration."""

from itertools import permutations
from unittest.mock import Mock

import numpy as np
import pytest

import assoc
from assoc.errors import InfeasibleError, InvalidInputError
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.ranking.columns import price_all_columns
from assoc.ranking.estimates.sampler import estimates
from assoc.ranking.marginals import _of_cluster, bounded, marginals
from assoc.ranking.pairs.events import pair_probabilities
from assoc.ranking.partition_function import log_partition
from tests.oracles import all_solutions, axial_problem, gated_problem, small_problems
from tests.reliability.exact import exact_marginals
from tests.sizes import few_or_all


def enumerable(count, seed, limit=4000):
    """Small problems with at least one and not too many solutions."""
    for problem in small_problems(count, seed):
        try:
            found = all_solutions(problem, limit)
        except MemoryError:
            continue
        if found:
            yield problem, found


def check_intervals(found, truth, room=1e-9):
    """The truth is in each interval, and so is the estimate."""
    true = np.array([truth[tuple(key)] for key in found.tuples.tolist()])
    assert len(true) == len(truth)
    assert (found.lower - room <= true).all() and (true <= found.upper + room).all()
    assert (found.lower - 1e-12 <= found.probability).all() and (found.probability <= found.upper + 1e-12).all()
    assert (found.lower >= 0.0).all() and (found.upper <= 1.0).all()


@few_or_all("count", 16, 160)
def test_intervals_contain_the_truth(count):
    widths = []
    for number, (problem, found) in enumerate(enumerable(count, 61)):
        k = (1, 3, 20, 5000)[number % 4]
        # listed, left to few open measurements, and summed exactly
        result = bounded(problem, k, Run(0), "auto", widest := (0, 2, 4, 22)[number // 4 % 4])
        assert widest < 22 or (len(problem.sizes) == 2 and problem.dummy) or result.listed == 0
        check_intervals(result, exact_marginals(problem))
        assert (result.lower <= result.upper).all()
        if k >= len(found):
            assert result.unseen < 1e-8
            assert np.allclose(result.lower, result.upper)
        elif k == 20:
            widths.append(result.unseen)
        # every measurement that each solution uses is somewhere
        for s, n in enumerate(problem.sizes):
            if problem.dummy or n == problem.sizes.min():
                for i in range(1, n + 1):
                    own = result.tuples[:, s] == i
                    room = 1e-6 + (result.upper - result.lower)[own].sum()
                    assert result.probability[own].sum() == pytest.approx(1.0, abs=room)
    # the intervals are useful: the weight beyond 20 solutions is bounded well below 1
    assert np.median(widths) < 0.5


def test_estimates_are_calibrated():
    """Swept, and sampled from any solution, with dummies and without: near the truth, and as far as they say."""
    errors, likely = [], []
    for problem, _ in enumerable(16, 71, limit=500):
        truth = exact_marginals(problem)
        found = marginals(problem, method="estimate")
        check_intervals(found, truth)
        true = np.array([truth[tuple(key)] for key in found.tuples.tolist()])
        assert np.abs(found.probability - true).max() < 1e-6 + found.error
        columns = price_all_columns(problem, Run(0))
        number = {tuple(problem.tuples[i].tolist()): j for j, i in enumerate(columns.origin.tolist())}
        true = np.array([truth[key] for key in number])
        greedy = assoc.assign(problem, "greedy").tuples.tolist()
        start = np.array([number[key] for key in map(tuple, greedy) if key in number], dtype=int)
        chains = estimates(columns, [start], Run(0))
        sampled, error = chains.mean(axis=0), chains.std(axis=0, ddof=1).max(initial=0.0) / 2.0
        assert np.abs(sampled - true).max(initial=0.0) < 0.02 + 5.0 * error
        errors.append(np.abs(sampled - true).sum() / max(len(true), 1))
        likely.append(true[sampled > 0.5] - sampled[sampled > 0.5])
    assert np.mean(errors) < 0.01
    assert abs(np.mean(np.concatenate(likely))) < 0.01


@pytest.mark.slow
def test_estimates_leave_intervals_alone():
    problem = axial_problem(np.random.default_rng(4), (16, 16, 16), 0.2, "mixed")
    certified, auto = marginals(problem, 3, method="certified"), marginals(problem, 3)
    assert (certified.lower == auto.lower).all() and (certified.upper == auto.upper).all()
    assert certified.error == 0.0 < auto.error
    assert auto.probability.tolist() == marginals(problem, 3).probability.tolist()
    with pytest.raises(InvalidInputError, match="method: expected one of"):
        marginals(problem, method="guess")


def odd_cycle(length, cost):
    """Sensors of one measurement each, in a cycle of pairs that cost the same."""
    tuples = np.zeros((length, length), dtype=np.int32)
    for i in range(length):
        tuples[i, [i, (i + 1) % length]] = 1
    return AssignmentProblem(tuples, np.full(length, cost), [1] * length)


@pytest.mark.parametrize("scale", [1e2, 1e4, 1e6, 1e8])
@pytest.mark.parametrize("length", [3, 5, 7])
@pytest.mark.parametrize("k", [1, 2])
def test_intervals_hold_where_the_bound_is_far_below_the_optimum(k, length, scale):
    """The excess of every solution over the bound is so large that its exponential is 0 in floating point."""
    result = marginals(odd_cycle(length, -scale), k)
    # as many solutions tie as the cycle has measurements: each leaves one of them out
    true = (length - 1) / 2 / length
    pairs = np.count_nonzero(result.tuples, axis=1) == 2
    assert (result.lower[pairs] <= true + 1e-12).all() and (true - 1e-12 <= result.upper[pairs]).all()
    # and they are at least as narrow as the k listed solutions allow
    assert result.unseen <= 1.0 - k / length + 1e-5


def test_large_undecided_lists_have_narrow_intervals():
    """Among two lists of 100 with eight candidates each the 100 best solutions weigh next to nothing."""
    rng = np.random.default_rng(3)
    first, second = rng.random((2, 100, 2)) * 10.0
    distance = np.linalg.norm(first[:, None] - second, axis=2)
    near = np.argsort(distance, axis=1)[:, :8]
    tuples = np.stack([np.repeat(np.arange(100), 8), near.reshape(-1)], axis=1) + 1
    costs = 2.0 * np.take_along_axis(distance, near, axis=1).reshape(-1) ** 2 - 2.0
    result = marginals(AssignmentProblem(tuples, costs, (100, 100)), 5)
    assert np.mean(result.upper - result.lower) < 0.01
    pairs = (result.tuples > 0).all(axis=1)
    exact = pair_probabilities(
        *(result.tuples[pairs].T - 1), _log_weights(tuples, costs, result, pairs), (100, 100), 2**20
    )
    assert (result.lower[pairs] <= exact.upper).all() and (exact.lower <= result.upper[pairs]).all()


def _log_weights(tuples, costs, result, pairs):
    of = dict(zip(map(tuple, tuples.tolist()), -costs, strict=True))
    return np.array([of[tuple(row)] for row in result.tuples[pairs].tolist()])


def test_intervals_hold_where_large_costs_cancel():
    """Two pairs and a singleton near 1e18: what they differ by is lost in their digits."""
    tuples = [[1, 0, 0], [1, 1, 0], [1, 0, 1]]
    result = marginals(AssignmentProblem(tuples, [1e18, 1e18 - 128.0, 1e18 - 256.0], (1, 1, 1)), 1)
    near = AssignmentProblem(tuples, [1e15, 1e15 - 0.125, 1e15 - 0.5], (1, 1, 1))
    check_intervals(marginals(near, 1), exact_marginals(near), 0.0)
    assert (result.upper - result.lower)[(result.tuples > 0).sum(axis=1) > 1].max() > 0.5


def test_intervals_hold_where_one_tuple_outweighs_the_others():
    """Small terms beside a large one: their sum may not be a difference of sums."""
    tuples = [[1, 1, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1], [0, 2, 1], [2, 0, 1], [1, 2, 0]]
    problem = AssignmentProblem(tuples, [-40.0, -200.0, -130.0, -90.0, -150.0, -60.0, -170.0], (2, 2, 1))
    check_intervals(marginals(problem, 1), exact_marginals(problem))


def test_when_time_is_over_the_intervals_say_that_nothing_is_known():
    for problem, _ in enumerable(20, 63):
        truth = exact_marginals(problem)
        try:
            result = marginals(problem, 5, time_limit=1e-9)
        except InfeasibleError:
            # the greedy choice cannot be completed without a longer search
            assert not problem.dummy
            continue
        check_intervals(result, truth, 0.0)
        assert (result.lower <= result.probability).all() and (result.probability <= result.upper).all()
        # the probabilities are those of one solution
        for s, n in enumerate(problem.sizes):
            if problem.dummy or n == problem.sizes.min():
                for i in range(1, n + 1):
                    assert result.probability[result.tuples[:, s] == i].sum() == 1.0
        # where a decision was needed
        assert result.unseen == 1.0 or set(truth.values()) <= {1.0}


def test_the_unseen_weight_is_bounded_tightly_when_solved_out():
    """On problems this small the partition function comes out exactly, and so does the unseen share."""
    checked = 0
    for problem, found in enumerable(120, 62, limit=500):
        if problem.dummy and len(problem.components()) > 1:
            continue
        costs = np.array([s.cost for s in found])
        weights = np.exp(costs[0] - costs)
        k = max(1, len(found) // 3)
        share = _of_cluster(problem, k, Run(0), "certified")[1]
        unseen = weights[k:].sum() / weights.sum()
        assert unseen - 1e-9 <= share <= unseen + 1e-6
        checked += 1
    assert checked > 40


@pytest.mark.parametrize("work", [0, 300, 10**8])
@pytest.mark.parametrize("a", [0.0, 0.5, 1.0])
def test_partition_function_is_never_underestimated(work, a):
    for problem, found in enumerable(100, 63, limit=600):
        columns = price_all_columns(problem, Run(np.random.default_rng(0)))
        bound = columns.bound + columns.offset
        excess = np.array([s.cost for s in found]) - bound
        exact = np.log(np.exp(-a * excess).sum())
        value = log_partition(columns, a, work)
        assert value >= exact - 1e-9
        if work == 10**8:
            assert value <= exact + 1e-6


@pytest.mark.slow
def test_more_solutions_narrow_the_intervals():
    problem = gated_problem(np.random.default_rng(3), (7, 7, 7), 0.3, "mixed")
    shares = [bounded(problem, k, Run(0), "auto", 0).unseen for k in (1, 5, 50, 500)]
    assert shares == sorted(shares, reverse=True)
    assert shares[-1] < shares[0]


def test_separated_targets_are_certain():
    """Targets far apart: the best solution has nearly all the weight, and one listed solution shows it."""
    tuples, costs = [], []
    for i in range(1, 41):
        tuples += [[i, i, i], [i, i, 0], [i, 0, i], [0, i, i]]
        costs += [-30.0, -12.0, -12.0, -12.0]
    result = marginals(AssignmentProblem(tuples, costs, [40, 40, 40]), 1)
    full = np.count_nonzero(result.tuples, axis=1) == 3
    assert result.lower[full].min() > 1.0 - 1e-5
    assert result.upper[~full].max() < 1e-5


def test_clusters_are_independent():
    """Two clusters side by side: the probabilities of each alone, and k of each listed."""
    rng = np.random.default_rng(8)
    one, two = (gated_problem(rng, (3, 3, 3), 0.5, "mixed") for _ in range(2))
    shifted = np.where(two.tuples > 0, two.tuples + 3, 0)
    both = AssignmentProblem(np.concatenate([one.tuples, shifted]), np.concatenate([one.costs, two.costs]), [6, 6, 6])
    k = 4
    together, *alone = (bounded(problem, k, Run(0), "certified", 0) for problem in (both, one, two))
    assert together.unseen == pytest.approx(max(result.unseen for result in alone), abs=1e-9)
    found = {tuple(t): (lo, p, hi) for t, lo, p, hi in zip(
        together.tuples.tolist(), together.lower, together.probability, together.upper, strict=True)}  # fmt: skip
    for result, shift in zip(alone, (0, 3), strict=True):
        moved = np.where(result.tuples > 0, result.tuples + shift, 0).tolist()
        for t, lo, p, hi in zip(moved, result.lower, result.probability, result.upper, strict=True):
            assert found[tuple(t)] == pytest.approx((lo, p, hi), abs=1e-9)
    # k of each stand for k * k of the whole, and give narrower intervals than k of the whole
    assert together.listed >= k


def test_large_problem_is_still_valid():
    """Without enumeration: the intervals of few solutions must contain those of many."""
    problem = axial_problem(np.random.default_rng(4), (9, 9, 9), 1.0, "mixed")
    few, many = marginals(problem, 3), marginals(problem, 400)
    assert (few.lower <= many.upper + 1e-12).all()
    assert (many.lower <= few.upper + 1e-12).all()
    assert (few.lower <= few.probability + 1e-12).all()


def test_frame_and_public_name():
    assert assoc.marginals is marginals
    frame = marginals(AssignmentProblem([[1, 1]], [-3.0], [1, 1])).to_frame()
    assert list(frame.columns) == ["sensor_1", "sensor_2", "probability", "lower", "upper"]
    odds = np.exp(3.0)
    expected = {(0, 1): 1 / (1 + odds), (1, 0): 1 / (1 + odds), (1, 1): odds / (1 + odds)}
    for row in frame.itertuples():
        assert row.probability == pytest.approx(expected[(row.sensor_1, row.sensor_2)])


def test_errors():
    with pytest.raises(InvalidInputError, match="k: expected"):
        marginals(AssignmentProblem([[1, 1]], [0.0], [1, 1]), 0)
    with pytest.raises(InfeasibleError):
        marginals(AssignmentProblem([[1, 1]], [0.0], [2, 2], dummy=False), 5)


@pytest.mark.parametrize("n", [7, pytest.param(20, marks=pytest.mark.slow)])
def test_two_lists_without_dummies_are_permanents(n):
    """A matrix u_i v_j has every permutation alike; of a small one, all are listed."""
    rng = np.random.default_rng(n)
    first, second = (index.ravel() for index in np.indices((n, n)))
    u, v = rng.normal(size=(2, n))
    costs = u[first] + v[second] + (rng.normal(size=n * n) if n < 10 else 0.0)
    result = marginals(AssignmentProblem(np.stack([first, second], 1) + 1, costs, (n, n), dummy=False))
    expected = np.full(n * n, 1.0 / n)
    if n < 10:
        orders = np.array(list(permutations(range(n))))
        weight = np.exp(-costs.reshape(n, n)[np.arange(n), orders].sum(axis=1))
        expected = np.concatenate([np.bincount(orders[:, i], weight, n) for i in range(n)]) / weight.sum()
    assert result.listed == 0 and result.unseen < 1e-9
    # distinct tuples are in the order of their numbers
    assert result.probability == pytest.approx(expected, abs=1e-9)


def test_two_sensors_without_duals_of_the_packing():
    """Murty's algorithm gives other multipliers; the bound must be valid for them, too, and for fewer solutions."""
    rng = np.random.default_rng(5)
    for number in range(40):
        problem = (
            gated_problem(rng, (3, 4), 0.7, listed_singletons=0.5) if number % 2 else axial_problem(rng, (3, 4), 0.9)
        )
        if not all_solutions(problem):
            continue
        check_intervals(marginals(problem, 2), exact_marginals(problem))


@pytest.mark.parametrize(("sizes", "share", "width"), [((40, 40), 0.3, 1e-6), ((8, 8, 8, 8), 0.1, 1e-12)])
def test_decided_problems_too_wide_to_be_summed(sizes, share, width):
    """Each needs the bound of the unseen weight at another temperature."""
    rng = np.random.default_rng(2)
    tuples = np.argwhere(rng.random(sizes) < share)
    tuples = np.unique(np.concatenate([tuples, np.repeat(np.arange(sizes[0])[:, None], len(sizes), axis=1)]), axis=0)
    costs = rng.normal(0.0, 100.0 if len(sizes) == 2 else 50.0, len(tuples))
    result = marginals(AssignmentProblem(tuples + 1, costs, sizes, dummy=False), method="certified")
    assert result.listed > 0 and result.unseen < width


@pytest.mark.parametrize("looks", [0, 1, 2])
def test_sampling_may_end_at_any_time(looks):
    """Also where all moves made so far are those to be forgotten."""
    problem = gated_problem(np.random.default_rng(1), (20, 20, 20), 0.2)
    columns = price_all_columns(problem, Run(np.random.default_rng(0)))
    run = Mock(should_stop=Mock(side_effect=[False] * looks + [True] * 99))
    best = np.zeros(0, dtype=np.int64)
    found = estimates(columns, [best], run, length=0.2)
    assert found is None if looks < 2 else np.isfinite(found).all() and found.max() <= 1.0
