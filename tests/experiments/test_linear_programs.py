"""Our linear programs beside HiGHS's: that bounds which differ are refused, and what the page shows."""

import numpy as np
import pytest

from experiments import linear_programs
from experiments.common.instances import synthetic
from experiments.pages.measured import linear_programs as table


@pytest.mark.parametrize("name", ["ghosts 20", "axial, random costs, n = 20"])
def test_programs_of_both_kinds_have_the_same_bounds(name):
    problem = linear_programs.KINDS["ghosts 20"](1) if name == "ghosts 20" else synthetic.axial_random(6, 1)
    packing = linear_programs.component_of(problem)
    found = linear_programs.measured(packing)
    assert tuple(found) == linear_programs.COLUMNS and all(value > 0.0 for value in found.values())
    assert (found["rows"], found["columns"]) == (packing.num_rows, packing.num_columns)


def test_a_bound_that_differs_is_refused():
    packing = linear_programs.component_of(linear_programs.KINDS["ghosts 20"](1))
    with pytest.raises(AssertionError, match="the bounds differ"):
        linear_programs.measured(packing, lambda *words: linear_programs.highs(*words) + 1e-5)


def test_masked_columns_are_not_used():
    packing = linear_programs.component_of(linear_programs.KINDS["ghosts 20"](1))
    every = np.ones(packing.num_columns, dtype=bool)
    fewer = packing.weights > np.median(packing.weights)
    assert linear_programs.highs(packing, fewer) > linear_programs.highs(packing, every) + 1.0


def test_the_page_shows_every_kind():
    assert [row.split(" | ")[0].removeprefix("| ") for row in table().splitlines()[2:]] == list(linear_programs.KINDS)
