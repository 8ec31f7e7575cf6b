"""Radars whose range rates fold, and that are blind across their line of sight."""

import math
from dataclasses import replace

import numpy as np
import pytest

from assoc.costs.views import Views
from assoc.filters import ConstantVelocity, ExtendedKalmanFilter
from assoc.filters.state import gaussian
from assoc.sensors import Radar3D
from assoc.simulation.observation import observe
from assoc.tracking import MultiSensorTracker

RADAR = Radar3D(
    position=[0.0, 0.0, 0.0], noise=[40.0, 2e-3, 2e-3, 1.0], false_alarm_rate=2.0,
    field_of_view=[[0.0, 8e4], [-math.pi, math.pi], [-0.05, 1.0], [-45.0, 45.0]],
)  # fmt: skip


def flight(sensor, steps=15):
    times = 2.0 * np.arange(steps)
    velocity = np.array([[-170.0, 90.0, 0.0], [60.0, 140.0, 0.0]])
    places = [np.array([[2e4, 1e4, 4e3], [-9e3, 1e4, 5e3]]) + t * velocity for t in times]
    rng = np.random.default_rng(0)
    return observe([sensor], times, [np.arange(2)] * steps, places, rng, velocities=[velocity] * steps), velocity


def speeds(sensor, scene, **options):
    tracker = MultiSensorTracker.for_scene(replace(scene, sensors=[sensor]), **options)
    for k in range(scene.num_scans):
        tracker.step(scene.times[k], scene.measurements[k])
    found = [track.velocity for track in tracker.tracks if track.confirmed]
    return tracker, np.array(sorted(found, key=lambda v: v[0])).reshape(-1, 3)


def test_folded_rates_are_unfolded_by_tracks_and_taken_to_fold_where_nobody_said():
    scene, truth = flight(replace(RADAR, folding=90.0))
    _, declared = speeds(replace(RADAR, folding=90.0), scene)
    tracker, assumed = speeds(RADAR, scene, adapt=True)
    _, wrong = speeds(replace(RADAR, folding=math.inf), scene, adapt=True)
    for found in (declared, assumed):
        np.testing.assert_allclose(found, truth, atol=12.0)
    assert wrong.shape != truth.shape or np.abs(wrong - truth).max() > 30.0
    assert "fold at 90 m/s" in tracker.health.verdicts[0]
    for other in (replace(RADAR, folding=90.0), replace(RADAR, folding=math.inf)):
        assert "fold" not in str(speeds(other, scene, adapt=True)[0].health)


def test_misses_in_the_notch_say_nothing():
    at = np.array([1e4, 0.0, 0.0])
    mean = np.array([[*at, 0.0, 150.0, 0.0], [*at, 90.0, 150.0, 0.0], [*at, 40.0, 150.0, 0.0]])
    states = gaussian(mean, np.repeat(np.diag([100.0] * 3 + [4.0] * 3)[None], 3, axis=0))
    blind = replace(RADAR, notch=15.0)
    for sensor, seen in ((RADAR, [1, 1, 1]), (blind, [0, 1, 1]), (replace(blind, folding=90.0), [0, 0, 1])):
        np.testing.assert_allclose(Views([sensor], (0, 1, 2)).shares(states)[:, 0], seen, atol=1e-3)
    # half a notch away from its edge by one standard deviation: the normal distribution's share
    edge = gaussian(np.array([[*at, 17.0, 0.0, 0.0]]), np.diag([1e-4] * 3 + [4.0] * 3)[None])
    assert Views([blind], (0, 1, 2)).shares(edge)[0, 0] == pytest.approx(0.8413, abs=1e-4)


@pytest.mark.parametrize("sectors", [None, [[-0.5, 0.5]]])
def test_a_track_in_the_notch_is_not_held_to_be_missed_at_one_instant_or_in_a_sector(sectors):
    lost = []
    for notch in (0.0, 15.0):
        motion = ConstantVelocity(1.0, kind="continuous")
        region = [[-3e4, 3e4], [-3e4, 3e4], [0.0, 1e4]]
        tracker = MultiSensorTracker([replace(RADAR, notch=notch)], ExtendedKalmanFilter(motion), region=region)
        tracker.begin(
            0.0, gaussian(np.array([[1e4, 0.0, 0.0, 0.0, 150.0, 0.0]]), np.diag([100.0] * 3 + [4.0] * 3)[None])
        )
        before = tracker.tracks[0].score
        tracker.step(1.0, [np.zeros((0, 4))], sectors=sectors)
        lost.append(before - tracker.tracks[0].score)
    assert lost[1] < 0.01 < 1.0 < lost[0]
