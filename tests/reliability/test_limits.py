"""Time limits on problems that take much longer: kept, and what is returned is sound and no worse than greedy's.

How late something is counts without what its thread waited for a processor; the allowance is generous, so that a
busy machine does no harm.
"""

import math

import numpy as np
import pytest

import assoc
from assoc._system.interpreted import compiled_only
from assoc._system.kernels.sorting import ascending, order_of, sort_part
from assoc.errors import InfeasibleError
from assoc.packing.bounds.dual_ascent import certified_bound, dual_bound
from assoc.packing.prepare import prepare
from assoc.packing.run import Outcome
from assoc.problem import AssignmentProblem
from assoc.ranking.kbest import kbest
from assoc.ranking.marginals import _distinct, marginals
from assoc.solvers.assign import assign
from tests.oracles import check_answer, small_problems
from tests.reliability.big import axial, ghosts
from tests.reliability.limits import WAYS, lateness
from tests.sizes import sample

LIMIT = 0.1
# seconds after which a way has missed its limit; without one most would never end
ALLOWED = 5.0


@pytest.fixture(scope="module")
def problem():
    # compiling is no part of a limit; what a short search met no kernel of, a longer one on a smaller problem does
    assoc.warm_up()
    for small in (axial(12), ghosts(30, 6000)):
        kbest(small, 3, time_limit=0.5)
        marginals(small, time_limit=0.5)
    return ghosts(60, 60_000)


@pytest.fixture(scope="module")
def greedy_cost(problem):
    return assign(problem, "greedy").cost


@pytest.fixture(scope="module")
def least(problem):
    """A bound that no time limit has cut short."""
    prepared = prepare(problem)
    return certified_bound(prepared.packing, dual_bound(prepared.packing)) + prepared.offset


def fresh(problem):
    """The same problem with nothing prepared yet."""
    return AssignmentProblem(problem.tuples, problem.costs, problem.sizes, dummy=problem.dummy)


@pytest.mark.slow
@sample("way", [name for name in WAYS if name not in ("greedy", "marginals")], every=3)
def test_limit_is_kept_and_the_best_so_far_is_returned(way, problem, greedy_cost, least):
    WAYS[way](fresh(problem), LIMIT)
    found, late = lateness(lambda: WAYS[way](fresh(problem), LIMIT), LIMIT)
    assert late < ALLOWED
    answer = found[0] if isinstance(found, list) else found
    assert check_answer(problem, answer.tuples) == pytest.approx(answer.cost, rel=1e-12)
    assert answer.lower_bound <= answer.cost <= greedy_cost
    assert answer.stopped_by == "time_limit"
    # nothing can be proved in the time, and nothing is said to be
    assert answer.status == "feasible"
    assert answer.cost >= least - 1e-6 * abs(least)


@pytest.mark.slow
def test_marginals_keep_the_limit_and_say_what_is_not_known(problem):
    WAYS["marginals"](fresh(problem), LIMIT)
    found, late = lateness(lambda: WAYS["marginals"](fresh(problem), LIMIT), LIMIT)
    assert late < ALLOWED
    assert (found.error > 0.0).any() and np.isfinite(found.probability).all()


@pytest.mark.parametrize("way", ["exact", "tabu", "kbest", "lagrangian"])
def test_hardly_any_time(way):
    """Less than the first look takes: still a complete solution and a bound, without dummies too."""
    problem = axial(30)
    cost = assign(problem, "greedy").cost
    found = WAYS[way](fresh(problem), 1e-6)
    answer = found[0] if isinstance(found, list) else found
    assert check_answer(problem, answer.tuples) == pytest.approx(answer.cost, rel=1e-12)
    assert -math.inf < answer.lower_bound <= answer.cost <= cost
    assert answer.stopped_by == "time_limit"


@pytest.mark.slow
def test_a_solver_that_gives_up_or_finds_little_is_helped_out(problem, greedy_cost):
    from assoc.solvers import registry

    def give_up(packing, parameters, run):
        raise InfeasibleError("none found")

    def take_nothing(packing, parameters, run):
        run.stopped_by = "time_limit"
        return Outcome(np.zeros(0, dtype=np.int64), 0)

    for solve in (give_up, take_nothing):
        registry.register(solve.__name__, registry.parameters("greedy"), solve)
        assert assign(fresh(problem), solve.__name__, time_limit=5.0).cost == greedy_cost


def test_sorting_as_numpy_does():
    rng = np.random.default_rng(1)
    for values in (
        rng.normal(size=20_000),
        rng.integers(-3, 4, 20_000).astype(float),
        np.where(rng.random(20_000) < 0.5, -0.0, 0.0),
        np.where(rng.random(20_000) < 0.1, np.inf, 1e300 * rng.normal(size=20_000)),
        -5e-324 * rng.integers(0, 9, 20_000),
        # parts that ascend already, of any length, and all of them at once
        np.concatenate([np.sort(rng.integers(0, 99, size)) for size in rng.integers(1, 80, 500)]).astype(float),
        np.arange(20_000.0),
        np.zeros(0),
    ):
        assert np.array_equal(ascending(values), np.argsort(values, kind="stable"))
        with compiled_only():
            for size in (values.size, 100, 33, 32, 17, 16, 1):
                some = values[:size]
                assert np.array_equal(order_of(some), np.argsort(some, kind="stable"))
        for begin, end in ((0, 3), (2, 45), (5, 1000), (7, 7)):
            part = values[:1000].copy()
            sort_part(part, begin, min(end, part.size))
            assert np.array_equal(part[begin:end], np.sort(values[:1000][begin:end]))
            assert np.array_equal(part[:begin], values[:begin]) and np.array_equal(part[end:], values[end:1000])


def test_distinct_tuples():
    # more than one number of 64 bits can tell apart
    wide = np.random.default_rng(2).integers(1, 50_000, (9, 6))
    many = [AssignmentProblem(wide[[0, 0, *range(9)]], np.zeros(11), [50_000] * 6, dummy=False)]
    for problem in [*small_problems(60, seed=71), ghosts(60, 3000), ghosts(60, 9000), *many]:
        tuples, place = _distinct(problem.tuples)
        assert np.array_equal(tuples, np.unique(problem.tuples, axis=0))
        assert np.array_equal(tuples[place], problem.tuples)
