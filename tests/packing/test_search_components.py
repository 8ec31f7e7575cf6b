"""What all metaheuristics share: limits, what is kept, and how much is refined."""

from __future__ import annotations

import numpy as np
import pytest

from assoc.packing.components.parameters import SearchParameters
from assoc.packing.components.search import search_components
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from experiments.common.oracles import gated_problem
from tests.solvers.pieces import component, problems

PROBLEM = gated_problem(np.random.default_rng(12), (8, 8, 7), 0.5, "mixed")


class Idle:
    """A searcher that offers nothing."""

    def __init__(self):
        self.count = 0

    def iterate(self, component, rng):
        self.count += 1


def run_idle(**limits):
    """Iterations of a searcher that offers nothing, what ended them, and the weight found."""
    idle = Idle()
    packing = prepare(PROBLEM).packing
    run = Run(0)
    outcome = search_components(lambda *_: idle, packing, run, SearchParameters(**limits))
    return idle.count, run.stopped_by, float(packing.weights[outcome.columns].sum())


def test_patience_and_iterations_end_the_search():
    assert run_idle(refinement="none", patience=7)[:2] == (7, "")
    assert run_idle(refinement="none", iterations=5)[:2] == (5, "iterations")
    assert run_idle(refinement="none", iterations=30, patience=30)[:2] == (30, "")


def test_the_best_cover_is_refined_by_refinement_full_alone():
    """A searcher that does nothing finds nothing, unless exact sub-steps do."""
    alone = run_idle(refinement="none", patience=20)[2]
    local = run_idle(refinement="local", patience=20)[2]
    full = run_idle(refinement="full", patience=20)[2]
    assert alone - 1.0 > local > full + 1.0


def test_what_is_worse_or_incomplete_is_not_kept():
    one = component(problems()["axial"], "full")
    empty = np.full(one.packing.num_rows, -1, dtype=np.int32)
    assert not one.offer(empty, -1e9) and one.best is None
    one.offer_greedy()
    best, weight = one.best.copy(), one.weight
    assert not one.offer(best, weight + 1.0)
    assert one.weight == weight


@pytest.mark.parametrize("name", ["mixed", "four"])
def test_how_much_new_covers_are_improved(name):
    """none: not at all; local: halves are matched anew; full: exact sub-steps, too."""
    weights = {}
    for refinement in ("none", "local", "full"):
        one = component(problems()[name], refinement)
        rng = np.random.default_rng(0)
        found = []
        for _ in range(8):
            owner = one.random_cover(1e-3, rng)
            before = one.weight_of(owner)
            after = one.improve(owner, rng, 5)
            assert after == pytest.approx(one.weight_of(owner), abs=1e-9) and after <= before + 1e-9
            assert refinement != "none" or after == before
            found.append((before, after))
        weights[refinement] = np.mean(found, axis=0)
    # the cover itself is improved by insertion unless refinement is none
    assert weights["none"][0] > weights["local"][0] + 1.0
    assert weights["local"][1] > weights["full"][1] + 1e-6
