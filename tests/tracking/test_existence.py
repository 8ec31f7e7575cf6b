"""Whether a target is still there: a Bernoulli recursion, and what of a track is reported."""

import math

import numpy as np
import pytest

from assoc import filters
from assoc.filters import Gaussian
from assoc.tracking import TRACKERS, LifeCycle
from tests.tracking import plain

LIFETIME = 50.0


def tracker_of(kind, mean, P=(0.8, 0.6), **options):
    motion = filters.ConstantVelocity(plain.Q_SIGMA, kind="continuous")
    tracker = kind(
        [plain.sensor(P=one) for one in P], filters.KalmanFilter(motion), region=plain.REGION,
        life_cycle=LifeCycle(lifetime=LIFETIME, deletion_time=1e3), **options,
    )  # fmt: skip
    tracker.begin(0.0, Gaussian(mean[None], np.eye(6)[None]), score=20.0)
    return tracker


NOTHING = [np.zeros((0, 3))] * 2


@pytest.mark.parametrize("kind", TRACKERS.values())
def test_misses_and_time_take_from_existence_what_bayes_says(kind):
    tracker = tracker_of(kind, np.array([500.0, 500.0, 250.0, 0.0, 0.0, 0.0]))
    p, reported = 1 / (1 + math.exp(-20.0)), []
    for k in range(1, 5):
        tracker.step(2.0 * k, NOTHING)
        p *= math.exp(-2.0 / LIFETIME)
        for P in (0.8, 0.6):
            p = p * (1 - P) / (1 - p * P)
        (track,) = tracker.tracks
        assert track.existence == pytest.approx(p, rel=1e-6)
        assert track.confirmed
        reported.append(track.reported)
        assert track.status == ("coasting" if p >= 0.5 else "lost")
    assert reported[0] and not reported[-1]


@pytest.mark.parametrize("kind", TRACKERS.values())
def test_a_known_track_does_not_blink(kind):
    """One scan that all sensors missed may be a shadow, two are not."""
    place = np.array([[500.0, 500.0, 250.0]])
    tracker = tracker_of(kind, np.append(place, np.zeros(3)), P=(0.9, 0.9))
    seen = []
    for k, detected in enumerate([True] * 6 + [False] * 2 + [True], start=1):
        tracker.step(2.0 * k, [place] * 2 if detected else NOTHING)
        (track,) = [track for track in tracker.tracks if track.track_id == 1]
        seen.append(track.status)
    assert seen == ["confirmed"] * 6 + ["coasting", "lost", "confirmed"]
