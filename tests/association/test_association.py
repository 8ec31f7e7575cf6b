"""Associations of scenes: targets, labels, fused positions, correct tuples, one seed one answer."""

import numpy as np
import pytest

import assoc
from assoc.association import associate
from assoc.association.solving import ScanOptions, associate_scan, associate_scans, gathered
from assoc.association.table import to_csv
from assoc.costs import positions_and_covariances
from assoc.scene import Scene, Truth
from assoc.sensors import PositionSensor
from assoc.simulation import simulate
from assoc.solvers import Outcome, registry

REGION = np.array([[0.0, 1000.0], [0.0, 1000.0], [0.0, 1000.0]])


def sensor(sigma: float) -> PositionSensor:
    return PositionSensor(
        position=[0, 0, 0],
        noise=[sigma] * 3,
        detection_probability=0.9,
        false_alarm_rate=0.5,
        field_of_view=REGION,
    )


@pytest.fixture(scope="module")
def by_hand():
    """Target 4 seen by three sensors, target 9 by two, target 2 by one; and a false alarm."""
    first = [[500, 500, 500], [100, 100, 100]]
    second = [[102, 98, 101], [900, 10, 700]]
    third = [[101, 101, 99], [503, 499, 502], [10, 900, 10]]
    sources = [[np.array([9, 4]), np.array([4, -1]), np.array([4, 9, 2])]]
    truth = Truth([np.array([2, 4, 9])], [np.array([[10, 900, 10], [100, 100, 100], [500, 500, 500]])], sources)
    sensors = [sensor(1.0), sensor(2.0), sensor(2.0)]
    return Scene(sensors, [7.0], [[np.array(first), np.array(second), np.array(third)]], REGION, truth)


@pytest.mark.parametrize("solver", ["greedy", "aco", "milp"])
def test_by_hand(by_hand, solver):
    result = associate(by_hand, solver)
    (scan,) = result.scans
    assert scan.time == 7.0 and scan.sizes == (2, 2, 3)
    assert scan.targets.tolist() == [[1, 0, 2], [2, 1, 1]]
    assert [label.tolist() for label in scan.labels()] == [[0, 1], [1, -1], [1, 0, -1]]
    assert scan.false_alarms == 2
    assert (scan.correct_tuples, scan.true_tuples) == (2, 2)
    # of direct measurements the maximum-likelihood position is the mean weighted by inverse variances
    np.testing.assert_allclose(scan.positions[0], np.average([[500] * 3, [503, 499, 502]], 0, [4, 1]), atol=1e-6)
    wanted = np.average([[100] * 3, [102, 98, 101], [101, 101, 99]], 0, [4, 1, 1])
    np.testing.assert_allclose(scan.positions[1], wanted, atol=1e-6)
    np.testing.assert_allclose(scan.covariances[0], np.eye(3) / 1.25, atol=1e-9)
    np.testing.assert_allclose(scan.covariances[1], np.eye(3) / 1.5, atol=1e-9)


def test_a_single_measurement_is_a_target_only_at_negative_cost():
    problem = assoc.AssignmentProblem([[1, 0], [0, 1]], [-1.0, 0.5], [1, 1])
    scan = associate_scan(problem, 0, ScanOptions("greedy"))
    assert scan.targets.tolist() == [[1, 0]]
    assert scan.false_alarms == 1 and scan.positions is None and scan.time is None


def test_each_scan_has_random_numbers_of_its_own():
    drawn = []

    def draw(packing, parameters, run):
        drawn.append(run.rng.random())
        return Outcome([], 1)

    registry.register("draw", registry.parameters("greedy"), draw)
    scene = simulate("three-radar", scans=3)
    for seed in (0, 1):
        associate(scene, "draw", seed=seed)
    assert len(set(drawn)) == 6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"solver": "magic"}, "unknown name 'magic'"),
        ({"solver": "greedy", "ants": 3}, "ants: no parameter of solver 'greedy'"),
        ({"solver": "greedy", "seed": -1}, "seed: expected a whole number >= 0"),
        ({"solver": "greedy", "jobs": 0}, "jobs: expected a whole number >= 1"),
        ({"solver": "greedy", "time_limit": 0.0}, "time_limit: expected seconds > 0"),
    ],
)
def test_bad_arguments(by_hand, arguments, message):
    with pytest.raises(assoc.InvalidInputError, match=message):
        associate(by_hand, **arguments)
    with pytest.raises(assoc.InvalidInputError, match="scene: expected a Scene, got str"):
        associate("scene.npz")  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["=1+1.npz", "+a.npz", "-a.npz", "@a.npz", "\ta.npz"])
def test_a_file_name_is_no_formula_in_a_spreadsheet(by_hand, name):
    scans = associate(by_hand).scans
    row = to_csv(scans, [name] * len(scans)).splitlines()[1]
    assert row.split(",")[0] == "'" + name
    assert to_csv(scans, ["a=b.npz"] * len(scans)).splitlines()[1].startswith("a=b.npz,")


def test_positions_at_another_time_follow_the_speed():
    """Where measurements have times of their own: as `positions_and_covariances` with that speed has them."""
    scene = simulate("rotating-radars", 0, aircraft=5, duration=8.0, interval=4.0)
    for speed in (100.0, 400.0):
        (one,) = associate(scene, gating={"speed": speed}).scans[1:]
        expected = positions_and_covariances(scene, 1, one.targets, speed=speed)
        assert len(one.targets) > 2
        np.testing.assert_allclose(one.positions, expected[0])
        np.testing.assert_allclose(one.covariances, expected[1])


@pytest.mark.parametrize("kbest", [None, 3])
def test_probabilities_of_targets_are_the_marginals_of_their_tuples(kbest):
    scene = simulate("crowd", 3, targets=8, scans=2, width=900.0, height=700.0, noise=60.0)
    options = ScanOptions("exact", kbest=kbest, marginals=True)
    result = gathered(associate_scans((scene,), options), options)
    for k, scan in enumerate(result.scans):
        found = assoc.marginals(assoc.build_problem(scene, k))
        known = dict(zip(map(tuple, found.tuples.tolist()), found.probability.tolist(), strict=True))
        for one in scan.ranked or (scan,):
            assert one.probabilities[:, 1].tolist() == [known[tuple(row)] for row in one.targets.tolist()]
            assert (np.diff(one.probabilities, axis=1) >= 0.0).all()
            assert one.least_probable == one.probabilities[:, 1].min()
            entry = one.to_dict()["targets"][0]
            assert entry["probability_lower"] <= entry["probability"] <= entry["probability_upper"]
    # something is in doubt
    assert min(scan.least_probable for scan in result.scans) < 0.9
    frame = result.to_frame()
    assert frame["probability"].tolist() == [p for scan in result.scans for p in scan.probabilities[:, 1]]
    assert to_csv(result.scans, ["a", "a"]).splitlines()[0].endswith(",least_probable")
    plain = associate(scene)
    assert plain.scans[0].probabilities is None and "probability" not in plain.to_frame()
