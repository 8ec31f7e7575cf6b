"""Passes of a branch and bound to the end: their bounds and incumbents on the way."""

import numpy as np
import pytest

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.prepare import prepare
from assoc.problem import AssignmentProblem
from assoc.solvers.assign import assign
from experiments.common.instances.synthetic import axial_random
from tests.packings import finished, ghosts


def test_bounds_of_passes_hold_and_rise():
    """From poor incumbents, checked after every node: the bound is never above the optimum, and never falls."""
    for seed in (16, 24, 31, 37):
        packing, duals, bound = ghosts(10, seed)
        best = finished(BranchAndBound(packing, duals, np.inf, 1e-9 * abs(bound))).weight
        for floor in (-np.inf, best - 0.5 * (best - bound)):
            search = BranchAndBound(packing, duals, 0.95 * bound, 1e-9 * abs(bound), to_the_end=True, floor=floor)
            bounds = []
            while not search.done:
                search.run(1)
                bounds.append(search.lower_bound)
            assert search.weight == pytest.approx(best, abs=1e-8) and bounds[-1] == pytest.approx(best, abs=1e-6)
            assert (np.diff(bounds) >= 0.0).all() and bounds[-1] <= best + 1e-9 and bounds[0] >= min(floor, best) - 1e-6
            # pass by pass, and not at the end alone
            assert len(np.unique(bounds)) > (2 if np.isfinite(floor) else 3)


def test_passes_over_whole_numbers_end_at_the_optimum_itself():
    """An aim between two whole numbers proves the larger one."""
    nodes = 0
    for seed in range(8):
        packing = prepare(axial_random(14, seed)).packing
        assert packing.granularity >= 1.0
        duals = dual_bound(packing)
        found = []
        for above in (np.inf, 0.0, 1.0, 5.0, 20.0):
            incumbent = above if not found else found[0] + above
            search = finished(BranchAndBound(packing, duals, incumbent, 0.9, to_the_end=True), 1)
            assert search.lower_bound == search.weight
            found.append(search.weight)
            nodes += search.nodes
        assert set(found) == {found[0]}
    assert nodes > 100


def test_a_gap_of_few_roundings_is_closed():
    """A share of such a gap rounds to 0: the aim would stay the same, and the same pass be repeated for ever."""
    tuples = [
        [2, 1, 2, 2, 1], [1, 2, 1, 2, 2], [2, 2, 2, 2, 1], [1, 2, 2, 2, 1], [2, 1, 1, 2, 2], [2, 1, 1, 1, 1],
        [2, 1, 1, 2, 1], [2, 1, 2, 1, 1], [1, 1, 2, 2, 1], [1, 1, 2, 1, 2], [1, 1, 2, 1, 1],
    ]  # fmt: skip
    costs = [
        534717956.5867999, -78.21682207598427, -5.159143142792697e-12, 1.5074410662039698e-07, -2176348.4286549557,
        0.00021004083834822964, -4.708665738726913e-10, 15277910879.285505, -6.606517070637708e-11, -3378.50670718536,
        -4.4795837356531726e-09,
    ]  # fmt: skip
    # in the order of a tensor: the order of columns decides how sums are rounded
    problem = AssignmentProblem.from_dense(
        AssignmentProblem(tuples, costs, [2] * 5, dummy=False).to_dense(), dummy=False
    )
    solution = assign(problem, "exact", nodes=2000)
    assert solution.stopped_by == "converged" and solution.iterations < 1000
    # the second and the eighth are the only two that use everything
    assert solution.cost == pytest.approx(costs[1] + costs[7], rel=1e-15)
