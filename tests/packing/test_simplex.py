"""The dual simplex method against HiGHS; its bounds when it is stopped, cut off or started anywhere."""

import time

import numpy as np
import pytest
from scipy.optimize import linprog

from assoc.packing.bounds.dual_ascent import certified_bound, dual_bound
from assoc.packing.prepare import prepare
from assoc.packing.simplex.basis import begin_from_duals, new_basis, primal_values
from assoc.packing.simplex.dual import CUT, OPTIMAL, STOPPED, Effort, solve_dual
from assoc.packing.simplex.linear_program import LinearProgram
from assoc.packing.simplex.program import Program, all_allowed, certified, make_feasible, program_of, weight_limit
from tests.oracles import axial_problem, gated_problem
from tests.packings import matrix_of, optimum
from tests.sizes import few_or_all


def random_packing(rng, number):
    """Gated problems and axial ones, of two to five sensors, with costs of all kinds."""
    sensors = int(rng.integers(2, 6))
    most = {2: 30, 3: 14, 4: 8, 5: 5}[sensors]
    sizes = tuple(int(n) for n in rng.integers(2, most, sensors))
    style = ("mixed", "positive", "negative", "ties")[number % 4]
    if number % 2:
        return prepare(gated_problem(rng, sizes, float(rng.uniform(0.05, 0.6)), style)).packing
    return prepare(axial_problem(rng, sizes, float(rng.uniform(0.5, 1.0)), style)).packing


def close(packing, bound, expected):
    scale = max(1.0, float(np.abs(packing.weights).max(initial=0.0)))
    return bound == expected or abs(bound - expected) <= 1e-9 * max(scale, abs(expected))


@few_or_all("count", 80, 10_000)
def test_the_bound_is_that_of_highs(count):
    """From no multipliers, poor, good and arbitrary ones; the primal values are a solution of the same weight."""
    rng = np.random.default_rng(81)
    infeasible = 0
    for number in range(count):
        packing = random_packing(rng, number)
        expected = optimum(packing)
        start = (None, dual_bound(packing, levels=3), dual_bound(packing), rng.normal(size=packing.num_rows))[
            number % 4
        ]
        relaxed = LinearProgram(packing).solve(duals=start)
        assert close(packing, relaxed.bound, expected)
        if expected == np.inf:
            infeasible += 1
            continue
        assert relaxed.status == OPTIMAL
        assert certified_bound(packing, relaxed.duals) == pytest.approx(relaxed.bound, abs=1e-9)
        assert relaxed.reduced.min(initial=0.0) >= -1e-12 * max(1.0, float(np.abs(packing.weights).max(initial=0.0)))
        covered = matrix_of(packing) @ relaxed.primal
        assert relaxed.primal.min(initial=0.0) >= 0.0 and covered.max(initial=0.0) <= 1.0 + 1e-8
        assert covered[~packing.slack].min(initial=1.0) >= 1.0 - 1e-8
        assert close(packing, float(packing.weights @ relaxed.primal), expected)
    assert infeasible < 0.5 * count


@few_or_all("count", 20, 150)
def test_warm_from_the_basis_at_hand(count):
    """Columns are masked and rows lose their slack, step by step as in a dive or a branching, and back again."""
    rng = np.random.default_rng(82)
    warm, cold, none = 0, 0, 0
    for number in range(count):
        packing = random_packing(rng, number)
        program = LinearProgram(packing)
        first = program.solve(duals=dual_bound(packing))
        program.mark()
        columns, slack = np.ones(packing.num_columns, dtype=bool), packing.slack.copy()
        for _ in range(5):
            columns &= rng.random(columns.size) < 0.9
            slack &= rng.random(slack.size) < 0.95
            relaxed = program.solve(columns=columns, slack=slack)
            expected = optimum(packing, columns, slack)
            assert close(packing, relaxed.bound, expected)
            none += expected == np.inf
            warm += relaxed.exchanges
            cold += LinearProgram(packing).solve(columns=columns, slack=slack).exchanges
            if expected == np.inf:
                break
        # masked columns are allowed again: the basis is no longer optimal, nor are its multipliers feasible
        assert close(packing, program.solve().bound, first.bound)
        program.back()
        again = program.solve()
        assert again.exchanges == 0 and close(packing, again.bound, first.bound)
    assert warm < 0.6 * cold and none


@few_or_all("count", 25, 1000)
def test_dives_end_nowhere_else_than_at_an_optimum(count):
    """Chains of hundreds of short calls on one basis: optimal solutions are feasible and weigh their bound."""
    rng = np.random.default_rng(86)
    solves = 0
    for number in range(count):
        packing = random_packing(rng, number)
        if not packing.num_columns:
            continue
        program = LinearProgram(packing)
        root = program.solve(duals=dual_bound(packing))
        program.mark()
        matrix = matrix_of(packing)
        for _ in range(5):
            program.back()
            relaxed, columns, slack = root, np.ones(packing.num_columns, dtype=bool), packing.slack.copy()
            while relaxed.status == OPTIMAL:
                covered = matrix @ relaxed.primal
                assert relaxed.primal[~columns].max(initial=0.0) <= 1e-7 and covered.max(initial=0.0) <= 1.0 + 1e-7
                assert covered[~slack].min(initial=1.0) >= 1.0 - 1e-7
                assert close(packing, float(packing.weights @ relaxed.primal), relaxed.bound)
                left = np.flatnonzero(columns & (relaxed.primal < 1.0 - 1e-7))
                if not left.size:
                    break
                j = rng.choice(left, p=(relaxed.primal[left] + 0.01) / (relaxed.primal[left] + 0.01).sum())
                rows = packing.cols[j][packing.cols[j] >= 0]
                if rng.random() < 0.7:
                    columns[np.unique(matrix[rows].indices)] = False
                    slack[rows] = False
                columns[j] = not columns[j]
                relaxed = program.solve(columns=columns, slack=slack)
                solves += 1
    assert solves > 15 * count


def test_whenever_it_stops_the_bound_holds():
    rng = np.random.default_rng(84)
    stopped = cut = 0
    for number in range(20):
        packing = random_packing(rng, number)
        expected = optimum(packing)
        for exchanges in (0, 1, 3, 10):
            relaxed = LinearProgram(packing).solve(exchanges=exchanges)
            assert relaxed.bound <= expected + 1e-9 * max(1.0, abs(expected)) and relaxed.exchanges <= exchanges
            stopped += relaxed.status == STOPPED
        if expected < np.inf:
            cutoff = expected - 0.1 * abs(expected)
            relaxed = LinearProgram(packing).solve(cutoff=cutoff)
            if relaxed.status == CUT:
                cut += 1
                assert cutoff - 1e-9 * abs(cutoff) <= relaxed.bound <= expected + 1e-9 * abs(expected)
        late = LinearProgram(packing).solve(deadline=time.monotonic() - 1.0)
        assert late.status == STOPPED and late.bound <= expected + 1e-9 * max(1.0, abs(expected))
    assert stopped > 20 and cut > 5


def test_a_certificate_holds_for_any_multipliers():
    """With rows of cuts, too, whose side is 2 and in which a column may count twice."""
    rng = np.random.default_rng(85)
    for number in range(40):
        packing = random_packing(rng, number)
        program = program_of(packing.arrays)
        allowed = all_allowed(program, packing.slack)
        expected = optimum(packing)
        for scale in (0.1, 3.0, 1e6):
            duals = rng.normal(0.0, scale, packing.num_rows)
            assert certified(program, allowed, duals) <= expected + 1e-9 * max(1.0, abs(expected))
            make_feasible(program, allowed, duals)
            assert certified(program, allowed, duals) <= expected + 1e-9 * max(1.0, abs(expected))
            assert all(packing.weights[j] - duals[packing.cols[j][packing.cols[j] >= 0]].sum() >= -1e-9 * scale
                       for j in range(packing.num_columns))  # fmt: skip


def test_a_row_with_a_side_and_a_coefficient_of_two():
    """Columns a, b over the rows 0 (side 1) and 1 (side 3, b twice): min -2a - 3b is at a = 0, b = 1."""
    program = Program(
        np.array([-2.0, -3.0]), np.array([0, 2, 5]), np.array([0, 1, 0, 1, 1], dtype=np.int32), np.array([1.0, 1.0]), 1
    )
    allowed = all_allowed(program, np.ones(2, dtype=bool))
    basis = new_basis(program)
    duals = np.zeros(2)
    make_feasible(program, allowed, duals)
    begin_from_duals(program, allowed, duals, basis)
    status, _ = solve_dual(program, allowed, basis, Effort(weight_limit(program), 100, np.inf))
    primal = np.empty(2)
    primal_values(program, basis, primal)
    # a + b <= 1, a + 2 b <= 1
    expected = linprog([-2.0, -3.0], A_ub=[[1.0, 1.0], [1.0, 2.0]], b_ub=[1.0, 1.0])
    assert status == OPTIMAL and program.weights @ primal == pytest.approx(expected.fun)
    assert certified(program, allowed, basis.duals) == pytest.approx(expected.fun)
