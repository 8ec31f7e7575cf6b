"""The problem of tracks of uncertain existence against Bayes' rule over all that may be the case."""

import dataclasses
import itertools
import math

import numpy as np
import pytest

import assoc
from assoc import InvalidInputError, filters
from assoc.filters import Gaussian
from assoc.sensors import Platform
from assoc.tracking import track_problem
from tests.tracking import plain

SENSORS = [plain.sensor(0.8, 2e5, 10.0), plain.sensor(0.9, 1e5, 15.0)]
"""Under so many false alarms that measurements in gates are more probably false."""
FILTER = filters.KalmanFilter(filters.ConstantVelocity(plain.Q_SIGMA, kind="continuous"))


def close_tracks(seed, count=2):
    """States of tracks side by side, and a scan of two sensors with false alarms."""
    rng = np.random.default_rng(seed)
    mean = np.concatenate([rng.uniform(420, 450, (count, 3)), rng.normal(0, 10, (count, 3))], axis=1)
    cov = np.diag([60.0] * 3 + [20.0] * 3)
    z = []
    for one in SENSORS:
        seen = mean[rng.random(count) < 0.8, :3]
        false = rng.uniform(420, 450, (int(rng.integers(0, 2)), 3))
        z.append(np.concatenate([seen + rng.normal(0, one.noise[0], seen.shape), false]))
    return mean, cov, z


def by_bayes(mean, cov, z, existence):
    """Posterior of each (track, measurements), and of existence: over who exists and what each sensor saw of whom."""
    count, total, pair, there = len(mean), 0.0, {}, np.zeros(len(mean))
    for real in itertools.product([False, True], repeat=count):
        prior = np.prod([r if e else 1.0 - r for e, r in zip(real, existence, strict=True)])
        ways = []
        for own in z:
            ways.append([
                way for way in itertools.product(range(len(own) + 1), repeat=count)
                if len({w for w in way if w}) == sum(w > 0 for w in way)
                and all(e or not w for w, e in zip(way, real, strict=True))
            ])  # fmt: skip
        for seen in itertools.product(*ways):
            weight = float(prior)
            for t in range(count):
                zs = {s: z[s][way[t] - 1] for s, way in enumerate(seen) if way[t]}
                weight *= math.exp(plain.set_score(zs, SENSORS, mean[t], cov)) if real[t] else 1.0
            total += weight
            there += weight * np.array(real)
            for t in range(count):
                key = (t + 1, *(way[t] for way in seen))
                pair[key] = pair.get(key, 0.0) + weight
    return {key: weight / total for key, weight in pair.items()}, there / total


@pytest.mark.parametrize("existence", [[0.9, 0.3], [1.0, 0.5], [1e-3, 0.999]])
@pytest.mark.parametrize("seed", range(4))
def test_marginals_are_bayes_rule(seed, existence):
    mean, cov, z = close_tracks(seed)
    states = Gaussian(mean, np.repeat(cov[None], len(mean), axis=0))
    problem = track_problem(FILTER, states, SENSORS, z, existence, gate_probability=1 - 1e-12)
    found = assoc.marginals(problem)
    truth, there = by_bayes(mean, cov, z, existence)
    assert found.exact.all()
    for row, p in zip(found.tuples.tolist(), found.probability, strict=True):
        if row[0]:
            assert p == pytest.approx(truth[tuple(row)], abs=1e-9)
    # every way that counts is a tuple
    listed = set(map(tuple, found.tuples.tolist()))
    assert all(key in listed for key, p in truth.items() if p > 1e-9)
    for t, r in enumerate(existence):
        alone = found.probability[(found.tuples == [t + 1, 0, 0]).all(axis=1)][0]
        missed = r * math.prod(1.0 - one.detection_probability for one in SENSORS)
        assert 1.0 - alone + alone * missed / (1.0 - r + missed) == pytest.approx(there[t], abs=1e-9)


def test_no_track_and_no_measurement():
    empty = Gaussian(np.zeros((0, 6)), np.zeros((0, 6, 6)))
    assert track_problem(FILTER, empty, SENSORS, [[], [[1.0, 2.0, 3.0]]]).sizes.tolist() == [0, 0, 1]


ON_A_SHIP = dataclasses.replace(SENSORS[1], platform=Platform([0.0, 1.0], [[0.0] * 3, [10.0] * 3]))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"sensors": [SENSORS[0], ON_A_SHIP]}, "sensors: number 2 is on a platform"),
        ({"sensors": [], "measurements": []}, "sensors: expected at least one"),
        ({"states": np.zeros((2, 6))}, "states: expected states of 6 components"),
        ({"states": Gaussian(np.zeros((2, 4)), np.stack([np.eye(4)] * 2))}, "states: expected states of 6 components"),
        ({"existence": [0.5, 0.0]}, "existence: expected probabilities above 0"),
        ({"existence": [0.5, 0.5, 0.5]}, "existence: expected one number, or one for each of 2 tracks"),
        ({"measurements": [[[1.0, 2.0, 3.0]]]}, "measurements of 1 sensors, expected 2"),
        ({"measurements": [[[1.0, 2.0]], []]}, "measurements of sensor 0 must have shape"),
    ],
)
def test_bad_arguments_are_refused(change, text):
    mean, cov, z = close_tracks(0)
    states = Gaussian(mean, np.stack([cov] * 2))
    arguments = {"states": states, "sensors": SENSORS, "measurements": z, "existence": 0.5} | change
    with pytest.raises(InvalidInputError, match=text):
        track_problem(FILTER, **arguments)
