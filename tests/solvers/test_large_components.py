"""Large components: wide gates join a whole scene, and its linear program decides nearly all."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

import assoc
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.solvers.exact.reduction import Reduction
from assoc.solvers.exact.search import _complete


def wide_gates(targets, seed, noise=0.6):
    """Three lists of points in the plane; tuples of points near each other, at the cost of equation 5."""
    rng = np.random.default_rng(seed)
    points = rng.random((targets, 2)) * np.sqrt(targets)
    lists = [points[rng.random(targets) < 0.95] for _ in range(3)]
    lists = [z + rng.normal(size=z.shape) * noise for z in lists]
    trees = [cKDTree(z) for z in lists]
    near = {(s, t): trees[s].query_ball_tree(trees[t], 2.3 * noise) for s, t in [(0, 1), (0, 2), (1, 2)]}
    tuples = [(i + 1, j + 1, 0) for i, js in enumerate(near[0, 1]) for j in js]
    tuples += [(i + 1, 0, k + 1) for i, ks in enumerate(near[0, 2]) for k in ks]
    tuples += [(0, j + 1, k + 1) for j, ks in enumerate(near[1, 2]) for k in ks]
    tuples += [
        (i + 1, j + 1, k + 1)
        for i, js in enumerate(near[0, 1])
        for j in js
        for k in set(near[0, 2][i]) & set(near[1, 2][j])
    ]
    rows = np.array(tuples)
    there = rows > 0
    z = np.stack([lists[s][rows[:, s] - 1] for s in range(3)], axis=1) * there[..., None]
    count = there.sum(axis=1)
    mean = z.sum(axis=1) / count[:, None]
    spread = (((z - mean[:, None]) * there[..., None]) ** 2).sum(axis=(1, 2)) / (2.0 * noise**2)
    costs = spread - 0.742 * count + 3.0 * (3 - count) - np.log(2.0 * np.pi * noise**2 / count)
    return assoc.AssignmentProblem(rows, costs, [len(z) for z in lists])


@pytest.mark.parametrize("seed", [0, 1])
def test_what_reduced_costs_decide_is_completed_to_a_good_solution(seed):
    problem = wide_gates(700, seed)
    packing = prepare(problem).packing
    components = Reduction(packing, Run(0)).reduce()
    largest = max(components, key=lambda one: one.packing.num_rows)
    assert largest.packing.num_rows > 300
    largest.take_over(dual_bound(largest.packing))
    before = largest.weight - largest.bound
    _complete(largest, Run(0))
    assert largest.weight - largest.bound < 0.5 * before
    owner = largest.best
    assert largest.weight == pytest.approx(largest.weight_of(owner)) and largest.is_complete(owner)


def test_a_scene_that_is_one_component_is_proved():
    problem = wide_gates(400, 2)
    assert max(map(len, problem.components())) > 0.9 * problem.num_tuples
    answer, other = assoc.assign(problem), assoc.assign(problem, "milp")
    assert answer.status == "optimal" and answer.cost == pytest.approx(other.cost, rel=1e-8)
