"""Places of clutter that trackers find: farms, shores, turbines; not formations, nor ships at anchor."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal

from assoc.scene import Scene
from assoc.scene.scan import Scan
from assoc.sensors import PositionSensor, Radar2D
from assoc.sensors.base import wrap_angle
from assoc.simulation.observation import observe
from assoc.tracking import TRACKERS, Initiation
from assoc.tracking.records.clutter import ClutterMap, flicker_ratio
from tests.sizes import sample
from tests.tracking.learning import REGION, TARGETS, group, planar, radars, scene_of, tracked, with_returns
from tests.tracking.stepping import stepped


def in_patch(tracker):
    """Reported tracks in the patch."""
    where = np.array([track.position for track in tracker.tracks if track.reported])[:, :2]
    return int((np.abs(where - [15.5e3, -15.5e3]) < 2e3).all(axis=1).sum())


@sample("name", sorted(TRACKERS), every=3)
def test_no_track_stays_where_clutter_is_dense(name):
    scene = with_returns(scene_of(radars(), 7, scans=15), 10, 1)
    told = TRACKERS[name].for_scene(scene)
    stepped(told, scene)
    assert in_patch(told) > 4
    tracker = tracked(scene, radars(), name)
    assert in_patch(tracker) == 0
    assert sum(track.reported for track in tracker.tracks) == TARGETS
    for sensor in tracker.health.sensors:
        assert sensor.places == pytest.approx(10.0, rel=0.25)
        assert sensor.verdict == f"{sensor.places:.3g} more a scan from places of clutter, which tracks are kept from"


@pytest.mark.parametrize("alarms", [1, 1000])
def test_density_of_clutter_by_place(alarms):
    """Several plots a turn from a patch are as dense as they are; one a turn may be a target."""
    rng, side = np.random.default_rng(5), 1e3 * alarms**0.5
    sensor = PositionSensor(
        position=np.zeros(3), noise=[1.0, 1.0], false_alarm_rate=alarms, field_of_view=[[0.0, side], [0.0, side]]
    )
    empty, turns = ClutterMap.empty([sensor]), np.ones(1)
    patch, alone = empty, empty
    for k in range(30):
        plots = np.concatenate([rng.uniform(0.0, 50.0, (5, 2)), rng.uniform(0.0, side, (alarms, 2))])
        patch = patch.after([sensor], Scan(k, float(k), (plots,)), turns, [np.full(len(plots), 0.5)])
        alone = alone.after([sensor], Scan(k, float(k), (rng.normal(25.0, 1.0, (1, 2)),)), turns)
    there = Scan(30, 30.0, (np.array([[25.0, 25.0], [700.0, 700.0]]),))
    inside, outside = patch.used_and_found([sensor], there)[0][0]
    # five in 50 x 50 m against one in 1000 x 1000 m
    assert inside == pytest.approx(np.log(2000.0), abs=0.7) and outside == 0.0
    assert not alone.used_and_found([sensor], there)[1][0].any()
    # of many measurements all, with evidence for a place about them, and some at times without, if plots are many
    many = Scan(30, 30.0, (rng.uniform(10.0, 40.0, (200, 2)),))
    assert patch.used_and_found([sensor], many)[0][0].all()
    unsure = replace(patch, plots=tuple(replace(own, votes=0.0 * own.votes) for own in patch.plots))
    weighed = [
        np.count_nonzero(replace(unsure, clock=np.array([turn])).used_and_found([sensor], many)[1][0])
        for turn in range(30, 36)
    ]
    assert weighed == [200] * 6 if alarms == 1 else 40 < weighed[0] <= 64 and not any(weighed[1:])


def test_what_stands_is_weighed_among_many():
    """A point with a plot in every turn, among 200 that move, wherever in the crowd others are weighed."""
    sensor = PositionSensor(
        position=np.zeros(3), noise=[1.0, 1.0], false_alarm_rate=1.0, field_of_view=[[0.0, 1e3], [0.0, 1e3]]
    )
    rng, known, visits = np.random.default_rng(6), ClutterMap.empty([sensor]), []
    for k in range(49):
        plots = np.concatenate([[[400.0, 300.0]] + rng.normal(size=(1, 2)), rng.uniform(0.0, 600.0, (200, 2))])
        weighed = known.used_and_found([sensor], Scan(k, float(k), (plots,)))[1][0] > 0.0
        if k > 20 and weighed.any():
            visits.append((weighed[0], np.count_nonzero(weighed), plots[weighed][1:, 0].max() < 400.0))
        known = known.after([sensor], Scan(k, float(k), (plots,)), np.ones(1))
    stands, count, elsewhere = zip(*visits, strict=True)
    assert len(visits) == 5 and all(stands) and max(count) < 70 and any(elsewhere)


def test_no_track_starts_in_a_closed_area():
    scene = with_returns(scene_of(radars(), 7, scans=10), 10, 1)
    patch = [[13e3, -18e3], [18e3, -18e3], [18e3, -13e3], [13e3, -13e3]]
    tracker = TRACKERS["nearest-neighbour"].for_scene(scene, initiation=Initiation(closed=[patch]))
    stepped(tracker, scene)
    assert in_patch(tracker) == 0
    assert sum(track.reported for track in tracker.tracks) == TARGETS


@pytest.mark.parametrize(("speed", "spacing", "noise"), [(120.0, 60.0, 50.0), (0.0, 60.0, 10.0)])
def test_targets_close_together_are_no_clutter(speed, spacing, noise):
    """Neither those that go on, nor those that stand, each near its own track."""
    sensor, plots = group(3, speed, spacing, noise)
    tracker = TRACKERS["multi-sensor"]([sensor], planar(5.0), adapt=True, initiation=Initiation(speed=max(speed, 10.0)))
    for k, z in enumerate(plots):
        tracker.step(float(k), [z])
    assert sum(track.reported for track in tracker.tracks) >= 11


@sample("spacing", [45.0, 60.0], every=2)
def test_what_stands_is_no_place_though_its_tracks_predict_badly(spacing):
    """Ships at a pier, three or four sigma apart, by a filter that lets them manoeuvre: as often shown as without."""
    for seed in range(3):
        sensor, plots = group(seed, 0.0, spacing, 15.0)
        shown = []
        for adapt in (True, False):
            options = {"adapt": adapt, "initiation": Initiation(speed=10.0)}
            tracker = TRACKERS["multi-sensor"]([sensor], planar(5.0), **options)
            count = 0
            for k, z in enumerate(plots):
                tracker.step(10.0 * k, [z])
                count += sum(track.reported for track in tracker.tracks)
            shown.append(count)
        assert shown[0] > 0.97 * shown[1] > 220


@pytest.mark.parametrize("middle", [0.0, np.pi])
def test_plots_are_of_the_point_they_come_back_to(middle):
    """Six points, each with a plot in most turns and in any order, also where azimuths begin again."""
    sensor = Radar2D(
        position=np.zeros(3), noise=[10.0, 1e-3], detection_probability=0.8, false_alarm_rate=2.0,
        field_of_view=[[0.0, 20e3], [-np.pi, np.pi]],
    )  # fmt: skip
    rng, known, truth = np.random.default_rng(2), ClutterMap.empty([sensor]), []
    points = np.array([5e3, middle]) + np.array([[80.0 * i, 8e-3 * j] for i in range(2) for j in (-1, 0, 1)])
    for k in range(10):
        seen = rng.permutation(6)[: rng.integers(3, 7)]
        z = points[seen] + 0.4 * rng.normal(0.0, [10.0, 1e-3], (len(seen), 2))
        z[:, 1] = wrap_angle(z[:, 1])
        known = known.after([sensor], Scan(k, float(k), (z,)), np.ones(1))
        truth += seen.tolist()
    pairs = set(zip(known.plots[0].sites.tolist(), truth, strict=True))
    assert len(pairs) == len({site for site, _ in pairs}) == len({point for _, point in pairs}) == 6


@pytest.mark.parametrize("turns", [(0, 1, 2, 3, 4, 5, 6, 7, 8, 9), (0, 4, 9), (0, 1, 9), (3, 4, 6), (5,)])
@pytest.mark.parametrize("now", [None, 11.0])
def test_ratio_of_what_flickers_to_what_stands(turns, now):
    """By integration over the rates; steady points are targets, those seen in three of ten turns are none."""
    P, plots = 0.9, len(turns)
    after = turns[1:] if now is not None else turns[1:-1]
    seen = np.isin(np.arange(turns[0] + 1, 11 if now is not None else turns[-1]), after)

    def likelihood(rate):
        return float(np.prod(np.where(seen, rate, 1.0 - rate))) / (0.5 * P)

    runs = [len(run) for run in "".join("x" if hit else "." for hit in seen).split("x") if run]
    target = P ** seen.sum() * np.prod([max((1.0 - P) ** run, 0.01) for run in runs])
    expected = np.log(quad(likelihood, 0.0, 0.5 * P)[0] / target)
    found = flicker_ratio(np.append(np.full(plots, 7.0), 3.0), np.append(turns, 2.0), P, now)
    assert found[:plots].sum() == pytest.approx(expected, rel=1e-6) and np.ptp(found[:plots]) == 0.0
    assert now is not None or plots not in (3, 10) or turns == (3, 4, 6) or (found[0] > 0.0) == (plots == 3)


def test_density_of_points_that_stand():
    """Of twelve points, each with a plot in every turn: normal about each, by as many plots as came from there."""
    sensor, _ = group(0, 0.0, 60.0, 10.0)
    rng, known, points = np.random.default_rng(3), ClutterMap.empty([sensor]), 60.0 * np.argwhere(np.ones((3, 4)))
    for k in range(10):
        z = points + 0.01 * rng.normal(size=points.shape)
        known = known.after([sensor], Scan(k, float(k), (z,)), np.ones(1))
    at = np.array([[60.0, 60.0], [68.0, 60.0], [60.0, 72.0]])
    found = known.used_and_found([sensor], Scan(10, 10.0, (at,)))[1][0]
    expected = sum(multivariate_normal(point, 110.0 * np.eye(2)).pdf(at) for point in points)
    assert found == pytest.approx(np.log(expected * sensor.volume / sensor.false_alarm_rate), abs=0.01)


@pytest.mark.slow
def test_turbines_that_flicker_are_clutter():
    """Twelve points that return a plot in a third of the turns, each its own: tracked without a map, not with one."""
    shown = []
    for adapt in (True, False):
        found = 0
        for seed in range(4):
            sensor, plots = group(seed, 0.0, 60.0, 15.0, scans=40)
            rng = np.random.default_rng(seed)
            tracker = TRACKERS["multi-sensor"]([sensor], planar(5.0), adapt=adapt, initiation=Initiation(speed=10.0))
            for k, z in enumerate(plots):
                tracker.step(10.0 * k, [z[rng.random(len(z)) < 0.4]])
            found += sum(track.reported for track in tracker.tracks)
        shown.append(found)
    assert shown[0] < 0.6 * shown[1]


def test_turbines_that_overlap_are_clutter_though_tracked_first():
    """Thirty in 3 x 3 km, 3.4 sigma from one to the next, seen by three radars in 0.4 of the turns: all tracks end."""
    scene, rng, low = scene_of(radars(), 7, scans=25), np.random.default_rng(1), np.array([14e3, -17e3, 0.0])
    points, plots = rng.uniform(low, low + [3e3, 3e3, 200.0], (30, 3)), []
    for scan in scene.measurements:
        more = [sensor.measure(points[rng.random(30) < 0.4]) for sensor in scene.sensors]
        more = [z + rng.normal(size=z.shape) * sensor.noise for z, sensor in zip(more, scene.sensors, strict=True)]
        plots.append([np.concatenate(both) for both in zip(scan, more, strict=True)])
    shown = []
    for adapt in (True, False):
        tracker = TRACKERS["multi-sensor"].for_scene(scene, adapt=adapt)
        stepped(tracker, Scene(scene.sensors, scene.times, plots, scene.region), times=True)
        shown.append(in_patch(tracker))
        assert sum(track.reported for track in tracker.tracks) - shown[-1] == TARGETS
    assert shown[0] <= 1 and shown[1] > 12


def test_targets_that_fly_together_are_confirmed_as_without_the_map():
    """What may be a place in the first turns is none unless it predicts surely better than tracks do."""
    for seed in range(4):
        sensor, plots = group(seed, 120.0, 60.0, 50.0)
        shown = []
        for adapt in (True, False):
            options = {"adapt": adapt, "initiation": Initiation(speed=120.0)}
            tracker = TRACKERS["multi-sensor"]([sensor], planar(5.0), **options)
            for k, z in enumerate(plots[:4]):
                tracker.step(float(k), [z])
            shown.append(sum(track.reported for track in tracker.tracks))
        assert shown[0] == shown[1] > 6


def test_no_doubt_where_tracks_predict_well_from_the_first():
    """Four abreast on each of three heights are as dense as a place of clutter, but each is near its own track."""
    times = 4.0 * np.arange(3)
    row = np.stack([np.arange(12) % 4 * 350.0, np.zeros(12), 3e3 * (np.arange(12) // 4 + 1.0)], axis=1)
    paths = list(row + times[:, None, None] * [0.0, 200.0, 0.0])
    for seed in range(4):
        scene = observe(radars(), times, [np.arange(12)] * 3, paths, np.random.default_rng(seed), region=REGION)
        tracker = TRACKERS["multi-sensor"].for_scene(scene, adapt=True)
        stepped(tracker, scene)
        # one may be new; without the map 12
        assert sum(track.reported for track in tracker.tracks) >= 11
