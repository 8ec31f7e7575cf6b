import math

import numpy as np
import pytest

from assoc.costs import tuple_costs
from assoc.scene import Scene
from assoc.sensors import BearingSensor, Radar2D, Radar3D
from tests.costs.dense_starts import excess
from tests.costs.reference import CIRCLE, constant, residuals


@pytest.mark.slow
@pytest.mark.parametrize("count", [120])
def test_no_start_leads_to_a_much_better_position(count):
    found = [one[1] for number in range(count) if (one := excess(11, number)) is not None]
    assert len(found) > count // 3
    # a local minimum that costs less than one nat does not price a pair out
    assert max(found) < 2.0
    assert np.mean(np.array(found) > 0.04) < 0.05


@pytest.mark.parametrize("number", [1413, 3497, 4974, 5035, 8812])
def test_fits_that_could_not_turn_around_a_sensor(number):
    # found among 10,000: at a radar's zenith, and beside a bearing sensor, up to 1,575 above the best
    found = excess(7, number)
    assert found is not None and found[1] < 0.04


def test_a_target_above_a_radar_or_a_bearing_sensor():
    """Azimuths jump there: the truth must not be priced out."""
    rng = np.random.default_rng(4)
    for _ in range(60):
        truth = np.array([2e3, -3e3, rng.uniform(1e3, 8e3)])
        aside = rng.uniform(5.0, 80.0) * np.array([math.cos(turn := rng.uniform(-math.pi, math.pi)), math.sin(turn)])
        below = np.array([truth[0] + aside[0], truth[1] + aside[1], 0.0])
        zenith = Radar3D(
            position=below, noise=[100.0, 0.02, 0.03], field_of_view=[[0.0, 1e5], CIRCLE, [-math.pi / 2, math.pi / 2]]
        )
        near, far = (BearingSensor(position=place, noise=[0.01]) for place in (below, [-9e3, 4e3, 0.0]))
        slant = Radar2D(position=[1.2e4, 5e3, 0.0], noise=[80.0, 5e-3], field_of_view=[[0.0, 1e5], CIRCLE])
        for sensors in ([zenith, far], [zenith, near, far], [near, slant], [near, far, slant]):
            measured = [one.measure(truth[None]) for one in sensors]
            for one, z in zip(sensors, measured, strict=True):
                z += rng.normal(size=z.shape) * np.sqrt(np.diag(one.covariance))
                if one is zenith:
                    z[:, 2] = np.clip(z[:, 2], -math.pi / 2, math.pi / 2)
            scene = Scene(sensors, [0.0], [measured], region=[[-2e4, 2e4], [-2e4, 2e4], [0.0, 1e4]])
            one = np.ones((1, len(sensors)), dtype=np.int64)
            ours = 2.0 * (tuple_costs(scene, 0, one)[0] - constant(scene, one[0]))
            assert ours <= np.sum(residuals(scene, one[0], truth) ** 2) + 1.0
