"""A sensor of a user's own class, beside the one built in that measures the same."""

import math

import numpy as np
import pytest

from assoc.costs import build_problem, positions_and_covariances, tuple_costs
from assoc.sensors import Radar3D, Sensor
from assoc.simulation.observation import observe


class Lidar(Sensor):
    """Range, azimuth and elevation, as a user writes it: what it measures, and which of it are angles."""

    kind, components, angular = "lidar", ("range", "azimuth", "elevation"), (False, True, False)

    def measure(self, positions, velocities=None):
        x, y, z = (positions - self.position).T
        return np.stack([np.sqrt(x**2 + y**2 + z**2), np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))], axis=1)


OPTIONS = {
    "noise": [40.0, 3e-3, 3e-3], "false_alarm_rate": 3.0,
    "field_of_view": [[0, 6e4], [-math.pi, math.pi], [-0.2, 1.2]],
}  # fmt: skip
PLACES = ([-2e4, 0.0, 0.0], [2e4, 5e3, 0.0], [0.0, -2e4, 0.0])
REGION = [[-2e4, 2e4], [-2e4, 2e4], [0.0, 1e4]]


def scenes(own=(0,), steps=1, targets=4):
    """The same measurements by radars, and with sensors of one's own in place of some."""
    radars = [Radar3D(position=place, **OPTIONS) for place in PLACES]
    rng, times = np.random.default_rng(0), 2.0 * np.arange(steps)
    start = np.column_stack([rng.uniform(-1.2e4, 1.2e4, (targets, 2)), rng.uniform(3e3, 8e3, targets)])
    velocity = rng.normal(0, 100, (targets, 3)) * [1, 1, 0]
    ids = [np.arange(targets)] * steps
    scene = observe(radars, times, ids, [start + t * velocity for t in times], rng, region=REGION)
    sensors = [Lidar(position=place, **OPTIONS) if s in own else radars[s] for s, place in enumerate(PLACES)]
    return scene, type(scene)(sensors, times, scene.measurements, region=REGION, truth=scene.truth)


@pytest.mark.parametrize("own", [(0,), (0, 1, 2)])
def test_the_same_problem(own):
    radars, mine = scenes(own)
    one, other = build_problem(radars, 0), build_problem(mine, 0)
    order, same = (np.lexsort(problem.tuples.T) for problem in (one, other))
    assert len(one.tuples) > 10
    np.testing.assert_array_equal(one.tuples[order], other.tuples[same])
    np.testing.assert_allclose(one.costs[order], other.costs[same], atol=1e-5)
    tuples = np.vstack([one.tuples, [[1, 0, 0], [0, 2, 0]]])
    np.testing.assert_allclose(tuple_costs(mine, 0, tuples), tuple_costs(radars, 0, tuples), atol=1e-5)
    for found, wanted in zip(*(positions_and_covariances(scene, 0, tuples) for scene in (mine, radars)), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-4, atol=0.05)
