"""What is handed to `exact` to improve its incumbent: moves that gain get the turns."""

import numpy as np
import pytest

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.component import split_components
from assoc.packing.local_search import LocalSearch
from assoc.packing.prepare import prepare
from assoc.packing.run import Methods, Run
from assoc.solvers import improve
from assoc.solvers.methods import EXACT_METHODS, IncumbentSearch, _Move
from experiments.common.instances.synthetic import wide_gates
from tests.solvers.pieces import with_greedy_cover


def largest(targets, seed):
    packing = prepare(wide_gates(targets, seed)).packing
    parts = split_components(packing, dual_bound(packing), packing.origin.astype(np.int64))
    return with_greedy_cover(max(parts, key=lambda one: one.packing.num_rows))


@pytest.mark.parametrize(("gains", "expected"), [("first", (49, 8)), ("second", (8, 49)), ("neither", (28, 29))])
def test_turns_go_to_what_gains(gains, expected):
    component = largest(60, 1)
    search, calls = IncumbentSearch(component, Run(0, methods=EXACT_METHODS)), {"first": 0, "second": 0, "steps": 0}

    def move(name):
        def make():
            calls[name] += 1
            component.weight -= float(name == gains)

        return _Move(name, make)

    search._moves, search._sub_steps = (move("first"), move("second")), move("steps")
    for _ in range(57):
        search.iterate()
    assert calls["first"] + calls["second"] == 57
    assert (calls["first"], calls["second"]) == pytest.approx(expected, abs=8)
    # what gains nothing follows each gain of another, and rests else
    assert calls["steps"] <= (10 if gains == "neither" else 57)


def test_the_same_seed_gives_the_same_incumbent():
    found = []
    for _ in range(2):
        component = largest(200, 3)
        search = IncumbentSearch(component, Run(7, methods=EXACT_METHODS))
        before = component.weight
        for _ in range(3):
            search.iterate()
        found.append(component.best.tolist())
        assert component.weight < before and component.is_complete(component.best)
    assert found[0] == found[1]


@pytest.mark.parametrize(("most", "times"), [(100, 0), (10_000, 1)])
def test_metaheuristics_do_without_a_linear_program_that_takes_too_long(most, times, monkeypatch):
    monkeypatch.setattr(improve, "_PROGRAM", most)
    asked = []
    run = Run(0, methods=Methods(bound_by_linear_program=lambda *_: asked.append(1)))
    assert improve._first_covers(LocalSearch(largest(200, 3), run), run)
    assert len(asked) == times
