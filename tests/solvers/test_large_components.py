"""Large components: wide gates join a whole scene, and its linear program decides nearly all."""

import numpy as np
import pytest

import assoc
from assoc._system import memory
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.component import split_components
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.solvers.exact.regions import close_by_regions
from assoc.solvers.exact.search import search_to_the_end
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


@pytest.mark.parametrize("unit", [0.0, 1.0])
def test_regions_bound_and_cover(unit):
    """From rough multipliers and greedy covers, by searches that are cut short: bounds hold, covers are complete."""
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
        close_by_regions(component, lambda part, nodes=seed % 4: search_to_the_end(part, nodes, 0, Run(0)))
        assert component.is_complete(component.best)
        assert component.weight == pytest.approx(component.weight_of(component.best), abs=1e-9)
        assert component.lower_bound <= optimum + 1e-6 <= component.weight + 2e-6
        closed += component.closed
    assert closed >= 10


def test_an_allowed_gap_spares_large_components_their_linear_program():
    """It grows with the square of the rows: they are not branched on where their gap is small enough."""
    problem = wide_gates(800, 2)
    proved, answer = assoc.assign(problem), assoc.assign(problem, gap=0.01)
    assert proved.status == "optimal" and proved.iterations > answer.iterations == 0
    assert answer.stopped_by == "gap" and answer.lower_bound <= proved.cost <= answer.cost
    assert answer.gap <= 0.01 * abs(answer.cost)
