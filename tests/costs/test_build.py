import itertools

import numpy as np
import pytest
from scipy.stats import chi2

from assoc.costs import build_problem, positions_and_covariances, tuple_costs
from assoc.errors import InvalidInputError, LimitExceededError
from assoc.scene import Scene
from assoc.sensors import PositionSensor
from tests.costs.reference import all_tuples, constant, freedom, make_scene, measures_positions
from tests.sizes import sample


def expected_candidates(scene, probability):
    """Every tuple that the documented rule admits, by looking at all of them."""
    tuples = all_tuples(scene)
    if not len(tuples):
        return {}
    costs = tuple_costs(scene, 0, tuples)
    positions, _ = positions_and_covariances(scene, 0, tuples)
    half = np.ptp(scene.region, axis=1) / 2
    highest = 3 * max(half[2], 0.1 * half.max())
    passed = {}
    for one, cost, position in zip(tuples, costs, positions, strict=True):
        chi = 2 * (cost - constant(scene, one))
        sought = measures_positions(scene, one) or abs(position[2] - scene.region[2].mean()) <= highest
        if sought and chi <= chi2.ppf(probability, freedom(scene, one)):
            passed[tuple(int(i) for i in one)] = cost
    result = {}
    for one, cost in passed.items():
        members = [s for s, i in enumerate(one) if i]
        couples = [tuple(i if s in two else 0 for s, i in enumerate(one)) for two in itertools.combinations(members, 2)]
        if cost < 0 and all(couple in passed for couple in couples):
            result[one] = cost
    return result


def found_candidates(problem):
    several = np.count_nonzero(problem.tuples, axis=1) > 1
    assert (problem.costs[~several] == 0).all()
    return {
        tuple(int(i) for i in one): cost
        for one, cost in zip(problem.tuples[several], problem.costs[several], strict=True)
    }


@sample("probability", [0.9, 0.999, 1.0], every=3)
@pytest.mark.parametrize(
    "kinds", ["RR", "RRR", "PPP", "ppp", "bbb", "rrr", "Rrb", "PRrb", "bbr", "bbbb", "rp", "Rb", "hhr", "hb"]
)
def test_candidates_are_those_of_an_exhaustive_search(kinds, probability):
    for seed in range(4):
        scene, _ = make_scene(kinds, seed, targets=4 if len(kinds) < 4 else 2)
        expected = expected_candidates(scene, probability)
        found = found_candidates(build_problem(scene, 0, gate_probability=probability))
        assert set(found) == set(expected)
        for one, cost in found.items():
            assert cost == pytest.approx(expected[one], rel=1e-6, abs=1e-4)


def gated_scene(sensors, targets, box, seed=0):
    rng = np.random.default_rng(seed)
    box = np.asarray(box, dtype=float)
    view = np.stack([0 * box, box], axis=1)
    made = [
        PositionSensor(position=[0, 0, 0], noise=[100.0] * 3, field_of_view=view, false_alarm_rate=0.1 * targets)
        for _ in range(sensors)
    ]
    truth = box * rng.random((targets, 3))
    measured = []
    for _ in made:
        seen = truth[rng.random(targets) < 0.9]
        clutter = box * rng.random((rng.poisson(0.1 * targets), 3))
        measured.append(np.vstack([seen + rng.normal(scale=100, size=seen.shape), clutter]))
    return Scene(made, [0.0], [measured], region=view)


def test_the_guard_names_the_number_and_what_to_change():
    scene, _ = make_scene("bbb", 0, targets=30)
    with pytest.raises(LimitExceededError, match=r"scan 0: about .* max_tuples = 100; lower gate_probability"):
        build_problem(scene, 0, max_tuples=100)
    crowd = gated_scene(4, 300, [3000, 3000, 1000])
    with pytest.raises(LimitExceededError, match="max_tuples"):
        build_problem(crowd, 0, max_tuples=100_000)


@pytest.mark.parametrize("kinds", ["R", "b", "RRR"])
def test_little_or_nothing_measured(kinds):
    scene, _ = make_scene(kinds, 0, targets=1, false_alarms=0.0)
    empty = Scene(scene.sensors, [0.0], [[[] for _ in scene.sensors]])
    assert build_problem(empty, 0).num_tuples == 0
    if len(kinds) == 1:
        problem = build_problem(scene, 0)
        assert problem.num_tuples == len(scene.measurements[0][0])


@pytest.mark.parametrize("probability", [0.0, -1, 1.1, float("nan"), "x", None])
def test_gate_probability_is_checked(probability):
    scene, _ = make_scene("RR", 0)
    with pytest.raises(InvalidInputError, match="gate_probability"):
        build_problem(scene, 0, gate_probability=probability)
