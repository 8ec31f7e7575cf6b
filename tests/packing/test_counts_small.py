"""Roots split on counts, on packings so small that the tests run uncompiled, too: `make mutants` does that."""

import numpy as np
import pytest

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching import counts
from assoc.packing.branching.counts import split_on_counts
from assoc.packing.branching.root import plain_root
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.packing import assemble
from tests.packing.test_counts import ALWAYS, columns_used, times_in
from tests.packings import all_covers, random_packing, weights_of


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
        while not one.done:
            one.run(1)
            assert one.lower_bound <= best + 1e-8
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
