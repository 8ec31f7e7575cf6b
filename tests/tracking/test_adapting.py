"""What trackers learn of their sensors and targets, beside what the simulation knows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from assoc.costs.views import BANDS, bands_of
from assoc.errors import InvalidInputError
from assoc.filters import ConstantVelocity, ExtendedKalmanFilter
from assoc.scene import Scene
from assoc.scene.scan import Scan
from assoc.sensors import PositionSensor, Radar2D
from assoc.sensors.base import wrap_angle
from assoc.simulation.observation import observe
from assoc.simulation.radars import on_circle, radar_over
from assoc.tracking import TRACKERS, Initiation
from assoc.tracking.adapting.in_use import in_use
from assoc.tracking.adapting.residuals import Predicted, Seen, shown_by
from assoc.tracking.records.clutter import ClutterMap
from assoc.tracking.records.prequential import trusted
from tests.sizes import sample
from tests.tracking.stepping import stepped

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
    stepped(tracker, scene, times=True)
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


def thinned(scene, share, beyond):
    """The scene with this share of its detections beyond a range (m), and all nearer ones."""
    rng = np.random.default_rng(1)
    kept = [
        [(z[:, 0] < beyond) | (rng.random(len(z)) < share) | (who < 0) for z, who in zip(*scan, strict=True)]
        for scan in zip(scene.measurements, scene.truth.sources, strict=True)
    ]
    left = [[z[k] for z, k in zip(*scan, strict=True)] for scan in zip(scene.measurements, kept, strict=True)]
    return Scene(scene.sensors, scene.times, left, scene.region)


@sample("name", sorted(TRACKERS), every=3)
def test_detection_probabilities_by_range_are_found_and_used(name):
    tracker = tracked(thinned(scene_of(radars(), 1), 0.4, 40e3), radars(), name)
    by_range = [(end, seen) for sensor in tracker.health.sensors for end, seen in sensor.by_range]
    near, far = (
        np.mean([seen.seen for end, seen in by_range if low < end < high]) for low, high in ((0, 34e3), (48e3, 1e6))
    )
    assert near > 0.75 and far < 0.5
    assert sum("by range " in sensor.verdict for sensor in tracker.health.sensors) >= 2
    assert in_use(tracker.settings, tracker.state.estimates).by_range.min() < 0.6


@pytest.mark.parametrize("at_once", [True, False])
def test_misses_and_detections_count_by_range(at_once):
    scene = scene_of(radars(), 1, scans=8)
    bands = np.repeat(np.linspace(0.9, 0.3, BANDS)[None], 3, axis=0)
    scores = []
    for told in (False, True):
        tracker = tracked(scene, radars())
        if told:
            tracker.state = tracker.state._replace(estimates=tracker.state.estimates._replace(bands=bands))
        before = {track.track_id: track.score for track in tracker.tracks}
        measured, sectors = scene.measurements[-1], None if at_once else np.array([[-np.pi, np.pi]] * 3)
        tracker.step(32.0, [z[:0] for z in measured], sectors=sectors)
        scores.append([track.score - before[track.track_id] for track in tracker.tracks if track.confirmed])
        assert len(scores[-1]) == TARGETS
    where = np.array([track.position for track in tracker.tracks if track.confirmed])
    missed = [np.log1p(-bands[s, bands_of(sensor, where)]) for s, sensor in enumerate(radars())]
    np.testing.assert_allclose(scores[0], 3 * np.log(0.1), rtol=1e-9)
    np.testing.assert_allclose(scores[1], np.sum(missed, axis=0), rtol=1e-9)


def test_right_declarations_are_left_as_they_are():
    for seed in range(2):
        tracker = tracked(scene_of(radars(), seed), radars())
        # these targets fly straight: quiet flight may be quieter than declared
        told = in_use(tracker.settings, tracker.state.estimates._replace(manoeuvres=1.0))
        assert told is tracker.settings and tracker.state.estimates.manoeuvres <= 1.0
        assert {sensor.verdict for sensor in tracker.health.sensors} == {"as declared"}


def test_wrong_noise_makes_no_further_tracks():
    scene, ids = scene_of(radars(240.0), 1), []
    for adapt in (False, True):
        tracker, seen = TRACKERS["nearest-neighbour"].for_scene(replace(scene, sensors=radars()), adapt=adapt), set()
        for k in range(scene.num_scans):
            tracker.step(scene.times[k], scene.measurements[k])
            seen |= {track.track_id for track in tracker.tracks if track.reported}
        ids.append(len(seen))
    assert ids[0] > 1.5 * TARGETS > ids[1]


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
    prior = Predicted(both[:, 0], np.zeros((T, 1, 3)), both, np.ones((T, 1)), np.zeros((T, 3)), np.zeros((1, 3, 3)))
    shown = shown_by(sensors, seen, prior, factors, factors)
    assert np.linalg.solve(shown.matrix, shown.right) == pytest.approx(1.0, abs=0.1)


def with_returns(scene, count, seed):
    """The scene with plots of each radar from one patch of 3 x 3 km in every scan."""
    rng, low = np.random.default_rng(seed), np.array([14e3, -17e3, 0.0])
    more = [
        [sensor.measure(rng.uniform(low, low + [3e3, 3e3, 200.0], (count, 3))) for sensor in scene.sensors]
        for _ in scene.times
    ]
    both = [
        [np.concatenate(pair) for pair in zip(scan, added, strict=True)]
        for scan, added in zip(scene.measurements, more, strict=True)
    ]
    return Scene(scene.sensors, scene.times, both, scene.region)


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
    assert {sensor.verdict for sensor in tracker.health.sensors} == {"as declared"}


def test_density_of_clutter_by_place():
    """Several plots a turn from a patch are as dense as they are; one a turn may be a target."""
    rng, sensor = np.random.default_rng(5), PositionSensor(
        position=np.zeros(3), noise=[1.0, 1.0], false_alarm_rate=1.0, field_of_view=[[0.0, 1e3], [0.0, 1e3]]
    )  # fmt: skip
    empty, turns = ClutterMap.empty([sensor]), np.ones(1)
    patch, alone = empty, empty
    for k in range(30):
        plots = np.concatenate([rng.uniform(0.0, 50.0, (5, 2)), rng.uniform(0.0, 1e3, (1, 2))])
        patch = patch.after([sensor], Scan(k, float(k), (plots,)), turns, [np.full((6, 2), 0.5)])
        alone = alone.after([sensor], Scan(k, float(k), (rng.normal(25.0, 1.0, (1, 2)),)), turns)
    there = Scan(30, 30.0, (np.array([[25.0, 25.0], [700.0, 700.0]]),))
    inside, outside = patch.used_and_found([sensor], there)[0][0]
    # five in 50 x 50 m against one in 1000 x 1000 m
    assert inside == pytest.approx(np.log(2000.0), abs=0.7) and outside == 0.0
    assert not alone.used_and_found([sensor], there)[1][0].any()


def test_no_track_starts_in_a_closed_area():
    scene = with_returns(scene_of(radars(), 7, scans=10), 10, 1)
    patch = [[13e3, -18e3], [18e3, -18e3], [18e3, -13e3], [13e3, -13e3]]
    tracker = TRACKERS["nearest-neighbour"].for_scene(scene, initiation=Initiation(closed=[patch]))
    stepped(tracker, scene)
    assert in_patch(tracker) == 0
    assert sum(track.reported for track in tracker.tracks) == TARGETS


def planar(noise):
    """A filter of nearly constant velocity in the plane."""
    return ExtendedKalmanFilter(ConstantVelocity(noise, dimensions=2, kind="continuous"))


def group(seed, speed, spacing, noise, scans=25):
    """Twelve targets in rows of three, seen by one sensor each second: the sensor, and its measurements."""
    rng, view = np.random.default_rng(seed), [[-10e3, 10e3], [-10e3, 10e3]]
    sensor = PositionSensor(
        position=np.zeros(3), noise=[noise] * 2, detection_probability=0.9, false_alarm_rate=5.0, field_of_view=view
    )
    at, plots = spacing * np.stack([np.arange(12) % 3, np.arange(12) // 3], axis=1), []
    for k in range(scans):
        seen = at + [k * speed, 0.0] + rng.normal(0.0, noise, (12, 2))
        plots.append(np.concatenate([seen[rng.random(12) < 0.9], rng.uniform(-10e3, 10e3, (rng.poisson(5.0), 2))]))
    return sensor, plots


@pytest.mark.parametrize(("speed", "spacing", "noise"), [(120.0, 60.0, 50.0), (0.0, 60.0, 10.0)])
def test_targets_close_together_are_no_clutter(speed, spacing, noise):
    """Neither those that go on, nor those that stand, each near its own track."""
    sensor, plots = group(3, speed, spacing, noise)
    tracker = TRACKERS["multi-sensor"]([sensor], planar(5.0), adapt=True, initiation=Initiation(speed=max(speed, 10.0)))
    for k, z in enumerate(plots):
        tracker.step(float(k), [z])
    assert sum(track.reported for track in tracker.tracks) >= 11


def test_what_stands_is_no_place_though_its_tracks_predict_badly():
    """Ships at a pier, by a filter that lets them manoeuvre: what comes back to where it was is no clutter."""
    for seed in range(3):
        sensor, plots = group(seed, 0.0, 60.0, 15.0)
        shown = []
        for adapt in (True, False):
            options = {"adapt": adapt, "initiation": Initiation(speed=10.0)}
            tracker = TRACKERS["multi-sensor"]([sensor], planar(5.0), **options)
            for k, z in enumerate(plots):
                tracker.step(10.0 * k, [z])
            shown.append(sum(track.reported for track in tracker.tracks))
        assert shown[0] >= shown[1] - 1 and shown[1] >= 10


@pytest.mark.parametrize("middle", [0.0, np.pi])
def test_density_of_plots_of_what_stands(middle):
    """That of a normal distribution about the mean of the plots so far, also where azimuths begin again."""
    sensor = Radar2D(
        position=np.zeros(3), noise=[10.0, 1e-3], detection_probability=0.8, false_alarm_rate=2.0,
        field_of_view=[[0.0, 20e3], [-np.pi, np.pi]],
    )  # fmt: skip
    rng, known, at = np.random.default_rng(2), ClutterMap.empty([sensor]), np.array([5e3, middle])
    for k in range(10):
        z = at + 0.05 * rng.normal(0.0, [10.0, 1e-3], (1, 2))
        z[:, 1] = wrap_angle(z[:, 1])
        known = known.after([sensor], Scan(k, float(k), (z,)), np.ones(1))
    off = np.array([[0.0, 0.0], [15.0, 1e-3], [0.0, 0.1]])
    z = np.stack([off[:, 0] + at[0], wrap_angle(off[:, 1] + at[1])], axis=1)
    expected = 0.8 * multivariate_normal([0.0, 0.0], np.diag([100.0, 1e-6]) * 1.1).pdf(off) / (2.0 / sensor.volume)
    assert known.standing(sensor, 0, z) == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize(
    ("turns", "least", "most"), [(range(10), 1.0, 1.0), ((0, 4, 9), 0.0, 0.01), ((0, 1, 9), 0.0, 0.01)]
)
def test_what_comes_back_seldom_is_no_target_that_stands(turns, least, most):
    """A turbine that flickers: a target would have been detected in nine of ten turns, not in three."""
    sensor, _ = group(0, 0.0, 60.0, 10.0)
    known, always = ClutterMap.empty([sensor]), ClutterMap.empty([sensor])
    for k in range(10):
        z = np.full((1, 2), 100.0)
        known = known.after([sensor], Scan(k, float(k), (z if k in turns else z[:0],)), np.ones(1))
        always = always.after([sensor], Scan(k, float(k), (z,)), np.ones(1))
    there = np.full((1, 2), 100.0)
    share = known.standing(sensor, 0, there) / always.standing(sensor, 0, there)
    assert least <= share[0] <= most


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


def test_tracks_that_share_the_plots_of_more_targets_teach_nothing():
    """Eleven tracks of twelve targets are missed seldom, and leave plots over: neither is of the sensor."""
    sensor, plots = group(3, 120.0, 60.0, 50.0, scans=60)
    tracker = TRACKERS["multi-sensor"]([sensor], planar(5.0), adapt=True, initiation=Initiation(speed=120.0))
    taken = []
    for k, z in enumerate(plots):
        step = tracker.step(float(k), [z])
        taken += step.confirmed if k >= 10 else []
    learnt = tracker.state.estimates
    # as one who believes every track would have it
    shown = sum(track.reported for track in tracker.tracks)
    assert np.concatenate(taken).sum() / (shown * 50) > 0.92
    assert learnt.dwells.sum() < 5 and (learnt.used == [[1.0, 0.9, 5.0]]).all()


def test_noise_is_learnt_in_formations():
    """Whose plot is whose does not matter so much there: all are farther off than declared."""
    sensor, plots = group(3, 120.0, 150.0, 50.0, scans=40)
    tracker = TRACKERS["multi-sensor"](
        [replace(sensor, noise=[20.0, 20.0])], planar(1.0), adapt=True, initiation=Initiation(speed=120.0)
    )
    for k, z in enumerate(plots):
        tracker.step(float(k), [z])
    assert tracker.state.estimates.used[0, 0] > 3.0


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


@pytest.mark.parametrize("bias", [0.0, 1.0])
def test_estimates_are_used_while_they_predict_better(bias):
    """Right declarations are hardly ever left; wrong ones are."""
    rng, left, runs = np.random.default_rng(8), 0, 200
    for _ in range(runs):
        evidence, used, mean = np.array(0.0), np.array(False), 0.0
        for seen in range(100):
            value = bias + rng.normal()
            # one step ahead: what it is compared with was found before
            evidence = evidence + 0.5 * (value**2 - (value - mean) ** 2)
            used = trusted(evidence, used)
            left += bool(used) and bias == 0.0
            mean += (value - mean) / (seen + 3.0)
        assert bool(used) or bias == 0.0
    # Ville's bound: of 200 at most 2 in the mean, each for some steps
    assert left <= 0.02 * runs * 100
    assert not trusted(np.array(0.0), np.array(True)) and trusted(np.array(0.1), np.array(True))


def test_biases_and_clocks_are_found_and_taken_out():
    """Of radars whose azimuths, and one whose clock, are off; of the same ones that are right nothing is."""
    rng, sensors = np.random.default_rng(7), radars()
    start, velocity = rng.uniform(-12e3, 12e3, (TARGETS, 3)), rng.uniform(-250.0, 250.0, (TARGETS, 3))
    start[:, 2], velocity[:, 2] = rng.uniform(2e3, 9e3, TARGETS), 0.0
    for wrong in (0.0, 1.0):
        tracker = TRACKERS["multi-sensor"](sensors, region=REGION, adapt=True)
        for k in range(40):
            plots = []
            for sensor, turned, late in zip(sensors, (5e-3, -5e-3, 0.0), (0.0, 0.0, 1.0), strict=True):
                z = sensor.measure(start + (2.0 * k - wrong * late) * velocity)
                z += rng.normal(size=z.shape) * sensor.noise + [0.0, wrong * turned, 0.0]
                plots.append(np.column_stack([z[:, 0], wrap_angle(z[:, 1]), z[:, 2]]))
            tracker.step(2.0 * k, plots)
        assert tracker.state.biases.used.any() == bool(wrong)
    assert TRACKERS["multi-sensor"](sensors, registration="online").settings.adapt
    with pytest.raises(InvalidInputError, match="registration: expected 'online', got 'batch'"):
        TRACKERS["multi-sensor"](sensors, registration="batch")
    found = tracker.state.biases.of(sensors)
    assert found[0]["azimuth"] - found[1]["azimuth"] == pytest.approx(0.01, abs=0.003)
    assert found[2]["time"] == pytest.approx(1.0, abs=0.2) and found[0]["time"] == pytest.approx(0.0, abs=0.2)
    assert "azimuth" in tracker.health.sensors[0].verdict and "s late" in tracker.health.sensors[2].verdict


def test_a_sensor_that_is_off_misses_nothing():
    """Tracks go on unseen while no radar looks, and are shown; with the same silence untold they end."""
    scene, off, shown = scene_of(radars(), 1, scans=20), range(10, 18), []
    for told in (True, False):
        tracker = TRACKERS["multi-sensor"].for_scene(scene)
        for k in range(18):
            sectors = np.array([[0.0, 0.0] if k in off else [-np.pi, np.pi]] * 3) if told else None
            tracker.step(4.0 * k, [z[:0] if k in off else z for z in scene.measurements[k]], sectors=sectors)
        shown.append(sum(track.reported for track in tracker.tracks))
    assert shown == [TARGETS, 0]


def wider_alarms(sensors, rate):
    """The radars with this many false alarms."""
    return [replace(sensor, false_alarm_rate=rate) for sensor in sensors]


KINDS = {
    "as declared": (radars(), None),
    "noise": (radars(160.0), None),
    "P_d": (radars(detection_probability=0.6), None),
    "false alarms": (wider_alarms(radars(), 40.0), None),
    "beside a wind farm": (radars(detection_probability=0.75), 10),
    "one radar": (radars(detection_probability=0.75, count=1), None),
}


@pytest.mark.slow
def test_estimates_are_within_a_tenth_and_their_intervals_hold():
    """Of 42 scenes of six kinds, whatever is wrongly declared of the sensors."""
    inside_all, off = [], {}
    for kind, (true, returns) in KINDS.items():
        for seed in range(7):
            scene = scene_of(true, 100 + seed, scans=60)
            scene = scene if returns is None else with_returns(scene, returns, seed)
            told = tracked(scene, radars(count=len(true))).health.sensors
            for sensor, truth, declared in zip(told, true, radars(count=len(true)), strict=True):
                values = (
                    (sensor.noise, (truth.noise / declared.noise)[0]),
                    (sensor.detection_probability, truth.detection_probability),
                    (sensor.false_alarm_rate, truth.false_alarm_rate),
                )
                inside_all += [inside(*value) for value in values]
                off.setdefault(kind, []).append([one.seen / right for one, right in values])
    found = {kind: np.round(np.mean(ratios, axis=0), 3).tolist() for kind, ratios in off.items()}
    assert np.abs(np.array(list(found.values())) - 1.0).max() < 0.1, found
    assert np.mean(inside_all) >= 0.95 - 2.0 * np.sqrt(0.05 * 0.95 / len(inside_all)), found
