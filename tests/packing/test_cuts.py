"""Cuts from odd sets: no whole-numbered solution violates one, the LP's solution violates each that is found."""

import numpy as np
import pytest
from scipy.optimize import linprog

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching import search as branch_and_bound
from assoc.packing.branching.root import plain_root, root_with_cuts
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.prepare import prepare
from assoc.packing.simplex.basis import primal_values
from assoc.packing.simplex.cuts import odd_sets
from assoc.packing.simplex.program import all_allowed, certified, make_feasible
from tests.oracles import gated_problem
from tests.packings import all_covers, finished, ghosts, matrix_of_program, relaxed, weights_of


def odd_packings(count, seed):
    """Dense problems of few measurements: their linear programs are rarely whole-numbered."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        sensors = 3 + number % 3
        sizes = tuple(int(n) for n in rng.integers(3, 5, sensors))
        packing = prepare(gated_problem(rng, sizes, float(rng.uniform(0.15, 0.5)) / 3 ** (sensors - 3))).packing
        for c in range(packing.num_components):
            part = packing.component(c)
            # few enough to list all solutions
            if part.num_columns > 5 and len(all_covers(part)) < 2000:
                yield part


def solved(packing):
    program, _, basis = relaxed(packing)
    primal = np.zeros(packing.num_columns)
    primal_values(program, basis, primal)
    return basis, primal


def pairs_covered(packing, rows):
    """Left-hand side of the cut of a set of rows, column by column."""
    return np.array([len(rows & set(cols)) // 2 for cols in packing.cols.tolist()])


def test_sets_are_odd_violated_and_spare_every_solution():
    found = 0
    for packing in odd_packings(150, 1):
        basis, primal = solved(packing)
        sets = odd_sets(packing.cols, basis, packing.num_rows)
        solutions = all_covers(packing)
        for members in sets:
            rows = set(np.flatnonzero(members).tolist())
            left = pairs_covered(packing, rows)
            assert len(rows) % 2 == 1 and left @ primal > (len(rows) - 1) / 2 + 0.01
            for solution in solutions:
                assert left[list(solution)].sum() <= (len(rows) - 1) / 2
        found += len(sets)
    assert found > 30


@pytest.mark.slow
def test_the_root_is_tighter_and_below_every_solution():
    """Its program is the LP with those cuts, by HiGHS; its multipliers prove a bound that holds."""
    tighter, closed = 0, 0
    for packing in odd_packings(150, 2):
        best = weights_of(packing, all_covers(packing)).min()
        plain = plain_root(packing, dual_bound(packing))
        root = root_with_cuts(packing, dual_bound(packing), np.inf, np.inf)
        size = packing.num_rows
        assert root.slack[size:].all() and np.array_equal(root.slack[:size], packing.slack)
        matrix = matrix_of_program(root.program)
        assert np.array_equal(matrix[:size], matrix_of_program(plain.program))
        weights, sides = packing.weights, root.program.sides
        optimum = linprog(weights, A_ub=matrix, b_ub=sides).fun
        without = linprog(weights, A_ub=matrix[:size], b_ub=sides[:size]).fun
        duals = root.duals.copy()
        allowed = all_allowed(root.program, root.slack)
        make_feasible(root.program, allowed, duals)
        assert certified(root.program, allowed, duals) == pytest.approx(optimum, abs=1e-9)
        assert without - 1e-9 <= optimum <= best + 1e-9
        tighter += optimum > without + 1e-6
        closed += without + 1e-6 < best < optimum + 1e-6
    assert tighter > 15 and closed > 5


def test_a_search_with_cuts_ends_at_the_same_optimum():
    for packing in odd_packings(100, 3):
        best = weights_of(packing, all_covers(packing)).min()
        for incumbent in (np.inf, best + 0.5):
            search = finished(BranchAndBound(packing, dual_bound(packing), incumbent, 1e-9, to_the_end=True), 1)
            assert search.weight == pytest.approx(best, abs=1e-9) and search.lower_bound <= best + 1e-9
            assert search.columns is not None
            assert packing.weights[search.columns].sum() == pytest.approx(best, abs=1e-9)


def test_only_better_solutions_are_looked_for_with_cuts():
    for packing in odd_packings(50, 4):
        best = weights_of(packing, all_covers(packing)).min()
        search = BranchAndBound(packing, dual_bound(packing), best, 1e-9, to_the_end=True)
        search.run(10_000)
        assert search.done and search.columns is None


def test_passes_need_no_good_incumbent(monkeypatch):
    """A search to the end from a poor incumbent takes few nodes more than one from the optimum."""

    def searched(incumbent):
        return finished(BranchAndBound(packing, duals, incumbent, 1e-9 * abs(bound), to_the_end=True))

    nodes = np.zeros(3)
    for seed in (4, 5, 6):
        packing, duals, bound = ghosts(30, seed)
        poor = searched(0.99 * bound)
        good = searched(poor.weight + 1e-6)
        with monkeypatch.context() as patch:
            patch.setattr(branch_and_bound, "_LAST", 0.0)
            alone = searched(0.99 * bound)
        for other in (good, alone):
            assert other.weight == pytest.approx(poor.weight, abs=1e-8)
        nodes += [poor.nodes, good.nodes, alone.nodes]
    assert nodes[0] < 2.0 * nodes[1] and nodes[0] < 0.5 * nodes[2]
