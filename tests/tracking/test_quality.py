"""Quality of tracks: NIS and NEES against their mean, hits by sensor, alarms."""

from dataclasses import replace

import numpy as np
import pytest

from assoc import filters
from assoc.filters import Gaussian
from assoc.simulation.observation import observe
from assoc.tracking import TRACKERS, track_scene
from assoc.tracking.quality import Qualities
from tests.tracking import plain


def scene_of(sensors, seed=0, scans=60):
    """Three targets in straight flight, a second from scan to scan."""
    rng, times = np.random.default_rng(seed), np.arange(float(scans))
    start, velocity = np.array([[200.0, 200, 200], [200.0, 500, 300], [200.0, 800, 100]]), np.array([8.0, 1.0, 0.5])
    paths = start + times[:, None, None] * velocity
    return observe(sensors, times, [np.arange(3)] * scans, list(paths), rng, region=plain.REGION)


def tracked(scene, declared, **options):
    motion = filters.ConstantVelocity(0.1, kind="continuous")
    kind = TRACKERS[options.pop("name", "multi-sensor")]
    tracker = kind(declared, filters.KalmanFilter(motion), region=plain.REGION, **options)
    table, _ = track_scene(tracker, replace(scene, sensors=declared))
    return table


@pytest.mark.parametrize("name", ["multi-sensor", "joint-probabilistic", "mht"])
def test_a_sound_tracker_has_nis_and_nees_of_1_and_no_alarm(name):
    sensors = [plain.sensor(0.9), plain.sensor(0.6)]
    table = tracked(scene_of(sensors), sensors, name=name)
    frame = table.to_frame()
    late = frame[frame["time"] > 20]
    assert late["nis"].mean() == pytest.approx(1.0, abs=0.2)
    assert late["nees"].mean() == pytest.approx(1.0, abs=0.5)
    last = frame[frame["time"] == 59.0]
    assert len(last) == 3
    assert last["consistent"].all()
    # here a poor first track of a target is lost, and its id goes on with the next one
    taken_up = set(frame.groupby("track_id")["started"].nunique().loc[lambda count: count > 1].index)
    assert not set(last["track_id"]) & set(table.inconsistent()) - taken_up
    # detections are counted from the first of an id
    seconds = 60 - last["track_id"].map(frame.groupby("track_id")["started"].min())
    np.testing.assert_allclose(last["hits_1"] / seconds, 0.9, atol=0.15)
    np.testing.assert_allclose(last["hits_2"] / seconds, 0.6, atol=0.2)


def test_noise_of_twice_the_declared_raises_an_alarm():
    table = tracked(scene_of([plain.sensor(0.9, sigma=20.0)]), [plain.sensor(0.9, sigma=10.0)])
    found = table.inconsistent()
    assert len(found) >= 3
    assert all(2.0 < nis < 5.0 for nis in found.values())


def test_nis_is_that_of_the_prediction_also_at_times_of_its_own():
    """A track and one plot 0.7 s after the last scan, by the formula."""
    sensor = plain.sensor()
    mean, cov = np.array([500.0, 500, 250, 20, -10, 5]), np.diag([60.0] * 3 + [20.0] * 3)
    motion = filters.ConstantVelocity(plain.Q_SIGMA, kind="continuous")
    tracker = TRACKERS["nearest-neighbour"]([sensor], filters.KalmanFilter(motion), region=plain.REGION)
    tracker.begin(0.0, Gaussian(mean[None], cov[None]))
    before, z, times = tracker.state, [np.array([[520.0, 490.0, 260.0]])], [np.array([0.7])]
    step = tracker.step(1.0, z, times)
    assert step.assigned[0].tolist() == [1]
    qualities = Qualities(1)
    qualities.after(tracker, before, step, z, times)
    there, spread = plain.predict(mean, cov, 0.7)
    off = z[0][0] - there[:3]
    expected = off @ np.linalg.solve(spread[:3, :3] + sensor.covariance, off) / 3
    assert qualities.of_track(1).nis == pytest.approx(expected)
    assert qualities.of_track(1).hits == (1,)
