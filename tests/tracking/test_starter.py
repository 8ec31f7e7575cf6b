"""Trackers that decide each scan at once, of bearings alone: a starter that keeps hypotheses begins their tracks."""

import numpy as np

from assoc import simulation
from assoc.filters import Gaussian
from assoc.tracking import TRACKERS
from assoc.tracking.records.ghosts import Unseen
from tests.sizes import sample
from tests.tracking.stepping import stepped

STARTING = ["multi-sensor", "static", "nearest-neighbour", "joint-probabilistic"]


def bearings(seed, scans=10):
    return simulation.simulate("bearing-only", seed, targets=4, scans=scans)


def found(tracker, truth):
    """Targets within 2 km of a reported track, and reported tracks further from all."""
    places = np.array([track.position[:2] for track in tracker.tracks if track.reported]).reshape(-1, 2)
    near = np.linalg.norm(truth[:, None, :2] - places[None], axis=2) < 2_000.0
    return near.any(axis=1).sum(), (~near.any(axis=0)).sum()


@sample("name", STARTING, every=2)
def test_targets_in_line_with_a_sensor_do_not_become_ghosts(name):
    """In the second scans two targets are in line with a sensor: whoever decides then has two ghosts, for ten scans."""
    # in 1000 and 1005 the joint assignment believed them, in 1015 nearest neighbours a crossing of false alarms
    for seed in (1000, 1005, 1015):
        scene = bearings(seed, 9)
        tracker = TRACKERS[name].for_scene(scene)
        stepped(tracker, scene)
        assert found(tracker, scene.truth.positions[-1]) == (len(scene.truth.positions[-1]), 0), seed


@sample("name", STARTING, every=2)
def test_ids_and_decisions_go_on_when_tracks_are_taken_over(name):
    scene = bearings(1000, 12)
    tracker = TRACKERS[name].for_scene(scene)
    owners = {}
    for k, step in enumerate(stepped(tracker, scene)):
        assert step.final[0].assigned is step.assigned and step.scan == k
        for ids, sources, sure in zip(step.assigned, scene.truth.sources[k], step.confirmed, strict=True):
            for track, source in zip(ids[sure].tolist(), sources[sure].tolist(), strict=True):
                owners.setdefault(track, []).append(source)
    # four tracks from beginning to end, each nearly always with its own target's bearings
    living = [track.track_id for track in tracker.tracks if track.confirmed]
    assert sorted(owners) == sorted(living) and len(living) == 4
    for own in owners.values():
        most = max(own.count(source) for source in set(own))
        assert most > 0.9 * len(own) > 20
    ids = [track.track_id for track in tracker.tracks]
    assert ids == sorted(set(ids))
    assert all(track.hits >= 8 for track in tracker.tracks if track.confirmed)


def test_ghosts_are_what_a_sensor_does_not_see():
    """Counted anew by hand: rows of misses of three sensors with P_D 0.9, 0.9 and 0.5."""
    miss = np.log([0.1, 0.1, 0.5])
    none, watch = Unseen.none(3), Unseen.none(3)
    everyone = np.ones((2, 3), dtype=np.bool_)
    rng = np.random.default_rng(3)
    rows = {7: np.zeros(3), 4: np.zeros(3)}
    for _ in range(60):
        detected = rng.random((2, 3)) < [[0.5, 0.9, 0.1], [0.9, 0.9, 0.5]]
        watch = watch.after(np.array([7, 4]), detected.astype(float), everyone)
        for track, own in zip((7, 4), detected, strict=True):
            rows[track] = np.where(own, 0, rows[track] + 1)
        expected = [track for track in (4, 7) if (np.array([0.1, 0.1, 0.5]) ** rows[track] < 1e-4).any()]
        assert watch.ghosts(miss).tolist() == expected
        np.testing.assert_array_equal(watch.misses, [rows[4], rows[7]])
    # four misses of a sensor with P_D 0.9 are still likely enough, a fifth is not; who cannot see has missed nothing
    for looked, ghosts in ((everyone, [4, 7]), (~everyone, [])):
        watch = none
        for k in range(5):
            assert not len(watch.ghosts(miss)), k
            watch = watch.after(np.array([4, 7]), np.array([[0.0, 1.0, 1.0]] * 2), looked)
        assert watch.ghosts(miss).tolist() == ghosts
    # what is a track's by half ends a row by half, and who is gone is forgotten
    half = watch.after(np.array([7]), np.array([[0.5, 1.0, 1.0]]), everyone[:1])
    assert half.ids.tolist() == [7] and half.misses.tolist() == [[0.5, 0.0, 0.0]]


# static fuses each scan by itself, and so never feeds it
@sample("name", [name for name in STARTING if name != "static"], every=2)
def test_a_ghost_that_a_sensor_never_sees_ends(name):
    """A track is set where bearings of two targets cross: two sensors feed it for ever, the third never does."""
    scene = bearings(0, 2)
    targets = np.array([[40e3, 70e3, 5e3], [60e3, 70e3, 5e3]])
    # in line with the first target for the sensor at (0, 0), with the second for that at (100, 0) km
    ghost = np.array([[50e3, 87.5e3, 5e3, 0.0, 0.0, 0.0]])
    rng = np.random.default_rng(0)
    tracker = TRACKERS[name].for_scene(scene)
    tracker.begin(-10.0, Gaussian(ghost, np.diag([400.0, 700.0, 3e3, 20.0, 20.0, 20.0]) ** 2))
    fed, ended = [], []
    for k in range(12):
        z = [sensor.measure(targets) + rng.normal(0.0, 2e-3, (2, 1)) for sensor in scene.sensors]
        step = tracker.step(10.0 * k, z)
        fed.append([1 in one for one in step.assigned])
        ended += step.ended.tolist()
    # four looks of the sensor that does not see it: 0.05 ** 4 is below 1e-4; in the last the bearings are free again
    assert fed[:3] == [[True, False, True]] * 3 and not np.any(fed[3:]) and ended == [1]
    assert found(tracker, targets) == (2, 0)
