"""Radars that do not measure heights: what states they get, and what their tracks know of heights."""

import math
from dataclasses import replace

import numpy as np
import pytest

from assoc.filters import Gaussian
from assoc.recordings import Recording, clustering_time_window, radar_of, with_heights
from assoc.sensors import BearingSensor, PositionSensor, Radar2D, Radar3D
from assoc.simulation.observation import observe
from assoc.tracking import TRACKERS, LifeCycle
from assoc.tracking.filter_choice import height_note, make_filter
from assoc.tracking.offline.plots import track_plots
from tests.tracking.stepping import stepped

CIRCLE = [-math.pi, math.pi]
REGION = np.array([[-20e3, 20e3], [-20e3, 20e3], [0.0, 12e3]])


def radar(x=0.0, noise=(50.0, 1e-3), **options):
    view = [[0.0, 60e3], CIRCLE, [0.0, 20e3]][: len(noise)]
    return Radar2D(position=[x, 0.0, 0.0], noise=noise, field_of_view=view, false_alarm_rate=0.5, **options)


BEARING = BearingSensor(position=[9e3, 0.0, 0.0], noise=[1e-3])
ON_MAP = PositionSensor(position=[0.0, 0.0, 0.0], noise=[9.0, 9.0], field_of_view=REGION[:2])
HIGH = Radar3D(position=[0.0, 0.0, 0.0], noise=[50.0, 1e-3, 1e-3], field_of_view=[[0.0, 6e4], CIRCLE, [0.0, 1.5]])
SEA = np.array([*REGION[:2], [0.0, 30.0]])


@pytest.mark.parametrize(
    ("sensors", "region", "axes", "note"),
    [
        ([radar()], None, 2, "flat"),
        ([radar()], SEA, 2, "flat"),
        ([radar()], REGION, 3, "sigma_z"),
        ([radar(), radar()], None, 2, "flat"),
        ([radar(), radar(9e3)], None, 3, "sigma_z"),
        ([radar(), BEARING], None, 3, "sigma_z"),
        ([radar(), ON_MAP], None, 3, "sigma_z"),
        ([radar(noise=(50.0, 1e-3, 30.0))], None, 3, None),
        ([radar(), HIGH], None, 3, None),
        ([BEARING, ON_MAP], None, 2, None),
    ],
)
def test_slant_ranges_from_several_places_need_heights(sensors, region, axes, note):
    made = make_filter("imm-cv", sensors, region=region)
    assert len(made.motion.position) == axes
    said = height_note(sensors, axes)
    assert note is None and said is None or note in said


def flight(sensors, height, seed=0, scans=30):
    """Four targets at one height, 4 s from scan to scan."""
    rng, times = np.random.default_rng(seed), 4.0 * np.arange(scans)
    start = np.column_stack([rng.uniform(-8e3, 8e3, (4, 2)), np.full(4, height)])
    angle = rng.uniform(-np.pi, np.pi, 4)
    velocity = 150.0 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(4)])
    paths = start + times[:, None, None] * velocity
    return observe(sensors, times, [np.arange(4)] * scans, list(paths), rng, region=REGION)


def tracked(scene):
    made = make_filter("imm-cv", scene.sensors, pace=4.0, region=scene.region)
    tracker = TRACKERS["multi-sensor"].for_scene(scene, made)
    stepped(tracker, scene)
    return [track for track in tracker.tracks if track.reported]


@pytest.mark.parametrize("height", [2e3, 9e3])
@pytest.mark.parametrize("noise", [(50.0, 1e-3), (50.0, 1e-3, 30.0)])
def test_several_radars_find_targets_at_any_height(height, noise):
    """Their planar states lay kilometres off at 9 km."""
    places = (-25e3, 0.0, 25e3) if len(noise) == 2 else (0.0,)
    scene = flight([radar(x, noise) for x in places], height)
    tracks = tracked(scene)
    truth = scene.truth.positions[-1]
    assert len(tracks) == len(truth)
    for track in tracks:
        off = truth - track.position
        nearest = off[np.argmin(np.hypot(off[:, 0], off[:, 1]))]
        assert np.hypot(*nearest[:2]) < 150.0
        assert abs(nearest[2]) < 4.0 * math.sqrt(track.covariance[2, 2])
        if len(noise) == 3:
            assert abs(nearest[2]) < 100.0


def test_one_radar_does_not_seem_to_know_heights():
    """Its tracks' errors are as large as they say, 3 degrees of freedom; extended filters had hundreds."""
    square = []
    for seed in range(3):
        scene = flight([radar()], 9e3, seed)
        truth = scene.truth.positions[-1]
        for track in tracked(scene):
            off = truth - track.position
            off = off[np.argmin(np.hypot(off[:, 0], off[:, 1]))]
            square.append(off @ np.linalg.solve(track.covariance[:3, :3], off))
    assert len(square) > 6
    assert np.mean(square) < 5.0


def test_unknown_heights_stay_within_those_of_the_region():
    """Without detections a velocity of 30 m/s would leave 9 km open after five minutes."""
    tracker = TRACKERS["multi-sensor"]([radar()], region=REGION, life_cycle=LifeCycle(deletion_time=1e4))
    assert tracker.settings.initiation.speed == (300.0, 300.0, 30.0)
    tracker.begin(0.0, Gaussian(np.array([[1e4, 1e4, 9e3, 0.0, 100.0, 0.0]]), np.diag([1e4] * 3 + [900.0] * 3)[None]))
    for time in np.arange(10.0, 600.0, 10.0):
        tracker.step(time, [np.zeros((0, 2))])
    (track,) = tracker.tracks
    # the noise of one step may come on top
    assert math.sqrt(track.covariance[2, 2]) < 1.1 * 6e3
    assert 0.0 < track.position[2] < 12e3


@pytest.mark.parametrize("missing", [0.0, 0.3])
def test_heights_of_plots_tell_aircraft_apart(missing):
    """Two aircraft one above the other; a share of the plots has no altitude."""
    rng, turns = np.random.default_rng(0), np.arange(40)
    times = np.repeat(10.0 * turns, 2) + np.tile([0.0, 0.01], len(turns))
    source, x = np.tile([0, 1], len(turns)), 60e3 - 200.0 * times
    altitudes = np.where(rng.random(len(times)) < missing, np.nan, np.where(source == 0, 9e3, 9.6e3))
    ground, noise = np.hypot(x, 20e3), rng.normal(0.0, [[150.0], [2e-3]], (2, len(times)))
    slant = np.hypot(ground, np.where(source == 0, 9e3, 9.6e3) - ground**2 / (2 * 6.371e6))
    plots = Recording(
        times,
        slant + noise[0],
        np.arctan2(20e3, x) + noise[1],
        np.ones(len(times), dtype=int),
        altitudes,
        sources=source,
    )
    radar = radar_of(plots, range_noise=150.0, azimuth_noise=2e-3)
    together, right, places = clustering_time_window(plots, 10.0), {}, {}
    for kind, sensors in (("flat", [radar]), ("high", with_heights(radar, plots))):
        tracker = TRACKERS["mht"](sensors, make_filter("ekf", sensors))
        done = track_plots(tracker, plots, together)
        taken = [done.tracks[source == one] for one in (0, 1)]
        right[kind] = np.mean([(ids == np.bincount(ids[ids > 0]).argmax()).mean() for ids in taken])
        places[kind] = np.array([track.position for track in tracker.tracks if track.reported])
    assert len(places["high"]) == 2
    assert missing or right["high"] > 0.9 > right["flat"]
    assert np.ptp(places["high"][:, 2]) == pytest.approx(600.0, abs=120.0)
    # the ground range is that below the aircraft
    np.testing.assert_allclose(np.hypot(*places["high"][:, :2].T), np.hypot(x[-1], 20e3), rtol=0.01)
    assert len(with_heights(radar, replace(plots, altitudes=np.full(len(times), np.nan)))) == 1
