"""Scene families hold what they promise; the problems made of them have the expected size."""

import numpy as np
import pytest

from assoc.costs import build_problem
from experiments.common.instances import scenes
from tests import oracles


def test_same_seed_same_scene() -> None:
    one, two, other = scenes.ghost(10, 3).scan(0), scenes.ghost(10, 3).scan(0), scenes.ghost(10, 4).scan(0)
    assert all((a == b).all() for a, b in zip(one.measurements, two.measurements, strict=True))
    assert (
        one.measurements[0].shape != other.measurements[0].shape or (one.measurements[0] != other.measurements[0]).any()
    )


@pytest.mark.parametrize(("make", "probability"), [(scenes.gated, 0.9), (scenes.radar_field, 0.9)])
def test_detections_and_false_alarms(make, probability: float) -> None:  # type: ignore[no-untyped-def]
    scene = make(3, 300, 0) if make is scenes.gated else make(300, 0)
    scan = scene.scan(0)
    assert scan.sources is not None
    assert scan.truth_positions is not None
    for sensor, z, source in zip(scene.sensors, scan.measurements, scan.sources, strict=True):
        assert (source >= 0).sum() == pytest.approx(300 * probability, abs=25)
        assert (source < 0).sum() == pytest.approx(sensor.false_alarm_rate, abs=4 * sensor.false_alarm_rate**0.5)
        seen = source >= 0
        residual = sensor.residual(z[seen], sensor.measure(scan.truth_positions[source[seen]]))
        normalised = residual / np.sqrt(np.diag(sensor.covariance))
        assert np.abs(normalised.mean(axis=0)).max() < 0.3
        assert normalised.std(axis=0) == pytest.approx(np.ones(sensor.dim), abs=0.15)
        assert sensor.in_view(z[~seen]).all()


def test_gated_has_the_published_number_of_tuples() -> None:
    assert 1_100 < build_problem(scenes.gated(3, 100, 0), 0).num_tuples < 1_600
    assert 4_500 < build_problem(scenes.ghost(40, 0), 0).num_tuples < 7_000


def test_ghost_truth_is_not_better_than_the_optimum() -> None:
    scene = scenes.ghost(12, 1)
    scan = scene.scan(0)
    problem = build_problem(scene, 0)
    assert scan.sources is not None
    assert scan.truth_positions is not None
    price = {tuple(row): cost for row, cost in zip(problem.tuples.tolist(), problem.costs, strict=True)}
    truth = 0.0
    for target in range(12):
        key = [0, 0, 0]
        for s, source in enumerate(scan.sources):
            hit = np.flatnonzero(source == target)
            key[s] = int(hit[0]) + 1 if len(hit) else 0
        # a tuple outside the gate leaves its measurements as false alarms at 0
        truth += price.get(tuple(key), 0.0)
    best = oracles.milp_optimum(problem)
    assert best <= truth + 1e-9
    assert best == pytest.approx(truth, rel=0.2)
