"""Targets that a sensor does not resolve give one measurement."""

import math
from dataclasses import replace

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.scene.scene import Scene
from assoc.sensors import PositionSensor, Radar3D
from assoc.simulation.observation import observe, resolved

SENSOR = PositionSensor(
    position=[0.0, 0.0, 0.0], noise=[1e-3, 1e-3], detection_probability=1.0 - 1e-12, false_alarm_rate=1e-9,
    field_of_view=[[-1e3, 1e3], [-1e3, 1e3]], resolution=[30.0, 10.0],
)  # fmt: skip
RADAR = Radar3D(
    position=[0.0, 0.0, 0.0], noise=[40.0, 2e-3, 2e-3, 1.0], resolution=[150.0, 0.02, math.inf, 5.0],
    field_of_view=[[0.0, 8e4], [-math.pi, math.pi], [-0.05, 1.0], [-300.0, 300.0]],
)  # fmt: skip


def test_a_resolution_is_checked_and_belongs_to_the_sensor():
    assert RADAR != replace(RADAR, resolution=None) and RADAR == replace(RADAR)
    assert RADAR.position_part.resolution.tolist() == [150.0, 0.02, math.inf]
    for wrong in ([150.0, 0.02], [150.0, -1.0, 1.0, 1.0], [150.0, math.nan, 1.0, 1.0]):
        with pytest.raises(
            InvalidInputError, match="resolution must be 4 numbers of at least 0, one for each of range"
        ):
            replace(RADAR, resolution=wrong)


def test_scenes_with_and_without_a_resolution(tmp_path):
    plain = replace(SENSOR, resolution=None)
    for version, sensors in ((5, [RADAR, SENSOR, plain]), (1, [plain])):
        scene = Scene(sensors, [0.0], [[np.zeros((0, sensor.dim)) for sensor in sensors]], [[-1e3, 1e3]] * 2 + [[0, 1]])
        scene.save(tmp_path / "scene.npz")
        with np.load(tmp_path / "scene.npz") as file:
            assert int(file["version"]) == version
        assert list(Scene.load(tmp_path / "scene.npz").sensors) == sensors


def test_simulated_targets_closer_in_all_components_give_one_measurement_between_them():
    # the second is closer than both limits, the third farther in y alone, the fourth in x alone
    at = np.array([[0.0, 0, 0], [20.0, 5, 0], [0.0, 30, 0], [-40.0, 0, 0]])
    scene = observe([SENSOR], np.arange(200.0), [np.arange(4)] * 200, [at] * 200, np.random.default_rng(0))
    shares = []
    for z, source in zip(scene.measurements, scene.truth.sources, strict=True):
        assert len(z[0]) == 3
        named = dict(zip(source[0].tolist(), z[0], strict=True))
        np.testing.assert_allclose([named[2], named[3]], at[2:, :2], atol=0.01)
        (one,) = (i for i in (0, 1) if i in named)
        share = named[one] @ at[1, :2] / (at[1, :2] @ at[1, :2])
        np.testing.assert_allclose(named[one], share * at[1, :2], atol=0.01)
        assert (share > 0.5) == (one == 1)
        shares.append(share)
    # exponential strengths: the share of the second is uniform
    assert abs(np.mean(shares) - 0.5) < 0.08 and abs(np.std(shares) - 12**-0.5) < 0.03


def test_targets_seen_in_different_turns_are_not_merged():
    exact = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]])
    kept, _ = resolved(SENSOR, exact, np.array([0.0, 0.1, 5.0]), 5.0, np.random.default_rng(0))
    assert kept.sum() == 2 and kept[2]
