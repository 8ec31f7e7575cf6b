"""Warnings: each for its mistake, and none on sound input."""

import datetime
import re
import warnings

import numpy as np
import pandas as pd
import pytest

import assoc
from assoc.errors import AssocWarning
from assoc.scene import Scene
from assoc.sensors import BearingSensor, PositionSensor, Radar3D
from assoc.simulation import simulate
from assoc.tracking import MultiSensorTracker, track_scene
from tests.sizes import sample

FLIGHTS = "time,icao24,lat,lon,geoaltitude\n" + "".join(
    f"{t},{who},{47.0 + 0.02 * k + 0.001 * t},{8.0 + 0.03 * k},{9000 + 300 * k}\n"
    for k, who in enumerate(("a", "b", "c", "d"))
    for t in range(0, 200, 5)
)

SCENARIOS = [
    ("three-radar", {"scans": 20}),
    ("three-radar", {"scans": 300, "range_rate_noise": 2.0}),
    ("crowd", {"scans": 3}),
    ("crowd", {"scans": 3, "sensor": "radar"}),
    ("bearing-only", {"scans": 4}),
    ("dubins-uav", {"targets": 3}),
    ("rotating-radars", {}),
    ("from-tracks", {"scans": 8}),
]


# the bearings take as long as all others together
@pytest.mark.parametrize(
    ("name", "values"),
    [pytest.param(*one, marks=pytest.mark.slow if one[0] == "bearing-only" else ()) for one in SCENARIOS],
    ids=lambda one: one if isinstance(one, str) else "",
)
@sample("seed", range(4), every=4)
def test_no_warning_on_any_scenario(name, values, seed, tmp_path):
    if name == "from-tracks":
        (tmp_path / "flights.csv").write_text(FLIGHTS)
        values = {**values, "file": str(tmp_path / "flights.csv")}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = simulate(name, seed, **values)
        scene.save(tmp_path / "scene.npz")
        again = Scene.load(tmp_path / "scene.npz")
        assert again.warnings == ()
        if seed == 0:
            assoc.associate(again)
            tracker = MultiSensorTracker(again.sensors, region=again.region)
            track_scene(tracker, again, scans=range(min(again.num_scans, 8)))


def test_no_warning_at_the_edges_of_what_is_sound():
    rng = np.random.default_rng(0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # azimuths counted from 0 to 2 pi, a bad but real direction finder, a field of view up to the zenith
        bearing = BearingSensor(position=[0, 0, 0], noise=[0.2], field_of_view=[[0, 2 * np.pi]])
        radar = Radar3D(position=[0, 0, 0], noise=[50, 0.01, 0.01], field_of_view=[[0, 1e5], [-1, 1], [0, np.pi / 2]])
        plane = PositionSensor(position=[0, 0, 0], noise=[30, 30, 30], field_of_view=[[-1e4, 1e4]] * 3)
        for seed in range(200):
            rng = np.random.default_rng(seed)
            # one target that stands still, at the edge of each field of view; heights that are all 0
            n = 12
            z = rng.normal(size=(n, 3))
            bearings = np.mod(0.2 * z[:, :1], 2 * np.pi)
            ranges, flat = [5e4, 0.0, 0.7] + z * [50, 0.01, 0.01], z * [30, 30, 0]
            scans = [[bearings[[k]], ranges[[k]], flat[[k]]] for k in range(n)]
            Scene([bearing, radar, plane], np.arange(n), scans)
        # a problem without a target in it
        assoc.assign(assoc.AssignmentProblem([[1, 1]], [3.0], [2, 2]))
        # targets near a radar of long reach, and one seen by a little beyond the zenith, north and the field of view
        few = [[5e3, 0.1, 0.1], [1.2e3, 2 * np.pi + 0.03, np.pi / 2 + 0.03], [1.5e5, 0.2, 0.2]]
        Scene([radar], [0.0, 1.0], [[np.array(few)], [np.zeros((0, 3))]])


def changed(scene, factors):
    """The scene with measurements times factors."""
    return Scene(scene.sensors, scene.times, [[z * factors for z in scan] for scan in scene.measurements], scene.region)


DEGREES = np.array([1.0, 180 / np.pi, 180 / np.pi])


@pytest.mark.parametrize(
    ("factors", "message"),
    [
        (DEGREES, r"Radar3D 'radar 1': azimuths from .* degrees\? radians are expected"),
        ([1.0, 1.0, 180 / np.pi], "elevations from .* beyond pi/2: degrees"),
        ([0.001, 1.0, 1.0], "100 % of its ranges .* lie outside of its field of view .*: another unit"),
        ([1 / 0.3048, 1.0, 1.0], "ranges .* lie outside"),
    ],
)
def test_measurements_in_other_units(factors, message):
    with pytest.warns(AssocWarning) as caught:
        scene = changed(simulate("three-radar", scans=6), factors)
    assert re.search(message, "\n".join(str(one.message) for one in caught))
    # of each radar one line for each component, and the line of this file that is to blame
    assert len(caught) == len(scene.warnings) == (6 if factors is DEGREES else 3)
    assert {one.filename for one in caught} == {__file__}


@pytest.mark.parametrize(
    ("few", "message"),
    [
        ([[5e4, 0.1, 30.0]], "elevations from 30 to 30 rad, but nothing is seen beyond pi/2"),
        ([[5e4, 350.0, 0.1], [5e4, 2.0, 0.1]], "azimuths from 2 to 350 rad: degrees"),
        ([[3.3e5, 0.1, 0.1]], r"100 % of its ranges \(3.3e\+05 to 3.3e\+05 m\) lie outside"),
        ([[12.0, 0.1, 0.1], [80.0, 0.2, 0.1], [45.0, 0.3, 0.1]], "its ranges end at 80 m, .* kilometres"),
    ],
)
def test_few_measurements_in_other_units(few, message):
    radar = Radar3D(position=[0, 0, 0], noise=[50, 0.01, 0.01], field_of_view=[[0, 1e5], [-1, 1], [0, np.pi / 2]])
    with pytest.warns(AssocWarning, match=message) as caught:
        Scene([radar], [0.0], [[np.array(few)]])
    assert len(caught) == 1


def test_sensors_in_degrees():
    with pytest.warns(AssocWarning, match="noise of azimuth is 5 rad: degrees"):
        BearingSensor(position=[0, 0, 0], noise=[5.0])
    view = [[0, 1e5], [-1, 1], [0, 60]]
    with pytest.warns(AssocWarning, match="field_of_view of elevation is 0 to 60 rad"):
        Radar3D(position=[0, 0, 0], noise=[50, 0.01, 0.01], field_of_view=view)


def test_dates_become_seconds():
    scene = simulate("three-radar", scans=3)
    start = datetime.datetime(2024, 1, 1, tzinfo=datetime.UTC)
    wanted = start.timestamp() + np.array([0.0, 1.5, 3.0])
    dates = [start + datetime.timedelta(seconds=s) for s in (0, 1.5, 3)]
    plain = [one.replace(tzinfo=None) for one in dates]
    as_days = np.array(plain, "datetime64[ms]")
    zone = datetime.timezone(datetime.timedelta(hours=5))
    for times in (dates, plain, as_days, list(as_days), pd.DatetimeIndex(plain), pd.Series(plain),
                  pd.DatetimeIndex(dates), [one.astimezone(zone) for one in dates]):  # fmt: skip
        np.testing.assert_allclose(Scene(scene.sensors, times, scene.measurements).times, wanted, rtol=0, atol=1e-5)
    apart = [one - dates[0] for one in dates]
    np.testing.assert_allclose(Scene(scene.sensors, apart, scene.measurements).times, [0, 1.5, 3], atol=1e-9)
