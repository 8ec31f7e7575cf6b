"""The full grid of tuples: nothing dropped, each at the price of equation 5, and the same optimum."""

import itertools

import numpy as np
import pytest

import assoc
from assoc.simulation import simulate

SCENES = {
    "three-radar": simulate("three-radar", seed=1, scans=4),
    "bearing-only": simulate("bearing-only", seed=1, scans=2, targets=4),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_grid_is_whole_and_its_optimum_that_of_the_candidates(name):
    scene = SCENES[name]
    for scan in range(scene.num_scans):
        whole = assoc.build_problem(scene, scan, all_tuples=True)
        expected = set(itertools.product(*(range(n + 1) for n in whole.sizes.tolist())))
        expected.discard((0,) * len(whole.sizes))
        assert set(map(tuple, whole.tuples.tolist())) == expected
        assert np.isfinite(whole.to_dense()).all()
        few = assoc.build_problem(scene, scan, gate_probability=1.0)
        known = dict(zip(map(tuple, whole.tuples.tolist()), whole.costs.tolist(), strict=True))
        for key, cost in zip(map(tuple, few.tuples.tolist()), few.costs.tolist(), strict=True):
            assert cost == pytest.approx(known[key], abs=1e-6)
        assert assoc.assign(whole).cost == pytest.approx(assoc.assign(few).cost, abs=1e-6)
