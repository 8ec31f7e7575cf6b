"""Reid's clusters against hypotheses about the whole scene, enumerated one by one with a plain Kalman filter."""

import itertools
import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from assoc.filters import ConstantVelocity, KalmanFilter
from assoc.tracking import HypothesisOrientedMHT, Initiation, LifeCycle
from assoc.tracking.mht.children import FALSE, NEW, Meanings, best_children
from assoc.tracking.mht.clusters import cluster, merged, parts, without
from tests.sizes import few_or_all
from tests.tracking import plain

GATE = 0.99
# so wide that no track comes near the edges, where a sensor misses less
REGION = 3.0 * plain.REGION
SENSOR = replace(plain.sensor(rate=0.5), field_of_view=REGION)


class WholeScene:
    """All hypotheses about everything: no clusters, no ranking; n-scan pruning against the best.

    A track is its measurements ((scan, number), ...), its score, mean and covariance; a hypothesis is a list of them.
    """

    def __init__(self, one, depth):
        self.one, self.depth, self.scan, self.time = one, depth, 0, 0.0
        self.hypotheses = [(0.0, {})]

    def step(self, time, z):
        one, known = self.one, {}
        density = one.false_alarm_rate / one.volume
        hit, miss = math.log(one.detection_probability / density), math.log(1 - one.detection_probability)
        birth = math.log(one.detection_probability * plain.BIRTH / one.false_alarm_rate)
        grown = []
        for weight, tracks in self.hypotheses:
            for name, track in tracks.items():
                if name not in known:
                    known[name] = self._next(track, z, time - self.time)
            # None: a false alarm
            meanings = [[None, "new", *(t for t in tracks if j in known[t])] for j in range(len(z))]
            for way in itertools.product(*meanings):
                old = [t for t in way if isinstance(t, tuple)]
                if len(old) != len(set(old)):
                    continue
                total, after = weight, {}
                for name, (score, mean, cov) in ((t, known[t][None]) for t in tracks):
                    if name in old:
                        j = way.index(name)
                        mean, cov, log = known[name][j]
                        gain, label = hit + log, (*name, (self.scan, j))
                    else:
                        gain, label = miss, name
                    total += gain
                    after[label] = (score + gain, mean, cov)
                for j, what in enumerate(way):
                    if what == "new":
                        total += birth
                        after[((self.scan, j),)] = (birth, *plain.start(z[j], one.covariance))
                grown.append((total, after))
        self.hypotheses = sorted(grown, key=lambda h: -h[0])
        self.time, self.scan = time, self.scan + 1
        if self.scan >= self.depth:
            oldest = self.scan - self.depth
            said = [{(t[0], m) for t in tracks for m in t if m[0] == oldest} for _, tracks in self.hypotheses]
            self.hypotheses = [h for h, own in zip(self.hypotheses, said, strict=True) if own == said[0]]

    def _next(self, track, z, dt):
        score, mean, cov = track
        mean, cov = plain.predict(mean, cov, dt) if dt else (mean, cov)
        found = {None: (score, mean, cov)}
        S = cov[:3, :3] + self.one.covariance
        for j, one in enumerate(z):
            away = one - mean[:3]
            if away @ np.linalg.solve(S, away) <= chi2.ppf(GATE, 3):
                found[j] = plain.correct(mean, cov, one, self.one.covariance)
        return found


def tracker(depth, **options):
    return HypothesisOrientedMHT(
        [SENSOR],
        KalmanFilter(ConstantVelocity(plain.Q_SIGMA, kind="continuous")),
        region=REGION,
        life_cycle=LifeCycle(missed_probability=1e-12, false_probability=1e-2),
        initiation=Initiation(speed=plain.SPEED, birth_rate=plain.BIRTH, widest=1.0),
        gate_probability=GATE,
        depth=depth,
        **{"max_hypotheses": 10**6, "hypothesis_drop": 1e6, **options},
    )


def meeting(seed):
    """Two targets that come near each other and part, a third far from them, a false alarm; seven scans."""
    rng = np.random.default_rng(seed)
    scans = []
    for k, gap in enumerate([260.0, 120.0, 60.0, 120.0, 260.0, 400.0, 540.0]):
        middle = np.array([500.0, 300.0, 100.0])
        truth = middle + np.array([[-gap / 2, 0, 0], [gap / 2, 0, 0], [0.0, 600.0, 200.0]])
        seen = truth[rng.random(3) < (1.0 if k < 2 else 0.8)]
        z = seen + rng.normal(0, 10, seen.shape)
        if k == 2:
            z = np.concatenate([z, middle[None] + rng.normal(0, 10, 3)])
        scans.append((4.0 * k, z[rng.permutation(len(z))]))
    return scans


def in_window(name, score, scan, depth):
    """A track by its measurements that the window still has, and its score."""
    return tuple(m for m in name if m[0] > scan - depth), round(float(score), 6)


def named(own, row):
    """A branch of the tracker in the same words."""
    history = own.state.method_state.window.history[row]
    used = [(own.num_steps - 1 - age, int(m) - 1) for age, m in reversed([*enumerate(history)]) if m]
    return tuple(used), round(float(own.state.tracks.score[row]), 6)


@pytest.mark.parametrize(("seed", "depth"), [(0, 2), (1, 2), (2, 2), pytest.param(0, 3, marks=pytest.mark.slow)])
def test_clusters_say_what_hypotheses_about_everything_say(seed, depth):
    own, whole = tracker(depth), WholeScene(SENSOR, depth)
    shared = []
    for scan, (time, z) in enumerate(meeting(seed)):
        own.step(time, [z])
        whole.step(time, z)
        assert math.prod(one.holds.shape[0] for one in own.state.method_state.clusters) == len(whole.hypotheses)
        weights = np.array([weight for weight, _ in whole.hypotheses])
        p = np.exp(weights - np.logaddexp.reduce(weights))
        np.testing.assert_allclose(own.probabilities, p, atol=1e-12)
        best = sorted(in_window(name, track[0], scan, depth) for name, track in whole.hypotheses[0][1].items())
        assert sorted(named(own, row) for row in own.state.method_state.best) == best
        expected, found = Counter(), Counter()
        for one, (_, tracks) in zip(p, whole.hypotheses, strict=True):
            for name, track in tracks.items():
                expected[in_window(name, track[0], scan, depth)] += one
        for one in own.state.method_state.clusters:
            for row, probability in zip(one.branches, one.probabilities @ one.holds, strict=True):
                found[named(own, row)] += probability
        assert found.keys() == expected.keys()
        for key, probability in expected.items():
            assert found[key] == pytest.approx(probability, abs=1e-10)
        homes = [
            i
            for i, one in enumerate(own.state.method_state.clusters)
            for row in one.best
            if own.state.tracks.confirmed[row]
        ]
        shared.append(len(homes) - len(set(homes)))
    # two of the three confirmed tracks were in one cluster, and fell apart again
    assert max(shared) > 0 and len(homes) == 3 and shared[-1] == 0


@few_or_all("problems", 20, 60)
@pytest.mark.parametrize("drop", [3.0, 1e6, math.inf])
def test_the_best_children_of_several_parents(drop, problems):
    rng = np.random.default_rng(5)
    for _ in range(problems):
        parents, tracks, count = (int(n) for n in rng.integers([1, 0, 1], [6, 5, 5]))
        near = rng.random((count, tracks)) < 0.6
        track = np.nonzero(near)[1].copy()
        first = np.append(0, near.sum(axis=1).cumsum())
        birth = np.where(rng.random(count) < 0.2, -np.inf, rng.normal(-1, 1, count))
        meanings = Meanings(first, track, rng.normal(2, 4, len(track)), birth)
        holds, before = rng.random((parents, tracks)) < 0.7, rng.normal(0, 3, parents)
        expected = []
        for h in range(parents):
            ways = [
                [(FALSE, 0.0), (NEW, birth[j])]
                + [(k, meanings.gain[k]) for k in range(first[j], first[j + 1]) if holds[h, track[k]]]
                for j in range(count)
            ]
            for way in itertools.product(*ways):
                taken = [track[k] for k, _ in way if k >= 0]
                value = before[h] + sum(gain for _, gain in way)
                if len(taken) == len(set(taken)) and value > -np.inf:
                    expected.append((value, h, tuple(k for k, _ in way)))
        expected.sort(reverse=True)
        most = int(rng.integers(1, 60))
        expected = [one for one in expected if one[0] >= expected[0][0] - drop][:most]
        parent, choice, weight = best_children(holds, before, meanings, most, drop)
        np.testing.assert_allclose(weight, [one[0] for one in expected], atol=1e-9)
        assert list(zip(parent.tolist(), map(tuple, choice.tolist()), strict=True)) == [one[1:] for one in expected]


def test_of_the_combinations_those_stay_that_may_become_the_best():
    # three tracks in the making, each less likely than not; measurements would make the first two likely
    doubtful = [cluster(np.array([i]), np.array([[False], [True]]), np.array([0.0, -2.0])) for i in range(3)]
    gain = np.array([9.0, 8.0, -2.0])
    one = merged(doubtful, gain, 2)
    assert {tuple(one.branches[held].tolist()) for held in one.holds} == {(0, 1), (0, 1, 2)}
    everything = merged(doubtful, gain, 100)
    assert sorted(everything.weight.tolist()) == sorted(-2.0 * n for n in (0, 1, 1, 1, 2, 2, 2, 3))


def test_hypotheses_that_differ_in_what_is_gone_alone_add_up():
    holds = np.array([[True, True], [True, False], [False, False]])
    one = without(cluster(np.array([4, 7]), holds, np.array([0.0, -0.5, -2.0])), np.array([False, True]))
    assert one.branches.tolist() == [4] and one.holds.tolist() == [[True], [False]]
    np.testing.assert_allclose(one.weight, [0.0, -2.0 - math.log(1.0 + math.exp(-0.5))])


def test_what_deleted_tracks_have_left_behind_stays_with_its_hypotheses():
    rng = np.random.default_rng(8)
    for _ in range(20):
        holds = np.unique(rng.random((9, 4)) < 0.5, axis=0)
        whole = cluster(np.arange(4), holds, rng.normal(0, 3, len(holds)))
        # all in one part: the weights are those of before, whatever the scores of what is left
        (one,) = parts(whole, np.zeros(len(whole.branches), dtype=np.int64), rng.normal(0, 3, len(whole.branches)))
        before = dict(zip(map(tuple, whole.holds.tolist()), whole.weight, strict=True))
        assert dict(zip(map(tuple, one.holds.tolist()), one.weight, strict=True)) == pytest.approx(before)
