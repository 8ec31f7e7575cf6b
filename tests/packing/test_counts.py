"""Roots split on counts, on packings so small that the tests run uncompiled, too: `make mutants` does that."""

import os

import numpy as np
import pytest

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching import counts
from assoc.packing.branching.counts import USUAL, Splitting, split_on_counts
from assoc.packing.branching.root import plain_root, root_with_cuts
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.packing import assemble
from assoc.packing.prepare import prepare
from experiments.common.instances.synthetic import axial_random
from tests.oracles import small_problems
from tests.packings import all_covers, finished, ghosts, random_packing, weights_of

# uncompiled they take minutes
compiled = pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT") == "1", reason="takes minutes without a compiler")
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


@pytest.fixture(params=[3, 26])
def packing(request):
    return random_packing(request.param)


def split(packing, cutoff=np.inf):
    leaves = split_on_counts(packing, plain_root(packing, dual_bound(packing)), cutoff, cutoff, np.inf, np.inf)
    assert len(leaves) > 1
    return leaves


def test_every_solution_is_of_one_part(packing):
    assert (times_in(split(packing), packing, columns_used(packing)) == 1).all()


def test_a_search_in_parts_ends_at_the_optimum(packing):
    best = weights_of(packing, all_covers(packing)).min()
    for incumbent in (-1.0, best + 0.3):
        one = BranchAndBound(packing, dual_bound(packing), incumbent, 1e-9, to_the_end=True, splitting=ALWAYS)
        bounds = []
        while not one.done:
            one.run(1)
            bounds.append(one.lower_bound)
        assert (np.diff(bounds) >= 0.0).all() and max(bounds) <= best + 1e-8
        assert one.weight == pytest.approx(best, abs=1e-9)


def test_the_least_bound_of_the_parts_bounds_the_whole(packing):
    leaves = split(packing)
    one = BranchAndBound(packing, dual_bound(packing), 0.0, 1e-9, to_the_end=True, splitting=ALWAYS)
    one._begin()
    one._waiting = sorted(leaves, key=lambda leaf: -leaf.bound)
    one._open.count, one._aim = 0, np.inf
    assert not one.done and one.lower_bound == min(leaf.bound for leaf in leaves)


@pytest.mark.parametrize("packing", [26], indirect=True)
def test_a_pass_is_split_in_its_middle(packing):
    """Split after one node, with others open: the bound proved so far stays."""
    one = BranchAndBound(packing, dual_bound(packing), 0.0, 1e-9, to_the_end=True, splitting=ALWAYS)
    one.run(1)
    assert one._open.count and not one._leaves
    shown = one.lower_bound
    one.run(1)
    assert len(one._leaves) > 1 and one.lower_bound >= shown


def test_columns_of_many_rows_are_counted():
    """More rows than an int8 holds."""
    sensors, num = 130, 6
    rng = np.random.default_rng(0)
    cols = (3 * np.arange(sensors) + rng.integers(0, 3, (num, sensors))).astype(np.int32)
    packing = assemble(cols, -np.ones(num), np.ones(3 * sensors, dtype=bool), np.arange(num, dtype=np.int32))
    every = counts._counts_of(packing.component(0))
    assert every.times.tolist() == [[1] * num, [sensors] * num]
    program = counts._with_rows(plain_root(packing, np.zeros(packing.num_rows)).program, every)
    last = program.sides.size - 3
    assert (np.bincount(program.rows, minlength=last + 3)[[last - 1, last]] == [num + 1, num * sensors + 1]).all()


def test_a_split_without_time_is_one_part_and_its_bound_holds(packing):
    best = weights_of(packing, all_covers(packing)).min()
    (leaf,) = split_on_counts(packing, plain_root(packing, dual_bound(packing)), np.inf, np.inf, -1.0, np.inf)
    assert leaf.bound <= best + 1e-9


def test_parts_that_there_is_no_time_to_solve_again_stay_as_they_were(packing):
    best = weights_of(packing, all_covers(packing)).min()
    root, everything = plain_root(packing, dual_bound(packing)), counts._counts_of(packing)
    counted = counts._Counted(root, everything, np.inf, np.inf)
    parts = counts._split(counted, everything, counted.effort.cutoff, np.inf)
    assert len(parts) > 1
    used = np.arange(len(everything.times)) < 1
    fewer = counts._Counted(root, everything.only(used), np.inf, np.inf)
    # in time, each has fewer rows, and a bound that is as good
    again = counts._solved_again(fewer, parts, used, np.inf)
    assert {leaf.root.slack.size for leaf in again} == {root.slack.size + 2}
    leaves = counts._solved_again(fewer, parts, used, -1.0)
    assert {leaf.root.slack.size for leaf in leaves} == {root.slack.size + 2 * len(used)}
    assert min(leaf.bound for leaf in leaves) <= best + 1e-9
    assert [leaf.bound for leaf in leaves] == [part.leaf.bound for part in parts]


@compiled
def test_bounds_of_parts_hold_and_rise():
    """From incumbents near and far, with cuts: no part that may hold the optimum is lost."""
    made = 0
    for seed in (16, 24, 31):
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
    assert made > 1


@compiled
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


@pytest.mark.slow
@compiled
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
