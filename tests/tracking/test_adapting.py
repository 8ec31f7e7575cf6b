"""What trackers learn of their sensors and targets, beside what the simulation knows."""

from dataclasses import replace

import numpy as np
import pytest

from assoc import simulation
from assoc._files.npz import save_npz
from assoc.errors import InvalidInputError
from assoc.filters import ConstantVelocity, ExtendedKalmanFilter
from assoc.scene import Scene
from assoc.simulation.observation import observe
from assoc.simulation.radars import on_circle, radar_over
from assoc.tracking import TRACKERS
from assoc.tracking.adapting.in_use import in_use
from assoc.tracking.adapting.residuals import Predicted, Seen, variances
from assoc.tracking.file import FORMAT, VERSION, file_arrays
from tests.sizes import sample

REGION = np.array([[-30e3, 30e3], [-30e3, 30e3], [0.0, 12e3]])
TARGETS = 8


def radars(noise=80.0, detection_probability=0.9, count=3):
    return [
        radar_over(
            REGION, place, range_noise=noise, angle_noise=noise / 50e3, detection_probability=detection_probability,
            false_alarm_rate=10.0, name=f"radar {s + 1}",
        )
        for s, place in enumerate(on_circle(np.zeros(3), 40e3, count))
    ]  # fmt: skip


def scene_of(sensors, seed, scans=30, turn=0.0):
    """Targets that fly straight, or turn for four of ten scans at a rate (rad/s)."""
    rng = np.random.default_rng(seed)
    times = 4.0 * np.arange(scans)
    rate = np.where(np.arange(scans) % 10 > 5, turn, 0.0)
    heading = rng.uniform(-np.pi, np.pi, TARGETS) + np.cumsum(rate * 4.0)[:, None]
    velocity = 200.0 * np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=-1)
    start = rng.uniform([-10e3, -10e3, 1e3], [10e3, 10e3, 2e3], (TARGETS, 3)) + 1e3 * np.arange(TARGETS)[:, None] * [
        0,
        0,
        1,
    ]
    paths = start + np.cumsum(4.0 * velocity, axis=0)
    return observe(sensors, times, [np.arange(TARGETS)] * scans, list(paths), rng, region=REGION)


def tracked(scene, sensors, name="nearest-neighbour", **options):
    """A tracker that adapts, after a scene of which it is told these sensors."""
    tracker = TRACKERS[name].for_scene(replace(scene, sensors=sensors), adapt=True, **options)
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        tracker.step(scan.time, scan.measurements, scan.times, scan.sectors)
    return tracker


def inside(quantity, truth):
    return quantity.low <= truth <= quantity.high


@sample("name", sorted(TRACKERS), every=3)
def test_noise_that_is_twice_the_declared_is_told(name):
    tracker = tracked(scene_of(radars(160.0), 1), radars(), name)
    for sensor in tracker.health.sensors:
        assert 1.7 < sensor.noise.seen < 2.3
        assert sensor.verdict == "noise about twice the declared"


def test_the_one_wrong_sensor_is_found():
    wrong = radars(160.0)[0]
    tracker = tracked(scene_of([wrong, *radars()[1:]], 2), radars())
    assert [sensor.verdict for sensor in tracker.health.sensors] == [
        "noise about twice the declared", "as declared", "as declared"
    ]  # fmt: skip
    assert str(tracker.health).splitlines()[4] == "radar 1: noise about twice the declared"
    assert max(map(len, str(tracker.health).splitlines())) <= 80


@pytest.mark.parametrize("declared", [0.9, 0.6])
def test_detection_probabilities_are_in_their_intervals(declared):
    shares, truth = [], 0.6
    for seed in range(8):
        tracker = tracked(scene_of(radars(detection_probability=truth), seed), radars(detection_probability=declared))
        shares += [inside(sensor.detection_probability, truth) for sensor in tracker.health.sensors]
    # 24 intervals of 95 %
    assert sum(shares) >= 20


def test_right_declarations_are_left_as_they_are():
    for seed in range(3):
        tracker = tracked(scene_of(radars(), seed), radars())
        assert in_use(tracker.settings, tracker.state.estimates) is tracker.settings
        assert {sensor.verdict for sensor in tracker.health.sensors} == {"as declared"}


def test_hard_manoeuvres_are_told_from_noise():
    filter = ExtendedKalmanFilter(ConstantVelocity(3.0, kind="continuous"))
    tracker = tracked(scene_of(radars(), 3, turn=0.15), radars(), filter=filter)
    assert {sensor.verdict for sensor in tracker.health.sensors} == {"as declared"}
    assert "as hard as the filter expects" in tracker.health.verdicts[-1]


def test_turning_radars_are_as_declared():
    scene = simulation.simulate("rotating-radars", 2, duration=60.0)
    tracker = tracked(scene, scene.sensors)
    assert {sensor.verdict for sensor in tracker.health.sensors} == {"as declared"}


@pytest.mark.parametrize("count", [1, 2, 3])
def test_factors_of_variances_are_found_without_a_tracker(count):
    rng, T = np.random.default_rng(4), 20_000
    sensors, factors = radars(count=count), np.array([4.0, 1.0, 0.25])[:count]
    where = rng.uniform([-10e3, -10e3, 3e3], [10e3, 10e3, 9e3], (T, 3))
    covariance = np.diag([90.0, 60.0, 40.0]) ** 2
    predicted = where + rng.normal(size=(T, 3)) * np.sqrt(np.diagonal(covariance))
    seen = []
    for sensor, factor in zip(sensors, factors, strict=True):
        z = sensor.measure(where) + rng.normal(size=(T, 3)) * sensor.noise * np.sqrt(factor)
        seen.append(Seen(np.arange(T), z, predicted))
    both = np.broadcast_to(covariance, (T, 1, 3, 3))
    prior = Predicted(both[:, 0], np.zeros((T, 1, 3)), both, np.ones((T, 1)))
    matrix, right = variances(sensors, seen, prior, factors)
    assert np.linalg.solve(matrix, right) == pytest.approx(1.0, abs=0.1)


@sample("name", sorted(TRACKERS), every=3)
def test_a_restored_tracker_goes_on_identically(name, tmp_path):
    scene = scene_of(radars(160.0), 5, scans=20)
    declared = replace(scene, sensors=radars())
    tracker, again = (TRACKERS[name].for_scene(declared, adapt=True) for _ in range(2))
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        if k == 12:
            assert tracker.state.estimates.used[0, 0] > 1.5
            tracker.save(tmp_path / "state.npz")
            again.restore(tmp_path / "state.npz")
        tracker.step(scan.time, scan.measurements)
        if k >= 12:
            again.step(scan.time, scan.measurements)
    assert [t.score for t in tracker.tracks] == [t.score for t in again.tracks]
    assert str(tracker.health) == str(again.health)


@pytest.mark.parametrize(
    "field, lie",
    [("used", -1.0), ("used", np.nan), ("weights", -1.0), ("factors", 0.0), ("ids", 3), ("open_hits", np.inf)],
)
def test_estimates_that_lie_are_named(field, lie, tmp_path):
    tracker, path = tracked(scene_of(radars(), 6, scans=6), radars()), tmp_path / "bad.npz"
    arrays = {name: np.array(value) for name, value in file_arrays(tracker.settings, tracker.state).items()}
    arrays[f"estimates.{field}"][:] = lie
    save_npz(path, FORMAT, VERSION, arrays)
    with pytest.raises(InvalidInputError, match=f"'estimates.{field}'"):
        tracker.restore(path)


def test_a_file_of_a_tracker_that_does_not_adapt_is_refused(tmp_path):
    scene = scene_of(radars(), 6, scans=2)
    TRACKERS["mht"].for_scene(scene).save(tmp_path / "state.npz")
    with pytest.raises(InvalidInputError, match="adapt was 'None', is 'True'"):
        TRACKERS["mht"].for_scene(scene, adapt=True).restore(tmp_path / "state.npz")


def test_a_tracker_that_does_not_adapt_has_no_health():
    assert TRACKERS["mht"](radars(), region=REGION).health is None


def test_a_tracker_without_tracks_adapts():
    empty = [[np.zeros((0, 3))] * 3] * 4
    tracker = tracked(Scene(radars(), np.arange(4.0), empty, REGION), radars())
    assert in_use(tracker.settings, tracker.state.estimates) is tracker.settings
