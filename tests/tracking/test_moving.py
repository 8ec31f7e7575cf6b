"""Targets that move, that stand, and large ones with several tracks."""

from types import SimpleNamespace

import numpy as np

from assoc.tracking import MovingTargets


def picture(*tracks, missed=0):
    return [
        SimpleNamespace(track_id=i, position=np.array([x, y, 0.0]), velocity=np.array([vx, 0.0, 0.0]), missed=missed)
        for i, x, y, vx in tracks
    ]


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
    targets = MovingTargets(away=15.0, length=40.0, together=1.0)
    targets.of(picture((7, 0.0, 0.0, 2.0), (3, 20.0, 0.0, 2.0), (5, 60.0, 10.0, -2.0)))
    (ship, boat) = targets.of(picture((3, 40.0, 0.0, 2.1), (5, 30.0, 10.0, -2.0), (7, 20.0, 0.0, 2.0)))
    assert (ship.track_id, ship.moving, boat.track_id) == (7, True, 5)
    np.testing.assert_allclose(ship.position, [30.0, 0.0, 0.0])
    np.testing.assert_allclose(ship.velocity, [2.05, 0.0, 0.0])
