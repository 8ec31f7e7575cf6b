"""Dives: covers from the linear program, drawn by pheromone and LP value, and far better than greedy ones."""

from __future__ import annotations

import numpy as np
import pytest

import assoc
from assoc.packing.components.component import Component
from assoc.packing.neighbourhoods import diving
from assoc.packing.neighbourhoods.diving import Diver, _Descent
from assoc.packing.run import Run
from assoc.packing.simplex.dual import OPTIMAL
from assoc.packing.simplex.linear_program import LinearProgram
from assoc.simulation import simulate
from assoc.solvers.aco.max_min import Colony
from assoc.solvers.aco.parameters import AcoParameters
from assoc.solvers.genetic.parameters import GeneticParameters
from assoc.solvers.genetic.population import Breeding
from assoc.solvers.tabu.moves import TabuSearch
from assoc.solvers.tabu.parameters import TabuParameters
from tests.solvers.pieces import columns_of, component, cover_of, open_problem


@pytest.fixture(scope="module")
def priced():
    """One component of a ghost scene with the multipliers of its linear program."""
    problem = assoc.build_problem(simulate("bearing-only", seed=2, targets=16, scans=1), 0)
    one = component(problem, "full")
    one.sharpen(Run(0))
    return one


def dive(one, seed=0, *, trail=None, strictness=4.0, cutoff=np.inf):
    """Columns and weight of one dive."""
    trail = np.ones(one.packing.num_columns) if trail is None else trail
    owner = Diver(one, np.inf).dive(trail, strictness, np.random.default_rng(seed), cutoff, np.inf)
    columns = columns_of(owner)
    # a cover: no row twice, and each row's owner is a column that has it
    np.testing.assert_array_equal(owner, cover_of(one.packing, columns))
    return columns, float(one.packing.weights[columns].sum())


def test_dives_are_near_the_bound(priced):
    """Alone, without any local search, they leave a fraction of what greedy covers leave."""
    assert Diver.pays(priced.packing)
    left = [dive(priced, seed)[1] - priced.bound for seed in range(8)]
    assert min(left) >= -1e-9
    rng = np.random.default_rng(0)
    greedy = [priced.weight_of(priced.random_cover(8.0, rng)) - priced.bound for _ in range(20)]
    assert np.median(left) < 0.5 * np.median(greedy)


def test_what_is_drawn_is_fixed(priced, monkeypatch):
    """Column after column: what was drawn stays whole in all programs that follow."""
    diver = Diver(priced, np.inf)
    solve, masks = diver._program.solve, []

    def spy(**words):
        relaxed = solve(**words)
        masks.append((words["columns"].copy(), words["slack"].copy(), relaxed))
        return relaxed

    monkeypatch.setattr(diver._program, "solve", spy)
    diver.dive(np.ones(priced.packing.num_columns), 4.0, np.random.default_rng(1), np.inf, np.inf)
    assert masks
    core = diver._core
    for columns, slack, relaxed in masks:
        # rows that may no longer stay uncovered have one column each, and the program takes all of it
        for r in np.flatnonzero(~slack):
            (left,) = [j for j in np.flatnonzero(columns) if r in core.cols[j]]
            if relaxed.status == 0:
                assert relaxed.primal[left] == pytest.approx(1.0, abs=1e-6)
    counts = [int((~slack).sum()) for _, slack, _ in masks]
    assert counts == sorted({*counts}), "each step fixes more rows"


def test_pheromone_and_values_decide(priced):
    """The first draw has the probabilities of the docstring: counted over many dives."""
    diver = Diver(priced, np.inf)
    core, primal = diver._core, diver._root.primal
    open_columns = np.flatnonzero((primal > 1e-6) & (primal < 1.0 - 1e-6))
    trail = np.random.default_rng(3).uniform(0.05, 1.0, priced.packing.num_columns)
    expected = trail[core.origin[open_columns]] * primal[open_columns] ** 2.0
    expected /= expected.sum()
    drawn = []

    class Watched:
        """Notes the first draw and ends the dive."""

        def choice(self, values, p):
            drawn.append((values, p))
            raise StopIteration

    with pytest.raises(StopIteration):
        diver.dive(trail, 2.0, Watched(), np.inf, np.inf)
    np.testing.assert_array_equal(drawn[0][0], open_columns)
    np.testing.assert_allclose(drawn[0][1], expected, rtol=1e-12)


def test_a_dive_ends_at_its_cutoff(priced, monkeypatch):
    """As soon as nothing better can follow; what it has then is a cover still."""
    steps = []
    for cutoff in (np.inf, priced.bound + 1e-6):
        diver = Diver(priced, np.inf)
        solve, count = diver._program.solve, []
        monkeypatch.setattr(
            diver._program, "solve", lambda solve=solve, count=count, **w: count.append(1) or solve(**w)
        )
        diver.dive(np.ones(priced.packing.num_columns), 4.0, np.random.default_rng(0), cutoff, np.inf)
        steps.append(len(count))
    assert 1 <= steps[1] < steps[0]


def test_components_too_small_or_too_large_do_not_dive(monkeypatch):
    one = component(open_problem(), "full")
    assert one.packing.num_rows < 30 and not one.dives
    monkeypatch.setattr(diving, "_LEAST", 5)
    assert component(open_problem(), "full").dives
    assert not component(open_problem(), "local").dives
    monkeypatch.setattr(diving, "_MOST", 5)
    assert not component(open_problem(), "full").dives


def test_the_colony_dives(monkeypatch):
    """So many divers a cycle, of several strictnesses; none where none is asked for."""
    called = []
    original = Diver.dive
    monkeypatch.setattr(diving, "_LEAST", 5)

    def spy(self, trail, strictness, *rest):
        called.append(strictness)
        return original(self, trail, strictness, *rest)

    monkeypatch.setattr(Diver, "dive", spy)
    for divers in (2, 0):
        called.clear()
        one = component(open_problem(), "full")
        colony = Colony(one, AcoParameters(divers=divers, beta=0.5, ants=3, clusters=1), lambda *_: None)
        for _ in range(2):
            colony.iterate(one, np.random.default_rng(0))
        assert called == [2.0, 4.0, 8.0, 16.0][: 2 * divers]


@pytest.mark.parametrize("searcher", [Breeding, TabuSearch])
def test_others_dive_once_an_iteration(searcher, monkeypatch):
    """Beside what a search begins with."""
    called = []
    monkeypatch.setattr(diving, "_LEAST", 5)
    original = Component.dive

    def spy(self, number, *rest):
        called.append(number)
        return original(self, number, *rest)

    one = component(open_problem(), "full")
    small = {"clusters": 1, "moves": 3} if searcher is TabuSearch else {"clusters": 1, "population": 6, "offspring": 1}
    parameters = (TabuParameters if searcher is TabuSearch else GeneticParameters)(**small)
    search, rng = searcher(one, parameters), np.random.default_rng(0)
    search.iterate(one, rng)
    monkeypatch.setattr(Component, "dive", spy)
    before = search.dives
    search.iterate(one, rng)
    search.iterate(one, rng)
    assert called == [before + 1, before + 2]


def test_what_costs_too_much_is_excluded(priced):
    """A column whose fixing lifts the bound beyond the aim goes, and all else is as it was."""
    excluded = 0
    for share in (1e-3, 0.1):
        diver = Diver(priced, np.inf)
        root, core = diver._root, diver._core
        at = _Descent(core, diver._program, root, root.bound + 10.0 * share)
        assert at._aim == pytest.approx(root.bound + 4.0 * share)
        for j in at.open_columns()[:4]:
            alone = LinearProgram(core).solve(columns=_fixed(core, j), slack=_covered(core, j)).bound
            at = _Descent(core, diver._program, root, root.bound + 10.0 * share)
            diver._program.back()
            at.step(int(j), np.inf)
            if alone > at._aim + 1e-9:
                assert not at._columns[j] and not at._fixed[j]
                assert (at._slack == core.slack).all() and at._open_rows == core.num_rows
                # the aim is as low as it may be
                without = LinearProgram(core).solve(columns=np.arange(core.num_columns) != j).bound
                assert at.relaxed.status == OPTIMAL and at.relaxed.bound == pytest.approx(without, abs=1e-7)
                assert without <= at._aim + 1e-9
                excluded += 1
            else:
                assert at._fixed[j] and at.relaxed.bound == pytest.approx(alone, abs=1e-7)
                assert at._open_rows == core.num_rows - (core.cols[j] >= 0).sum()
    assert excluded > 2


def test_an_aim_that_nothing_meets_is_raised(priced):
    """By doubling, up to the cutoff, beyond which the dive has nothing to find."""
    diver = Diver(priced, np.inf)
    root = diver._root
    j = int(np.argmax(np.where(root.primal < 0.99, root.primal, 0.0)))
    for cutoff, found in ((root.bound + 50.0, True), (root.bound - 1e-6, False)):
        diver._program.back()
        at = _Descent(diver._core, diver._program, root, cutoff)
        at._aim = root.bound - 1e-3
        at.step(j, np.inf)
        assert (at.relaxed.status == OPTIMAL) is found
        assert at._aim <= cutoff and (found or at._aim == cutoff)


def _fixed(core, j):
    """Columns that are left when one is fixed."""
    rows = set(core.cols[j][core.cols[j] >= 0].tolist())
    return np.array([k == j or not rows & set(core.cols[k].tolist()) for k in range(core.num_columns)])


def _covered(core, j):
    """Rows that may stay uncovered then."""
    slack = core.slack.copy()
    slack[core.cols[j][core.cols[j] >= 0]] = False
    return slack


def test_the_smaller_program_is_the_rest_of_the_larger(priced):
    """The same bound and the same covers, less what was fixed."""
    diver = Diver(priced, np.inf)
    diver._program.back()
    at = _Descent(diver._core, diver._program, diver._root, np.inf)
    assert not at.may_shrink
    at.step(int(at.open_columns()[0]), np.inf)
    assert at.relaxed.status == OPTIMAL
    smaller = at.shrunk(np.inf)
    fixed = diver._core.origin[at._fixed]
    assert smaller._packing.num_rows <= at._open_rows < diver._core.num_rows
    weight = priced.packing.weights[fixed].sum()
    assert smaller.relaxed.bound + weight == pytest.approx(at.relaxed.bound, abs=1e-6)
    assert not np.isin(smaller.origin, fixed).any()
    np.testing.assert_array_equal(smaller._packing.weights, priced.packing.weights[smaller.origin])
    owner = smaller.cover(priced.packing)
    assert set(fixed.tolist()) <= {*columns_of(owner)}
