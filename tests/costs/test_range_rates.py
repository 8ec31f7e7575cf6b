import itertools
from dataclasses import replace

import numpy as np
import pytest

from assoc import simulation
from assoc.costs import build_problem, positions_and_covariances, tuple_costs
from assoc.errors import InvalidInputError
from assoc.scene import Scene
from assoc.sensors import Radar3D
from tests.costs.reference import CIRCLE, REGION, SIDE, all_tuples

SPEED = 100.0


def doppler_scene(seed, mixed=False, targets=2):
    """Three radars with large, correlated noise, so that plain sums over velocities do."""
    rng = np.random.default_rng(seed)
    noise = np.diag([50.0, 2e-3, 2e-3, 60.0])
    mix = np.eye(4)
    mix[3, :3] = [0.5, 0.3, -0.4]
    R = noise @ mix @ mix.T @ noise
    view = [[0, 2e5], CIRCLE, [-0.5, 1.5], [-600, 600]]
    sensors = [Radar3D(position=[*rng.uniform(-SIDE, SIDE, 2), 0.0], noise=R, field_of_view=view) for _ in range(3)]
    if mixed:
        sensors[1] = sensors[1].position_part
    places = np.column_stack([rng.uniform(-SIDE, SIDE, (targets, 2)), rng.uniform(1e3, 1e4, targets)])
    velocities = rng.normal(0, SPEED, (targets, 3))
    scan = []
    for sensor in sensors:
        exact = sensor.measure(places, velocities)
        scan.append(exact + rng.standard_normal(exact.shape) @ np.linalg.cholesky(sensor.covariance).T)
    return Scene(sensors, [0.0], [scan], region=REGION), places, velocities


@pytest.mark.slow
@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize("seed", range(2))
def test_costs_are_the_likelihood_summed_over_all_velocities(seed, mixed):
    scene, _, _ = doppler_scene(seed, mixed)
    # those of one target: of others the likelihood lies beyond any grid
    tuples = np.array([[i, i, j] for i in (1, 2) for j in (0, i)] + [[0, 1, 1], [2, 0, 2]])
    costs = tuple_costs(scene, 0, tuples, speed=SPEED)
    positions, _ = positions_and_covariances(scene, 0, tuples)
    axis = np.linspace(-7 * SPEED, 7 * SPEED, 71)
    step = axis[1] - axis[0]
    v = np.array(list(itertools.product(axis, axis, axis)))
    log_prior = -0.5 * (v**2).sum(axis=1) / SPEED**2 - 3 * np.log(SPEED * np.sqrt(2 * np.pi))
    for one, cost, place in zip(tuples, costs, positions, strict=True):
        total, fixed = log_prior.copy(), 0.0
        for sensor, z, index in zip(scene.sensors, scene.measurements[0], one, strict=True):
            p = sensor.detection_probability
            if not index:
                fixed -= np.log(1 - p)
                continue
            nu = sensor.residual(z[index - 1], sensor.measure(np.broadcast_to(place, (len(v), 3)), v))
            total -= 0.5 * (nu @ np.linalg.inv(sensor.covariance) * nu).sum(axis=1)
            total -= 0.5 * np.linalg.slogdet(2 * np.pi * sensor.covariance)[1]
            fixed -= np.log(p * sensor.volume / sensor.false_alarm_rate)
        top = total.max()
        integral = top + np.log(np.exp(total - top).sum() * step**3)
        assert cost == pytest.approx(fixed - integral, rel=1e-7, abs=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_candidates_are_all_tuples_of_negative_cost(seed):
    scene = simulation.simulate("three-radar", seed, scans=4, range_rate_noise=1.0, false_alarms=4.0)
    tuples = all_tuples(scene)
    costs = tuple_costs(scene, 0, tuples)
    problem = build_problem(scene, 0, gate_probability=1.0)
    several = np.count_nonzero(problem.tuples, axis=1) > 1
    found = dict(zip(map(tuple, problem.tuples[several].tolist()), problem.costs[several], strict=True))
    wanted = {tuple(one): cost for one, cost in zip(tuples.tolist(), costs, strict=True) if cost < 0}
    assert found.keys() == wanted.keys()
    np.testing.assert_allclose([found[one] for one in wanted], list(wanted.values()), rtol=1e-9)


@pytest.mark.parametrize("speed", [0, -1.0, np.nan, "fast", [1, 2, 3, 4]])
def test_a_bad_speed_is_refused(speed):
    scene = simulation.simulate("three-radar", 1, scans=2)
    with pytest.raises(InvalidInputError, match="speed must be a number above 0"):
        build_problem(scene, 0, speed=speed)


def test_folded_rates_cost_around_the_interval_and_nothing_while_the_velocity_is_open():
    scene, _, _ = doppler_scene(0)
    tuples = np.array([[1, 1, 1], [1, 2, 0], [2, 2, 2]])

    def costs(folding, shift, speed):
        sensors = [
            replace(sensor, noise=np.diag(np.diag(sensor.covariance)), folding=folding) for sensor in scene.sensors
        ]
        moved = [z + [0.0, 0.0, 0.0, shift] for z in scene.measurements[0]]
        return tuple_costs(Scene(sensors, [0.0], [moved], region=REGION), 0, tuples, speed=speed)

    np.testing.assert_allclose(costs(900.0, 900.0, SPEED), costs(900.0, 0.0, SPEED), rtol=1e-9)
    np.testing.assert_allclose(costs(1e4, 0.0, SPEED), costs(None, 0.0, SPEED), rtol=1e-9)
    # of no use: uniform on the interval, whatever they are
    open_velocity = costs(300.0, 0.0, 1e3)
    np.testing.assert_allclose(costs(300.0, 77.0, 1e3), open_velocity, rtol=1e-9)
    np.testing.assert_allclose(costs(300.0, 0.0, 2e3), open_velocity, rtol=1e-9)
