"""The k best in parts split on counts, on packings so small that the tests run uncompiled, too (`make mutants`)."""

import numpy as np
import pytest

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.counts import Splitting
from assoc.packing.packing import assemble
from assoc.packing.run import never
from assoc.ranking import component_ranking
from assoc.ranking.component_ranking import ComponentRanking
from tests.packings import all_covers, finished, random_packing, weights_of

# their kernel compiles for a quarter of a minute
pytestmark = pytest.mark.slow

# every split that raises the bound, at once
ALWAYS = Splitting(after=1, pays=np.inf)


# packings that cuts do not close before there is anything to split: few of the random ones
@pytest.mark.parametrize(("seed", "rigid"), [(149, 0.0), (26, 0.0), (26, 0.3)])
@pytest.mark.parametrize(("k", "budget"), [(4, 0), (12, 6)])
def test_none_is_left_out_and_none_listed_twice(seed, rigid, k, budget):
    check_list(random_packing(seed, rigid), k, budget)


def ranked(packing, **options):
    """The weights of all solutions, and a ranking of the four lightest."""
    every = np.sort(weights_of(packing, all_covers(packing)))
    duals = dual_bound(packing)
    return every, ComponentRanking(packing, duals, 4, every[-1] + 1.0, 1e-12, budget=0, splitting=ALWAYS, **options)


def check_list(packing, k, budget):
    """The lightest k by recursion, and the bound at any moment."""
    weight_of = {frozenset(one): float(packing.weights[one].sum()) for one in map(list, all_covers(packing))}
    every = sorted(weight_of.values())
    ranking = ComponentRanking(packing, dual_bound(packing), k, every[-1] + 1.0, 1e-12, budget=budget, splitting=ALWAYS)
    while not ranking.done:
        before = ranking.proven
        ranking.run(1)
        known = {frozenset(columns.tolist()) for columns in ranking.solutions()[1]}
        rest = min((weight for one, weight in weight_of.items() if one not in known), default=np.inf)
        assert ranking.proven <= rest + 1e-9
        # a full list may raise the bound further; a split never lowers it
        assert ranking.proven >= before - 1e-9 or len(known) == k
    weights, chosen = ranking.solutions()
    assert ranking.parts_begun > 1
    assert ranking.proven == pytest.approx(every[k - 1] if k <= len(every) else every[-1] + 1.0, abs=1e-9)
    assert weights.tolist() == pytest.approx(every[:k], abs=1e-9)
    found = [frozenset(columns.tolist()) for columns in chosen]
    assert len(set(found)) == len(found)
    assert [weight_of[one] for one in found] == pytest.approx(weights.tolist(), abs=1e-9)


def test_without_memory_for_parts_the_search_goes_on_as_it_was():
    packing = random_packing(3)
    room = component_ranking.work_memory(packing.num_rows, packing.num_columns, packing.num_sensors)
    every, ranking = ranked(packing, memory_allows=lambda needed: needed <= room)
    finished(ranking, 1)
    assert not ranking.parts_begun
    assert not ranking.out_of_memory
    assert ranking.solutions()[0].tolist() == pytest.approx(every[:4], abs=1e-9)


def test_what_was_given_up_in_one_part_is_remembered_in_the_next():
    packing = random_packing(149)
    every, ranking = ranked(packing)
    while not ranking.parts_begun:
        ranking.run(1)
    assert ranking._open.count
    while ranking._open.count:
        ranking._open.give_up()
    while not ranking.done:
        ranking.run(1)
        assert ranking.out_of_memory
    assert ranking.proven < every[3]


def test_a_split_that_time_ends_leaves_a_bound_that_holds():
    packing = random_packing(26)
    every, ranking = ranked(packing)
    ranking.run(1)
    before = ranking.proven
    # time is over as soon as the search for cuts begins
    ranking._deadline = lambda: -1.0
    ranking._split()
    assert before <= ranking.proven <= every[0] + 1e-9
    ranking._deadline = never
    finished(ranking, 1)
    assert ranking.solutions()[0].tolist() == pytest.approx(every[:4], abs=1e-9)


def test_parts_that_show_nothing_new_are_not_begun():
    packing = random_packing(149)
    every, ranking = ranked(packing)
    while not ranking._split():
        assert not ranking.done
        ranking.run(1)
    waiting = ranking._waiting
    assert not ranking._split()
    assert ranking._waiting is waiting


def test_where_there_is_nothing_to_ask_all_is_listed():
    # any of three columns of one row each; the one that joins the rows is beyond the limit
    cols = np.array([[0, -1, -1], [-1, 1, -1], [-1, -1, 2], [0, 1, 2]], dtype=np.int32)
    weights = np.array([-1.0, -1.1, -1.2, 5.0])
    packing = assemble(cols, weights, np.ones(3, dtype=np.bool_), np.arange(4, dtype=np.int32)).component(0)
    ranking = ComponentRanking(packing, dual_bound(packing), 9, 0.5, 1e-12, budget=0, splitting=ALWAYS)
    for _ in range(5):
        ranking.run(1)
    assert ranking.done
    assert ranking.solutions()[0].tolist() == pytest.approx([-3.3, -2.3, -2.2, -2.1, -1.2, -1.1, -1.0, 0.0])
