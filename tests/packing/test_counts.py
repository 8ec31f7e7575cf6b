"""The root split on counts: its parts have all solutions, and their bounds are valid."""

import numpy as np
import pytest

from assoc import AssignmentProblem, assign
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching import counts
from assoc.packing.branching.counts import USUAL, Splitting, split_on_counts
from assoc.packing.branching.root import plain_root, root_with_cuts
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.prepare import prepare
from assoc.packing.simplex.program import weight_limit
from experiments.common.instances.synthetic import axial_random
from tests.oracles import small_problems
from tests.packings import all_covers, finished, ghosts, is_cover, random_packing, weights_of

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


@pytest.mark.parametrize("rigid", [0.0, 0.3])
def test_every_solution_is_of_one_part_and_weighs_no_less_than_its_bound(rigid):
    split = dropped = 0
    for seed in range(24):
        packing = random_packing(seed, rigid)
        root = plain_root(packing, dual_bound(packing))
        used = columns_used(packing)
        if not len(used):
            continue
        weights = used @ packing.weights
        for cutoff in (np.inf, weights.min() + 0.8, weights.min()):
            leaves = split_on_counts(packing, root, cutoff, cutoff, np.inf, np.inf)
            split += len(leaves) > 1
            times = times_in(leaves, packing, used)
            assert times.max() <= 1 and (weights[times == 0] >= cutoff - 1e-9).all()
            dropped += int((times == 0).sum())
    assert split > 8 and dropped > 0


@pytest.mark.parametrize("rigid", [0.0, 0.3])
def test_a_search_of_parts_ends_at_the_optimum(rigid):
    for seed in range(20):
        packing = random_packing(seed, rigid)
        best = weights_of(packing, all_covers(packing)).min(initial=np.inf)
        for incumbent in (np.inf, -1.0, best - 0.5, best + 0.3):
            one = BranchAndBound(packing, dual_bound(packing), incumbent, 1e-9, to_the_end=True, splitting=ALWAYS)
            while not one.done:
                one.run(1)
                assert one.lower_bound <= max(best, min(best, incumbent)) + 1e-8
            assert one.weight == pytest.approx(min(best, incumbent), abs=1e-9)
            if one.columns is not None:
                assert is_cover(packing, one.columns)
                assert packing.weights[one.columns].sum() == pytest.approx(best, abs=1e-9)


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


def test_a_range_without_a_solution_is_left_out():
    packing = random_packing(3)
    everything = counts._counts_of(packing)
    counted = counts._Counted(plain_root(packing, dual_bound(packing)), everything, np.inf, np.inf)
    # three columns of three rows and one more of two: eleven rows of nine
    two, three = 0, 1
    assert (everything.most == [4, 3, 4, 9]).all()
    none = everything.within(three, 3, 3).within(two, 1, 4)
    part = counted.part(none)
    assert part.leaf.bound >= weight_limit(part.leaf.root.program) - 1e-6 and part.values is None
    assert counted.part(everything.within(three, 0, 2)).leaf.bound >= counted.part(everything).leaf.bound - 1e-9


def test_further_columns_have_no_rows_and_weigh_nothing():
    packing = random_packing(5)
    everything = counts._counts_of(packing)
    part = counts._Counted(plain_root(packing, dual_bound(packing)), everything, np.inf, np.inf).part(everything)
    arrays = counts._with_counts(packing.arrays, part.leaf.root.program)
    assert (arrays.cols[packing.num_columns :] == -1).all() and len(arrays.cols) == packing.num_columns + 4
    assert (arrays.weights[packing.num_columns :] == 0.0).all()


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


def test_a_long_first_pass_is_split_before_it_ends():
    """From a poor incumbent the first aim is so high that its pass alone would take hundreds of nodes."""
    packing, duals, bound = ghosts(20, 4048)
    nodes = []
    for after in (10**9, USUAL.after):
        one = BranchAndBound(
            packing, duals, 0.5 * bound, 1e-9 * abs(bound), to_the_end=True, splitting=Splitting(after)
        )
        bounds = []
        while not one.done:
            one.run(10)
            bounds.append(one.lower_bound)
        assert (np.diff(bounds) >= 0.0).all() and bounds[-1] == pytest.approx(one.weight, abs=1e-6)
        nodes.append(one.nodes)
    assert nodes[1] < 0.2 * nodes[0]


@pytest.mark.slow
def test_tuples_of_many_sensors():
    """Any two share a measurement, so that the linear program is far below the optimum and the root is split."""
    rng = np.random.default_rng(0)
    tuples = rng.integers(1, 4, (100, 130))
    costs = -1.0 - 1e-3 * rng.random(100)
    problem = AssignmentProblem(tuples, costs, [3] * 130)
    for solver in ("exact", "tabu"):
        solution = assign(problem, solver, **({"iterations": 5} if solver == "tabu" else {}))
        assert solution.cost == pytest.approx(costs.min(), abs=1e-12)
    assert assign(problem).status == "optimal"
