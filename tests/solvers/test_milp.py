"""The backends of milp against exhaustive search, each other, and the clock."""

import pytest

from assoc.solvers.assign import assign
from experiments.common.instances.synthetic import axial_random, planted
from tests.oracles import check_answer

BACKENDS = ("scip", "highs")


@pytest.mark.parametrize("backend", BACKENDS)
def test_time_limit_returns_best_and_valid_bound(backend):
    problem = axial_random(20, seed=100)
    # what is compiled on first use would eat the time
    assign(axial_random(4, seed=100), "milp", backend=backend, time_limit=5.0)
    solution = assign(problem, "milp", backend=backend, time_limit=0.5)
    check_answer(problem, solution.tuples)
    # the costs are >= 0 and an optimum of 20 tuples is far below 100 (the average of a random one is 990)
    assert 0.0 <= solution.lower_bound <= 40.0
    assert solution.cost < 200.0
    if solution.status != "optimal":
        assert solution.stopped_by == "time_limit"


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("seconds", [1e10, 1e14, 1e300, float("inf")])
def test_a_limit_of_ages_is_none(backend, seconds):
    """Clocks of the libraries end before that, each elsewhere."""
    problem, optimum = planted(4, seed=100, targets=4)
    assert assign(problem, "milp", backend=backend, time_limit=seconds).cost == pytest.approx(optimum, abs=1e-6)
