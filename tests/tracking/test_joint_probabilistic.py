"""The joint probabilistic tracker against enumeration of all joint events."""

import itertools
import math

import numpy as np
import pytest

from assoc import InvalidInputError, filters
from assoc.filters import Gaussian
from assoc.filters.merging import merged
from assoc.tracking import JointProbabilisticTracker
from tests.tracking import plain

SCORE = 1.5
"""Of the tracks at the start: their existence is likely, not certain."""


def tracker_of(sensor, **options):
    return plain.tracker_of(JointProbabilisticTracker, [sensor], **options)


def close_targets(rng, count=3):
    """States of targets side by side, and a scan with one false alarm."""
    mean = np.concatenate([rng.uniform(420, 450, (count, 3)), rng.normal(0, 10, (count, 3))], axis=1)
    cov = np.diag([60.0] * 3 + [20.0] * 3)
    seen = mean[rng.random(count) < 0.8, :3]
    z = np.concatenate([seen + rng.normal(0, 10, seen.shape), rng.uniform(420, 450, (1, 3))])
    return mean, cov, rng.permutation(z)


def by_enumeration(mean, cov, z, sensor, score):
    """Probability of each pair, the same with the best permutations alone, of existence; and corrected states."""
    T, M = len(mean), len(z)
    p, P = 1 / (1 + math.exp(-score)), sensor.detection_probability
    density = sensor.false_alarm_rate / sensor.volume
    done = [[plain.correct(mean[t], cov, z[m], sensor.covariance) for m in range(M)] for t in range(T)]
    total, pair, share, sets = 0.0, np.zeros((T, M + 1)), np.zeros((T, M + 1)), {}
    for way in itertools.product(range(M + 1), repeat=T):
        used = [w for w in way if w]
        if len(used) != len(set(used)):
            continue
        weight = 1.0
        for t, w in enumerate(way):
            weight *= p * P * math.exp(done[t][w - 1][2]) / density if w else 1 - p * P
        total += weight
        pair[range(T), way] += weight
        sets.setdefault((tuple(w > 0 for w in way), frozenset(used)), []).append((weight, way))
    for ways in sets.values():
        share[range(T), max(ways)[1]] += sum(weight for weight, _ in ways) / total
    pair /= total
    left = pair[:, 0] * p * (1 - P) / (1 - p * P)
    return pair, share, left, done


@pytest.mark.parametrize("permutations", ["best", "all"])
@pytest.mark.parametrize("seed", range(12))
def test_probabilities_existence_and_states_are_those_of_all_joint_events(seed, permutations):
    rng, sensor = np.random.default_rng(seed), plain.sensor()
    mean, cov, z = close_targets(rng)
    tracker = tracker_of(sensor, max_events=10_000, permutations=permutations)
    tracker.begin(0.0, Gaussian(mean, np.repeat(cov[None], len(mean), axis=0)), score=SCORE)
    tracker.step(0.0, [z])
    pair, share, left, done = by_enumeration(mean, cov, z, sensor, SCORE)
    (found,) = tracker.probabilities
    for i, m, p, low, high in zip(
        found.track_id, found.measurement, found.probability, found.lower, found.upper, strict=True
    ):
        assert p == pytest.approx(pair[i - 1, m + 1], abs=1e-9)
        assert low - 1e-12 <= pair[i - 1, m + 1] <= high + 1e-12
    if permutations == "all":
        share = pair
    # pairs below 1e-4 keep their probability
    np.testing.assert_allclose(found.share, share[found.track_id - 1, found.measurement + 1], atol=2e-4)
    exists = pair[:, 1:].sum(axis=1) + left
    tracks = {track.track_id: track for track in tracker.tracks}
    for t in range(len(mean)):
        track = tracks[t + 1]
        assert track.score == pytest.approx(math.log(exists[t] / (1 - exists[t])), abs=1e-6)
        parts = [(left[t], mean[t], cov), *((share[t, m + 1], *done[t][m][:2]) for m in range(len(z)))]
        middle = sum(w * x for w, x, _ in parts) / exists[t]
        spread = sum(w * (C + np.outer(x - middle, x - middle)) for w, x, C in parts) / exists[t]
        close = {"rtol": 1e-6} if permutations == "all" else {"rtol": 1e-3, "atol": 2e-2}
        np.testing.assert_allclose(track.mean, middle, **close)
        np.testing.assert_allclose(track.covariance, spread, rtol=1e-5, atol=1.0 if permutations == "best" else 1e-6)


@pytest.mark.parametrize("own_times", [False, True])
def test_tracks_side_by_side_stay_apart(own_times):
    """Two targets 20 m abreast under a sensor of 10 m: averaged over permutations, they meet in the middle."""
    place, velocity = np.array([[400.0, 490.0, 250.0], [400.0, 510.0, 250.0]]), np.array([3.0, 0.0, 0.0])
    start = Gaussian(np.hstack([place, [velocity] * 2]), np.array([np.diag([100.0] * 3 + [4.0] * 3)] * 2))
    apart = {"best": [], "all": []}
    for seed, (permutations, gaps) in itertools.product(range(3), apart.items()):
        rng, tracker = np.random.default_rng(seed), tracker_of(plain.sensor(), permutations=permutations)
        tracker.begin(0.0, start)
        for k in range(1, 41):
            seen = place[rng.random(2) < 0.9] + k * velocity
            z = seen + rng.normal(0.0, 10.0, seen.shape)
            tracker.step(float(k), [z], [np.full(len(z), float(k))] if own_times else None)
            at = {track.track_id: track.position[1] for track in tracker.tracks}
            if k > 20:
                gaps.append(abs(at[1] - at[2]) / 20.0)
    assert np.mean(apart["all"]) < 0.5
    assert 0.8 < np.mean(apart["best"]) < 1.2


@pytest.mark.parametrize(("permutations", "least", "most"), [("best", 0.8, 1.5), ("all", 0.0, 0.5)])
def test_tracks_of_a_formation_stay_apart(permutations, least, most):
    """Twelve in rows of three, 12 m apart under a sensor of 10 m, one cluster: errors widen it, no more."""
    velocity, spread = np.array([3.0, 0.0, 0.0]), []
    place = [380.0, 480.0, 250.0] + 12.0 * np.stack([np.arange(12) // 3, np.arange(12) % 3, np.zeros(12)], axis=1)
    start = Gaussian(np.hstack([place, [velocity] * 12]), np.array([np.diag([100.0] * 3 + [4.0] * 3)] * 12))
    for seed in range(3):
        rng, tracker = np.random.default_rng(seed), tracker_of(plain.sensor(), permutations=permutations)
        tracker.begin(0.0, start)
        for k in range(1, 41):
            seen = place[rng.random(12) < 0.9] + k * velocity
            tracker.step(float(k), [seen + rng.normal(0.0, 10.0, seen.shape)])
        spread.append(np.sqrt(np.var([track.position[:2] for track in tracker.tracks], axis=0).sum()))
    assert least < np.mean(spread) / np.sqrt(np.var(place, axis=0).sum()) < most


@pytest.mark.parametrize("seed", range(12))
def test_intervals_of_few_events_hold(seed):
    rng, sensor = np.random.default_rng(seed), plain.sensor()
    mean, cov, z = close_targets(rng, count=4)
    tracker = tracker_of(sensor, max_events=2)
    tracker.begin(0.0, Gaussian(mean, np.repeat(cov[None], len(mean), axis=0)), score=SCORE)
    tracker.step(0.0, [z])
    pair, *_ = by_enumeration(mean, cov, z, sensor, SCORE)
    (found,) = tracker.probabilities
    true = pair[found.track_id - 1, found.measurement + 1]
    assert (found.lower - 1e-12 <= true).all()
    assert (true <= found.upper + 1e-12).all()
    assert (found.upper - found.lower).max() > 1e-3


def test_models_are_merged_each_by_itself():
    rng = np.random.default_rng(2)
    means, weights = rng.normal(0, 5, (3, 2, 4)), rng.dirichlet([1, 1], 3)
    roots = rng.normal(0, 1, (3, 2, 4, 4))
    covariances = roots @ roots.transpose(0, 1, 3, 2)
    state = filters.InteractingMultipleModel(
        [filters.KalmanFilter(filters.ConstantVelocity(q, dimensions=2)) for q in (1.0, 9.0)],
        np.array([[0.9, 0.1], [0.1, 0.9]]),
    ).start(Gaussian(means[:, 0], covariances[:, 0]))
    mixture = type(state)(means, covariances, weights)
    share = np.array([0.25, 0.75, 1.0])
    found = merged(mixture, np.array([0, 0, 1]), share, 2)
    # moments of the whole mixture are kept, and a single state stays what it is
    whole = 0.25 * mixture.mean[0] + 0.75 * mixture.mean[1]
    np.testing.assert_allclose(found.mean[0], whole)
    away = mixture.mean[:2] - whole
    parts = mixture.covariance[:2] + away[:, :, None] * away[:, None]
    np.testing.assert_allclose(found.covariance[0], 0.25 * parts[0] + 0.75 * parts[1])
    np.testing.assert_allclose(found.means[1], means[2])
    np.testing.assert_allclose(found.weights[0], 0.25 * weights[0] + 0.75 * weights[1])


def test_states_that_cannot_be_merged_are_refused():
    ensemble = filters.EnsembleKalmanFilter(filters.ConstantVelocity(1.0), 20)
    with pytest.raises(InvalidInputError, match="cannot be merged"):
        JointProbabilisticTracker([plain.sensor()], ensemble, region=plain.REGION)
    for option in ({"max_events": 0}, {"permutations": "most"}):
        with pytest.raises(InvalidInputError, match=next(iter(option))):
            tracker_of(plain.sensor(), **option)
