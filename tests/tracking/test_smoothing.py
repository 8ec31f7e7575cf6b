"""Smoothed tracks against one large linear system, and against the truth."""

import numpy as np
import pytest

from assoc import filters
from assoc.scene import Scene
from assoc.tracking import Decision, MultiSensorTracker, smoothed
from tests.tracking import plain


@pytest.mark.slow
@pytest.mark.parametrize("own_times", [False, True])
def test_a_smoothed_track_is_the_least_squares_of_all_its_measurements(own_times):
    rng, sensor = np.random.default_rng(3), plain.sensor()
    times = np.array([0.0, 1.0, 2.5, 3.0, 5.0])
    path = np.array([300.0, 400.0, 200.0]) + times[:, None] * np.array([20.0, -10.0, 5.0])
    z = [path[k : k + 1] + rng.normal(0, 10, (1, 3)) for k in range(5)]
    z[2] = np.zeros((0, 3))
    # one scan a measurement either way; with times of their own the scan ends half a second later
    stamps = [[np.full(len(one), time)] for one, time in zip(z, times, strict=True)] if own_times else None
    scans = times + 0.5 * (own_times & (times != 2.5))
    scene = Scene([sensor], scans, [[one] for one in z], plain.REGION, measurement_times=stamps)
    motion = filters.ConstantVelocity(plain.Q_SIGMA, kind="continuous")
    tracker = MultiSensorTracker.for_scene(scene, filters.KalmanFilter(motion))
    decisions = []
    for k, time in enumerate(scans):
        ours = np.ones(len(z[k]), dtype=np.int64)
        decisions.append(Decision(k, time, (ours,), (ours > 0,)))
    frame = smoothed(tracker, scene, decisions).to_frame()
    # information form over all five states: prior, motion, measurements
    n = 6 * len(times)
    A, b = np.zeros((n, n)), np.zeros(n)
    speed = tracker.settings.initiation.speed
    prior = np.linalg.inv(np.diag([100.0] * 3 + [speed**2] * 3))
    A[:6, :6] += prior
    b[:6] += prior @ np.concatenate([z[0][0], np.zeros(3)])
    H = np.hstack([np.eye(3), np.zeros((3, 3))])
    for k in range(1, len(times)):
        one, dt = np.eye(3), times[k] - times[k - 1]
        F = np.block([[one, dt * one], [0 * one, one]])
        Q = plain.predict(np.zeros(6), np.zeros((6, 6)), dt)[1]
        G = np.hstack([-F, np.eye(6)])
        rows = slice(6 * (k - 1), 6 * (k + 1))
        A[rows, rows] += G.T @ np.linalg.inv(Q) @ G
        if len(z[k]):
            rows = slice(6 * k, 6 * (k + 1))
            A[rows, rows] += H.T @ H / 100.0
            b[rows] += H.T @ z[k][0] / 100.0
    states = np.linalg.solve(A, b).reshape(-1, 6)
    np.testing.assert_allclose(frame[["x", "y", "z"]], states[:, :3], rtol=1e-4)
    np.testing.assert_allclose(frame[["vx", "vy", "vz"]], states[:, 3:], rtol=1e-2, atol=0.05)
    sigma = np.sqrt(np.diagonal(np.linalg.inv(A)).reshape(-1, 6)[:, :3])
    np.testing.assert_allclose(frame[["sigma_x", "sigma_y", "sigma_z"]], sigma, rtol=1e-2)
    assert frame["time"].tolist() == times.tolist()
    assert frame["hits"].tolist() == [1, 2, 2, 3, 4]
    assert frame["last_detection"].tolist() == [0.0, 1.0, 1.0, 3.0, 5.0]
