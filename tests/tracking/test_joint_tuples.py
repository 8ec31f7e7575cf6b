"""The joint probabilistic tracker with all sensors at once against enumeration of all joint events."""

import itertools
import math

import numpy as np
import pytest

from assoc import InvalidInputError
from assoc.filters import Gaussian
from assoc.simulation import simulate
from assoc.tracking import Initiation, JointProbabilisticTracker
from assoc.tracking.associate.joint_tuples import MARGIN
from experiments.trackers.running import through
from tests.tracking import plain

SENSORS = [plain.sensor(0.8, 2e4, 10.0), plain.sensor(0.7, 1e4, 15.0)]
SCORE = 1.5


def tracker_of(**options):
    return plain.tracker_of(JointProbabilisticTracker, SENSORS, all_sensors=True, **options)


def close_targets(seed, count=3):
    """States of targets side by side, and a scan of two sensors with a false alarm each."""
    rng = np.random.default_rng(seed)
    mean = np.concatenate([rng.uniform(420, 440, (count, 3)), rng.normal(0, 10, (count, 3))], axis=1)
    cov = np.diag([60.0] * 3 + [20.0] * 3)
    z = []
    for one in SENSORS:
        seen = mean[rng.random(count) < 0.8, :3]
        z.append(np.concatenate([rng.normal(seen, one.noise[0]), rng.uniform(420, 450, (1, 3))]))
    return mean, cov, z


def corrected(mean, cov, zs):
    for s, z in zs.items():
        mean, cov, _ = plain.correct(mean, cov, z, SENSORS[s].covariance)
    return mean, cov


def by_enumeration(mean, cov, z, permutations):
    """Probability of each track and its measurements, the same as states use it, and scores after the scan."""
    p, ways = 1 / (1 + math.exp(-SCORE)), []
    for m in mean:
        alone, own = math.exp(plain.set_score({}, SENSORS, m, cov)), {}
        for rows in itertools.product(*(range(len(one) + 1) for one in z)):
            zs = {s: z[s][i - 1] for s, i in enumerate(rows) if i}
            gain = math.exp(plain.set_score(zs, SENSORS, m, cov))
            if zs and gain > alone * math.exp(-MARGIN):
                own[rows] = p * gain
        own[(0,) * len(z)] = 1.0 - p + p * alone
        ways.append(own)
    total, pair, sets = 0.0, [dict.fromkeys(own, 0.0) for own in ways], {}
    for event in itertools.product(*ways):
        used = [(s, i) for rows in event for s, i in enumerate(rows) if i]
        if len(set(used)) < len(used):
            continue
        weight = math.prod(own[rows] for own, rows in zip(ways, event, strict=True))
        total += weight
        for of, rows in zip(pair, event, strict=True):
            of[rows] += weight
        sets.setdefault((tuple(any(rows) for rows in event), frozenset(used)), []).append((weight, event))
    share = [dict.fromkeys(own, 0.0) for own in ways]
    for events in sets.values():
        for of, rows in zip(share, max(events)[1], strict=True):
            of[rows] += sum(weight for weight, _ in events)
    pair = [{rows: weight / total for rows, weight in of.items()} for of in pair]
    share = [{rows: weight / total for rows, weight in of.items()} for of in share]
    return pair, pair if permutations == "all" else share


@pytest.mark.parametrize("permutations", ["best", "all"])
@pytest.mark.parametrize("seed", range(6))
def test_probabilities_existence_and_states_are_those_of_all_joint_events(seed, permutations):
    mean, cov, z = close_targets(seed)
    tracker = tracker_of(max_events=2**20, permutations=permutations)
    tracker.begin(0.0, Gaussian(mean, np.repeat(cov[None], len(mean), axis=0)), score=SCORE)
    tracker.step(0.0, z)
    pair, share = by_enumeration(mean, cov, z, permutations)
    for s, found in enumerate(tracker.probabilities):
        for i, m, p, low, high in zip(
            found.track_id, found.measurement, found.probability, found.lower, found.upper, strict=True
        ):
            true = sum(weight for rows, weight in pair[i - 1].items() if rows[s] == m + 1)
            assert p == pytest.approx(true, abs=1e-9)
            assert low - 1e-12 <= true <= high + 1e-12
    tracks = {track.track_id: track for track in tracker.tracks}
    p, missed = 1 / (1 + math.exp(-SCORE)), math.prod(1 - one.detection_probability for one in SENSORS)
    for t in range(len(mean)):
        left = pair[t][0, 0] * p * missed / (1 - p + p * missed)
        exists = 1.0 - pair[t][0, 0] + left
        assert 1.0 / (1.0 + math.exp(-tracks[t + 1].score)) == pytest.approx(exists, abs=1e-9)
        parts = []
        for rows, weight in share[t].items():
            zs = {s: z[s][i - 1] for s, i in enumerate(rows) if i}
            parts.append((weight if zs else left, *corrected(mean[t], cov, zs)))
        middle = sum(w * x for w, x, _ in parts) / exists
        spread = sum(w * (C + np.outer(x - middle, x - middle)) for w, x, C in parts) / exists
        # less likely tuples keep their permutations
        close = {"rtol": 1e-4} if permutations == "all" else {"rtol": 1e-3, "atol": 2e-2}
        np.testing.assert_allclose(tracks[t + 1].mean, middle, **close)
        np.testing.assert_allclose(tracks[t + 1].covariance, spread, rtol=1e-3, atol=1.0)


@pytest.mark.parametrize("seed", range(6))
def test_intervals_of_few_events_hold(seed):
    mean, cov, z = close_targets(seed, count=4)
    tracker = tracker_of(max_events=4)
    tracker.begin(0.0, Gaussian(mean, np.repeat(cov[None], len(mean), axis=0)), score=SCORE)
    tracker.step(0.0, z)
    pair, _ = by_enumeration(mean, cov, z, "all")
    width = 0.0
    for s, found in enumerate(tracker.probabilities):
        for i, m, low, high in zip(found.track_id, found.measurement, found.lower, found.upper, strict=True):
            true = sum(weight for rows, weight in pair[i - 1].items() if rows[s] == m + 1)
            assert low - 1e-12 <= true <= high + 1e-12
            width = max(width, high - low)
    assert width > 1e-3


@pytest.mark.parametrize("score", [SCORE, -9.0])
def test_measurements_of_one_instant_are_as_those_with_times_of_their_own(score):
    """The same scan, its instant given for each measurement; tracks that are detected, and that hardly exist."""
    mean, cov, z = close_targets(1)
    tracks = []
    for times in (None, [np.full(len(one), 2.0) for one in z]):
        tracker = tracker_of(initiation=Initiation(birth_rate=1e-9, widest=1e-4))
        tracker.begin(0.0, Gaussian(mean, np.repeat(cov[None], len(mean), axis=0)), score=score)
        tracker.step(2.0, z, times)
        tracks.append(tracker.tracks)
    assert (tracks[0][0].last_detection == 2.0) == (score > 0.0)
    for one, other in zip(*tracks, strict=True):
        assert one.score == pytest.approx(other.score, rel=1e-6)
        assert one.last_detection == other.last_detection
        np.testing.assert_allclose(one.mean, other.mean, rtol=1e-6)
        np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-6)


def test_targets_are_found_and_followed():
    """From nothing, by new tracks of tuples: each of the targets that fly all the time has one reported track."""
    scene = simulate("three-radar", 5, scans=12)
    done = through(JointProbabilisticTracker.for_scene(scene, all_sensors=True), scene)
    truth, (_, places) = scene.truth.positions[-1], done.confirmed[-1]
    apart = np.linalg.norm(truth[:, None, :2] - places[None, :, :2], axis=2)
    assert np.mean(apart.min(axis=1) < 500.0) > 0.8
    assert len(places) <= len(truth) + 1


def test_clusters_too_wide_for_exact_sums_are_followed_as_well():
    """Sums over clusters of more than three open measurements are swept with the heaviest states."""
    scene, found = simulate("crowd", 7, targets=24, scans=6), []
    for events in (2**20, 8):
        tracker = JointProbabilisticTracker.for_scene(scene, all_sensors=True, max_events=events)
        found.append(through(tracker, scene).confirmed)
    for (ids, places), (other_ids, other_places) in zip(*found, strict=True):
        assert ids.tolist() == other_ids.tolist()
        assert np.abs(places - other_places).max(initial=0.0) < 5.0
    assert len(found[0][-1][0]) > 15


def test_all_sensors_is_checked():
    with pytest.raises(InvalidInputError, match="all_sensors must be True or False"):
        JointProbabilisticTracker(SENSORS, all_sensors="yes")
