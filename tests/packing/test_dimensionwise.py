"""Dimensionwise search: each split is re-matched to its optimum, checked against a plain reading."""

import numpy as np
import pytest

from assoc.errors import InfeasibleError
from assoc.packing.cover import Cover
from assoc.packing.neighbourhoods.dimensionwise import improve_dimensionwise, splits
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.solvers.methods import EXACT_METHODS
from experiments.common.instances.synthetic import planar_random
from tests.oracles import axial_problem, brute_force, gated_problem, small_problems
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


def test_two_sensors_are_solved_at_once():
    rng = np.random.default_rng(1)
    for _ in range(40):
        problem = gated_problem(rng, (5, 6), 0.5)
        prepared = prepare(problem)
        cover = Cover.empty(prepared.packing)
        improve_dimensionwise(prepared.packing, cover.owner)
        assert cover.weight + prepared.offset == pytest.approx(brute_force(problem), abs=1e-9)
    cover = _random_cover(prepare(planar_random(40, 100)).packing, rng)
    improve_dimensionwise(cover.packing, cover.owner)
    from scipy.optimize import linear_sum_assignment

    dense = planar_random(40, 100).to_dense()
    assert cover.weight == pytest.approx(dense[linear_sum_assignment(dense)].sum(), abs=1e-9)


def _restricted(problem, owner, prepared, mask):
    """The problem with only those tuples that respect the halves of one split: its optimum by brute force."""
    packing = prepared.packing
    group = np.arange(packing.num_rows)
    for k in np.unique(owner[owner >= 0]):
        for part in (True, False):
            rows = [r for s, r in enumerate(packing.cols[k]) if r >= 0 and bool(mask >> s & 1) == part]
            if rows:
                group[rows] = rows[0]
    sizes = np.bincount(group, minlength=packing.num_rows)
    keep = np.zeros(packing.num_columns, dtype=bool)
    for j, column in enumerate(packing.cols):
        halves = [
            [group[r] for s, r in enumerate(column) if r >= 0 and bool(mask >> s & 1) == part] for part in (True, False)
        ]
        keep[j] = all(len(set(h)) <= 1 and (not h or len(h) == sizes[h[0]]) for h in halves)
    rows_of = packing.origin[keep]
    singles = problem.tuples[prepared.single] if problem.dummy else problem.tuples[:0]
    tuples = np.concatenate([problem.tuples[rows_of], singles])
    costs = np.concatenate([problem.costs[rows_of], prepared.single_cost if problem.dummy else []])
    return brute_force(AssignmentProblem(tuples, costs, problem.sizes, dummy=problem.dummy))


def test_no_split_leaves_anything_to_gain():
    rng = np.random.default_rng(3)
    for number in range(60):
        if number % 3 == 0:
            problem = axial_problem(rng, [(5, 5, 5), (4, 5, 6), (3, 3, 3, 3)][number % 9 // 3], 1.0)
        else:
            problem = gated_problem(rng, [(5, 5, 5), (3, 3, 4, 3)][number % 2], 0.4, listed_singletons=0.4)
        prepared = prepare(problem)
        cover = _random_cover(prepared.packing, rng)
        improve_dimensionwise(prepared.packing, cover.owner)
        for mask in splits(problem.num_sensors).tolist():
            assert cover.weight + prepared.offset == pytest.approx(
                _restricted(problem, cover.owner, prepared, mask), abs=1e-8
            )


def test_splits():
    assert splits(3).tolist() == [1, 2, 3]
    assert len(splits(4)) == 7
    assert len(splits(6)) == 31
    assert splits(8).tolist() == [1 << s for s in range(8)]
