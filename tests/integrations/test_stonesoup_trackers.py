"""Our trackers, registration and fusion of tracks inside Stone Soup, against what they do outside of it."""

from datetime import datetime, timedelta

import numpy as np
import pytest

pytest.importorskip("stonesoup")

from stonesoup.types.angle import Bearing
from stonesoup.types.detection import Detection
from stonesoup.types.multihypothesis import MultipleHypothesis
from stonesoup.types.state import GaussianState
from stonesoup.types.track import Track
from stonesoup.types.update import Update

from assoc.errors import InvalidInputError
from assoc.integrations.stonesoup import (
    AssocTracker,
    RegistrationFeeder,
    SceneDetectionReader,
    TrackFusionTracker,
    adapt,
    scene_from_detections,
)
from assoc.registration import OnlineRegistration, RegistrationParameters
from assoc.simulation import simulate
from assoc.tracking import TRACKERS
from tests.integrations.test_stonesoup_scenes import adapted, planar_model

ZERO = datetime(2026, 1, 1)
MODELS = [planar_model(0.0, 0.0), planar_model(8e3, 1e3)]
SENSORS = [adapt(model, max_range=2e4, false_alarm_rate=0.1) for model in MODELS]


def seconds(count):
    return ZERO + timedelta(seconds=count)


def look(sensor, time, places, bias=(0.0, 0.0)):
    """Exact bearings and ranges of places in the plane, and a bias of both."""
    offset = np.asarray(MODELS[sensor].translation_offset, dtype=float).ravel()
    away = np.asarray(places, dtype=float) - offset
    values = np.column_stack([np.arctan2(away[:, 1], away[:, 0]), np.hypot(*away.T)]) + bias
    return {Detection([[Bearing(b)], [r]], seconds(time), measurement_model=MODELS[sensor]) for b, r in values}


def moving(time, count=2):
    """Targets some kilometres apart that fly to the north."""
    return np.column_stack([2e3 + 3e3 * np.arange(count), 3e3 + 50.0 * time + 500.0 * np.arange(count)])


@pytest.mark.parametrize("kind", ["mht", "joint-probabilistic"])
def test_tracks_are_those_of_the_tracker_alone(kind):
    scene = simulate("three-radar", seed=1, scans=8)
    own = TRACKERS[kind].for_scene(scene)
    reader = SceneDetectionReader(scene)
    tracker = AssocTracker(reader, adapted(scene), kind, {"filter": own.filter}, region=scene.region)
    shown = 0
    for k, (_, tracks) in enumerate(tracker):
        scan = scene.scan(k)
        step = own.step(scan.time, scan.measurements)
        reported = {str(track.track_id): track for track in own.tracks if track.reported}
        assert {track.id for track in tracks} == reported.keys()
        for track in tracks:
            expected, shown = reported[track.id], shown + 1
            np.testing.assert_allclose(track.mean[[0, 2, 4], 0].astype(float), expected.position, rtol=1e-4, atol=0.5)
            np.testing.assert_allclose(track.mean[[1, 3, 5], 0].astype(float), expected.velocity, rtol=1e-3, atol=0.5)
            np.testing.assert_allclose(track.covar[::2, ::2], expected.covariance[:3, :3], rtol=1e-3, atol=1.0)
            assert float(track.exist_prob) == pytest.approx(expected.existence, abs=1e-3)
            took = sum(int((ids == expected.track_id).sum()) for ids in step.assigned)
            assert isinstance(track.state, Update) == (took > 0)
            if took:
                whole = track.hypothesis if isinstance(track.hypothesis, MultipleHypothesis) else [track.hypothesis]
                assert len(list(whole)) == took
    assert shown > 8


def test_late_detections_are_put_where_they_belong():
    """The second radar's come 4 s late: afterwards the tracks are those of detections in time."""
    sets = [(seconds(2 * k), look(s, 2 * k, moving(2 * k))) for k in range(8) for s in (0, 1)]
    late = sorted(
        sets, key=lambda one: one[0] + timedelta(seconds=5) * any(d.measurement_model is MODELS[1] for d in one[1])
    )
    in_time, after = (
        AssocTracker(stream, SENSORS, interval=2, horizon=horizon, asynchronous=True)
        for stream, horizon in ((sets, None), (late, 20))
    )
    for tracker in (in_time, after):
        times = [time for time, _ in tracker]
        assert times == sorted(times)
    assert len(in_time.tracks) == len(after.tracks) == 2
    for one, other in zip(*(sorted(t.tracks, key=lambda t: t.mean[0, 0]) for t in (in_time, after)), strict=True):
        np.testing.assert_allclose(one.mean.astype(float), other.mean.astype(float), rtol=1e-6, atol=1e-3)
    assert after.tracker.late > 8 and after.tracker.refused == 0
    with pytest.raises(InvalidInputError, match="expected a horizon in seconds"):
        list(AssocTracker(late, SENSORS, interval=2))


def test_a_sensor_that_does_not_report_has_not_looked():
    """Two radars take turns; of one that is taken to look all the time half of the looks would be misses."""
    stream = [(seconds(2 * k), look(k % 2, 2 * k, moving(2 * k))) for k in range(12)]
    existence = []
    for asynchronous in (True, False):
        tracker = AssocTracker(stream, SENSORS, interval=2, asynchronous=asynchronous)
        *_, (_, tracks) = tracker
        existence.append(min((float(track.exist_prob) for track in tracks), default=0.0) if len(tracks) == 2 else 0.0)
    assert existence[0] > 0.99 and existence[0] > existence[1]


def test_registration_is_that_of_the_scene_and_keeps_the_sets():
    rng = np.random.default_rng(0)
    biases = [(0.004, 80.0), (-0.004, -80.0)]
    sets = [
        (seconds(4 * k), look(s, 4 * k, moving(4 * k, 5), rng.normal(0, [0.001, 5.0], (5, 2)) + biases[s]))
        for k in range(10)
        for s in (0, 1)
    ]
    feeder = RegistrationFeeder(sets, SENSORS, {"range_spread": 100.0})
    corrected = list(feeder)
    assert [(time, len(found)) for time, found in corrected] == [(time, len(found)) for time, found in sets]
    scene = scene_from_detections(sets, SENSORS)
    own = OnlineRegistration(scene.sensors, scene.region, RegistrationParameters(range_spread=100.0))
    for k in range(scene.num_scans):
        own = own.after(float(scene.times[k]), scene.scan(k).measurements)
    np.testing.assert_allclose(feeder.registration.biases, own.biases)
    # range and bearing of the first radar, of the second
    np.testing.assert_allclose(own.biases[[0, 2]], [80.0, -80.0], atol=25.0)
    np.testing.assert_allclose(own.biases[[1, 3]], [0.004, -0.004], atol=0.002)
    for (_, before), (_, after), s in zip(sets[-2:], corrected[-2:], (0, 1), strict=True):
        (old, new) = (
            sorted((d.state_vector for d in found), key=lambda v: float(v[0, 0])) for found in (before, after)
        )
        for one, other in zip(old, new, strict=True):
            assert isinstance(other[0, 0], Bearing)
            taken = [float(one[i, 0]) - float(other[i, 0]) for i in (1, 0)]
            np.testing.assert_allclose(taken, own.biases[2 * s : 2 * s + 2], rtol=1e-6)


def test_tracks_of_several_trackers_are_fused():
    def system(offset, spread, names):
        """Yields a growing set of tracks, as Stone Soup's trackers do; the second target is gone after 6 s."""
        tracks = {name: Track(id=name) for name in names}
        for k in range(6):
            there = set()
            for name, (x, y) in zip(names, moving(2 * k), strict=True):
                if k < 4 or name == names[0]:
                    mean, covar = [[x + offset], [0.0], [y], [50.0]], np.diag([spread, 1.0, 100.0, 1.0])
                    tracks[name].append(GaussianState(mean, covar, timestamp=seconds(2 * k)))
                    there.add(tracks[name])
            yield seconds(2 * k), there

    fused = TrackFusionTracker([system(4.0, 50.0, "ab"), system(-4.0, 100.0, "cd")], parameters={"patience": 3.0})
    ids = []
    for k, (time, tracks) in enumerate(fused):
        assert time == seconds(2 * k)
        found = {track.metadata["members"]: track for track in tracks}
        assert found.keys() == ({("a", "c"), ("b", "d")} if k < 4 else {("a", "c")})
        one = found["a", "c"]
        ids.append(one.id)
        assert abs(one.mean[0, 0] - 2e3) <= 4.0 and one.covar[0, 0] <= 100.0
        assert len(one) == k + 1 and one.mean[2, 0] == pytest.approx(3e3 + 100.0 * k)
    assert len(set(ids)) == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kind": "phd"}, "kind: unknown tracker 'phd'; known: "),
        ({"velocity_mapping": (1, 9)}, r"expected indices of x, y .* below 4, got \[0, 2\] and \[1, 9\]"),
        ({"detector": None}, "detector: expected one to iterate over"),
    ],
)
def test_bad_arguments(options, message):
    with pytest.raises(InvalidInputError, match=message):
        next(AssocTracker(**{"detector": [], "sensors": SENSORS, **options}))
