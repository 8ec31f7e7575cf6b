"""Large components: wide gates join a whole scene, and its linear program decides nearly all."""

import numpy as np
import pytest

import assoc
from assoc._system import memory
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.component import split_components
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.packing.simplex.linear_program import LinearProgram
from assoc.solvers.exact import regions, tightening
from assoc.solvers.exact.regions import close_by_regions
from assoc.solvers.exact.search import search_to_the_end
from assoc.solvers.exact.tightening import Prices, tighten
from experiments.common.instances.large import cameras
from experiments.common.instances.synthetic import wide_gates
from tests.sizes import sample
from tests.solvers.pieces import with_greedy_cover


def test_a_scene_that_is_one_component_is_proved():
    problem = wide_gates(200, 2)
    assert max(map(len, problem.components())) > 0.9 * problem.num_tuples
    answer, other = assoc.assign(problem), assoc.assign(problem, "milp")
    assert answer.status == "optimal" and answer.cost == pytest.approx(other.cost, rel=1e-8)


@sample("seed", [1, 3], every=2)
def test_a_large_component_is_proved_without_its_linear_program(seed, monkeypatch):
    """Its inverses would take 600 MB. Memory is said to be short: the system is not asked for what small parts take."""
    monkeypatch.setattr(memory, "fits", lambda needed: needed < 20e6)
    answer = assoc.assign(wide_gates(1200, seed), nodes=200)
    assert answer.status == "optimal"


@pytest.mark.parametrize("cuts", [False, True])
@pytest.mark.parametrize("unit", [0.0, 1.0])
def test_regions_bound_and_cover(unit, cuts, monkeypatch):
    """From rough multipliers and greedy covers, by searches that are cut short: bounds hold, covers are complete."""
    if cuts:
        monkeypatch.setattr(regions, "MANY", 1)
        monkeypatch.setattr(tightening, "_REGION", 25)
    closed = 0
    for seed in range(25):
        problem = wide_gates(60, seed, 0.5)
        costs = np.floor(problem.costs * 8.0) if unit else problem.costs
        packing = prepare(assoc.AssignmentProblem(problem.tuples, costs, problem.sizes)).packing
        assert packing.granularity == unit
        multipliers = dual_bound(packing, levels=2 + seed % 5)
        parts = split_components(packing, multipliers, packing.origin.astype(np.int64))
        component = with_greedy_cover(max(parts, key=lambda one: one.packing.num_rows))
        optimum = search_to_the_end(component.packing, 10**6, 0, Run(0)).lower_bound
        close_by_regions(component, lambda part, nodes=seed % 4: search_to_the_end(part, nodes, 0, Run(0)), Run(0))
        assert component.is_complete(component.best)
        assert component.weight == pytest.approx(component.weight_of(component.best), abs=1e-9)
        assert component.lower_bound <= optimum + 1e-6 <= component.weight + 2e-6
        closed += component.closed
    assert closed >= 10


def test_regions_grow_where_cuts_alone_have_shown_as_much(monkeypatch):
    """An answer that reaches out shows no more than the cuts did, and less by the margin of rounding."""
    monkeypatch.setattr(regions, "MANY", 1)
    monkeypatch.setattr(tightening, "_REGION", 25)
    packing = prepare(wide_gates(60, 18, 0.5)).packing
    parts = split_components(packing, dual_bound(packing, levels=5), packing.origin.astype(np.int64))
    component = with_greedy_cover(max(parts, key=lambda one: one.packing.num_rows))
    close_by_regions(component, lambda part: search_to_the_end(part, 10**6, 0, Run(0)), Run(0))
    assert component.closed


def test_cuts_of_regions_raise_the_bound_above_the_linear_program(monkeypatch):
    """Bound and reduced costs hold for the optimum and its columns; most of the gap of the linear program is closed."""
    monkeypatch.setattr(tightening, "_REGION", 60)
    shares = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        # sources on a line: indices of a tuple are near each other
        tuples = rng.integers(2, 80, size=(500, 1)) + rng.integers(-2, 3, size=(500, 3))
        problem = assoc.AssignmentProblem(tuples, -rng.gamma(4.0, 1.0, size=500), [81] * 3)
        packing = prepare(problem).packing
        parts = split_components(packing, dual_bound(packing), packing.origin.astype(np.int64))
        component = with_greedy_cover(max(parts, key=lambda one: one.packing.num_rows))
        best = search_to_the_end(component.packing, 10**6, 0, Run(0))
        relaxed = LinearProgram(component.packing).solve(duals=component.duals).bound
        prices = Prices.of(component)
        tighten(component, prices, Run(0))
        assert prices.bound + np.append(0.0, prices.reduced[best.columns]).max() <= best.lower_bound + 1e-6
        weights = component.packing.weights - prices.reduced
        for cut in prices.cuts:
            uses = np.isin(component.packing.cols, cut.rows).sum(axis=1) // 2
            assert cut.rows.size % 2 == 1 and cut.dual < 0.0
            weights -= cut.dual * uses
        kept = np.isfinite(prices.reduced)
        own = np.append(prices.duals, 0.0)[component.packing.cols].sum(axis=1)
        assert weights[kept] == pytest.approx(own[kept], abs=1e-9)
        if best.lower_bound - relaxed > 1e-3:
            shares.append((prices.bound - relaxed) / (best.lower_bound - relaxed))
    assert len(shares) >= 3 and np.mean(shares) > 0.5


def test_an_allowed_gap_spares_large_components_their_linear_program():
    """It grows with the square of the rows: they are not branched on where their gap is small enough."""
    problem = wide_gates(800, 2)
    proved, answer = assoc.assign(problem), assoc.assign(problem, gap=0.01)
    assert proved.status == "optimal" and proved.iterations > answer.iterations == 0
    assert answer.stopped_by == "gap" and answer.lower_bound <= proved.cost <= answer.cost
    assert answer.gap <= 0.01 * abs(answer.cost)


def test_gains_of_moves_add_up_to_what_the_cost_fell_by():
    """From the first cover of the trace on; what branching finds and what the improver's moves find are told apart."""
    told = set()
    for problem in (wide_gates(300, 4), cameras(150, 3, 3.0, 1)):
        answer = assoc.assign(problem)
        assert sum(answer.gains.values()) == pytest.approx(answer.trace[0].cost - answer.cost, abs=1e-9)
        told |= answer.gains.keys()
    assert {"branching", "tabu"} <= told <= {"branching", "tabu", "genetic", "sub-steps", "regions"}
