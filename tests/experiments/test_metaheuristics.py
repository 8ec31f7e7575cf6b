"""The experiments on the parts and settings of the metaheuristics."""

from types import SimpleNamespace

import numpy as np
import pytest

import assoc
from assoc.packing.run import Run
from experiments.metaheuristics import ablation, parts, running
from experiments.metaheuristics.problems import problem


def test_a_runs_clock_counts_processor_time(monkeypatch):
    run = Run(0, time_limit=5.0)
    clock = iter((3.0, 4.0))
    monkeypatch.setattr(running.time, "process_time", lambda: next(clock))
    with running._by_processor_time():
        assert run.runtime() == 1.0


def test_searches_that_dive_run_by_that_clock():
    """Parts of the work have their deadlines by it, too."""
    one = problem("ghosts 20", 0)
    assert running.run(one, "tabu", 5.0, 0, iterations=1) <= assoc.assign(one, "greedy").cost


def test_what_comes_after_the_budget_does_not_count(monkeypatch):
    one = problem("ghosts 20", 0)
    clock = iter(np.arange(0.0, 1e6, 10.0))
    # ten seconds pass between any two looks at the clock: only the first solution is in time
    monkeypatch.setattr(running.time, "process_time", lambda: next(clock))
    solutions = []

    def remembering(*arguments, **options):
        solutions.append(assoc.assign(*arguments, **options))
        return solutions[-1]

    cost = running.run(one, "genetic", 1.0, 0, remembering)
    assert cost == min(solutions[0].trace[0].cost, assoc.assign(one, "greedy").cost)


@pytest.mark.parametrize("part", parts.PARTS, ids=lambda part: part.words)
def test_parts_are_taken_out_and_put_back(part):
    # two targets' worth of work is enough for what is tested: feasible, not below the optimum, and as before after it
    one = problem("ghosts 10", 1)
    optimum = assoc.assign(one).cost
    before = parts.moves._moves, parts.LocalSearch.walk, parts.Breeding._parent, parts.Breeding._child
    for solver in part.solvers:
        with part.without():
            assert running.run(one, solver, 5.0, 0, iterations=2, **part.parameters) >= optimum - 1e-9
    after = parts.moves._moves, parts.LocalSearch.walk, parts.Breeding._parent, parts.Breeding._child
    assert before == after


def test_kernels_are_rewritten_where_they_say():
    with pytest.raises(ValueError, match="once"):
        parts._rewritten(parts.moves._moves, "no such text", "")


def test_inverted_selection_takes_the_worst():
    breeding = parts.Breeding.__new__(parts.Breeding)
    breeding.parameters = type("Parameters", (), {"tournament": 200})()
    breeding.fitness = np.array([3.0, -7.0, 5.0, 0.0])
    rng = np.random.default_rng(0)
    with next(part for part in parts.PARTS if part.words == "selection inverted").without():
        assert breeding._parent(rng) == 2
    assert breeding._parent(rng) == 1
    assert breeding.fitness.tolist() == [3.0, -7.0, 5.0, 0.0]


def test_equal_members_are_admitted_without_the_rule():
    component = SimpleNamespace(is_complete=lambda owner: True, tolerance=1e-9)
    for words, expected in ((parts.WHOLE, [1.0, 2.0, 3.0]), ("equal members admitted", [1.0, 2.0, 2.0])):
        breeding = parts.Breeding.__new__(parts.Breeding)
        breeding.members, breeding.fitness = np.zeros((3, 1), np.int32), np.array([1.0, 2.0, 3.0])
        with next(part for part in parts.PARTS if part.words == words).without():
            breeding._admit(component, np.ones(1, np.int32), 2.0)
        assert breeding.fitness.tolist() == expected


def test_pheromone_fades_away_without_its_limit():
    for words, fades in ((parts.WHOLE, False), ("no lower limit of pheromone", True)):
        colony = parts.colony.Colony.__new__(parts.colony.Colony)
        colony.pheromone, colony.slack_pheromone, colony.lowest = np.full(2, 0.3), np.full(1, 0.3), 0.25
        with next(part for part in parts.PARTS if part.words == words).without():
            colony._deposit(np.zeros(1, np.int32), 0.5)
        assert (colony.pheromone[1] < 0.25) == fades and colony.pheromone[0] == pytest.approx(0.65)


def test_figures_are_differences_from_the_whole():
    costs = {
        ("aco", parts.WHOLE): np.array([-100.0, -50.0]),
        ("aco", parts.OWN[2].words): np.array([-99.0, -50.5]),
        ("aco", parts.ALONE): np.array([-90.0, -40.0]),
        ("aco", f"alone, {parts.OWN[2].words}"): np.array([-81.0, -38.0]),
        ("tabu", parts.WHOLE): np.array([-101.0, -50.0]),
    }
    claims = {claim.quantity: claim for claim in ablation.claims_of("ghosts 40", 2.0, costs)}
    assert claims["ghosts 40, 2 s: problems"].ours == 2
    whole = claims["ghosts 40, 2 s: aco, all parts, above the best found"]
    assert whole.ours == pytest.approx(100 * (1 / 101 + 0.5 / 50.5) / 2)
    alone = claims[f"ghosts 40, 2 s: aco, alone, {parts.OWN[2].words}, above {parts.ALONE}"]
    assert alone.ours == pytest.approx(7.5) and alone.interval == pytest.approx((5.0, 10.0))
    part = claims[f"ghosts 40, 2 s: aco, {parts.OWN[2].words}, above all parts"]
    assert part.ours == pytest.approx(0.0, abs=1e-12) and part.interval == pytest.approx((-1.0, 1.0))
