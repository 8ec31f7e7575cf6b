"""Dimensionwise search: each split is re-matched to its optimum, checked against a plain reading."""

import numpy as np
import pytest

from assoc.errors import InfeasibleError
from assoc.packing.cover import Cover
from assoc.packing.neighbourhoods.dimensionwise import improve_dimensionwise, splits
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.solvers.methods import EXACT_METHODS
from tests.oracles import brute_force, small_problems
from tests.packings import is_cover


def _random_cover(packing, rng):
    cover = Cover.empty(packing)
    cover.add_greedily(rng.permutation(packing.num_columns).astype(np.int64))
    if not cover.complete(Run(rng, methods=EXACT_METHODS)):
        raise InfeasibleError("none")
    return cover


def feasible(packing, owner):
    columns = np.unique(owner[owner >= 0])
    assert is_cover(packing, columns)
    rows = packing.cols[columns]
    np.testing.assert_array_equal(np.flatnonzero(owner >= 0), np.sort(rows[rows >= 0]))


def test_never_worse_and_feasible_on_every_kind_of_problem():
    rng = np.random.default_rng(0)
    improved = 0
    for problem in small_problems(300, seed=8):
        prepared = prepare(problem)
        packing = prepared.packing
        if packing.num_columns == 0:
            continue
        try:
            cover = _random_cover(packing, rng)
        except InfeasibleError:
            continue
        before = cover.weight
        change = improve_dimensionwise(packing, cover.owner)
        feasible(packing, cover.owner)
        assert cover.weight == pytest.approx(before + change, abs=1e-9)
        assert cover.weight + prepared.offset >= brute_force(problem) - 1e-9
        improved += change < 0
        assert improve_dimensionwise(packing, cover.owner) == 0.0
    assert improved > 60


def test_splits():
    assert splits(3).tolist() == [1, 2, 3]
    assert len(splits(4)) == 7
    assert len(splits(6)) == 31
    assert splits(8).tolist() == [1 << s for s in range(8)]
