"""Rankings of ghost scenes: that a solution left out would be noticed, and what the page shows."""

import numpy as np
import pytest

import assoc
from experiments import ghost_rankings
from experiments.common.results import Results
from experiments.pages.measured import ghost_rankings as table
from tests.oracles import gated_problem


def test_a_solution_left_out_is_noticed():
    problem = gated_problem(np.random.default_rng(5), (6, 6, 6), 0.4, "mixed")
    ranking = assoc.kbest(problem, 11)
    assert ghost_rankings.nothing_better(problem, ranking[:10], 60.0)
    # not a tie, so that the one left out is better
    assert ranking[10].cost > ranking[3].cost + 1e-3
    with pytest.raises(AssertionError, match="left out"):
        ghost_rankings.nothing_better(problem, ranking[:3] + ranking[4:], 60.0)


def test_kinds_have_the_goals_that_were_set():
    assert {kind.goal for kind in ghost_rankings.KINDS.values() if kind.targets == 20} == {5.0}
    assert {kind.goal for kind in ghost_rankings.KINDS.values() if kind.targets == 40} == {60.0}


def test_the_page_shows_every_kind_with_its_goal():
    results = Results("ghost_rankings")
    rows = table().splitlines()[2:]
    assert [row.split(" | ")[0].removeprefix("| ") for row in rows] == list(ghost_rankings.KINDS)
    for name, kind in ghost_rankings.KINDS.items():
        assert results[f"{name}: kbest, longest"].band == (None, kind.goal)
