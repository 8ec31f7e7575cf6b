"""Costs with a prior of positions, against integrals done by numerical quadrature, and what is grown with them."""

import itertools
import math

import numpy as np
import pytest

from assoc.costs import build_problem, tuple_costs
from assoc.errors import InvalidInputError
from assoc.scene import Scene
from assoc.sensors import BearingSensor, PositionSensor
from assoc.simulation import simulate

BOX = np.array([[-5e3, 5e3], [-4e3, 4e3], [0.0, 2e3]])


def likelihood(sensors, measured, points):
    """Density of the measurements at points (n, 3), against false alarms, times what misses say."""
    total = np.zeros(len(points))
    for sensor, z in zip(sensors, measured, strict=True):
        if z is None:
            total += math.log1p(-sensor.detection_probability)
            continue
        off = sensor.residual(np.asarray(z)[None], sensor.measure(points))
        R = sensor.covariance
        density = -0.5 * (off @ np.linalg.inv(R) * off).sum(axis=1) - 0.5 * np.linalg.slogdet(2 * math.pi * R)[1]
        total += density + math.log(sensor.detection_probability * sensor.volume / sensor.false_alarm_rate)
    return total


def integral(sensors, measured, centre, widths, steps):
    """Log of the integral over a box around a centre, by the midpoint rule."""
    axes = [c + w * (np.arange(n) + 0.5) / n * 2 - w for c, w, n in zip(centre, widths, steps, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    values = likelihood(sensors, measured, points)
    cell = np.prod([2 * w / n for w, n in zip(widths, steps, strict=True)])
    return float(np.logaddexp.reduce(values) + math.log(cell))


def test_positions_in_space_by_quadrature():
    sensors = [PositionSensor(position=[0, 0, 0], noise=s, field_of_view=BOX) for s in ([30, 40, 50], [60, 20, 30])]
    z = [[100.0, 200.0, 900.0], [130.0, 190.0, 880.0]]
    scene = Scene(sensors, [0.0], [[[one] for one in z]], BOX)
    density = 2e-9
    wanted = -(math.log(density) + integral(sensors, z, [120, 195, 890], [300, 300, 300], [60, 60, 60]))
    found = tuple_costs(scene, 0, [[1, 1]], target_density=density)
    # exact for linear sensors
    assert found == pytest.approx(wanted, abs=1e-3)
    assert build_problem(scene, 0, target_density=density).costs.min() == pytest.approx(float(found[0]))
    # a prior takes off what equation 5 gives for free
    assert found > tuple_costs(scene, 0, [[1, 1]])


def test_bearings_in_the_plane_by_quadrature():
    places = ([0, 0, 0], [3000, -500, 0], [-2500, 1000, 0])
    sensors = [BearingSensor(position=p, noise=[0.01]) for p in places]
    target = np.array([[800.0, 2500.0, 0.0]])
    z = [sensor.measure(target)[0] + 0.004 for sensor in sensors]
    scene = Scene(sensors, [0.0], [[[one] for one in z]], BOX)
    density = 3e-7
    for chosen in ([1, 1, 1], [1, 1, 0], [0, 1, 1]):
        given = [one if used else None for one, used in zip(z, chosen, strict=True)]
        # per m^2: the height, which no bearing depends on, integrates to one
        flat = integral(sensors, given, [800, 2500, 0], [900, 900, 0.5], [700, 700, 1])
        wanted = -(math.log(density) + flat)
        assert tuple_costs(scene, 0, [chosen], target_density=density) == pytest.approx(wanted, abs=0.03)


@pytest.mark.parametrize("name", ["bearing-only", "three-radar"])
@pytest.mark.parametrize("density", [1e-10, "auto"])
def test_growing_finds_what_trying_all_tuples_finds(name, density):
    values = {"targets": 4} if name == "bearing-only" else {"range_rate_noise": 2.0}
    scene = simulate(name, 3, scans=2, **values)
    for k in range(2):
        sizes = scene.scan(k).sizes
        every = [row for row in itertools.product(*(range(n + 1) for n in sizes)) if np.count_nonzero(row) > 1]
        costs = tuple_costs(scene, k, every, target_density=density)
        wanted = {row: cost for row, cost in zip(every, costs, strict=True) if cost < 0}
        problem = build_problem(scene, k, gate_probability=1.0, target_density=density)
        several = np.count_nonzero(problem.tuples, axis=1) > 1
        found = dict(zip(map(tuple, problem.tuples[several].tolist()), problem.costs[several], strict=True))
        assert found.keys() == wanted.keys() and wanted
        for row, cost in found.items():
            assert cost == pytest.approx(wanted[row], abs=1e-6)


@pytest.mark.parametrize("density", [0.0, -1.0, math.nan, math.inf, "many", True, [1.0]])
def test_densities_that_are_none(density):
    with pytest.raises(InvalidInputError, match="target_density must be a number above 0, 'auto' or None|'many'"):
        build_problem(simulate("three-radar", scans=1), 0, target_density=density)
