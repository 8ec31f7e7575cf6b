"""Measurements with times of their own, against a plain Kalman filter, an enumeration and simultaneous scans."""

import math

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.filters import ConstantVelocity, KalmanFilter
from assoc.simulation import simulate
from assoc.tracking import TRACKERS, Initiation, LifeCycle
from tests.sizes import sample
from tests.tracking import plain

KINDS = ["multi-sensor", "static", "mht", "mht-hypothesis", "nearest-neighbour", "joint-probabilistic"]
SENSORS = [plain.sensor(0.8, 1e-3, 10.0), plain.sensor(0.9, 1e-3, 15.0), plain.sensor(0.7, 1e-3, 5.0)]
PLACE, VELOCITY = np.array([500.0, 500.0, 250.0]), np.array([20.0, -10.0, 5.0])


def make(kind, sensors=SENSORS, **options):
    options = {
        "life_cycle": LifeCycle(missed_probability=1e-9),
        "initiation": Initiation(speed=plain.SPEED, birth_rate=plain.BIRTH, widest=1.0),
        "gate_probability": 1 - 1e-9,
        **options,
    }
    return TRACKERS[kind](sensors, KalmanFilter(ConstantVelocity(plain.Q_SIGMA, kind="continuous")), **options)


def at(t):
    return PLACE + t * VELOCITY


def scans(rng, count):
    """One measurement of each sensor in each second, in an order of its own."""
    made = []
    for k in range(count):
        times = k + rng.uniform(0.0, 1.0, 3)
        made.append((k + 1.0, [rng.normal(at(t), s.noise)[None] for t, s in zip(times, SENSORS, strict=True)], times))
    return made


def in_order(made):
    """A plain filter over all measurements by their times; state and covariance at the last scan's end."""
    flat = sorted((t, s, z[s][0]) for _, z, times in made for s, t in enumerate(times))
    mean, cov = plain.start(flat[0][2], SENSORS[flat[0][1]].covariance)
    when = flat[0][0]
    for t, s, z in flat[1:]:
        mean, cov, _ = plain.correct(*plain.predict(mean, cov, t - when), z, SENSORS[s].covariance)
        when = t
    return plain.predict(mean, cov, made[-1][0] - when)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [0, 1])
def test_a_track_is_filtered_in_the_order_of_times_whatever_the_order_of_sensors(kind, seed):
    made = scans(np.random.default_rng(seed), 4)
    tracker = make(kind)
    for end, z, times in made:
        step = tracker.step(end, z, [np.array([t]) for t in times])
    mean, cov = in_order(made)
    (track,) = [track for track in tracker.tracks if track.confirmed]
    # probabilities are never quite 1
    digits = 1e-4 if kind == "joint-probabilistic" else 1e-8
    np.testing.assert_allclose(track.mean, mean, rtol=digits)
    np.testing.assert_allclose(track.covariance, cov, rtol=digits, atol=digits)
    assert [one.tolist() for one in step.assigned] == [[track.track_id]] * 3
    assert track.last_detection == made[-1][2].max()
    assert track.started == made[0][2].min()


@pytest.mark.parametrize("kind", KINDS)
def test_times_that_are_all_the_scans_own_change_nothing(kind):
    scene = simulate("crowd", 3, targets=6, scans=5, sensors=3, width=20_000.0)
    kinds = TRACKERS[kind].for_scene(scene), TRACKERS[kind].for_scene(scene)
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        kinds[0].step(scan.time, scan.measurements)
        kinds[1].step(scan.time, scan.measurements, scan.own_times(), [[0.0, 2 * math.pi]] * 3)
    found = [sorted(t.position.tolist() for t in tracker.tracks if t.confirmed) for tracker in kinds]
    assert len(found[0]) == 6
    np.testing.assert_allclose(found[1], found[0], atol=0.5)


@pytest.mark.parametrize("kind", KINDS)
def test_a_miss_is_charged_once_a_look(kind):
    tracker = make(kind, SENSORS[:2])
    tracker.step(0.0, [at(0.0)[None], at(0.0)[None]])
    (before,) = tracker.tracks
    empty, everywhere, nowhere = [np.zeros((0, 3))] * 2, [0.0, 2 * math.pi], [0.0, 0.0]
    tracker.step(1.0, empty, sectors=[nowhere, nowhere])
    (still,) = tracker.tracks
    assert still.score == before.score
    # the first sensor looks at one half of the sky, then at the other; the target is at 45 degrees
    tracker.step(2.0, empty, sectors=[[math.pi / 2, 3 * math.pi / 2], nowhere])
    assert tracker.tracks[0].score == before.score
    tracker.step(3.0, empty, sectors=[[-math.pi / 2, math.pi / 2], nowhere])
    assert tracker.tracks[0].score == pytest.approx(before.score + math.log(0.2), abs=1e-12)
    tracker.step(4.0, empty, sectors=[nowhere, everywhere])
    assert tracker.tracks[0].score == pytest.approx(before.score + math.log(0.2 * 0.1), abs=1e-12)


@sample("kind", KINDS, every=6)
def test_the_patience_counts_looks_not_scans(kind):
    """Ten scans for a turn: a track lives on though it is seen in one of them only."""
    tracker = make(kind, SENSORS[:1], life_cycle=LifeCycle(false_probability=1e-3))
    for k in range(200):
        t = float(k)
        away = at(t % 40 * 0.25)
        azimuth = math.atan2(away[1], away[0])
        sector = [2 * math.pi * k / 10, 2 * math.pi * (k + 1) / 10]
        seen = (azimuth - sector[0]) % (2 * math.pi) < 2 * math.pi / 10
        z = at(0.0)[None] if seen else np.zeros((0, 3))
        tracker.step(t, [z], [np.full(len(z), t)], [sector])
    # and yet it is gone some looks after the last detection
    assert len([track for track in tracker.tracks if track.confirmed and track.track_id == 1]) == 1
    for k in range(200, 320):
        tracker.step(float(k), [np.zeros((0, 3))], sectors=[[2 * math.pi * k / 10, 2 * math.pi * (k + 1) / 10]])
    assert not tracker.tracks


def test_what_is_refused():
    tracker = make("multi-sensor", SENSORS[:1])
    z = [at(0.0)[None]]
    tracker.step(5.0, z, [np.array([4.0])])
    for times, sectors, words in [
        ([np.array([4.9])], None, "must lie from the last step's time, 5 s, to 6 s, got 4.9"),
        ([np.array([6.1])], None, "must not be after the scan's time, 6 s, got 6.1"),
        ([np.array([5.5, 5.6])], None, r"times of sensor 0 must have shape \(1,\)"),
        ([np.array([math.nan])], None, "times of sensor 0 must be finite"),
        (5.5, None, "times must be one array for each of 1 sensors"),
        (None, [[0.0, 7.0]], "that of sensor 0 must be from an azimuth to one 0 to 2 pi above it"),
        (None, [[1.0, 0.0]], "that of sensor 0 must be from"),
        (None, [[0.0, 1.0]] * 2, r"sectors must have shape \(1, 2\)"),
    ]:
        with pytest.raises(InvalidInputError, match=words) as caught:
            tracker.step(6.0, z, times, sectors)
        assert "\n" not in str(caught.value)
        assert tracker.time == 5.0
