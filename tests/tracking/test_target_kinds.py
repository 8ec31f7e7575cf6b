"""Priors that suit what is tracked."""

import numpy as np
import pytest

from assoc import Scene, simulation, track
from assoc._cli.track import options
from assoc.filters import FreeFlight
from assoc.sensors import Radar2D, Radar3D
from assoc.simulation.observation import observe
from assoc.tracking import Initiation, MultiSensorTracker, NearestNeighbourTracker
from assoc.tracking.file import described
from assoc.tracking.filter_choice import manoeuvre_noise
from assoc.tracking.target_kinds import TARGETS, target_kind
from tests.tracking.stepping import stepped


def harbour(seed=0, scans=20):
    """Two boats of 3 m/s in a harbour of 400 m, and one radar that turns in two seconds."""
    rng, times = np.random.default_rng(seed), 2.0 * np.arange(scans)
    radar = Radar2D(
        position=np.zeros(3), noise=[3.0, 0.01], false_alarm_rate=1.0, field_of_view=[[0, 280], [-np.pi, np.pi]]
    )
    measurements = []
    for time in times:
        boats = np.array([[-100 + 3 * time, 50, 0], [80, -90 + 2 * time, 0.0]])[rng.random(2) < 0.9]
        noise = rng.normal(0, 1, (len(boats), 2)) * radar.noise
        false = rng.uniform([0, -np.pi], [280, np.pi], (rng.poisson(1.0), 2))
        measurements.append([np.concatenate([radar.measure(boats) + noise, false])])
    return Scene([radar], times, measurements, [[-200, 200], [-200, 200], [-1, 1]])


def confirmed(scene, **options):
    tracker = MultiSensorTracker.for_scene(scene, **options)
    stepped(tracker, scene)
    return [track for track in tracker.tracks if track.confirmed]


@pytest.mark.parametrize("targets", ["ship", "auto"])
def test_boats_in_a_small_region_get_tracks(targets):
    scene = harbour()
    assert confirmed(scene) == []  # 300 m/s: the second detection may be anywhere
    speeds = sorted(float(np.linalg.norm(track.velocity)) for track in confirmed(scene, targets=targets))
    np.testing.assert_allclose(speeds, [2.0, 3.0], atol=0.7)


@pytest.mark.slow
def test_where_nothing_is_tracked_the_end_says_which_slower_targets_would_be(tmp_path, capsys):
    harbour(scans=40).save(tmp_path / "harbour.npz")
    words = [str(tmp_path / "harbour.npz"), "-o", str(tmp_path / "tracks.csv")]
    for more in ([], ["--check"]):
        assert track.main([*words, *more]) == 0
        told = capsys.readouterr().out
        assert "0 confirmed tracks" in told and "targets look slower than assumed: --targets ship\n" in told
    assert track.main([*words, "--targets", "ship"]) == 0
    told = capsys.readouterr().out
    assert "2 confirmed tracks" in told and "slower" not in told


def test_short_tracks_of_false_alarms_say_so(tmp_path, capsys):
    """One drone in a region of four kilometres, a scan in ten seconds: a prior of 300 m/s joins what is nothing."""
    times, view = 10.0 * np.arange(40), [[0, 6000], [-np.pi, np.pi], [-0.05, 1.5]]
    path = np.column_stack([5.0 * times - 1000.0, 200.0 * np.sin(times / 120.0), np.full(40, 120.0)])
    radars = [
        Radar3D(position=place, noise=[5.0, 3e-3, 3e-3], false_alarm_rate=3.0, field_of_view=view)
        for place in ([-1600.0, -1000.0, 0.0], [1400.0, 1200.0, 0.0])
    ]
    region = [[-2e3, 2e3], [-2e3, 2e3], [0, 400]]
    rng = np.random.default_rng(3)
    observe(radars, times, [np.zeros(1, int)] * 40, list(path[:, None]), rng, region=region).save(tmp_path / "one.npz")
    words = [str(tmp_path / "one.npz"), "-o", str(tmp_path / "tracks.csv")]
    assert track.main(words) == 0
    told = capsys.readouterr().out
    slower = told.partition("tracks are short: targets look slower than assumed: --targets ")[2].split("\n")[0]
    assert TARGETS[slower].speed < 20.0
    assert track.main([*words, "--targets", slower]) == 0
    told = capsys.readouterr().out
    assert ": 1 confirmed track" in told and "slower" not in told


@pytest.mark.slow
def test_auto_tells_aircraft_from_boats():
    assert target_kind("auto", harbour(1), NearestNeighbourTracker.for_scene).speed <= TARGETS["ship"].speed
    aircraft = simulation.simulate("three-radar", 1, scans=8)
    assert target_kind("auto", aircraft, NearestNeighbourTracker.for_scene).speed >= TARGETS["airliner"].speed


def test_priors_of_a_kind():
    scene = harbour()
    assert TARGETS["fighter"].speed == Initiation().speed
    assert TARGETS["fighter"].noise(4.0) == pytest.approx(manoeuvre_noise(4.0))
    ship = MultiSensorTracker.for_scene(scene, targets="ship").settings
    assert np.max(ship.initiation.speed) == 5.0
    given = MultiSensorTracker.for_scene(scene, targets="ship", initiation=Initiation(speed=9.0)).settings
    assert np.max(given.initiation.speed) == 9.0 and described(given.filter) == described(ship.filter)
    assert tuple(TARGETS) == options.TARGETS


def arcs(speed, up, height, scans=40):
    """Two radars see two targets in free flight until they are down, at a scan in five seconds."""
    motion, times = FreeFlight(0.0), 5.0 * np.arange(scans)
    x = np.array([[-2e5, 0.0, height, speed, 0.0, up], [-1e5, 9e4, height, speed, -0.1 * speed, 0.9 * up]])
    paths = np.stack([motion.propagate(x, t)[:, :3] for t in times])
    view = [[0, 3e6], [-np.pi, np.pi], [0.01, np.pi / 2]]
    radars = [
        Radar3D(position=place, noise=[100.0, 1e-3, 1e-3], false_alarm_rate=2.0, field_of_view=view)
        for place in ([-2e5, -1e5, 0.0], [2e5, 6e4, 0.0])
    ]
    ids = [np.flatnonzero(path[:, 2] > 0) for path in paths]
    places = [path[rows] for path, rows in zip(paths, ids, strict=True)]
    region = [[-3e6, 3e6], [-3e6, 3e6], [0, 1e6]]
    return observe(radars, times, ids, places, np.random.default_rng(0), region=region)


@pytest.mark.parametrize(("told", "known_from", "late"), [({"targets": "ballistic"}, 3, 0), ({"adapt": True}, 6, 1)])
def test_missiles_are_held_until_they_are_down(told, known_from, late):
    falling, wrong = arcs(1200.0, 700.0, 5e3), []
    tracker = MultiSensorTracker.for_scene(falling, **told)
    for k in range(falling.num_scans):
        tracker.step(falling.times[k], falling.measurements[k])
        there, tracks = falling.truth.positions[k], [track for track in tracker.tracks if track.reported]
        wrong.append(len(tracks) - len(there))
    # a filter for turns, too, is less sure how deep a target would be
    assert min(wrong[known_from:]) == 0 and sum(wrong[known_from:]) <= late
    assert not len(falling.truth.positions[-1])


def test_a_target_detected_below_the_floor_is_not_taken_to_have_come_down():
    level = arcs(1200.0, 700.0, 5e3)
    high = Scene(level.sensors, level.times, level.measurements, [[-3e6, 3e6], [-3e6, 3e6], [3e5, 1e6]], level.truth)
    tracker = MultiSensorTracker.for_scene(high, targets="ballistic")
    for k in range(10):
        tracker.step(high.times[k], high.measurements[k])
    tracker.step(high.times[10], [np.zeros((0, 3))] * 2)
    assert len([track for track in tracker.tracks if track.reported]) == 2


def test_satellites_are_held_as_long_as_they_are_seen():
    orbits = arcs(7500.0, 0.0, 6e5)
    found = confirmed(orbits, targets="satellite")
    off = np.linalg.norm(
        np.sort([track.position for track in found], axis=0) - np.sort(orbits.truth.positions[-1], axis=0)
    )
    assert len(found) == 2 and off < 4e3
    speeds = [np.linalg.norm(track.velocity) for track in found]
    np.testing.assert_allclose(speeds, 7520.0, atol=150.0)
    # such targets are beyond the usual prior: it loses them from scan to scan, until a tracker that adapts sees them
    learnt, ids = MultiSensorTracker.for_scene(orbits, adapt=True), []
    for k in range(orbits.num_scans):
        learnt.step(orbits.times[k], orbits.measurements[k])
        ids.append([track.track_id for track in learnt.tracks if track.confirmed])
    assert len(ids[-1]) == 2 and ids[-1] == ids[len(ids) // 2]
    assert "faster than assumed" in str(learnt.health)
    assert "than assumed" not in str(MultiSensorTracker.for_scene(orbits, adapt=True, targets="satellite").health)
    assert len(confirmed(orbits)) != 2 or max(track.track_id for track in confirmed(orbits)) > 20
