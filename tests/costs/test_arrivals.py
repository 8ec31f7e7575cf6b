"""Arrival times of which the time of emission is not known, beside sums over a dense grid of places and times."""

import math
from dataclasses import replace

import numpy as np
import pytest

import assoc
from assoc.costs import build_problem, emission_times, positions_and_covariances, tuple_costs
from assoc.errors import InvalidInputError, LimitExceededError
from assoc.problem import AssignmentProblem
from assoc.scene import Scene
from assoc.sensors import ArrivalTimeSensor, BearingSensor
from assoc.simulation import simulate
from assoc.tracking import MultiSensorTracker

SPEED, LISTENED = 340.0, 8.0
FIELD = [[0.0, 1000.0], [0.0, 1000.0], [0.0, 0.0]]
SITES = np.array(
    [[50.0, 80.0, 0.0], [940.0, 120.0, 0.0], [480.0, 930.0, 0.0], [120.0, 700.0, 0.0], [800.0, 600.0, 0.0]]
)


def microphones(count, *, noise=0.02, **values):
    options = {"detection_probability": 0.8, "false_alarm_rate": 0.5, **values}
    view = [[0.0, LISTENED]]
    return [
        ArrivalTimeSensor(position=site, noise=[noise], field_of_view=view, wave_speed=SPEED, **options)
        for site in SITES[:count]
    ]


def heard(place, emitted, count, rng, noise=0.02):
    """Arrival times of one emission, a list of one for each microphone."""
    return [
        [[emitted + float(np.linalg.norm(site - place)) / SPEED + rng.normal(0.0, noise)]] for site in SITES[:count]
    ]


def reference_chi(times, noise, x, y, emitted):
    """Chi-square at places and times by broadcasting, without any derivative or mean."""
    total = 0.0
    for site, time in zip(SITES, times, strict=False):
        if time is not None:
            total = total + ((time - emitted - np.hypot(x - site[0], y - site[1]) / SPEED) / noise) ** 2
    return total


@pytest.mark.parametrize("missed", [(), (1,), (0, 4)])
def test_costs_beside_a_dense_grid(missed):
    rng, noise, place, emitted = np.random.default_rng(len(missed)), 0.02, np.array([430.0, 390.0, 0.0]), 2.5
    scene = Scene(microphones(5), [0.0], [heard(place, emitted, 5, rng)], region=FIELD)
    row = np.array([[0 if s in missed else 1 for s in range(5)]])
    times = [None if s in missed else float(z[0, 0]) for s, z in enumerate(scene.scan(0).measurements)]
    x, step = np.linspace(place[0] - 80.0, place[0] + 80.0, 161, retstep=True)
    y = np.linspace(place[1] - 80.0, place[1] + 80.0, 161)
    e, tick = np.linspace(emitted - 0.25, emitted + 0.25, 201, retstep=True)
    chi = reference_chi(times, noise, x[:, None, None], y[:, None], e)
    found = 5 - len(missed)
    density = 0.5 / LISTENED
    fixed = found * (0.5 * math.log(2 * math.pi * noise**2) - math.log(0.8 / density)) - len(missed) * math.log(0.2)
    # equation 5: the best place and time
    assert tuple_costs(scene, 0, row)[0] == pytest.approx(0.5 * chi.min() + fixed, abs=0.05)
    best = np.unravel_index(int(chi.argmin()), chi.shape)
    positions, covariances = positions_and_covariances(scene, 0, row)
    assert positions[0] == pytest.approx([x[best[0]], y[best[1]], 0.0], abs=2.0 * step)
    assert emission_times(scene, 0, row)[0] == pytest.approx(e[best[2]], abs=2.0 * tick)
    # a density of targets: place and time integrated out
    likelihood = np.exp(-0.5 * (chi - chi.min()))
    share = 3.0 / 1000.0**2 * likelihood.sum() * step**2 * tick / LISTENED
    integrated = tuple_costs(scene, 0, row, target_density=3.0 / 1000.0**2)[0]
    assert integrated == pytest.approx(0.5 * chi.min() + fixed - math.log(share), abs=0.1)
    weight = likelihood.sum(axis=2) / likelihood.sum()
    spread = (weight * (x[:, None] - (weight * x[:, None]).sum()) ** 2).sum()
    assert covariances[0, 0, 0] == pytest.approx(spread, rel=0.1)


def test_too_few_arrival_times_are_no_position():
    scene = Scene(microphones(4), [0.0], [[[[1.0]], [[1.2]], [[1.5]], [[1.7]]]], region=FIELD)
    costs = tuple_costs(scene, 0, [[1, 0, 0, 0], [1, 1, 0, 0], [1, 1, 1, 0]])
    assert costs[0] == 0.0 and np.isinf(costs[1]) and np.isfinite(costs[2])
    in_space = Scene(scene.sensors, [0.0], scene.measurements, region=[*FIELD[:2], [0.0, 100.0]])
    assert np.isinf(tuple_costs(in_space, 0, [[1, 1, 1, 0]])[0])


def crowded(seed, count, events, false, noise=0.02):
    """A second in which several shots are heard, and other noises."""
    rng = np.random.default_rng(seed)
    shots = [heard(np.append(rng.uniform(0, 1000, 2), 0), rng.uniform(0, 3), count, rng, noise) for _ in range(events)]
    scan = []
    for s in range(count):
        kept = [shot[s][0] for shot in shots if rng.random() < 0.8]
        kept += [[time] for time in rng.uniform(0, 4, rng.poisson(false))]
        scan.append(rng.permutation(np.reshape(kept, (-1, 1))))
    return Scene(microphones(count, noise=noise), [0.0], [scan], region=FIELD)


@pytest.mark.parametrize("density", [None, 2.0 / 1000.0**2])
def test_the_optimum_of_all_tuples_in_the_region_is_among_the_listed(density):
    listed_all = 0
    for seed in range(40):
        scene = crowded(seed, 4 + seed % 2, 1 + seed % 3, 0.5)
        every = build_problem(scene, 0, all_tuples=True, target_density=density, gate_probability=1.0)
        listed = build_problem(scene, 0, target_density=density, gate_probability=1.0)
        places = positions_and_covariances(scene, 0, every.tuples)[0]
        inside = ((places[:, :2] >= 0.0) & (places[:, :2] <= 1000.0)).all(axis=1)
        inside |= np.count_nonzero(every.tuples, axis=1) == 1
        inside = AssignmentProblem(every.tuples[inside], every.costs[inside], every.sizes)
        best, found = assoc.assign(inside).cost, assoc.assign(listed).cost
        assert found <= best + 0.5  # a tuple of three may have another place
        listed_all += found <= best + 1e-3
        np.testing.assert_allclose(
            tuple_costs(scene, 0, listed.tuples, target_density=density), listed.costs, rtol=0, atol=0.05
        )
    assert listed_all >= 38


def test_parts_of_two_shots_at_once_are_listed():
    """Beside all tuples in the region: what is heard of both within the time in which sound crosses it."""
    useful = missing = 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        sites = np.column_stack([rng.uniform(0, 1000, (7, 2)), np.zeros(7)])
        shots = np.column_stack([rng.uniform(0, 1000, (2, 2)), np.zeros(2)])
        emitted = rng.uniform(0, 0.5, 2)
        sensors = [replace(microphones(1, noise=0.002)[0], position=site) for site in sites]
        due = emitted + np.linalg.norm(sites[:, None] - shots, axis=2) / SPEED + rng.normal(0, 0.002, (7, 2))
        scan = [times[rng.random(2) < 0.9, None] for times in due]
        scene = Scene(sensors, [0.0], [scan], region=FIELD)
        every = build_problem(scene, 0, all_tuples=True, gate_probability=1.0)
        listed = {*map(tuple, build_problem(scene, 0, gate_probability=1.0).tuples.tolist())}
        places = positions_and_covariances(scene, 0, every.tuples)[0]
        good = ((places[:, :2] >= 0.0) & (places[:, :2] <= 1000.0)).all(axis=1) & (every.costs < 0.0)
        good &= np.count_nonzero(every.tuples, axis=1) > 3
        useful += np.count_nonzero(good)
        missing += sum(tuple(one) not in listed for one in every.tuples[good].tolist())
    assert missing < 0.03 * useful and useful > 400


def test_twenty_stations():
    """What is found costs no more than the truth, has as many targets, and few measurements are elsewhere."""
    scene = simulate("arrival-times", 5, scans=3, depth=0.0)
    for k in range(scene.num_scans):
        scan, problem = scene.scan(k), build_problem(scene, k, target_density="auto")
        assert len(problem.tuples) < 5_000
        solution = assoc.assign(problem)
        found = solution.tuples[np.count_nonzero(solution.tuples, axis=1) > 1]
        truth = scan.true_tuples()
        cost = tuple_costs(scene, k, truth, target_density="auto").sum()
        assert solution.cost <= cost + 0.5 * len(truth) and len(found) == len(truth)
        # sources of the arrival times of each target found
        sources = [[source[i - 1] for source, i in zip(scan.sources, row, strict=True) if i] for row in found]
        owners = [int(np.bincount(np.array(names) + 1).argmax()) - 1 for names in sources]
        assert sorted(owners) == sorted(scan.truth_ids)
        right = sum(names.count(owner) for names, owner in zip(sources, owners, strict=True))
        assert right >= 0.95 * max(np.count_nonzero(truth), sum(map(len, sources)))
        off = (
            positions_and_covariances(scene, k, found)[0]
            - scan.truth_positions[np.searchsorted(scan.truth_ids, owners)]
        )
        assert np.linalg.norm(off, axis=1).max() < 2_000.0


@pytest.mark.parametrize(("seed", "scan", "options"), [
    (103, 0, {"depth": 0.0, "events": 6, "false_alarms": 2.0}), (102, 1, {}), (301, 1, {}),
])  # fmt: skip
def test_what_two_emissions_heard_goes_to_the_one_that_it_costs_less(seed, scan, options):
    """An emission lies where it fits what it hears; the truth, in which it hears less, is a choice nevertheless."""
    scene = simulate("arrival-times", seed, scans=2, **options)
    found = assoc.assign(build_problem(scene, scan, target_density="auto"))
    truth = tuple_costs(scene, scan, scene.scan(scan).true_tuples(), target_density="auto").sum()
    assert found.cost <= truth + 1e-3


def test_two_phases_of_one_wave():
    """P and S waves at four stations: eight sensors; their distance in time tells that of the earthquake."""
    sites = np.array([[0, 0, 0], [40e3, 5e3, 0], [10e3, 45e3, 0], [60e3, 50e3, 0]], dtype=float)
    place, emitted = np.array([[22e3, 18e3, -9e3]]), 4.0
    sensors = [
        ArrivalTimeSensor(position=site, noise=[0.05], field_of_view=[[0, 60]], wave_speed=speed)
        for site in sites for speed in (6_000.0, 3_400.0)
    ]  # fmt: skip
    scan = [emitted + sensor.measure(place) for sensor in sensors]
    scene = Scene(sensors, [0.0], [scan], region=[[-20e3, 80e3], [-20e3, 80e3], [-20e3, 0]])
    found = assoc.associate(scene).scans[0]
    assert found.targets.tolist() == [[1] * 8]
    assert found.positions[0] == pytest.approx(place[0], abs=50.0)
    assert emission_times(scene, 0, found.targets)[0] == pytest.approx(emitted, abs=0.01)


def test_bad_input():
    receivers = microphones(3)
    with pytest.raises(InvalidInputError, match="wave_speed must be a number above 0, m/s, got 0"):
        ArrivalTimeSensor(position=[0, 0, 0], noise=[0.1], field_of_view=[[0, 1]], wave_speed=0)
    with pytest.raises(InvalidInputError, match="wave_speed"):
        ArrivalTimeSensor(position=[0, 0, 0], noise=[0.1], field_of_view=[[0, 1]])
    mixed = Scene([*receivers, BearingSensor(position=[0, 0, 0], noise=[0.1])], [0.0], [[[[1.0]]] * 4], region=FIELD)
    with pytest.raises(InvalidInputError, match="receivers of arrival times, which must be alone"):
        build_problem(mixed, 0)
    scene = Scene(receivers, [0.0], [[[[1.0]], [[1.1]], [[1.2]]]], region=FIELD)
    with pytest.raises(InvalidInputError, match="a tracker cannot take arrival times"):
        MultiSensorTracker.for_scene(scene)
    own_times = Scene(receivers, [2.0], scene.measurements, region=FIELD, measurement_times=[[[1.0], [1.1], [1.2]]])
    with pytest.raises(InvalidInputError, match="leave out measurement_times"):
        build_problem(own_times, 0)
    with pytest.raises(InvalidInputError, match="no arrival times"):
        emission_times(simulate("three-radar", scans=1), 0, np.zeros((0, 3), int))
    with pytest.raises(LimitExceededError, match="more than max_tuples = 3"):
        build_problem(crowded(2, 5, 3, 1.0), 0, max_tuples=3)


def test_in_a_file(tmp_path):
    scene = simulate("arrival-times", scans=1, stations=4)
    scene.save(tmp_path / "scene.npz")
    again = Scene.load(tmp_path / "scene.npz")
    assert again.sensors == scene.sensors and again.sensors[0].wave_speed == 6_000.0


def test_derivatives():
    sensor, places = microphones(1)[0], np.random.default_rng(0).uniform(0, 1000, (20, 3))
    slopes = super(ArrivalTimeSensor, sensor).jacobian(places)
    np.testing.assert_allclose(sensor.jacobian(places), slopes, rtol=0, atol=1e-9)
