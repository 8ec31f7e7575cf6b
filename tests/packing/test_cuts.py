"""Cuts from odd sets: no whole-numbered solution violates one, the LP's solution violates each that is found."""

import numpy as np
import pytest

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.prepare import prepare
from assoc.packing.simplex.basis import primal_values
from assoc.packing.simplex.cuts import odd_sets
from tests.oracles import gated_problem
from tests.packings import all_covers, finished, relaxed, weights_of


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


def test_a_search_with_cuts_ends_at_the_same_optimum():
    for packing in odd_packings(100, 3):
        best = weights_of(packing, all_covers(packing)).min()
        for incumbent in (np.inf, best + 0.5):
            search = finished(BranchAndBound(packing, dual_bound(packing), incumbent, 1e-9, to_the_end=True), 1)
            assert search.weight == pytest.approx(best, abs=1e-9) and search.lower_bound <= best + 1e-9
            assert search.columns is not None
            assert packing.weights[search.columns].sum() == pytest.approx(best, abs=1e-9)
