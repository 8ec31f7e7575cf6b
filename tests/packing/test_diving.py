"""Dives: covers from the linear program, drawn by pheromone and LP value, and far better than greedy ones."""

from __future__ import annotations

import numpy as np
import pytest

import assoc
from assoc.packing.components import search
from assoc.packing.neighbourhoods import diving
from assoc.packing.neighbourhoods.diving import Diver
from assoc.packing.run import Run
from assoc.simulation import simulate
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
    """One diver a cycle, of several strictnesses; none where none is asked for."""
    called = []
    original = Diver.dive
    monkeypatch.setattr(diving, "_LEAST", 5)
    # but those with which every search begins
    monkeypatch.setattr(search, "_DIVES", 0)

    def spy(self, trail, strictness, *rest):
        called.append(strictness)
        return original(self, trail, strictness, *rest)

    monkeypatch.setattr(Diver, "dive", spy)
    problem = assoc.build_problem(simulate("bearing-only", seed=4, targets=20, scans=1), 0)
    assoc.assign(problem, "aco", iterations=5, divers=2, beta=0.5, clusters=1)
    assert len(called) > 4 and {*called[:4]} == {2.0, 4.0, 8.0, 16.0}
    called.clear()
    assoc.assign(problem, "aco", iterations=5, divers=0, clusters=1)
    assert not called
