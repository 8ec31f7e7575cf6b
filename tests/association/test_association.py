"""Associations of scenes: targets, labels, fused positions, correct tuples, one seed one answer."""

import json

import cloudpickle
import numpy as np
import pytest

import assoc
from assoc.association import Association, associate
from assoc.association.plan import Plan
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


def test_correct_means_exactly_the_measurements_of_a_target(by_hand):
    # the third sensor missed target 9 in truth; what it was given to is a false alarm nearby
    sources = [[np.array([9, 4]), np.array([4, -1]), np.array([4, -1, 9])]]
    truth = Truth(by_hand.truth.target_ids, by_hand.truth.positions, sources)
    scene = Scene(by_hand.sensors, by_hand.times, by_hand.measurements, REGION, truth)
    totals = associate(scene, "milp").totals()
    assert (totals["correct_tuples"], totals["true_tuples"], totals["share_correct"]) == (1, 2, 0.5)


def test_true_tuples(by_hand):
    assert by_hand.scan(0).true_tuples().tolist() == [[2, 1, 1], [1, 0, 2]]
    scene = Scene(by_hand.sensors, by_hand.times, by_hand.measurements, REGION)
    assert scene.scan(0).true_tuples() is None
    totals = associate(scene, "greedy").totals()
    assert totals["true_tuples"] is None and totals["share_correct"] is None
    # one sensor with two measurements of target 4: it has no tuple
    twice = Truth([np.array([4])], [np.zeros((1, 3))], [[np.array([4, 4]), np.array([4, -1]), np.full(3, -1)]])
    scene = Scene(by_hand.sensors, by_hand.times, by_hand.measurements, REGION, twice)
    assert scene.scan(0).true_tuples().tolist() == []


def test_a_single_measurement_is_a_target_only_at_negative_cost():
    problem = assoc.AssignmentProblem([[1, 0], [0, 1]], [-1.0, 0.5], [1, 1])
    scan = Plan((problem,), "greedy")((0, 0))
    assert scan.targets.tolist() == [[1, 0]]
    assert scan.false_alarms == 1 and scan.positions is None and scan.time is None


def test_empty_scans_and_a_single_sensor():
    nothing = np.zeros((0, 3))
    scene = Scene([sensor(1.0)] * 2, [0.0, 1.0], [[nothing, nothing], [nothing, np.ones((1, 3))]], REGION)
    result = associate(scene, "greedy")
    assert [scan.false_alarms for scan in result.scans] == [0, 1]
    assert result.totals()["gap"] == 0.0
    assert len(result.to_frame()) == 0
    alone = Scene([sensor(1.0)], [0.0], [[np.ones((3, 3))]], REGION)
    assert associate(alone, "greedy").totals()["false_alarms"] == 3


def test_the_seed_of_a_scan_does_not_depend_on_what_was_solved_before():
    scene = simulate("bearing-only", targets=6, scans=4)
    plan = Plan((scene,), "aco", seed=5, parameters={"mode": "paper", "iterations": 40})
    forward = [plan((0, k)) for k in range(4)]
    backward = [plan((0, k)) for k in reversed(range(4))][::-1]
    for one, other in zip(forward, backward, strict=True):
        assert np.array_equal(one.solution.tuples, other.solution.tuples)
        assert one.solution.iterations == other.solution.iterations


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


def test_processes_do_not_change_the_answer():
    scene = simulate("three-radar", scans=6)
    one, two = (associate(scene, "aco", seed=1, jobs=jobs, mode="paper") for jobs in (1, 2))
    for a, b in zip(one.scans, two.scans, strict=True):
        assert a.scan == b.scan and np.array_equal(a.solution.tuples, b.solution.tuples)
        assert a.solution.cost == b.solution.cost and a.solution.lower_bound == b.solution.lower_bound
        assert np.array_equal(a.positions, b.positions)


def test_processes_are_sent_the_scans_that_they_solve(monkeypatch):
    scene = simulate("three-radar", scans=40)
    sent = []

    def spread(task, items, **rest):
        sent.extend([task, *items])
        return map(task, items)

    monkeypatch.setattr("assoc.association.plan.parallel_map", spread)
    for gating in ({}, {"target_density": "auto"}):
        plan = Plan((scene,), "greedy", gating=gating)
        sent.clear()
        found = [list(plan.run(plan.items(), jobs)) for jobs in (1, 2)]
        assert all(a.solution.cost == b.solution.cost for a, b in zip(*found, strict=True))
        whole, bare = (len(cloudpickle.dumps(sent[at])) for at in (0, 41))
        # a prior found from all scans needs them
        assert (bare > 0.9 * whole) if gating else (bare < 0.2 * whole)


@pytest.mark.slow
def test_errors_in_processes_come_through():
    scene = simulate("three-radar", scans=4)
    with pytest.raises(assoc.LimitExceededError, match="tuples"):
        associate(scene, "greedy", jobs=2, gating={"max_tuples": 1})


def test_frame_summary_and_json(by_hand, tmp_path):
    result = associate(by_hand, "greedy", seed=3)
    frame = result.to_frame()
    assert list(frame.columns[:6]) == ["scan", "time", "target", "sensor_1", "sensor_2", "sensor_3"]
    assert list(frame.columns[6:]) == ["x", "y", "z", "sigma_x", "sigma_y", "sigma_z"]
    assert frame[["sensor_1", "sensor_2", "sensor_3"]].to_numpy().tolist() == [[1, 0, 2], [2, 1, 1]]
    assert frame["sigma_x"].to_numpy() == pytest.approx([1.25**-0.5, 1.5**-0.5])
    assert "2 targets, 2 false alarms" in result.summary() and "2 of 2 true tuples" in result.summary()
    path = tmp_path / "result.json"
    result.to_json(path)
    content = json.loads(path.read_text())
    keys = ["format", "version", "solver", "parameters", "seed", "scans", "totals"]
    assert list(content) == keys
    assert (content["format"], content["version"], content["seed"]) == ("assoc.result", 1, 3)
    (scan,) = content["scans"]
    assert list(scan) == (
        ["scan", "time", "sizes", "cost", "lower_bound", "gap", "status", "tuples", "targets", "runtime"]
        + ["compile_time"]
    )
    assert sorted(map(tuple, scan["tuples"])) == [(0, 0, 3), (0, 2, 0), (1, 0, 2), (2, 1, 1)]
    assert [target["tuple"] for target in scan["targets"]] == [[1, 0, 2], [2, 1, 1]]
    np.testing.assert_array_equal(scan["targets"][0]["position"], result.scans[0].positions[0])
    assert np.shape(scan["targets"][0]["covariance"]) == (3, 3)
    assert content["totals"]["cost"] == scan["cost"]


def test_json_has_no_infinities(tmp_path):
    result = Association((), "greedy", {"limit": float("inf"), "names": ("a", 1), "n": np.int64(3)})
    result.to_json(tmp_path / "r.json")
    content = json.loads((tmp_path / "r.json").read_text())
    assert content["parameters"] == {"limit": None, "names": ["a", 1], "n": 3}


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
    plan = Plan((scene,), "exact", kbest=kbest, marginals=True)
    result = plan.gather(plan.run(plan.items()))
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
