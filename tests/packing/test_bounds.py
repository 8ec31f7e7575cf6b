"""Bounds never above the optimum, and multipliers that prove them, checked with plain numpy."""

import math

import numpy as np
import pytest
from scipy.sparse import csr_array

from assoc.errors import InfeasibleError
from assoc.packing.bounds.dual_ascent import certified_bound, dual_bound
from assoc.packing.packing import assemble
from assoc.packing.prepare import prepare
from assoc.packing.simplex.program import all_allowed, certified, program_of
from tests.oracles import axial_problem, brute_force, gated_problem, small_problems
from tests.packings import by_highs
from tests.sizes import few_or_all


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
