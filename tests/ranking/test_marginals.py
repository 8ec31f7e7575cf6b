"""Association probabilities against full enumeration."""

from itertools import permutations

import numpy as np
import pytest

import assoc
from assoc.errors import InfeasibleError, InvalidInputError
from assoc.problem import AssignmentProblem
from assoc.ranking import sampler
from assoc.ranking.marginals import marginals, weighed
from tests.oracles import all_solutions, gated_problem, small_problems
from tests.reliability.exact import exact_marginals
from tests.reliability.problems import draw
from tests.sizes import few_or_all


def enumerable(count, seed, limit=4000):
    """Small problems with at least one and not too many solutions."""
    for problem in small_problems(count, seed):
        try:
            found = all_solutions(problem, limit)
        except MemoryError:
            continue
        if found:
            yield problem


def true_of(found, problem):
    truth = exact_marginals(problem)
    assert len(truth) == len(found.tuples)
    return np.array([truth[tuple(row)] for row in found.tuples.tolist()])


@few_or_all("count", 6, 160)
def test_sums_are_exact_and_samples_as_far_off_as_they_say(count):
    errors, held = [], []
    for problem in enumerable(count, 61):
        found = marginals(problem)
        true = true_of(found, problem)
        assert np.abs(found.probability - true).max() < 1e-8
        assert found.exact.all() and (found.error == 0.0).all()
        sampled = weighed(problem, None, 0)
        away = np.abs(sampled.probability - true)
        assert (sampled.error[~sampled.exact] > 0.0).all()
        errors += away.tolist()
        held += (away <= 4.0 * sampled.error + 1e-8).tolist()
    assert np.mean(errors) < 0.005 and np.mean(held) > 0.99


def test_where_chains_cannot_pass_between_solutions_they_say_so():
    """Few tuples that must cover all: no move leads from some solutions to others."""
    held = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        tuples = np.argwhere(rng.random((5, 5, 5)) < 0.3) + 1
        problem = AssignmentProblem(tuples, rng.normal(0.0, 1.0, len(tuples)), (5, 5, 5), dummy=False)
        try:
            true = exact_marginals(problem)
        except InfeasibleError:
            continue
        found = weighed(problem, None, 0, 0.05)
        truth = np.array([true[tuple(row)] for row in found.tuples.tolist()])
        held += (np.abs(found.probability - truth) <= 4.0 * found.error + 1e-8).tolist()
    assert len(held) > 300 and np.mean(held) > 0.99


def _far_off(seed, number, length=0.05, errors=4.0):
    """Tuples of a random problem whose probability is further from the truth than so many told errors."""
    problem = draw(seed, number).problem
    truth = exact_marginals(problem)
    found = weighed(problem, None, 0, length)
    true = np.array([truth.get(tuple(row), np.nan) for row in found.tuples.tolist()])
    return found.tuples[np.abs(found.probability - true) > errors * found.error + 1e-8].tolist()


def test_chains_that_stay_where_they_began_do_not_agree_on_what_is_wrong():
    """Costs of 1e4 in an axial problem, and of 1e5 less than alone: no move leads from one solution to the other."""
    assert _far_off(8300, 1775) == [] == _far_off(8300, 1775, length=1.0)
    assert _far_off(8300, 1764) == []


def test_sums_whose_weights_underflow_are_done_in_logarithms():
    """Costs of millions, and a relaxation that is half as much again below every solution: an odd cycle of pairs."""
    around = [[1, 1, 0], [0, 1, 1], [1, 0, 1]]
    found = marginals(AssignmentProblem(around, [-8e6, -8e6 - np.log(2.0), -8e6], (1, 1, 1)))
    known = dict(zip(map(tuple, found.tuples.tolist()), found.probability, strict=True))
    assert [known[row] for row in [(1, 1, 0), (0, 1, 1), (1, 0, 1)]] == pytest.approx([0.25, 0.5, 0.25], abs=1e-7)
    assert [known[row] for row in [(1, 0, 0), (0, 1, 0), (0, 0, 1)]] == pytest.approx([0.5, 0.25, 0.25], abs=1e-7)
    # equal ones among which no chain could pass
    problem = draw(9702, 4115).problem
    found = marginals(problem)
    assert np.abs(found.probability - true_of(found, problem)).max() < 1e-8
    assert found.error.max() < 1e-5
    # of logarithms of 1e290 rounding leaves nothing below 1: no probability is above it
    for number in (3258, 12801, 13874):
        problem = draw(9902, number).problem
        found = marginals(problem)
        assert np.all(np.abs(found.probability - true_of(found, problem)) <= found.error + 1e-8)


def test_sums_in_logarithms_are_those_of_the_usual_sweep(monkeypatch):
    def lost(plan, weights, free, deadline, probability, alone):
        probability[:], alone[:] = np.nan, np.nan
        return len(plan.ends)

    problems = list(enumerable(12, 77))
    monkeypatch.setattr("assoc.ranking.marginals.sum_clusters", lost)
    for problem in problems:
        found = marginals(problem)
        assert np.abs(found.probability - true_of(found, problem)).max() < 1e-8


def test_of_what_no_chain_ever_left_nothing_is_known():
    """One cover of what must be covered: nothing shows that it is the only one."""
    only = AssignmentProblem([[1, 1, 1], [2, 2, 2], [1, 2, 1]], [0.0, 0.0, -50.0], (2, 2, 2), dummy=False)
    found = weighed(only, None, 0, 0.05)
    assert (found.error == 1.0).all()
    assert marginals(only).error.max() == 0.0


def test_chains_end_by_what_they_looked_at():
    """Five sensors and all tuples: a move looks at a thousand columns; no round begins once all were looked at."""
    looked = []

    def counted(*arguments):
        looked.append(walk(*arguments))
        return looked[-1]

    walk = sampler._walk
    rng = np.random.default_rng(3)
    problem = gated_problem(rng, (3, 3, 3, 3, 2), 1.0, "mixed")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sampler, "_walk", counted)
        patch.setattr(sampler, "_LOOKS", 3_000_000)
        patch.setattr(sampler, "_MORE_LOOKS", 0)
        found = weighed(problem, None, 0)
    assert sum(looked[:-8]) < 3_000_000 <= sum(looked)
    assert np.isfinite(found.error).all() and (found.error > 0.0).all()


def test_clusters_are_independent():
    rng = np.random.default_rng(8)
    one, two = (gated_problem(rng, (3, 3, 3), 0.5, "mixed") for _ in range(2))
    shifted = np.where(two.tuples > 0, two.tuples + 3, 0)
    both = AssignmentProblem(np.concatenate([one.tuples, shifted]), np.concatenate([one.costs, two.costs]), [6, 6, 6])
    together = marginals(both)
    known = dict(zip(map(tuple, together.tuples.tolist()), together.probability.tolist(), strict=True))
    for part, shift in ((one, 0), (two, 3)):
        found = marginals(part)
        for row, p in zip(np.where(found.tuples > 0, found.tuples + shift, 0).tolist(), found.probability, strict=True):
            assert known[tuple(row)] == pytest.approx(p, abs=1e-9)


@pytest.mark.parametrize("widest", [0, 22])
def test_degenerate_problems(widest):
    """No tuples, one measurement, equal and huge costs, one above all others."""
    full = [[i, j] for i in (1, 2, 3) for j in (1, 2, 3)]
    cases = [
        (np.zeros((0, 2), int), [], (2, 3)), (np.zeros((0, 2), int), [], (1, 0)), ([[1, 0]], [3.0], (1, 0)),
        (full, [0.0] * 9, (3, 3)), (full, [1e15] * 9, (3, 3)), (full, [-1e15] * 9, (3, 3)),
        (full, [-1e15, 1e15, 0.0] * 3, (3, 3)),
        ([[1, 0, 0], [1, 1, 0], [1, 0, 1]], [1e18, 1e18 - 128, 1e18 - 256], (1, 1, 1)),
    ]  # fmt: skip
    for tuples, costs, sizes in cases:
        problem = AssignmentProblem(tuples, costs, sizes)
        found = weighed(problem, None, widest, 0.1)
        assert np.isfinite(found.probability).all() and ((found.error == 0.0) == found.exact).all()
        truth = exact_marginals(problem)
        for row, p, error in zip(found.tuples.tolist(), found.probability, found.error, strict=True):
            true = truth.get(tuple(row), p)
            assert abs(p - true) <= 6.0 * error + 1e-8


def test_without_time_nothing_is_said():
    for problem in enumerable(10, 63):
        found = marginals(problem, time_limit=1e-9)
        assert (found.error == 1.0).all() and not found.exact.any()
        assert ((found.probability >= 0.0) & (found.probability <= 1.0)).all()


def test_arrays_frame_and_errors():
    assert assoc.marginals is marginals
    frame = marginals(AssignmentProblem([[1, 1]], [-3.0], [1, 1])).to_frame()
    assert list(frame.columns) == ["sensor_1", "sensor_2", "probability", "error", "exact"]
    odds = np.exp(3.0)
    expected = {(0, 1): 1 / (1 + odds), (1, 0): 1 / (1 + odds), (1, 1): odds / (1 + odds)}
    for row in frame.itertuples():
        assert row.probability == pytest.approx(expected[(row.sensor_1, row.sensor_2)])
    costs = np.random.default_rng(1).normal(size=(4, 4))
    with pytest.warns(assoc.AssocWarning, match="scipy"):
        found = marginals(costs)
    orders = np.array(list(permutations(range(4))))
    weight = np.exp(-costs[np.arange(4), orders].sum(axis=1))
    true = np.concatenate([np.bincount(orders[:, i], weight, 4) for i in range(4)]) / weight.sum()
    assert found.probability == pytest.approx(true, abs=1e-9)
    with pytest.warns(assoc.AssocWarning, match="scipy"):
        assert len(assoc.kbest(costs, 24)) == 24
    with pytest.raises(InvalidInputError, match="exists no longer"):
        marginals(AssignmentProblem([[1, 1]], [0.0], [1, 1]), k=3)
    with pytest.raises(InfeasibleError):
        marginals(AssignmentProblem([[1, 1]], [0.0], [2, 2], dummy=False))


def test_measurements_that_no_move_began_with_are_not_known():
    """300 moves of a chain among 120 measurements: those that they did not begin with have error 1."""
    problem = gated_problem(np.random.default_rng(9), (40, 40, 40), 0.2, "mixed")
    few = weighed(problem, None, 0, 300 / 40_000)
    many = weighed(problem, None, 0, 0.2)
    assert 0.1 < (few.error[~few.exact] == 1.0).mean() < 0.9
    assert (many.error[~many.exact] == 1.0).mean() < 0.1
    known = few.error < 1.0
    assert (np.abs(few.probability - many.probability) <= 4.0 * (few.error + many.error))[known].mean() > 0.9
