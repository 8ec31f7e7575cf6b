"""Trackers that decide each scan at once, of bearings alone: a starter that keeps hypotheses begins their tracks."""

import numpy as np
import pytest

from assoc import simulation
from assoc._files.npz import save_npz
from assoc.errors import InvalidInputError
from assoc.filters import Gaussian
from assoc.scene import Scan
from assoc.tracking import TRACKERS, LatePlots
from assoc.tracking.file import FORMAT, VERSION, file_arrays
from assoc.tracking.progress import Progress, Work
from assoc.tracking.records.ghosts import Unseen
from assoc.tracking.records.track import Step
from assoc.tracking.stages.starter import partners
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


def test_a_starter_of_another_time_is_refused(tmp_path):
    scene, path = bearings(1002, 2), tmp_path / "state.npz"
    one, two = (TRACKERS["static"].for_scene(scene) for _ in range(2))
    stepped(one, scene)
    arrays = file_arrays(one.settings, one.state)
    save_npz(path, FORMAT, VERSION, arrays | {"nursery.time": arrays["nursery.time"] - 1.0})
    with pytest.raises(InvalidInputError, match="nursery.time"):
        two.restore(path)
    assert two.time is None


def test_late_bearings_are_put_in_their_place():
    """A sensor's bearings of one scan come late: the tracks keep their ids."""
    scene = bearings(1001, 9)
    late = LatePlots(TRACKERS["nearest-neighbour"].for_scene(scene), horizon=40.0)
    nothing = [np.zeros((0, 1))] * 2
    for k in range(9):
        scan = scene.scan(k)
        if k != 5:
            late.step(scan.time, scan.measurements)
            continue
        before = {track.track_id for track in late.tracks if track.reported}
        late.step(scan.time, [*scan.measurements[:2], np.zeros((0, 1))])
        late.step(scan.time + 1.0, [np.zeros((0, 1))] * 3, None, np.zeros((3, 2)))
        stamps = np.full(len(scan.measurements[2]), scan.time + 0.5)
        step = late.step(
            scan.time + 2.0, [*nothing, scan.measurements[2]], [np.zeros(0)] * 2 + [stamps], np.zeros((3, 2))
        )
        assert step.late == len(stamps) and set(step.assigned[2][step.confirmed[2]].tolist()) <= before
    assert {track.track_id for track in late.tracks if track.reported} == before and len(before) == 3


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


def test_partners_of_a_ghost_are_those_that_swapped():
    """Track 67 has a bearing of either target, 58 the other one of the first; 47 has its own three."""
    scene = bearings(0, 2)
    targets = np.array([[40e3, 70e3, 5e3], [60e3, 50e3, 5e3], [25e3, 30e3, 5e3]])
    tracker = TRACKERS["nearest-neighbour"].for_scene(scene)
    scan = Scan(0, 0.0, tuple(sensor.measure(targets) for sensor in scene.sensors))
    progress = Progress(tracker.settings, tracker.state, scan, Work(tracker.settings, tracker.state))
    ids = (np.array([58, 67, 47]), np.array([67, 58, 47]), np.array([0, 58, 47]))
    step = Step(0, 0.0, ids, tuple(one > 0 for one in ids))
    assert partners(progress, step, np.array([67])).tolist() == [58, 67]
    # where nothing is swapped there is no partner
    ids = (np.array([0, 58, 47]), np.array([67, 58, 47]), np.array([67, 58, 47]))
    step = Step(0, 0.0, ids, tuple(one > 0 for one in ids))
    assert partners(progress, step, np.array([67])).tolist() == []


def test_sensors_that_start_tracks_have_no_starter():
    scene = simulation.simulate("three-radar", 0, scans=2)
    assert not any(TRACKERS[name].for_scene(scene).settings.starter for name in STARTING)
    assert all(TRACKERS[name].for_scene(bearings(0, 2)).settings.starter for name in STARTING)
