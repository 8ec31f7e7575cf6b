"""The root split on counts: its parts have all solutions, and their bounds are valid."""

import numpy as np
import pytest

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.counts import USUAL, Splitting, split_on_counts
from assoc.packing.branching.root import root_with_cuts
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.prepare import prepare
from experiments.common.instances.synthetic import axial_random
from tests.oracles import small_problems
from tests.packings import all_covers, finished, ghosts

# split whenever it can be, and at once
ALWAYS = Splitting(after=1, raised=-np.inf, pays=np.inf)


def inside(leaf, size, used):
    """Mask of the solutions in this part; ``used``: mask of the columns of each, shape (solutions, N)."""
    program = leaf.root.program
    half = (program.sides.size - size) // 2
    times = np.zeros((used.shape[1], program.sides.size))
    for j in range(used.shape[1]):
        np.add.at(times[j], program.rows[program.start[j] : program.start[j + 1]], 1.0)
    value = used @ times[:, size : size + half]
    most = program.sides[size : size + half]
    return ((value <= most) & (value >= most - program.sides[size + half :])).all(axis=1)


def columns_used(packing):
    """Which columns each solution has, shape (solutions, N)."""
    every = all_covers(packing)
    used = np.zeros((len(every), packing.num_columns), dtype=np.int64)
    for row, one in zip(used, every, strict=True):
        row[list(one)] = 1
    return used


def times_in(leaves, packing, used):
    """In how many parts each solution is; in each it weighs no less than the bound."""
    weights, times = used @ packing.weights, np.zeros(len(used), dtype=np.int64)
    for leaf in leaves:
        part = inside(leaf, packing.num_rows, used)
        times += part
        assert (weights[part] >= leaf.bound - 1e-9).all()
    return times


def test_bounds_of_parts_hold_and_rise():
    """Checked after every node, from incumbents near and far, with cuts."""
    made = 0
    for seed in (16, 24, 31, 37):
        packing, duals, bound = ghosts(10, seed)
        best = finished(BranchAndBound(packing, duals, np.inf, 1e-9 * abs(bound))).weight
        for incumbent in (0.95 * bound, best + 1e-3 * abs(best)):
            one = BranchAndBound(packing, duals, incumbent, 1e-9 * abs(bound), to_the_end=True, splitting=ALWAYS)
            bounds = []
            while not one.done:
                one.run(1)
                bounds.append(one.lower_bound)
            made += len(one._leaves) > 1
            assert one.weight == pytest.approx(best, abs=1e-8) and bounds[-1] == pytest.approx(best, abs=1e-6)
            assert (np.diff(bounds) >= 0.0).all() and bounds[-1] <= best + 1e-9
    assert made > 2


def test_axial_packings_and_problems_without_dummies():
    """All columns of one size leave nothing to split; of several sizes, with rows that must be covered, they do."""
    for seed in range(4):
        packing = prepare(axial_random(10, seed)).packing
        root = root_with_cuts(packing, dual_bound(packing), np.inf, np.inf)
        leaves = split_on_counts(packing, root, np.inf, np.inf, np.inf, np.inf)
        assert len(leaves) == 1 and leaves[0].root.program.sides.size == root.program.sides.size
    for problem in small_problems(40, 91):
        packing = prepare(problem).packing
        found = []
        for to_the_end in (False, True):
            one = BranchAndBound(packing, dual_bound(packing), np.inf, 1e-9, to_the_end=to_the_end, splitting=ALWAYS)
            found.append(finished(one, 5).weight)
        assert found[0] == pytest.approx(found[1], abs=1e-9)


def test_fewer_nodes_are_needed_where_the_gap_is_wide():
    packing, duals, bound = ghosts(20, 2018)
    weight, nodes = np.inf, []
    for after in (10**9, 10**9, USUAL.after):
        # the second and the third from the same incumbent, a little above the optimum
        incumbent = min(0.95 * bound, weight + 1e-3 * abs(weight)) if nodes else 0.95 * bound
        one = BranchAndBound(packing, duals, incumbent, 1e-9 * abs(bound), to_the_end=True, splitting=Splitting(after))
        before, weight = weight, finished(one).weight
        assert not nodes or weight == pytest.approx(before, abs=1e-8)
        nodes.append(one.nodes)
    assert nodes[2] < 0.7 * nodes[1]
