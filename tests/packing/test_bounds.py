"""Bounds never above the optimum, and multipliers that prove them, checked with plain numpy."""

import math

import numpy as np
import pytest
from scipy.sparse import csr_array

from assoc.errors import InfeasibleError
from assoc.packing.bounds.dual_ascent import certified_bound, component_bounds, dual_bound
from assoc.packing.packing import assemble
from assoc.packing.prepare import prepare
from assoc.packing.simplex.program import all_allowed, certified, program_of
from assoc.problem import AssignmentProblem
from assoc.solvers.assign import assign
from tests.oracles import axial_problem, brute_force, gated_problem, milp_optimum, small_problems
from tests.packings import by_highs
from tests.sizes import few_or_all, sample
from tests.solvers.test_against_brute_force import installed


def lp_optimum(problem):
    """Optimal cost of the linear relaxation, by HiGHS."""
    sizes = problem.sizes
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    column, sensor = np.nonzero(problem.tuples)
    row = offsets[sensor] + problem.tuples[column, sensor] - 1
    matrix = csr_array((np.ones(row.size), (row, column)), shape=(int(offsets[-1]), problem.num_tuples))
    must = np.repeat(problem.dummy | (sizes == sizes.min()), sizes)
    every = np.ones(problem.num_tuples, dtype=bool)
    return by_highs(problem.costs, matrix, np.ones(len(must)), ~must, every, ())


def check_proof(problem, duals, bound):
    """Every reduced cost >= 0, sign-correct multipliers, and their sum at least the bound.

    A row that need not be covered (longer dimensions without dummies) has a multiplier <= 0.
    """
    assert [u.shape for u in duals] == [(n,) for n in problem.sizes]
    scale = max(1.0, float(np.abs(problem.costs).max(initial=0.0)))
    reduced = problem.costs.copy()
    for s, u in enumerate(duals):
        reduced -= np.concatenate([[0.0], u])[problem.tuples[:, s]]
        if not problem.dummy and problem.sizes[s] > problem.sizes.min():
            assert u.max(initial=0.0) <= 1e-12 * scale
    assert reduced.min(initial=0.0) >= -1e-11 * scale
    assert bound <= sum(u.sum() for u in duals) + 1e-9 * scale * max(1, int(problem.sizes.sum()))


@pytest.mark.parametrize("with_dummies", [True, False])
@few_or_all("number", 100, 1500)
def test_thousands_of_random_problems(number, with_dummies):
    """The bound of arbitrary, poor and good multipliers is valid, rectangular and gated."""
    rng = np.random.default_rng(1)
    tight = 0
    count = 0
    for problem in small_problems(number, seed=31, dummy=with_dummies):
        try:
            optimum = brute_force(problem)
        except InfeasibleError:
            continue
        count += 1
        prepared = prepare(problem)
        packing = prepared.packing
        slack = 1e-12 * max(1.0, float(np.abs(problem.costs).sum()))
        good = dual_bound(packing)
        poor = dual_bound(packing, levels=int(rng.integers(0, 4)), passes=int(rng.integers(1, 4)))
        arbitrary = rng.normal(0.0, 5.0, packing.num_rows)
        for duals in (good, poor, arbitrary, good + 1e-3 * arbitrary):
            assert certified_bound(packing, duals) + prepared.offset <= optimum + slack
        tight += certified_bound(packing, good) + prepared.offset >= optimum - 1e-6
    # the linear relaxation of such small problems is mostly integral (of 300: 88 % and 74 % by HiGHS)
    assert tight >= (0.8 if with_dummies else 0.6) * count


@pytest.mark.parametrize("kind", ["gated", "rectangular"])
def test_against_linear_program(kind):
    """Never above the LP's optimum, and near it."""
    rng = np.random.default_rng(2)
    shortfall = []
    for number in range(60):
        sizes = tuple(int(n) for n in rng.integers(4, 9, rng.integers(2, 5)))
        style = ("mixed", "positive", "negative", "ties")[number % 4]
        if kind == "gated":
            problem = gated_problem(rng, sizes, 0.2, style, listed_singletons=0.3)
        else:
            problem = axial_problem(rng, sizes, 0.7, style)
        expected = lp_optimum(problem)
        if expected == np.inf:
            continue
        prepared = prepare(problem)
        bound = certified_bound(prepared.packing, dual_bound(prepared.packing)) + prepared.offset
        assert bound <= expected + 1e-6
        shortfall.append((expected - bound) / max(1.0, abs(expected)))
    assert len(shortfall) > 40
    assert np.median(shortfall) < 1e-3
    assert max(shortfall) < 0.1


@sample("name", installed(), every=3)
@few_or_all("count", 20, 90)
def test_duals_of_solutions_prove_their_bound(count, name):
    proved = 0
    rng = np.random.default_rng(3)
    problems = list(small_problems(count, seed=32))
    problems += [gated_problem(rng, (8, 7, 9), 0.1, "mixed", listed_singletons=0.5) for _ in range(10)]
    problems += [axial_problem(rng, (6, 7, 9), 0.5, "mixed") for _ in range(10)]
    for problem in problems:
        try:
            solution = assign(problem, name)
        except InfeasibleError:
            continue
        if solution.duals:
            # branching may have raised a heuristic's bound above that of its multipliers
            check_proof(problem, solution.duals, -np.inf)
            proved += sum(u.sum() for u in solution.duals) >= solution.lower_bound - 1e-6
    if name in ("exact", "greedy"):
        assert proved >= 0.54 * len(problems)


def test_exact_gives_duals_only_where_they_are_the_proof():
    rng = np.random.default_rng(7)
    large = [gated_problem(rng, (25, 25, 25), 0.01, "negative") for _ in range(5)]
    for problem in (*small_problems(200, seed=33), *large):
        try:
            solution = assign(problem, "exact")
        except InfeasibleError:
            continue
        if solution.duals:
            check_proof(problem, solution.duals, solution.lower_bound)


@pytest.mark.parametrize("name", installed())
@few_or_all("count", 2, 8)
def test_bounds_of_solvers_on_middle_sized_problems(count, name):
    rng = np.random.default_rng(6)
    for number in range(count):
        sizes = tuple(int(n) for n in rng.integers(5, 10, 3))
        style = ("mixed", "ties")[number % 2]
        problem = gated_problem(rng, sizes, 0.3, style) if number % 4 else axial_problem(rng, sizes, 0.9, style)
        optimum = milp_optimum(problem)
        solution = assign(problem, name)
        assert solution.lower_bound <= optimum + 1e-9 <= solution.cost + 2e-9


def test_the_sum_of_many_multipliers_is_a_bound_to_the_last_digit():
    """A thousand times 0.1 is 99.9999999999986, added one by one: more than the -100 that these multipliers prove."""
    half = 500
    links = np.array([(n // 2, half + (n + 1) // 2) for n in range(2 * half - 1)], dtype=np.int32)
    origin = np.arange(len(links), dtype=np.int32)
    packing = assemble(links, np.zeros(len(links)), np.ones(2 * half, dtype=np.bool_), origin)
    assert packing.num_components == 1 and packing.num_rows == 2 * half
    program = program_of(packing.arrays)
    allowed = all_allowed(program, packing.slack)
    for tenths in range(1, 10):
        duals = np.full(2 * half, -0.1 * tenths)
        most = math.fsum(duals)
        for bound in (certified_bound(packing, duals), certified(program, allowed, duals)):
            assert most + 2e-15 * most <= bound <= most


def test_component_without_cover_is_unbounded():
    """If a measurement that must be used is in no tuple, the bound shows that there is no solution."""
    problem = AssignmentProblem([[1, 1]], [1.0], [2, 2], dummy=False)
    packing = prepare(problem).packing
    assert np.isposinf(component_bounds(packing, np.zeros(packing.num_rows))).any()
