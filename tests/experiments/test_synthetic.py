"""Known optima are what they are said to be; the same seed gives the same problem."""

import numpy as np
import pytest

from experiments.common.instances import synthetic
from tests import oracles


@pytest.mark.parametrize("n", [2, 3, 5, 8])
@pytest.mark.parametrize("seed", range(3))
def test_axial_known_optimum(n: int, seed: int) -> None:
    problem, optimum = synthetic.axial_known_optimum(n, seed)
    assert problem.sizes.tolist() == [n, n, n]
    assert not problem.dummy
    assert oracles.milp_optimum(problem) == pytest.approx(optimum, abs=1e-9)


@pytest.mark.parametrize("sensors", [2, 3, 4, 5, pytest.param(6, marks=pytest.mark.slow)])
def test_planted(sensors: int) -> None:
    for seed in range(2):
        problem, optimum = synthetic.planted(sensors, seed, targets=4)
        assert oracles.milp_optimum(problem) == pytest.approx(optimum, abs=1e-9)
        # every singleton is listed, none was added at 0
        singletons = np.count_nonzero(problem.tuples, axis=1) == 1
        assert singletons.sum() == problem.sizes.sum()
        assert (problem.costs[singletons] != 0).all()
    full, optimum = synthetic.planted(sensors, 0)
    assert 2_000 < full.num_tuples < 31_000
    assert len(np.unique(full.tuples, axis=0)) == full.num_tuples
    again, same = synthetic.planted(sensors, 0)
    assert same == optimum
    assert (again.costs == full.costs).all()
