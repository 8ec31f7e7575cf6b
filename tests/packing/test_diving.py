"""Dives: covers from the linear program, drawn by pheromone and LP value, and far better than greedy ones."""

import numpy as np
import pytest

import assoc
from assoc.packing.branching.depth_first import Limits
from assoc.packing.branching.root import plain_root
from assoc.packing.local_search import LocalSearch
from assoc.packing.neighbourhoods import diving
from assoc.packing.neighbourhoods.diving import Diver, _Descent
from assoc.packing.run import Run
from assoc.packing.simplex.dual import OPTIMAL
from assoc.packing.simplex.linear_program import LinearProgram
from assoc.simulation import simulate
from assoc.solvers.exact.search import bound_by_linear_program
from assoc.solvers.genetic.parameters import GeneticParameters
from assoc.solvers.genetic.population import Breeding
from assoc.solvers.methods import EXACT_METHODS
from assoc.solvers.tabu.moves import TabuSearch
from assoc.solvers.tabu.parameters import TabuParameters
from experiments.common.instances.synthetic import axial_known_optimum
from tests.packings import optimum
from tests.solvers.pieces import (
    columns_of,
    component,
    cover_of,
    random_covers,
    with_greedy_cover,
)

# no cover is known
NONE = np.zeros(0, dtype=np.int64)


def ghosts():
    return assoc.build_problem(simulate("bearing-only", seed=2, targets=16, scans=1), 0)


@pytest.fixture(scope="module")
def priced():
    """One component of a ghost scene with the multipliers of its linear program."""
    one = component(ghosts())
    bound_by_linear_program(one, Run(0))
    return one


class Plain(Diver):
    """A diver without cuts: programs of the packing alone are easily rebuilt."""

    root = staticmethod(lambda packing, duals, *_: plain_root(packing, duals))


@pytest.fixture
def plain(priced):
    return Plain(priced, NONE, np.inf)


def dive(one, seed=0, *, trail=None, strictness=4.0, cutoff=np.inf):
    """Columns and weight of one dive."""
    trail = np.ones(one.packing.num_columns) if trail is None else trail
    owner = Diver(one, NONE, np.inf).dive(trail, strictness, np.random.default_rng(seed), cutoff, np.inf)
    columns = columns_of(owner)
    # a cover: no row twice, and each row's owner is a column that has it
    np.testing.assert_array_equal(owner, cover_of(one.packing, columns))
    return columns, float(one.packing.weights[columns].sum())


def test_dives_are_near_the_bound(priced):
    """Without local search, their gaps are a fraction of those of greedy covers."""
    assert Diver.pays(priced.packing)
    left = [dive(priced, seed)[1] - priced.bound for seed in range(8)]
    assert min(left) >= -1e-9
    # the share first left to branch and bound is most of such a small component
    assert Diver(priced, NONE, np.inf).share * priced.packing.num_rows >= 39.0
    greedy = [priced.weight_of(owner) - priced.bound for owner in random_covers(priced, 8.0, 20)]
    assert np.median(left) < 0.5 * np.median(greedy)


def test_pheromone_and_values_decide(priced, plain):
    """The first draw has the probabilities of the module's docstring: counted over many draws."""
    diver = plain
    core, primal = diver._core, diver._relaxed.primal
    open_columns = np.flatnonzero((primal > 1e-6) & (primal < 1.0 - 1e-6))
    # all values are 1/2 in this program: others test more
    primal[open_columns] = np.linspace(0.1, 0.9, open_columns.size)
    trail = np.random.default_rng(3).uniform(0.05, 1.0, priced.packing.num_columns)
    expected = trail[core.origin[open_columns]] * primal[open_columns] ** 2.0
    expected /= expected.sum()
    at, rng, draws = _Descent(core, diver._program, diver._relaxed, np.inf), np.random.default_rng(4), 4000
    drawn = [at.draw(trail[core.origin], 2.0, rng) for _ in range(draws)]
    # every column once, the likely ones early
    assert all(sorted(columns.tolist()) == open_columns.tolist() for columns in drawn[:50])
    first = np.array([columns[0] for columns in drawn])
    share = np.array([(first == j).mean() for j in open_columns])
    assert (np.abs(share - expected) <= 5.0 * np.sqrt(expected / draws) + 1e-3).all()
    # and the second draw is one among those left
    likely = int(open_columns[np.argmax(expected)])
    second = np.array([columns[1] for columns in drawn if columns[0] == likely])
    chance = np.where(open_columns == likely, 0.0, expected)
    chance /= chance.sum()
    among = np.array([(second == j).mean() for j in open_columns])
    assert (np.abs(among - chance) <= 5.0 * np.sqrt(chance / second.size) + 2e-3).all()


def test_a_dive_ends_at_its_cutoff(priced, plain):
    """It stops as soon as nothing better can follow, here at once."""
    covered = []
    for cutoff in (np.inf, priced.bound + 1e-6):
        plain.share = diving._LOWEST
        owner = plain.dive(np.ones(priced.packing.num_columns), 4.0, np.random.default_rng(0), cutoff, np.inf)
        covered.append(np.count_nonzero(owner >= 0))
    assert covered == [priced.packing.num_rows, 0]


def test_dives_begin_in_a_program_with_cuts(priced, plain):
    """Its bound is nearer to the optimum, and its solution to whole numbers."""
    root = plain._relaxed
    diver = Diver(priced, NONE, np.inf)
    core = diver._core
    best = optimum(core, whole=True)
    assert root.bound + 0.01 < diver._relaxed.bound <= best + 1e-7
    assert len(diver._root.sets) > 0


def test_what_lies_near_the_bound_holds_the_cover_that_is_known(priced):
    """If it had none, dives would find none."""
    (owner,) = random_covers(priced, 1.0, 1)
    assert priced.is_complete(owner)
    known = np.array(columns_of(owner))
    without = Diver(priced, NONE, np.inf, core=2)._core
    assert not np.isin(known, without.origin).all()
    core = Diver(priced, known, np.inf, core=2)._core
    assert np.isin(known, core.origin).all() and core.num_columns < priced.packing.num_columns


def test_the_core_is_what_the_program_with_cuts_would_take():
    """Chosen by the multipliers without cuts it lacks the optimum; in the end no column is missing."""
    problem, optimum = axial_known_optimum(14, 1)
    one = component(problem)
    bound_by_linear_program(one, Run(0))
    assert optimum < with_greedy_cover(one).weight
    bounds, least = [], []
    for rounds in (1, 3):
        diver = Diver(one, one.best_columns(), np.inf, core=4, rounds=rounds)
        bounds.append(diver._relaxed.bound)
        least.append(diver._reduced_costs(one.duals).min())
    assert bounds == pytest.approx([one.weight, optimum], abs=1e-2)
    assert least[0] < -1.0 and least[1] > -1e-6


class Watched(LocalSearch):
    """A search that keeps the number and beta of each dive."""

    def escape(self, number, trail=None, beta=1.0):
        self.dived.append((number, beta))
        return super().escape(number, trail, beta)


def watched():
    found = Watched(component(ghosts()), Run(0, methods=EXACT_METHODS), clusters=1)
    found.dived = []
    return found


@pytest.mark.parametrize("searcher", [Breeding, TabuSearch])
def test_others_dive_once_an_iteration(searcher):
    """In addition to the covers with which a search begins."""
    search = watched()
    small = {"moves": 3} if searcher is TabuSearch else {"population": 6, "offspring": 1}
    parameters = (TabuParameters if searcher is TabuSearch else GeneticParameters)(**small)
    at_work = searcher(search.component, parameters)
    at_work.iterate(search)
    search.dived.clear()
    before = at_work.escapes
    at_work.iterate(search)
    at_work.iterate(search)
    assert search.dived == [(before + 1, 1.0), (before + 2, 1.0)]


def test_columns_are_fixed_in_their_order(plain):
    """Columns that fit are fixed until they cover enough rows; the program is then that of the rest."""
    diver = plain
    root, core = diver._relaxed, diver._core
    drawn = np.random.default_rng(0).permutation(_Descent(core, diver._program, root, np.inf).open_columns())
    for rows in (0.0, 5.0, 100.0):
        diver._program.back()
        at = _Descent(core, diver._program, root, np.inf)
        assert at.fix(drawn, rows, np.inf)
        covered, fixed = set(), []
        for j in drawn:
            own = set(core.cols[j][core.cols[j] >= 0].tolist())
            if not covered & own and (not fixed or len(covered) < rows):
                covered |= own
                fixed.append(int(j))
        assert at._fixed == fixed and at.open_rows == core.num_rows - len(covered)
        columns = np.logical_and.reduce([_left(core, j) for j in fixed])
        np.testing.assert_array_equal(at._columns, columns)
        slack = core.slack & ~np.isin(np.arange(core.num_rows), list(covered))
        assert at.relaxed.bound == pytest.approx(
            LinearProgram(core).solve(columns=columns, slack=slack).bound, abs=1e-7
        )


def test_what_leaves_nothing_better_is_not_fixed(plain):
    """Then everything is restored, including the basis."""
    diver = plain
    root, core = diver._relaxed, diver._core
    fixed = refused = 0
    for j in _Descent(core, diver._program, root, np.inf).open_columns()[:12]:
        diver._program.back()
        alone = LinearProgram(core).solve(columns=_left(core, j), slack=_covered(core, j)).bound
        for cutoff in (alone + 1.0, alone - 1e-6):
            # no cover below the cutoff has columns of larger reduced cost: they go, too
            light = root.reduced <= cutoff - root.bound
            least = LinearProgram(core).solve(columns=_left(core, j) & light, slack=_covered(core, j)).bound
            diver._program.back()
            at = _Descent(core, diver._program, root, cutoff)
            assert at.fix(np.array([j]), 1.0, np.inf) is (least < cutoff)
            if least < cutoff:
                assert at._fixed == [j] and at.relaxed.bound == pytest.approx(least, abs=1e-7)
                fixed += 1
            else:
                assert at._columns.all() and not at._fixed and at.open_rows == core.num_rows
                assert at.relaxed.status == OPTIMAL and at.relaxed.bound == pytest.approx(root.bound, abs=1e-9)
                value = core.weights @ at.relaxed.primal
                assert value == pytest.approx(root.bound, abs=1e-7)
                refused += 1
    assert refused > 2 and fixed > 2


def test_the_rest_is_covered_as_well_as_can_be(plain):
    """The completion of the fixed columns is optimal by scipy's MILP; empty if that is not below the cutoff."""
    diver, core = plain, plain._core
    for cutoff in (np.inf, -1.0):
        diver._program.back()
        at = _Descent(core, diver._program, diver._relaxed, np.inf)
        assert at.fix(at.open_columns()[::3], 15.0, np.inf)
        fixed = list(at._fixed)
        assert len(fixed) > 1
        columns = np.logical_and.reduce([_left(core, j) for j in fixed])
        best = optimum(core, columns, fixed=fixed, whole=True)
        at._cutoff = min(cutoff, best - 1e-6) if cutoff < 0.0 else cutoff
        found, done = at.completed(Limits(1e-9, np.inf, 10_000, np.inf))
        assert done and at.fixed.tolist() == fixed
        if cutoff < 0.0:
            assert found.tolist() == fixed
        else:
            assert set(fixed) < set(found.tolist())
            # no row twice
            cover_of(core, found)
            assert core.weights[found].sum() == pytest.approx(best, abs=1e-7)


def test_the_share_grows_while_searches_end_and_shrinks_while_they_do_not(priced, plain):
    """They end where nothing is below the cutoff, and do not where their time is over."""
    trail, rng = np.ones(priced.packing.num_columns), np.random.default_rng(0)
    for cutoff, deadline, limit in ((priced.bound, np.inf, diving._HIGHEST), (np.inf, -np.inf, diving._LOWEST)):
        plain.share = 0.5
        shares = [0.5]
        for _ in range(60):
            plain.dive(trail, 4.0, rng, cutoff, deadline)
            shares.append(plain.share)
        assert shares == sorted(shares, reverse=limit < 0.5)
        assert shares[-1] == limit


def _left(core, j):
    """Columns that remain when one is fixed."""
    rows = set(core.cols[j][core.cols[j] >= 0].tolist())
    return np.array([k == j or not rows & set(core.cols[k].tolist()) for k in range(core.num_columns)])


def _covered(core, j):
    """Rows that may stay uncovered then."""
    slack = core.slack.copy()
    slack[core.cols[j][core.cols[j] >= 0]] = False
    return slack
