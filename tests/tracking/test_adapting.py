"""What trackers learn of their sensors and targets, beside what the simulation knows."""

from dataclasses import replace

import numpy as np
import pytest

from assoc.costs.views import BANDS, bands_of
from assoc.errors import InvalidInputError
from assoc.scene import Scene
from assoc.sensors import PositionSensor, Radar2D
from assoc.sensors.base import wrap_angle
from assoc.simulation import simulate
from assoc.tracking import TRACKERS, Initiation
from assoc.tracking.adapting.in_use import in_use
from assoc.tracking.adapting.learning import _nearest
from assoc.tracking.adapting.residuals import Predicted, Seen, shown_by
from assoc.tracking.filter_choice import two_speeds
from assoc.tracking.records.biases import Biases
from assoc.tracking.records.estimates import ALARMS, KEEP
from assoc.tracking.records.prequential import trusted
from tests.sizes import sample
from tests.tracking.learning import REGION, TARGETS, group, planar, radars, scene_of, tracked, with_returns


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
        seen.append(Seen(np.arange(T), z, predicted, np.full(T, np.inf)))
    both = np.broadcast_to(covariance, (T, 1, 3, 3))
    prior = Predicted(both[:, 0], np.zeros((T, 1, 3)), both, np.ones((T, 1)), np.zeros((T, 3)), np.zeros((1, 3, 3)))
    shown = shown_by(sensors, seen, prior, factors, np.append(factors, 1.0))
    # beside other sensors nothing is asked of predictions
    known = count + (count == 1)
    assert np.linalg.solve(shown.matrix[:known, :known], shown.right[:known]) == pytest.approx(1.0, abs=0.1)


def test_heights_that_transponders_say_are_no_noise_of_radars():
    """All radars hear the same height, in steps that are finer than the noise declared for it."""
    rng, T = np.random.default_rng(5), 20_000
    sensors = [
        Radar2D(
            name=f"{k}",
            position=[40e3 * k, -50e3, 0.0],
            noise=[60.0, 1e-3, 30.0],
            field_of_view=[[0.0, 2e5], [-np.pi, np.pi], [0.0, 2e4]],
            detection_probability=0.9,
            false_alarm_rate=1.0,
        )
        for k in range(2)
    ]
    where = rng.uniform([-10e3, -10e3, 3e3], [10e3, 10e3, 9e3], (T, 3))
    covariance = np.diag([90.0, 60.0, 40.0]) ** 2
    predicted = where + rng.normal(size=(T, 3)) * np.sqrt(np.diagonal(covariance))
    seen = []
    for sensor in sensors:
        z = sensor.measure(where)
        z[:, :2] += rng.normal(size=(T, 2)) * sensor.noise[:2]
        z[:, 2] = 30.48 * np.round(z[:, 2] / 30.48)
        seen.append(Seen(np.arange(T), z, predicted, np.full(T, np.inf)))
    both = np.broadcast_to(covariance, (T, 1, 3, 3))
    prior = Predicted(both[:, 0], np.zeros((T, 1, 3)), both, np.ones((T, 1)), np.zeros((T, 3)), np.zeros((1, 3, 3)))
    shown = shown_by(sensors, seen, prior, np.ones(2), np.ones(3))
    assert np.linalg.solve(shown.matrix[:2, :2], shown.right[:2]) == pytest.approx(1.0, abs=0.1)


def test_a_plot_beside_another_of_nobody_is_no_manoeuvre():
    """Six sigma off it says so alone, and hardly where as near to the prediction there is one more."""
    view, there = [[-40e3, 40e3]] * 2, np.zeros((1, 3))
    sensor = PositionSensor(
        position=np.zeros(3), noise=[10.0] * 2, detection_probability=0.5, false_alarm_rate=1.0, field_of_view=view
    )
    own = 50.0**2 * np.eye(2)[None]
    prior = Predicted(own, np.zeros((1, 1, 2)), own[:, None], np.ones((1, 1)), np.zeros((1, 2)), own)
    gained = [
        shown_by([sensor], [Seen(np.zeros(1, np.int64), np.array([[300.0, 0.0]]), there, np.array([nearest]))],
                 prior, np.ones(1), np.ones(2)).manoeuvres.max()
        for nearest in (36.0, np.inf)
    ]  # fmt: skip
    assert gained[0] < 0.3 * gained[1] and gained[1] > 5.0


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


def test_biases_that_drift_are_followed_and_stay_where_nothing_is_measured():
    """Ten metres a scan, of noise of 30 m: without lag; afterwards no farther than the damped drift goes, then back."""
    rng, sensors = np.random.default_rng(4), radars()[:1]
    biases, information = Biases.none(sensors), np.diag([30.0**-2, 0.0, 0.0, 0.0])
    for k in range(60):
        seen = 10.0 * k + rng.normal(0.0, 30.0)
        biases = biases.after(sensors, information, information[:, 0] * (seen - biases.used[0]))
    # a memory of ten scans that knows no drift is 100 m behind
    assert biases.used[0] == pytest.approx(600.0, abs=40.0)
    for _ in range(100):
        biases = biases.after(sensors, 0.0 * information, 0.0 * information[:, 0])
        assert 0.0 <= biases.used[0] < 1100.0
    assert biases.used[0] < 700.0


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


def test_cautious_predictions_make_noise_no_smaller():
    """Aircraft fly straighter than the filter expects, and radars see them one after the other."""
    seen = []
    for seed in range(2):
        scene = simulate("rotating-radars", seed, turns="4,7,11", interval=1.0, aircraft=12)
        told = [replace(sensor, noise=2.0 * sensor.noise) for sensor in scene.sensors]
        seen += [sensor.noise.seen for sensor in tracked(scene, told).health.sensors]
    assert np.mean(seen) == pytest.approx(0.5, abs=0.05)


def wider_alarms(sensors, rate):
    """The radars with this many false alarms."""
    return [replace(sensor, false_alarm_rate=rate) for sensor in sensors]


def test_fewer_false_alarms_than_declared_are_found_and_everything_else_is_still_learnt():
    """What lies at no place is no dense clutter, however few false alarms are in use."""
    true = wider_alarms(radars(detection_probability=0.7), 3.0)
    scene = scene_of(true, 1, scans=60)
    tracker = tracked(scene, radars())
    counted = np.array([[np.count_nonzero(own < 0) for own in scan] for scan in scene.truth.sources])
    recent = np.average(counted, axis=0, weights=KEEP ** np.arange(60)[::-1])
    for sensor, simulated in zip(tracker.health.sensors, recent, strict=True):
        assert sensor.false_alarm_rate.seen == pytest.approx(simulated, rel=0.1)
        assert inside(sensor.detection_probability, 0.7)
    # told, but not used: where false alarms come from some places only, they are more there
    assert (tracker.state.estimates.used[:, ALARMS] == 10.0).all()


def test_a_plot_of_nobody_may_lie_exactly_where_a_track_is_expected():
    """The density of others is large then, and finite."""
    sensor = PositionSensor(position=np.zeros(3), noise=[10.0] * 2, detection_probability=0.9, false_alarm_rate=1.0,
                            field_of_view=[[-1e4, 1e4]] * 2)  # fmt: skip
    tracker = TRACKERS["multi-sensor"]([sensor], two_speeds(dimensions=2), adapt=True)
    tracker.step(0.0, [np.array([[0.0, 0.0], [5e3, 50.0]])])
    states = tracker.state.tracks.states
    there = tracker.settings.filter.expected(states, sensor).mean
    off = _nearest(tracker.settings, states, sensor, np.append(there[:1], there[1:] + 30.0, axis=0))
    assert 0.0 < off[0] < 1e-9 < off[1] < np.inf


KINDS = {
    "as declared": (radars(), None),
    "noise": (radars(160.0), None),
    "P_d": (radars(detection_probability=0.6), None),
    "false alarms": (wider_alarms(radars(), 40.0), None),
    "fewer false alarms": (wider_alarms(radars(detection_probability=0.75), 3.0), None),
    "beside a wind farm": (radars(detection_probability=0.75), 10),
    "one radar": (radars(detection_probability=0.75, count=1), None),
}


@pytest.mark.slow
def test_estimates_are_within_a_tenth_and_their_intervals_hold():
    """Of 49 scenes of seven kinds, whatever is wrongly declared of the sensors."""
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
