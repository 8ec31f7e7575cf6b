"""Costs of measurements of different times, against one big Gaussian and against simultaneous ones."""

import itertools
import math

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import assoc
from assoc.costs import positions_and_covariances, tuple_costs
from assoc.costs.own_times import UNREST
from assoc.errors import InvalidInputError
from assoc.scene import Scene
from assoc.sensors import BearingSensor
from assoc.simulation import simulate
from tests.tracking.plain import sensor

SPEED, WIDE = 40.0, 1e5
VIEW = np.array([[0.0, 5e3], [0.0, 5e3], [0.0, 5e3]])
SENSORS = [sensor(P, rate, sigma, VIEW) for P, rate, sigma in ((0.8, 2.0, 20.0), (0.9, 1.0, 30.0), (0.7, 2.0, 10.0))]


def timed(seed):
    rng = np.random.default_rng(seed)
    truth, velocity = np.array([2e3, 2e3, 2e3]), rng.normal(0, SPEED, 3)
    times = rng.uniform(0.0, 2.0, 3)
    z = [rng.normal(truth + t * velocity, s.noise)[None] for t, s in zip(times, SENSORS, strict=True)]
    return Scene(SENSORS, [2.0], [z], measurement_times=[[np.array([t]) for t in times]])


def stacked(scene, row):
    """Cost and position by one Gaussian: a flat position, a prior of the velocity, white noise in between."""
    seen = [s for s in range(3) if row[s]]
    t = np.array([scene.measurement_times[0][s][0] for s in seen])
    z = np.array([scene.measurements[0][s][0] for s in seen])
    R = np.diag([SENSORS[s].noise[0] ** 2 for s in seen])
    first, elapsed = t.min(), t - t.min()
    low, high = np.minimum.outer(elapsed, elapsed), np.maximum.outer(elapsed, elapsed)
    noise = UNREST**2 * (low**2 * high / 2 - low**3 / 6)
    prior = WIDE**2 + SPEED**2 * np.outer(elapsed, elapsed) + noise
    log = sum(multivariate_normal.logpdf(z[:, i], np.full(len(t), 2e3), prior + R) for i in range(3))
    # the flat prior's density taken out, and the likelihood at the best position taken for that over all
    log += 3 * math.log(math.sqrt(2 * math.pi) * WIDE)
    log -= 1.5 * math.log(2 * math.pi / np.trace(np.linalg.inv(R)))
    cost = -log
    for s, one in enumerate(SENSORS):
        P = one.detection_probability
        cost -= math.log(P * one.volume / one.false_alarm_rate) if s in seen else math.log(1 - P)
    end = 2.0 - first
    now = WIDE**2 + SPEED**2 * elapsed * end + UNREST**2 * (elapsed**2 * end / 2 - elapsed**3 / 6)
    return cost, 2e3 + now @ np.linalg.solve(prior + R, z - 2e3)


@pytest.mark.parametrize("seed", range(4))
def test_costs_and_positions_are_those_of_one_big_gaussian(seed):
    scene = timed(seed)
    for row in itertools.product([0, 1], repeat=3):
        if sum(row) < 2:
            continue
        expected, place = stacked(scene, row)
        assert tuple_costs(scene, 0, [row], speed=SPEED)[0] == pytest.approx(expected, abs=1e-4), row
        found, _ = positions_and_covariances(scene, 0, [row], speed=SPEED)
        np.testing.assert_allclose(found[0], place, atol=0.05)
    problem = assoc.build_problem(scene, 0, speed=SPEED)
    np.testing.assert_allclose(problem.costs, tuple_costs(scene, 0, problem.tuples, speed=SPEED))
    assert [1, 1, 1] in problem.tuples.tolist()


@pytest.mark.parametrize("name", ["crowd", "three-radar"])
def test_times_that_are_all_the_same_change_nothing(name):
    scene = simulate(name, 1, scans=2, **({"targets": 12} if name == "crowd" else {}))
    times = [[np.full(len(z), t) for z in scan] for t, scan in zip(scene.times, scene.measurements, strict=True)]
    same = Scene(scene.sensors, scene.times, scene.measurements, scene.region, measurement_times=times)
    for k in range(2):
        one, other = assoc.build_problem(scene, k), assoc.build_problem(same, k)
        expected = dict(zip(map(tuple, one.tuples.tolist()), one.costs, strict=True))
        found = dict(zip(map(tuple, other.tuples.tolist()), other.costs, strict=True))
        # a gate for each measurement given those before is not quite one for all together
        assert len(set(expected) ^ set(found)) <= 0.05 * len(expected)
        for row in set(expected) & set(found):
            assert found[row] == pytest.approx(expected[row], abs=0.02)


def test_bearings_alone_are_not_compared_over_time():
    sensors = [BearingSensor(position=[x, 0, 0], noise=[1e-3]) for x in (0.0, 1e4, 2e4)]
    target = np.array([[1e4, 3e4, 5e3]])
    z = [one.measure(target) for one in sensors]
    scene = Scene(sensors, [1.0], [z], measurement_times=[[[0.2], [0.9], [0.5]]])
    assert assoc.build_problem(scene, 0).num_tuples == 3
    with pytest.raises(InvalidInputError, match="row 0 has bearings alone"):
        tuple_costs(scene, 0, [[1, 1, 0]])
