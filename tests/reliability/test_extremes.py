"""Costs and positions at the edges of what sensors can deliver: finite, and the best where that is defined."""

import numpy as np
import pytest

from assoc.association import associate
from assoc.costs import build_problem, positions_and_covariances, tuple_costs
from tests.costs.reference import all_tuples, constant, measures_positions, residuals
from tests.reliability.scenes import draw
from tests.sizes import few_or_all

# angles of several turns, and targets beyond every view, are warned of
pytestmark = pytest.mark.filterwarnings("error", "ignore::assoc.errors.AssocWarning")


def clear_of_sensors(scene, one, target, scale):
    """Whether no sensor of the tuple that measures angles sits on the target: there angles mean nothing."""
    return all(
        np.hypot(*(target - sensor.position)[:2]) > 1e-3 * scale
        for sensor, index in zip(scene.sensors, one, strict=True)
        if index and sensor.kind != "position"
    )


@few_or_all("count", 25, 250)
def test_everything_is_finite(count):
    for number in range(count):
        scene, _, _ = draw(11, number)
        tuples = all_tuples(scene, least=1)[:2000]
        costs = tuple_costs(scene, 0, tuples)
        positions, covariances = positions_and_covariances(scene, 0, tuples)
        assert np.isfinite(costs).all(), number
        assert np.isfinite(positions).all() and np.isfinite(covariances).all(), number
        assert (np.diagonal(covariances, axis1=1, axis2=2) > 0).all(), number
        problem = build_problem(scene, 0)
        listed = dict(zip(map(tuple, tuples.tolist()), costs.tolist(), strict=True))
        for row, cost in zip(problem.tuples.tolist(), problem.costs.tolist(), strict=True):
            if sum(i > 0 for i in row) >= 2:
                assert cost == pytest.approx(listed[tuple(row)], rel=1e-6, abs=1e-6), number
        assert associate(scene).solutions[0].status == "optimal", number


@few_or_all("count", 30, 250)
def test_the_fit_is_no_worse_than_the_truth(count):
    """From a millimetre to a million kilometres: the position found explains the measurements best."""
    judged = 0
    for number in range(count):
        scene, truth, scale = draw(12, number)
        # angles as wide as 0.3 rad have several optima
        if any(np.sqrt(s.covariance[a, a]) > 0.1 for s in scene.sensors for a in range(s.dim) if s.angular[a]):
            continue
        tuples = [one for one in all_tuples(scene)[:300].tolist() if measures_positions(scene, one)]
        if not tuples:
            continue
        for one, cost in zip(tuples, tuple_costs(scene, 0, tuples).tolist(), strict=True):
            for target in truth:
                if clear_of_sensors(scene, one, target, scale):
                    at_truth = residuals(scene, one, target)
                    if at_truth @ at_truth < 60.0:
                        least = 0.5 * at_truth @ at_truth + constant(scene, one)
                        assert cost <= least + 1e-6 * max(1.0, abs(least)), (number, one)
                        judged += 1
    assert judged > 1.2 * count
