import math

import numpy as np
import pytest

from assoc.costs import tuple_costs
from assoc.scene import Scene
from assoc.sensors import PositionSensor, Radar2D
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


def test_radar_beside_its_target_and_a_position_sensor():
    """A range bends within the noise of what it is compared with: the truth must not be priced out."""
    rng = np.random.default_rng(2)
    for distance in (100.0, 400.0, 900.0):
        for turn in rng.uniform(-math.pi, math.pi, 8):
            truth = np.array([3e3, -2e3, 100.0])
            place = truth + [distance * math.cos(turn), distance * math.sin(turn), -100.0]
            radar = Radar2D(position=place, noise=[10.0, 2e-3], field_of_view=[[0.0, 1e5], CIRCLE])
            plane = PositionSensor(position=np.zeros(3), noise=[100.0, 100.0], field_of_view=[[-1e5, 1e5]] * 2)
            measured = [sensor.measure(truth[None]) for sensor in (radar, plane)]
            measured[1] += rng.normal(size=(1, 2)) * 80.0
            scene = Scene([radar, plane], [0.0], [measured], region=[[-2e4, 2e4], [-2e4, 2e4], [0.0, 1e4]])
            one = np.array([[1, 1]])
            ours = 2.0 * (tuple_costs(scene, 0, one)[0] - constant(scene, one[0]))
            assert ours <= np.sum(residuals(scene, one[0], truth) ** 2) + 1.0
