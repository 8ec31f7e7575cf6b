"""Priors that suit what is tracked."""

import numpy as np
import pytest

from assoc import InvalidInputError, Scene, simulation
from assoc._cli.track import options
from assoc.sensors import Radar2D
from assoc.tracking import Initiation, MultiSensorTracker, NearestNeighbourTracker
from assoc.tracking.file import described
from assoc.tracking.filter_choice import manoeuvre_noise
from assoc.tracking.target_kinds import TARGETS, target_kind
from tests.tracking.stepping import stepped


def harbour(seed=0, scans=20):
    """Two boats of 3 m/s in a harbour of 400 m, and one radar that turns in two seconds."""
    rng, times = np.random.default_rng(seed), 2.0 * np.arange(scans)
    radar = Radar2D(
        position=np.zeros(3), noise=[3.0, 0.01], false_alarm_rate=1.0, field_of_view=[[0, 280], [-np.pi, np.pi]]
    )
    measurements = []
    for time in times:
        boats = np.array([[-100 + 3 * time, 50, 0], [80, -90 + 2 * time, 0.0]])[rng.random(2) < 0.9]
        noise = rng.normal(0, 1, (len(boats), 2)) * radar.noise
        false = rng.uniform([0, -np.pi], [280, np.pi], (rng.poisson(1.0), 2))
        measurements.append([np.concatenate([radar.measure(boats) + noise, false])])
    return Scene([radar], times, measurements, [[-200, 200], [-200, 200], [-1, 1]])


def confirmed(scene, **options):
    tracker = MultiSensorTracker.for_scene(scene, **options)
    stepped(tracker, scene)
    return [track for track in tracker.tracks if track.confirmed]


@pytest.mark.parametrize("targets", ["ship", "auto"])
def test_boats_in_a_small_region_get_tracks(targets):
    scene = harbour()
    assert confirmed(scene) == []  # 300 m/s: the second detection may be anywhere
    speeds = sorted(float(np.linalg.norm(track.velocity)) for track in confirmed(scene, targets=targets))
    np.testing.assert_allclose(speeds, [2.0, 3.0], atol=0.7)


def test_auto_tells_aircraft_from_boats():
    assert target_kind("auto", harbour(1), NearestNeighbourTracker.for_scene).speed <= TARGETS["ship"].speed
    aircraft = simulation.simulate("three-radar", 1, scans=8)
    assert target_kind("auto", aircraft, NearestNeighbourTracker.for_scene).speed >= TARGETS["airliner"].speed


def test_priors_of_a_kind():
    scene = harbour()
    assert TARGETS["fighter"].speed == Initiation().speed
    assert TARGETS["fighter"].noise(4.0) == pytest.approx(manoeuvre_noise(4.0))
    ship = MultiSensorTracker.for_scene(scene, targets="ship").settings
    assert np.max(ship.initiation.speed) == 5.0
    given = MultiSensorTracker.for_scene(scene, targets="ship", initiation=Initiation(speed=9.0)).settings
    assert np.max(given.initiation.speed) == 9.0 and described(given.filter) == described(ship.filter)
    assert tuple(TARGETS) == options.TARGETS


def test_unknown_kinds():
    with pytest.raises(InvalidInputError, match="targets: unknown name 'boat'; known: airliner"):
        MultiSensorTracker.for_scene(harbour(scans=2), targets="boat")
    with pytest.raises(InvalidInputError, match="auto needs a scene"):
        target_kind("auto", None, NearestNeighbourTracker.for_scene)
