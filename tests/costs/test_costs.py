import numpy as np
import pytest

from assoc.costs import positions_and_covariances, tuple_costs
from assoc.errors import InvalidInputError
from assoc.scene import Scene
from assoc.sensors import Radar2D, Radar3D
from tests.costs.reference import (
    CIRCLE,
    all_tuples,
    best_fit,
    constant,
    determined,
    make_scene,
    measures_positions,
    residuals,
)
from tests.sizes import sample

MIXES = ["RRR", "PPP", "ppp", "bbb", "rrr", "RrP", "RPb", "PbP", "pRb", "bbbb", "rrrb", "hhh", "hrb"]


@sample("kinds", MIXES, every=2)
@sample("seed", range(3), every=3)
def test_costs_are_equation_5_at_the_position_scipy_finds(kinds, seed):
    scene, truth = make_scene(kinds, seed)
    tuples = all_tuples(scene)
    costs = tuple_costs(scene, 0, tuples)
    positions, _ = positions_and_covariances(scene, 0, tuples)
    compared = 0
    # the plausible ones, on which everything depends, and a few others
    for k in [*np.argsort(costs)[:12], *np.random.default_rng(seed).integers(len(tuples), size=5)]:
        one = tuples[k]
        chi, where = best_fit(scene, one, [positions[k], truth[0]])
        ours = 2 * (costs[k] - constant(scene, one))
        assert ours >= chi - 1e-6 * (1 + chi)
        # beyond any gate local minima may differ; so do mirror images below the ground
        if chi < 40 and determined(scene, one, where) and where[2] > 0:
            assert ours == pytest.approx(chi, rel=1e-6, abs=1e-5)
            compared += 1
    assert compared >= 3


@pytest.mark.parametrize("kinds", ["RRR", "RR", "PPP", "RPb", "RPr", "hh", "RPh"])
def test_position_and_covariance_are_those_of_the_likelihood(kinds):
    scene, truth = make_scene(kinds, 5, targets=1, false_alarms=0.0)
    one = np.array([[min(1, len(z)) for z in scene.measurements[0]]])
    assert measures_positions(scene, one[0])
    positions, covariances = positions_and_covariances(scene, 0, one)
    _, where = best_fit(scene, one[0], [truth[0]])
    np.testing.assert_allclose(positions[0], where, atol=1e-2)
    jacobian = np.empty((len(residuals(scene, one[0], where)), 3))
    for axis in range(3):
        step = 0.5 * np.eye(3)[axis]
        jacobian[:, axis] = residuals(scene, one[0], where + step) - residuals(scene, one[0], where - step)
    np.testing.assert_allclose(covariances[0], np.linalg.inv(jacobian.T @ jacobian), rtol=1e-3, atol=1e-3)


def test_the_region_never_moves_a_determined_tuple():
    scene, _ = make_scene("RPbb", 1)
    tuples = all_tuples(scene)
    tuples = tuples[(tuples[:, :2] > 0).any(axis=1)]
    elsewhere = Scene(scene.sensors, scene.times, scene.measurements, region=[[9e4, 9.1e4]] * 2 + [[5e4, 5e4]])
    np.testing.assert_array_equal(tuple_costs(scene, 0, tuples), tuple_costs(elsewhere, 0, tuples))


def test_two_range_azimuth_radars_take_an_open_height_from_the_region():
    # target in the plane of the radars: slant ranges do not tell the height there
    truth = np.array([[2e4, 3e4, 0.0]])
    sensors = [
        Radar2D(position=p, noise=[50, 1e-3], field_of_view=[[0, 1e5], CIRCLE]) for p in ([0, 0, 0], [4e4, 0, 0])
    ]
    scene = Scene(sensors, [0.0], [[s.measure(truth) for s in sensors]], region=[[0, 5e4], [0, 5e4], [-2000, 2000]])
    position, covariance = positions_and_covariances(scene, 0, [[1, 1]])
    np.testing.assert_allclose(position[0], truth[0], atol=100)
    assert np.isfinite(covariance).all()
    assert tuple_costs(scene, 0, [[1, 1]])[0] == pytest.approx(constant(scene, [1, 1]), abs=0.1)


def test_single_measurements_cost_nothing_and_have_a_position():
    scene, _ = make_scene("RrbPp", 3)
    singles = np.array([t for t in all_tuples(scene, least=1) if np.count_nonzero(t) == 1])
    assert (tuple_costs(scene, 0, singles) == 0).all()
    positions, covariances = positions_and_covariances(scene, 0, singles)
    assert np.isfinite(positions).all()
    assert (np.linalg.eigvalsh(covariances) > 0).all()


def test_azimuths_on_both_sides_of_pi_belong_together():
    truth = np.array([[-5e4, 0.0, 3000.0]])
    sensors = [
        Radar3D(position=[0, y, 0], noise=[50, 1e-3, 1e-3], field_of_view=[[0, 1e5], CIRCLE, [0, 1.5]])
        for y in (-1.0, 1.0)
    ]
    scene = Scene(sensors, [0.0], [[s.measure(truth) for s in sensors]])
    a, b = scene.measurements[0]
    assert a[0, 1] * b[0, 1] < 0
    assert tuple_costs(scene, 0, [[1, 1]])[0] == pytest.approx(constant(scene, [1, 1]), abs=1e-6)


@pytest.mark.parametrize(
    ("tuples", "words"),
    [
        ([[1, 99]], "index 99 for sensor 1"),
        ([[-1, 1]], "index -1 for sensor 0"),
        ([[0, 0]], "no measurement"),
        ([[1, 1, 1]], "shape"),
        ([[1.0, 1.0]], "integers"),
    ],
)
def test_wrong_tuples_are_refused(tuples, words):
    scene, _ = make_scene("RP", 0)
    with pytest.raises(InvalidInputError, match=words):
        tuple_costs(scene, 0, tuples)
