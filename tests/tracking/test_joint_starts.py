"""Sensors of which none can start a track alone: tracks begin where bearings cross, and ghosts die."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from assoc import AssocWarning
from assoc.filters import Gaussian
from assoc.scene import Scene
from assoc.sensors import BearingSensor
from assoc.simulation import simulate
from assoc.simulation.observation import observe
from assoc.simulation.radars import azimuth_interval, on_circle, padded_azimuth
from assoc.tracking import TRACKERS, track_scene
from tests.sizes import sample

REGION = np.array([[-10e3, 10e3], [-10e3, 10e3], [0.0, 100.0]])
NOISE, TARGETS = 2e-3, 4


@cache
def scene(seed, scans=25):
    """Three bearing sensors around four slow targets, two false alarms in each scan."""
    rng = np.random.default_rng(seed)
    sensors = [
        BearingSensor(
            position=place, noise=np.array([NOISE]), detection_probability=0.9, false_alarm_rate=2.0,
            field_of_view=np.array([padded_azimuth(azimuth_interval(place, REGION), NOISE)]), name=f"sensor {i}",
        )
        for i, place in enumerate(on_circle(np.zeros(3), 15e3, 3))
    ]  # fmt: skip
    middle = np.column_stack([rng.uniform(-5e3, 5e3, (TARGETS, 2)), np.full(TARGETS, 50.0)])
    heading, speed = rng.uniform(-np.pi, np.pi, TARGETS), rng.uniform(10.0, 30.0, TARGETS)
    velocity = np.column_stack([speed * np.cos(heading), speed * np.sin(heading), np.zeros(TARGETS)])
    times = 4.0 * np.arange(scans)
    paths = middle + (times - times.mean())[:, None, None] * velocity
    ids = [np.arange(TARGETS)] * scans
    return observe(sensors, times, ids, list(paths), rng, region=REGION, velocities=[velocity] * scans)


@sample("name", ["mht", "mht-hypothesis", "joint-probabilistic", "multi-sensor"], every=4)
def test_three_bearings_start_all_tracks_and_ghosts_die(name):
    one = scene(7)
    tracker = TRACKERS[name].for_scene(one)
    found, false = [], []
    for k in range(one.num_scans):
        scan = one.scan(k)
        tracker.step(scan.time, scan.measurements)
        places = np.array([track.position[:2] for track in tracker.tracks if track.reported]).reshape(-1, 2)
        away = np.linalg.norm(scan.truth_positions[:, None, :2] - places[None], axis=2)
        found.append(int((away.min(axis=1, initial=np.inf) < 300.0).sum()))
        false.append(int((away.min(axis=0) > 500.0).sum()) if len(places) else 0)
    assert TARGETS in found[:10]
    assert found[-1] == TARGETS
    assert not any(false[20:])


@pytest.mark.parametrize("name", TRACKERS)
def test_bearings_that_can_start_no_track_are_told_of_once(name):
    made = simulate("bearing-only", 1, targets=2, scans=3)
    times = [[np.full(len(z), time) for z in scan] for time, scan in zip(made.times, made.measurements, strict=True)]
    alone = Scene(made.sensors[:1], made.times, [scan[:1] for scan in made.measurements], region=made.region)
    for told, one in (
        ("all sensors measure angles alone: measurements with times", replace(made, measurement_times=times)),
        ("the only sensor measures angles alone", alone),
    ):
        with pytest.warns(AssocWarning) as caught:
            table, _ = track_scene(TRACKERS[name].for_scene(one), one)
        assert len(table) == 0 and len(caught) == 1 and str(caught[0].message).startswith(told)
        assert caught[0].filename == __file__
    # from known targets on there are tracks, and nothing to tell
    tracker = TRACKERS[name].for_scene(made)
    tracker.begin(0.0, Gaussian(np.zeros((1, 6)), np.eye(6)[None] * 1e4))
    tracker.step(made.times[0] + 1.0, made.measurements[0], [one + 1.0 for one in times[0]])
