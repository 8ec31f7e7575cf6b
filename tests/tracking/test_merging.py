"""Two tracks of one target become one; two targets side by side stay two."""

import numpy as np
import pytest

from assoc import filters
from assoc.filters import Gaussian
from assoc.tracking import TRACKERS
from assoc.tracking.records.doubles import Doubles
from tests.sizes import sample
from tests.tracking import plain

START = np.array([500.0, 500.0, 250.0, 5.0, 0.0, 0.0])


def run(kind, starts, places, scans=30, P=0.9, bias=(0.0, 0.0, 0.0), path=None):
    """Steps of a tracker that begins with tracks at `starts` (T, 6), where targets fly from `places` (n, 6)."""
    rng, sensors = np.random.default_rng(1), [plain.sensor(P=P, rate=0.5) for _ in range(3)]
    motion = filters.ConstantVelocity(plain.Q_SIGMA, kind="continuous")
    tracker = kind(sensors, filters.KalmanFilter(motion), region=plain.REGION)
    tracker.begin(0.0, Gaussian(starts, np.tile(np.diag([100.0] * 3 + [9.0] * 3), (len(starts), 1, 1))))
    steps = []
    for k in range(1, scans + 1):
        now = places[:, :3] + k * places[:, 3:]
        found = [now[rng.random(len(now)) < P] for _ in sensors]
        noisy = [z + rng.normal(0.0, 10.0, z.shape) + [0.0, off, 0.0] for z, off in zip(found, bias, strict=True)]
        steps.append(tracker.step(float(k), noisy))
        if path is not None and k == scans // 2:
            tracker.save(path)
            tracker = kind(sensors, filters.KalmanFilter(motion), region=plain.REGION)
            tracker.restore(path)
    return tracker, steps


# the others join all sensors' measurements first, or one track is soon starved
@pytest.mark.parametrize("kind", [TRACKERS[n] for n in ("multi-sensor", "mht", "nearest-neighbour", "mht-hypothesis")])
def test_two_tracks_of_one_target_become_the_older_one(kind, tmp_path):
    """Two sensors err to one side, the third to the other, and each side feeds its own track."""
    bias = 15.0, 15.0, -15.0
    starts = START + np.array([[0.0, y, 0.0, 0.0, 0.0, 0.0] for y in (15.0, -15.0)])
    tracker, steps = run(kind, starts, START[None], 12, bias=bias)
    assert [track.track_id for track in tracker.tracks if track.confirmed] == [1]
    merged = np.concatenate([step.merged for step in steps])
    assert merged.tolist() == [[2, 1]]
    (when,) = (k for k, step in enumerate(steps) if len(step.merged))
    assert 2 in steps[when].ended and not any((ids == 2).any() for step in steps[when:] for ids in step.assigned)
    # a tracker saved in between comes to the same
    again = run(kind, starts, START[None], 12, bias=bias, path=tmp_path / "tracker.npz")[1]
    assert np.concatenate([step.merged for step in again]).tolist() == merged.tolist()


@sample("P", [0.6, 0.9], every=2)
@pytest.mark.parametrize("kind", TRACKERS.values())
def test_two_targets_side_by_side_stay_two(kind, P):
    both = np.stack([START, START + [0.0, 20.0, 0.0, 0.0, 0.0, 0.0]])
    tracker, steps = run(kind, both, both, P=P)
    assert not any(len(step.merged) for step in steps)
    assert [track.track_id for track in tracker.tracks if track.confirmed] == [1, 2]


def test_so_much_evidence_is_as_rare_as_declared():
    """Two targets, each detected with P: the mean likelihood ratio is one at most."""
    rng, P = np.random.default_rng(2), 0.7
    # P as the prior has it
    drawn = rng.beta(5.0 * P, 5.0 * (1.0 - P), (20000, 1, 1))
    a, b = (rng.random((20000, 4, 2)) < drawn for _ in range(2))
    counts = np.stack([a & ~b, ~a & b, ~a & ~b], axis=-1).sum(axis=1)
    pairs = np.zeros((20000, 2), dtype=np.int64)
    ratio = np.exp(Doubles(pairs, counts[:, :1].astype(float)).one_target(np.array([P])))
    apart = ~(a & b).any(axis=1)[:, 0]
    assert 0.5 < (ratio * apart).mean() <= 1.05
    # a track that is never fed may be of a target out of sight
    assert not ratio[(counts[:, 0, :2] == 0).any(axis=1)].any()


@pytest.mark.parametrize("kind", [TRACKERS["mht"], TRACKERS["mht-hypothesis"]])
def test_a_track_that_the_best_hypothesis_gives_up_takes_no_more_measurements(kind):
    """Else its tree would go on by whatever measurement of another target is in its gate when its time is up."""
    sensors = [plain.sensor(P=0.9, rate=0.5)]
    tracker = kind(
        sensors, filters.KalmanFilter(filters.ConstantVelocity(10.0, kind="continuous")), region=plain.REGION
    )
    starts = START + np.array([[0.0, y, 0.0, 0.0, 0.0, 0.0] for y in (0.0, 60.0)])
    tracker.begin(0.0, Gaussian(starts, np.tile(np.diag([100.0] * 3 + [9.0] * 3), (2, 1, 1))), 200.0)
    for k in range(1, 20):
        tracker.step(float(k), [START[None, :3] + k * START[None, 3:]])
    assert [track.track_id for track in tracker.tracks if track.confirmed] == [1]
