"""Tracks of targets that a sensor does not resolve."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from assoc.costs.tracks.unresolved import (
    Looks,
    explained,
    narrowed,
    offers,
    resolutions,
    unresolved_probability,
)  # fmt: skip
from assoc.filters import ConstantVelocity, KalmanFilter
from assoc.filters.base import Expected
from assoc.sensors import PositionSensor
from assoc.simulation.observation import observe
from assoc.tracking import TRACKERS, MultiSensorTracker
from assoc.tracking.records.unresolved import SURE, Shared, Unresolved

SENSOR = PositionSensor(
    position=[0.0, 0.0, 0.0], noise=[10.0, 10.0], detection_probability=0.95, false_alarm_rate=2.0,
    field_of_view=[[-5e3, 5e3], [-5e3, 5e3]], resolution=[80.0, 80.0],
)  # fmt: skip
REGION = [[-5e3, 5e3], [-5e3, 5e3], [0.0, 1.0]]
UNSAID = replace(SENSOR, resolution=None)


def flight(sensor=SENSOR, seed=0, scans=70):
    """Two targets that come from 600 m apart to 30 m, fly so for 20 scans, and part again."""
    t = np.arange(float(scans))
    side = 15.0 + np.maximum(np.abs(t - t[-1] / 2) - 10.0, 0.0) * 12.0
    places = np.stack([np.stack([60.0 * (t - 35.0), sign * side, 0.0 * t], axis=1) for sign in (-1, 1)], axis=1)
    return observe(
        [sensor], t, [np.arange(2)] * scans, list(places), np.random.default_rng(seed), region=REGION
    ), places


def ids_of(scene, kind, sensor, path=None, **options):
    """Ids of the tracks within 60 m of each target, before they meet and after; the tracker; fewest tracks between."""
    made = lambda: kind([sensor], KalmanFilter(ConstantVelocity(1.0, dimensions=2, kind="continuous")),  # noqa: E731
                        region=REGION, **options)  # fmt: skip
    tracker, found, fewest = made(), [], 9
    for k, time in enumerate(scene.times):
        tracker.step(time, scene.measurements[k])
        if path is not None and k == 35:
            tracker.save(path)
            tracker = made()
            tracker.restore(path)
        if 20 <= k <= 50:
            fewest = min(fewest, sum(track.reported for track in tracker.tracks))
        if k in (15, len(scene.times) - 1):
            tracks = [track for track in tracker.tracks if track.reported]
            off = [[np.linalg.norm(track.position - place) for track in tracks] for place in scene.truth.positions[k]]
            found.append([tracks[int(np.argmin(row))].track_id if min(row) < 60.0 else None for row in off])
    return found, tracker, fewest


@pytest.mark.parametrize("name", ["multi-sensor", "mht", "joint-probabilistic", "nearest-neighbour", "mht-hypothesis"])
def test_both_tracks_live_through_plots_of_both(name, tmp_path):
    scene, _ = flight()
    (before, after), tracker, fewest = ids_of(scene, TRACKERS[name], SENSOR)
    assert None not in before and sorted(before) == sorted(after) and len(set(after)) == 2
    # none began beside them, and a tracker saved in between comes to the same
    assert sum(track.reported for track in tracker.tracks) == fewest == 2
    again = ids_of(scene, TRACKERS[name], SENSOR, path=tmp_path / "tracker.npz")[0]
    assert again == [before, after]
    # without the knowledge one of them is lost on the way
    assert ids_of(scene, TRACKERS[name], UNSAID)[2] < 2


def test_a_resolution_that_nobody_said_is_learnt_where_there_is_one():
    found, tracker, _ = ids_of(flight()[0], MultiSensorTracker, UNSAID, adapt=True)
    assert sorted(found[0]) == sorted(found[1])
    weights = tracker.state.unresolved.weights(0)
    assert weights[0] < 0.01
    # limits of lengths and angles: a sensor of positions has lengths alone
    assert 50.0 <= resolutions(UNSAID)[weights.argmax(), 0] <= 120.0
    found, tracker, _ = ids_of(flight(UNSAID)[0], MultiSensorTracker, UNSAID, adapt=True)
    assert sorted(found[0]) == sorted(found[1]) and tracker.state.unresolved.weights(0)[0] > 0.99
    assert tracker.state.unresolved.confirmed.tolist() == sorted(found[0])


def test_steps_decide_every_measurement_once():
    scene, _ = flight()
    for name in ("multi-sensor", "mht"):
        tracker = TRACKERS[name].for_scene(scene)
        decided = []
        for k, time in enumerate(scene.times):
            step = tracker.step(time, scene.measurements[k])
            assert [len(ids) for ids in step.assigned] == [len(z) for z in scene.measurements[k]]
            decided += step.final
        for decision in [*decided, *tracker.flush()]:
            assert [len(ids) for ids in decision.assigned] == [len(z) for z in scene.measurements[decision.scan]]


def test_probability_against_sampling():
    rng = np.random.default_rng(0)
    difference, covariance, limits = (
        np.array([30.0, -50.0]),
        np.diag([400.0, 900.0]),
        np.array([[60.0, 40.0], [0, 9.0]]),
    )
    drawn = rng.multivariate_normal(difference, covariance, 200_000)
    expected = (np.abs(drawn)[:, None] < limits).all(axis=2).mean(axis=0)
    found = unresolved_probability(difference[None], covariance[None], limits)
    np.testing.assert_allclose(found[0], expected, atol=0.005)


def test_narrowed_differences_against_sampling():
    rng = np.random.default_rng(0)
    difference, spread = np.array([[30.0, -5.0]]), np.array([20.0, 30.0])
    limits, weights = np.array([[40.0, 10.0], [25.0, np.inf]]), np.array([[0.3, 0.7]])
    precision, pull = narrowed(difference, np.diag(spread**2)[None], limits, weights)
    drawn = rng.normal(difference, spread, (400_000, 2))
    for axis in range(2):
        parts = [drawn[np.abs(drawn[:, axis]) < limit, axis] for limit in limits[:, axis]]
        mean = weights[0] @ [part.mean() for part in parts]
        variance = weights[0] @ [(part**2).mean() for part in parts] - mean**2
        assert 1.0 / (precision[0, axis] + spread[axis] ** -2) == pytest.approx(variance, rel=0.02)
        moved = pull[0, axis] / (precision[0, axis] + spread[axis] ** -2)
        assert difference[0, axis] + moved == pytest.approx(mean, abs=0.1)


def test_offsets_are_those_of_the_joint_update():
    """Two plots with these offsets move both tracks as one measurement of midpoint and difference does."""
    rng = np.random.default_rng(1)
    root = rng.normal(size=(2, 2))
    C, R = root @ root.T + np.eye(2), np.diag([2.0, 0.5])
    sensor = replace(SENSOR, noise=R, false_alarm_rate=1e-3)
    a, b, z, precision = np.array([1.0, 2.0]), np.array([-1.5, 2.5]), np.array([0.4, 1.7]), np.array([0.3, 0.2])
    apart = np.array([0.5, -0.2])
    looks = Looks(Expected(a[None], (C + R)[None]), Expected(b[None], (C + R)[None]), (a - b)[None], 2.0 * C[None])
    pull = precision * (apart - (a - b))
    at = offers(sensor, z, looks, precision, pull)
    gain = C @ np.linalg.inv(C + R)
    found = [a + gain @ (at[0] - a), b + gain @ (at[1] - b)]
    # stacked: the mean of both, with the spread of its place between them, and of their difference
    P, eye = np.kron(np.eye(2), C), np.eye(2)
    H = np.block([[0.5 * eye, 0.5 * eye], [eye, -eye]])
    place = R + (np.outer(a - b, a - b) + 2.0 * C) / 12.0
    noise = np.block([[place, 0.0 * eye], [0.0 * eye, np.diag(1.0 / precision)]])
    x = np.concatenate([a, b])
    x = x + P @ H.T @ np.linalg.solve(H @ P @ H.T + noise, np.concatenate([z, apart]) - H @ x)
    np.testing.assert_allclose(np.concatenate(found), x, atol=1e-9)


def test_plots_are_explained_as_a_sum_over_events():
    """Both likelihoods against a sum over all events, written out, beside false alarms alone."""
    z, P, R = np.array([[2.0, 1.0], [9.0, -3.0]]), SENSOR.detection_probability, 100.0 * np.eye(2)
    a, b, C = np.array([3.0, 4.0]), np.array([-8.0, 1.0]), 40.0 * np.eye(2)
    clutter = np.array([-12.0, -11.0])
    looks = Looks(Expected(a[None], (C + R)[None]), Expected(b[None], (C + R)[None]), (a - b)[None], 2.0 * C[None])
    log_one, log_two, plot = explained(SENSOR, z, clutter, looks)
    f = lambda at, S: np.array([multivariate_normal(at, S).pdf(one) for one in z]) / np.exp(clutter)  # noqa: E731
    of_a, of_b = f(a, C + R), f(b, C + R)
    two = (1 - P) ** 2 + P * (1 - P) * (of_a.sum() + of_b.sum()) + P**2 * (of_a[0] * of_b[1] + of_a[1] * of_b[0])
    middle = f((a + b) / 2, R + C / 2 + (np.outer(a - b, a - b) + 2.0 * C) / 12.0)
    one = (1 - P) ** 2 + (1 - (1 - P) ** 2) * middle.sum()
    np.testing.assert_allclose([log_one[0], log_two[0]], np.log([one, two]), rtol=1e-9)
    assert plot.tolist() == [int(middle.argmax())]


def test_only_pairs_that_were_seen_apart_are_two():
    known = Unresolved.none(1)
    assert known.weights(0)[0] > 0.9 and known.weights(0).sum() == pytest.approx(1.0)
    at = np.array([[0.0, 0.0], [0.0, 25.0]])
    tracker = MultiSensorTracker([SENSOR], KalmanFilter(ConstantVelocity(1.0, dimensions=2)), region=REGION)
    rng = np.random.default_rng(0)
    for k in range(12):
        # one plot in each scan, then both
        tracker.step(float(k), [at[:1] + rng.normal(0.0, 10.0, (1, 2))])
    assert not len(tracker.state.unresolved.ids)
    for k in range(12, 20):
        tracker.step(float(k), [at + rng.normal(0.0, 10.0, (2, 2))])
    assert tracker.state.unresolved.apart.tolist() == [SURE]


def test_tracks_of_unresolved_pairs_have_no_plots_of_their_own():
    """Each track of a pair that a sensor did not resolve, pair by pair; tracks that are gone are in no row."""
    pairs, probability = np.array([[3, 7], [7, 9], [4, 8]]), np.array([[0.9, 0.1], [0.2, 0.7], [0.6, 0.6]])
    hidden = Shared(pairs, probability).hidden(np.array([3, 5, 7, 8, 9]))
    assert hidden.tolist() == [[True, False], [False, False], [True, True], [True, True], [False, True]]
