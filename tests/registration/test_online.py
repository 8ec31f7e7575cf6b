"""Online: the biases of a whole recording, drift followed, trackers corrected, saved and restored."""

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.registration import OnlineRegistration, RegistrationParameters, register, with_biases
from assoc.tracking import MultiSensorTracker
from tests.registration.common import BIASES, REGION, biased_scene, radars, scene_of
from tests.sizes import sample
from tests.tracking.stepping import stepped


def went_through(online, scene):
    for time, scan in zip(scene.times, scene.measurements, strict=True):
        online = online.after(float(time), scan)
    return online


@pytest.mark.slow
def test_as_good_as_all_at_once():
    scene = biased_scene(scans=40)
    online = went_through(OnlineRegistration(scene.sensors, REGION, RegistrationParameters(drift=0.0)), scene)
    at_once = register(scene)
    assert (np.abs(online.biases - at_once.biases) < 1.5 * at_once.deviations).all()
    np.testing.assert_allclose(np.sqrt(np.diag(online.covariance)), at_once.deviations, rtol=0.3)


@pytest.mark.slow
def test_drift_is_followed():
    """Range of one radar, 0 to 150 m in 100 scans of 36 s: the last scans' biases, not the mean of all."""
    plain = scene_of(radars(), 2, 100)
    online = OnlineRegistration(plain.sensors, REGION, RegistrationParameters(drift=0.5))
    for k in range(100):
        one = with_biases(plain, [{"range": 1.5 * k}, {}, {}])
        online = online.after(36.0 * k, one.measurements[k])
    assert online.biases[0] == pytest.approx(150.0, abs=25.0)
    assert online._kept == ()


@sample("saved_after", [3, 40], every=2)
def test_tracker_saved_and_restored(tmp_path, saved_after):
    scene = biased_scene(scans=saved_after + 3)
    one = MultiSensorTracker.for_scene(scene, registration="online")
    stepped(one, scene, 0, saved_after)
    one.save(tmp_path / "tracker.npz")
    other = MultiSensorTracker.for_scene(scene, registration="online")
    other.restore(tmp_path / "tracker.npz")
    for tracker in (one, other):
        stepped(tracker, scene, saved_after)
    assert np.array_equal(one.registration.biases, other.registration.biases)
    assert all(np.array_equal(a.mean, b.mean) for a, b in zip(one.tracks, other.tracks, strict=True))
    with pytest.raises(InvalidInputError, match="other settings"):
        MultiSensorTracker.for_scene(scene).restore(tmp_path / "tracker.npz")
    with np.load(tmp_path / "tracker.npz") as file:
        arrays = dict(file)
    arrays["registration_kept_sizes"] = arrays["registration_kept_sizes"] - 1
    arrays["registration_covariance"] = -arrays["registration_covariance"]
    np.savez(tmp_path / "spoiled.npz", **arrays)
    with pytest.raises(InvalidInputError, match="registration"):
        other.restore(tmp_path / "spoiled.npz")


@pytest.mark.slow
def test_tracker_with_biases_tracks_as_without():
    plain = scene_of(radars(), 4, 25)
    wrong = with_biases(plain, BIASES)
    counts = {}
    for name, scene, how in (("plain", plain, None), ("wrong", wrong, None), ("online", wrong, "online")):
        tracker = MultiSensorTracker.for_scene(scene, registration=how)
        stepped(tracker, scene)
        truth = plain.scan(24).truth_positions
        confirmed = np.array([track.position for track in tracker.tracks if track.confirmed])
        apart = np.linalg.norm(truth[:, None] - confirmed[None], axis=2).min(axis=1)
        counts[name] = (len(confirmed), np.median(apart))
    assert counts["online"][1] < 1.3 * counts["plain"][1] < counts["wrong"][1]
    assert abs(counts["online"][0] - counts["plain"][0]) <= 1


def test_bad_input():
    scene = biased_scene(scans=2)
    with pytest.raises(InvalidInputError, match="registration: expected 'online'"):
        MultiSensorTracker.for_scene(scene, registration="batch")
    with pytest.raises(InvalidInputError, match="'time' is not estimated online"):
        OnlineRegistration(scene.sensors, REGION, RegistrationParameters(components=("time",)))
    with pytest.raises(InvalidInputError, match="number 0 is a int, expected a Sensor"):
        OnlineRegistration([1])
    online, z = OnlineRegistration(scene.sensors, REGION), scene.measurements[0]
    for given, match in (
        (z[:2], "measurements: 2 sensors, expected 3"),
        ([z[0], z[1][:, :2], z[2]], "measurements, sensor 1 must have shape .n, 3., got"),
        ([z[0], z[1], np.zeros(3)], "measurements, sensor 2 must have shape"),
        ([np.full((1, 3), np.nan), *z[1:]], "measurements, sensor 0 must be finite"),
    ):
        for act in (online.correct, lambda one: online.after(0.0, one)):
            with pytest.raises(InvalidInputError, match=match):
                act(given)
