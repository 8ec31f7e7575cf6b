"""Targets that move, that stand, and large ones with several tracks."""

from types import SimpleNamespace

import numpy as np
import pytest

from assoc.sensors import PositionSensor
from assoc.tracking import TRACKERS, Initiation, MovingTargets
from assoc.tracking.filter_choice import two_speeds


def picture(*tracks, missed=0, spread=(2.0, 0.3)):
    """Tracks (id, x, y, vx) with these standard deviations of places and velocities."""
    return [
        SimpleNamespace(
            track_id=i, position=np.array([x, y, 0.0]), velocity=np.array([vx, 0.0, 0.0]), missed=missed,
            covariance=np.diag(np.repeat(spread, 2)) ** 2,
        )
        for i, x, y, vx in tracks
    ]  # fmt: skip


def test_moving_is_having_been_away():
    targets = MovingTargets(away=15.0)
    seen = [targets.of(picture((1, x, 0.0, 2.0), (2, 3.0 * (x % 4), 50.0, 9.0))) for x in range(0, 20, 2)]
    assert [one.moving for step in seen for one in step if one.track_id == 1] == [False] * 8 + [True] * 2
    assert not any(one.moving for step in seen for one in step if one.track_id == 2)
    # it stays one where it stops and comes back, until the track ends
    assert targets.of(picture((1, 0.0, 0.0, 0.0)))[0].moving
    assert targets.of([]) == []
    assert not targets.of(picture((1, 100.0, 0.0, 0.0)))[0].moving


def test_what_is_not_seen_to_move_does_not():
    """A track of a dock drifts away while it is missed; a boat is detected again farther on."""
    targets = MovingTargets(away=15.0)
    targets.of(picture((1, 0.0, 0.0, 2.0)))
    assert not targets.of(picture((1, 40.0, 0.0, 2.0), missed=3))[0].moving
    assert targets.of(picture((1, 42.0, 0.0, 2.0)))[0].moving


def test_bow_and_stern_are_one_and_boats_that_pass_are_two():
    targets = MovingTargets(away=15.0)
    targets.of(picture((7, 0.0, 0.0, 2.0), (3, 20.0, 0.0, 2.0), (5, 60.0, 10.0, -2.0)))
    (ship, boat) = targets.of(picture((3, 40.0, 0.0, 2.1), (5, 30.0, 10.0, -2.0), (7, 20.0, 0.0, 2.0)))
    assert (ship.track_id, ship.moving, boat.track_id) == (7, True, 5)
    np.testing.assert_allclose(ship.position, [30.0, 0.0, 0.0])
    np.testing.assert_allclose(ship.velocity, [2.05, 0.0, 0.0])


def ids(targets, pictures):
    return [[one.track_id for one in targets.of(tracks)] for tracks in pictures][-1]


@pytest.mark.parametrize("size", [0.1, 1.0, 10.0])
def test_boats_abreast_are_two_at_any_scale(size):
    spread = (2.0 * size, 0.3 * size)
    pictures = [
        picture((1, 2.0 * k * size, 0.0, 2.0 * size), (2, 2.0 * k * size, 12.0 * size, 2.0 * size), spread=spread)
        for k in range(12)
    ]
    assert ids(MovingTargets(away=15.0 * size), pictures) == [1, 2]
    ahead = [
        picture((1, 2.0 * k * size, 0.0, 2.0 * size), (2, (2.0 * k + 12.0) * size, 0.0, 2.0 * size), spread=spread)
        for k in range(12)
    ]
    assert ids(MovingTargets(away=15.0 * size), ahead) == [1]


def test_boats_that_were_two_stay_two():
    """One comes up behind the other and follows it; hulls do not become shorter."""
    follows = [picture((1, 4.0 * k, 0.0, 4.0), (2, 7.0 * k + 10.0, 0.0, 7.0)) for k in range(10)]
    after = [picture((1, 40.0 + 4.0 * k, 0.0, 4.0), (2, 80.0 + 4.0 * k, 0.0, 4.0)) for k in range(10)]
    assert ids(MovingTargets(), after) == [1]
    assert ids(MovingTargets(), follows + after) == [1, 2]


def test_plots_of_a_hull_and_of_boats_abreast():
    """From plots: a hull of 30 m with some of them, two boats 12 m apart with one each."""
    rng = np.random.default_rng(0)
    lidar = PositionSensor(
        position=np.zeros(3), noise=[2.0, 2.0], detection_probability=0.9, false_alarm_rate=0.1,
        field_of_view=[[-500.0, 500.0], [-500.0, 500.0]],
    )  # fmt: skip
    tracker = TRACKERS["multi-sensor"](
        [lidar], two_speeds(0.5, 2), region=[[-500.0, 500.0], [-500.0, 500.0], [-1.0, 1.0]],
        initiation=Initiation(speed=5.0),
    )  # fmt: skip
    targets, found = MovingTargets(position=tracker.filter.motion.position), []
    for k in range(40):
        at = np.array([3.0 * k, 0.0])
        hull = at + [[-15.0, 0.0], [rng.uniform(-15.0, 15.0), 0.0], [15.0, 0.0]]
        boats = [200.0, 0.0] - at + [[0.0, 200.0], [0.0, 212.0]]
        plots = np.concatenate([hull[rng.random(3) < 0.7], boats[rng.random(2) < 0.9]])
        tracker.step(float(k), [plots + rng.normal(0.0, 1.0, plots.shape)])
        found = targets.of([track for track in tracker.tracks if track.confirmed])
    places = np.array([one.position[:2] for one in found if one.moving])
    near_boats = places[places[:, 1] > 100.0]
    assert len(near_boats) == 2 and np.linalg.norm(near_boats[0] - near_boats[1]) == pytest.approx(12.0, abs=4.0)
    assert len(places) == 3
