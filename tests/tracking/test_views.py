"""A sensor misses only what it can see: against brute force, and against trackers that lack the sensor."""

import math
from dataclasses import replace

import numpy as np
import pytest

from assoc.costs.views import share_in_sector, share_in_view
from assoc.filters import ConstantVelocity, ExtendedKalmanFilter
from assoc.sensors import Radar3D
from assoc.tracking import TRACKERS
from tests.sizes import sample

REGION = np.array([[-30e3, 30e3], [-30e3, 30e3], [0.0, 10e3]])
TURN = 2.0 * math.pi
KINDS = list(TRACKERS)


def radar(x=-20e3, reach=60e3, P=0.8, **options):
    values = {
        "position": [x, 0.0, 0.0], "noise": [50.0, 1e-3, 1e-3], "detection_probability": P, "false_alarm_rate": 1.0,
        "field_of_view": [[0.0, reach], [-math.pi, math.pi], [0.0, math.pi / 2]],
    }  # fmt: skip
    return Radar3D(**(values | options))


def make(kind, sensors, **options):
    motion = ConstantVelocity(5.0, kind="continuous")
    return TRACKERS[kind](sensors, ExtendedKalmanFilter(motion), region=REGION, **options)


def flight(sensors, seed, scans=8, start=(5e3, 1e3, 5e3), velocity=(200.0, 0.0, 0.0)):
    """Measurements of a target and false alarms, scan by scan of 4 s, each sensor with random numbers of its own."""
    for k in range(scans):
        where, scan = np.array([start]) + 4.0 * k * np.array([velocity]), []
        for s, sensor in enumerate(sensors):
            rng = np.random.default_rng([seed, k, s])
            z = sensor.measure(where) + rng.normal(0.0, sensor.noise)
            seen = sensor.in_view(sensor.measure(where)) & (rng.random() < sensor.detection_probability)
            low, high = sensor.field_of_view.T
            scan.append(np.concatenate([z[seen], rng.uniform(low, high, (1, 3))]))
        yield 4.0 * k, scan


def state_of(tracker):
    return [
        (t.track_id, t.confirmed, t.hits, t.score, t.existence, *t.mean.tolist(), *t.covariance.ravel().tolist())
        for t in tracker.tracks
    ]


@pytest.mark.parametrize("sector", [None, (-0.8, 0.1), (3.0, 4.0)])
def test_shares_are_those_of_samples(sector):
    rng = np.random.default_rng(0)
    sensor = radar(0.0, 10e3, field_of_view=[[2e3, 10e3], [-0.5, 0.2], [0.05, 0.6]])
    positions = rng.uniform([4e3, -3e3, 1e3], [11e3, 1e3, 4e3], (40, 3))
    root = rng.normal(0.0, 200.0, (40, 3, 3))
    covariances = root @ root.transpose(0, 2, 1)
    shares = share_in_view(sensor, positions, covariances)
    if sector is not None:
        shares = shares * share_in_sector(sensor, positions, covariances, np.array(sector))
    for share, where, spread in zip(shares, positions, covariances, strict=True):
        z = sensor.measure(rng.multivariate_normal(where, spread, 4000))
        inside = sensor.in_view(z)
        if sector is not None:
            inside &= np.mod(z[:, 1] - sector[0], TURN) <= sector[1] - sector[0]
        # components are taken as independent, and the sensor as linear
        assert share == pytest.approx(inside.mean(), abs=0.12)
    assert np.ptp(shares) > 0.3 or sector == (3.0, 4.0)


@pytest.mark.parametrize("kind", KINDS)
def test_a_sensor_that_does_not_look_changes_nothing(kind):
    """Switched off, or one that reports on its own and is silent: a sector without width."""
    sensors = [radar(), radar(20e3), radar(0.0, P=0.99)]
    alone, both = make(kind, sensors[:2]), make(kind, sensors)
    everywhere = [[-math.pi, math.pi]] * 2
    for time, z in flight(sensors, 1):
        alone.step(time, z[:2], sectors=everywhere)
        both.step(time, [*z[:2], np.zeros((0, 3))], sectors=[*everywhere, [0.0, 0.0]])
        assert state_of(both) == state_of(alone)
    assert any(track.confirmed for track in both.tracks)


@pytest.mark.parametrize("timed", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_sensors_that_cannot_see_a_target_do_not_matter(kind, timed):
    """Five radars that reach nowhere near: tracks are confirmed and scored as without them."""
    sensors = [radar(), *(radar(-29e3, 100.0 + s, P=0.95, name=str(s)) for s in range(5))]
    alone, both = make(kind, sensors[:1]), make(kind, sensors)
    for time, z in flight(sensors[:1], 2):
        times = [np.full(2 if len(z[0]) > 1 else 1, time)] if timed else None
        alone.step(time, z, times)
        both.step(time, [*z, *[np.zeros((0, 3))] * 5], None if times is None else [*times, *[np.zeros(0)] * 5])
        # a tentative track may become so wide that they might see it
        found, expected = ([one for one in state_of(tracker) if one[1]] for tracker in (both, alone))
        np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert len(found) == 1


@sample("kind", KINDS, every=3)
def test_a_track_crosses_a_gap_between_views_under_its_id(kind):
    """Two radars that reach 12 km, 8 km of nothing between them; 40 s out of view."""
    sensors = [replace(radar(x, 12e3, P=0.9), name=str(x)) for x in (-16e3, 16e3)]
    tracker, ids = make(kind, sensors), []
    for time, z in flight(sensors, 5, 30, (-14e3, 0.0, 3e3), (200.0, 0.0, 0.0)):
        tracker.step(time, z)
        ids.append([track.track_id for track in tracker.tracks if track.reported])
    assert len(ids[5]) == 1 and ids[5:] == [ids[5]] * 25
    # where both can see it and do not, it ends
    for k in range(30, 45):
        tracker.step(4.0 * k, [np.zeros((0, 3))] * 2)
    assert not [track for track in tracker.tracks if track.confirmed]


@pytest.mark.parametrize("kind", KINDS)
def test_a_lost_track_is_taken_up_again_under_its_id(kind):
    """Twice 24 s of shadow that nobody knows; and a target that appears elsewhere gets an id of its own."""
    sensors, seen, other = [radar(-20e3, P=0.9), radar(20e3, P=0.9)], [], []
    tracker = make(kind, sensors)
    for k, (time, z) in enumerate(flight(sensors, 7, 40, (-14e3, 0.0, 5e3))):
        if 10 <= k < 16 or 25 <= k < 31:
            z = [one[-1:] for one in z]
        if k >= 14:
            where = np.array([[0.0, 15e3 + 800.0 * (k - 14), 4e3]])
            z = [np.concatenate([one, sensor.measure(where)]) for one, sensor in zip(z, sensors, strict=True)]
        step = tracker.step(time, z)
        shown = [track for track in tracker.tracks if track.confirmed]
        seen.append({track.track_id for track in shown if abs(track.position[1]) < 5e3})
        other.append({track.track_id for track in shown if track.position[1] > 12e3})
    assert seen[8] == seen[20] == seen[39] and len(seen[8]) == 1
    assert set() in seen[10:20]
    assert len(other[39]) == 1 and other[39] != seen[39]
    assert any(seen[39] <= set(ids.tolist()) for ids in step.assigned)


@sample("kind", KINDS, every=3)
def test_after_a_hard_manoeuvre_a_track_goes_on_at_once(kind):
    """In the first scan after it measurements lie 350 m from where the track is predicted; two radars see it then."""
    sensors = [radar(-20e3, P=0.9), radar(20e3, P=0.9), radar(P=0.9)]
    tracker, ids, off = make(kind, sensors), set(), []
    for k in range(24):
        turned = 350.0 * max(k // 4 - 1, 0)
        where = np.array([[-8e3 + 800.0 * k, turned, 5e3]])
        rng = np.random.default_rng([3, k])
        noisy = [one.measure(where) + rng.normal(0.0, one.noise) for one in sensors]
        tracker.step(4.0 * k, [z[: int(s != k // 4 % 3)] for s, z in enumerate(noisy)])
        shown = [track for track in tracker.tracks if track.reported]
        if k >= 3:
            ids |= {track.track_id for track in shown}
            off.append([np.linalg.norm(track.position - where[0]) for track in shown])
    assert len(ids) == 1 and all(len(one) == 1 and one[0] < 200.0 for one in off)
