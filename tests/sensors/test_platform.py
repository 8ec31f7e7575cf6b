"""Sensors on platforms: where they stand, what they measure, and scenes, costs and tracks of them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from assoc import AssocWarning, InvalidInputError, Scene, associate, build_problem, sensors
from assoc.costs import positions_and_covariances
from assoc.sensors import BearingSensor, Platform, PositionSensor, Radar2D, Radar3D
from assoc.tracking import TRACKERS
from assoc.tracking.filter_choice import two_speeds
from tests.sizes import sample

TURN = [-math.pi, math.pi]
# a ship on a circle, its bow along the circle
ANGLES = np.linspace(0.0, 0.8 * math.pi, 200)
SHIP = Platform(
    25.0 * ANGLES,
    np.stack([400 * np.cos(ANGLES), 400 * np.sin(ANGLES), 0 * ANGLES], axis=1),
    np.mod(ANGLES + math.pi / 2, 2 * math.pi),
)
KINDS = {
    "radar3d": Radar3D(position=[5, 2, 9], noise=[5, 0.01, 0.01], field_of_view=[[0, 3e3], TURN, [-0.5, 1.0]]),
    "range rate": Radar3D(
        position=[5, 2, 9], noise=[5, 0.01, 0.01, 0.3], field_of_view=[[0, 3e3], TURN, [-0.5, 1.0], [-90, 90]]
    ),
    "radar2d": Radar2D(position=[5, 2, 0], noise=[5, 0.01], field_of_view=[[0, 3e3], TURN]),
    "bearing": BearingSensor(position=[-5, 0, 0], noise=[0.01]),
    "position": PositionSensor(position=[-5, 1, 0], noise=[4, 9], field_of_view=[[-2e3, 2e3], [-2e3, 2e3]]),
}


def relative(sensor, platform, time, place, velocity):
    """What a sensor on a platform measures, by hand."""
    h = float(np.interp(time, platform.times, np.unwrap(platform.headings)))
    bow = np.array([[math.cos(h), math.sin(h), 0], [-math.sin(h), math.cos(h), 0], [0, 0, 1]])
    own = np.array([np.interp(time, platform.times, column) for column in platform.positions.T])
    away = bow @ (place - own) - sensor.position
    if isinstance(sensor, PositionSensor):
        return away[: sensor.dim]
    found = {"azimuth": math.atan2(away[1], away[0]), "range": float(np.linalg.norm(away))}
    found["elevation"] = math.asin(away[2] / found["range"])
    step = 1e-4
    if sensor.measures_velocity:
        later = relative(
            replace(sensor, noise=sensor.covariance[:3, :3], field_of_view=sensor.field_of_view[:3]),
            platform,
            time + step,
            place + step * velocity,
            velocity,
        )
        found["range rate"] = (later[0] - found["range"]) / step
    return np.array([found[name] for name in sensor.components[: sensor.dim]])


@pytest.mark.parametrize("name", KINDS)
def test_measurements_are_relative_to_the_carrier(name):
    sensor = replace(KINDS[name], platform=SHIP)
    for time, place in ((0.0, [900.0, 300, 80]), (11.3, [-500.0, 100, 20]), (47.0, [30.0, -700, 300])):
        velocity = np.array([3.0, -8, 1])
        z = relative(sensor, SHIP, time, np.array(place), velocity)
        standing = sensor.at(time)
        assert standing.platform is None
        there = standing.measure(np.array([place]), velocity[None])
        found = sensor.aligned(z[None], np.array([time]))
        assert standing.residual(found, there) == pytest.approx(0.0, abs=1e-2 if sensor.measures_velocity else 1e-9)
        assert standing.in_view(found).all()
        density = sensor.false_alarm_rate / sensor.volume
        assert standing.false_alarm_rate / standing.volume == pytest.approx(density)


def boats(time):
    return np.array([[900 - 3 * time, 500 + 6 * time, 0], [-800 + 7 * time, -600 + 2 * time, 0.0]])


def scene_of(names, *, own_times=False, platform=SHIP, seed=0):
    """Scans every two seconds; with own times each boat is measured somewhere in between."""
    rng, on_board = np.random.default_rng(seed), [replace(KINDS[name], platform=platform) for name in names]
    times = np.arange(2.0, 40.0, 2.0)
    stamps = [[t - rng.uniform(0, 1.9, 2) * own_times for _ in names] for t in times]
    measurements = [
        [
            np.stack([relative(s, platform, t, boats(t)[i], [[-3, 6, 0], [7, 2, 0]][i]) for i, t in enumerate(when)])
            + rng.normal(0, np.sqrt(np.diagonal(s.covariance)), (2, s.dim))
            for s, when in zip(on_board, scan, strict=True)
        ]
        for scan in stamps
    ]  # fmt: skip
    region = [[-2e3, 2e3], [-2e3, 2e3], [-5, 5]]
    return Scene(on_board, times, measurements, region, measurement_times=stamps if own_times else None)


@sample("own_times", [False, True], every=2)
@pytest.mark.parametrize("kind", TRACKERS)
def test_tracks_of_a_turning_ship(kind, own_times):
    scene = scene_of(["radar2d", "bearing"], own_times=own_times)
    tracker = TRACKERS[kind].for_scene(scene, two_speeds(2.0, 2))
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        step = tracker.step(scan.time, scan.measurements, times=scan.times)
    found = np.array([track.position for track in tracker.tracks if track.confirmed])
    truth = boats(scan.time)
    apart = np.linalg.norm(found[:, None] - truth, axis=2)
    assert apart.shape == (2, 2) and apart.min(axis=0).max() < 25.0
    assert [len(ids) for ids in step.assigned] == [2, 2]


@pytest.mark.parametrize("own_times", [False, True])
def test_a_platform_that_stands_still_changes_nothing(own_times):
    moored = Platform([0.0, 100.0], np.zeros((2, 3)), [0.0, 0.0])
    one = scene_of(["radar2d", "position", "bearing"], own_times=own_times, platform=moored)
    plain = [sensor.at(0.0) for sensor in one.sensors]
    measured = [
        [s.aligned(z, np.full(2, t)) for s, z in zip(one.sensors, scan, strict=True)]
        for t, scan in zip(one.times, one.measurements, strict=True)
    ]
    other = replace(one, sensors=plain, measurements=measured)
    for k in (3, 9):
        a, b = build_problem(one, k), build_problem(other, k)
        assert np.array_equal(a.tuples, b.tuples)
        np.testing.assert_allclose(a.costs, b.costs, rtol=1e-9)


def test_a_moving_sensors_scan_costs_that_of_one_standing_there():
    scene = scene_of(["radar2d", "radar3d", "position"])
    time = float(scene.times[7])
    there = Scene(
        [sensor.at(time) for sensor in scene.sensors], [time],
        [[s.aligned(z, np.full(2, time)) for s, z in zip(scene.sensors, scene.measurements[7], strict=True)]],
        scene.region,
    )  # fmt: skip
    a, b = build_problem(scene, 7), build_problem(there, 0)
    assert np.array_equal(a.tuples, b.tuples) and np.array_equal(a.costs, b.costs)
    fused = positions_and_covariances(scene, 7, np.ones((1, 3), dtype=int))[0][0]
    assert np.linalg.norm(fused[:2] - boats(time)[0, :2]) < 15.0
    targets = associate(scene).scans[7].positions[:, :2]
    assert np.linalg.norm(targets[:, None] - boats(time)[:, :2], axis=2).min(axis=0).max() < 20.0


def test_scene_files(tmp_path):
    drifting = Platform(SHIP.times, SHIP.positions)
    scene = scene_of(["radar2d", "bearing", "position"])
    carriers = (SHIP, drifting, None)
    changed = replace(scene, sensors=[replace(s, platform=p) for s, p in zip(scene.sensors, carriers, strict=True)])
    changed.save(tmp_path / "scene.npz")
    loaded = Scene.load(tmp_path / "scene.npz")
    assert loaded.sensors == changed.sensors and loaded.sensors[1].platform.headings is None
    with np.load(tmp_path / "scene.npz") as file:
        arrays = dict(file)
    assert arrays["version"] == 3 and len(arrays["platform_times"]) == 400
    for name, value, message in (
        ("platform_times", arrays["platform_times"][:-1], r"'platform_times' has shape \(399,\), expected \(400,\)"),
        ("sensor_platform", np.array([0, 5, -1]), "'sensor_platform' must hold -1 to 1"),
        ("platform_times", arrays["platform_times"][::-1], "times must be one or more seconds that ascend"),
    ):
        np.savez(tmp_path / "bad.npz", **{**arrays, name: value})
        with pytest.raises(InvalidInputError, match=f"bad.npz: .*{message}"):
            Scene.load(tmp_path / "bad.npz")


def test_bad_platforms():
    times, still = [0.0, 1.0, 2.0], np.zeros((3, 3))
    with pytest.raises(InvalidInputError, match="headings go up to 180: degrees"):
        Platform(times, still, [0.0, 90.0, 180.0])
    with pytest.raises(InvalidInputError, match="seconds that ascend"):
        Platform([0.0, 2.0, 1.0], still)
    with pytest.raises(InvalidInputError, match=r"positions must have shape \(3, 3\)"):
        Platform(times, still[:, :2])
    with pytest.raises(InvalidInputError, match="no position at 3 s, its times are 0 to 2 s"):
        replace(KINDS["bearing"], platform=Platform(times, still)).at(3.0)
    with pytest.raises(InvalidInputError, match="platform must be a Platform"):
        replace(KINDS["bearing"], platform=still)
    jumps = Platform([0.0, 1.0, 2.0, 3.0], [[0, 0, 0], [3, 0, 0], [5003, 0, 0], [5006, 0, 0]])
    with pytest.warns(AssocWarning, match="BearingSensor 'b': platform jumps at 1 s, with 5000 m/s"):
        replace(KINDS["bearing"], name="b", platform=jumps)
    late = replace(KINDS["bearing"], name="b", platform=Platform(times, still))
    with pytest.raises(InvalidInputError, match="scene: BearingSensor 'b': platform: has no position at 3 s"):
        Scene([late], [2.0, 3.0], [[[]], [[[0.1]]]]).check_platforms()
    assert {"Platform", *(kind.__name__ for kind in sensors.KINDS.values())} <= {*sensors.__all__}
