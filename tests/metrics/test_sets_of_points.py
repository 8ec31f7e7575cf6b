"""OSPA and GOSPA are what their definitions say, and what Stone Soup says."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from assoc.errors import InvalidInputError
from assoc.metrics import Trajectories, gospa, gospa_over_time, mean_gospa, ospa, ospa2
from tests.metrics import reference

# a coarse grid: ties, coinciding points and distances equal to the cutoff come often
points = st.lists(st.tuples(st.integers(-3, 3), st.integers(-3, 3)), max_size=4)
cutoffs = st.sampled_from([0.5, 1.0, 2.0, 5.0])
orders = st.sampled_from([1.0, 1.5, 2.0, 3.0])


def near(x):
    return pytest.approx(x, rel=1e-9, abs=1e-12)


@settings(max_examples=150)
@given(points, points, cutoffs, orders)
def test_ospa_is_the_minimum_over_permutations(x, y, c, p):
    found = ospa(x, y, c, p)
    expected = reference.ospa(lambda i, j: math.dist(x[i], y[j]), len(x), len(y), c, p)
    assert found.distance == near(expected)
    assert found.localisation**p + found.cardinality**p == near(found.distance**p)
    assert ospa(y, x, c, p) == near(found)
    assert 0 <= found.distance <= c * (1 + 1e-12)


@settings(max_examples=150)
@given(points, points, cutoffs, orders)
def test_gospa_is_the_minimum_over_matchings(x, y, c, p):
    found = gospa(x, y, c, p)
    expected, _, _ = reference.gospa(lambda i, j: math.dist(x[i], y[j]), len(x), len(y), c, p)
    assert found.distance == near(expected)
    assert found.localisation + found.missed + found.false == near(found.distance**p)
    assert all(math.dist(x[i], y[j]) < c for i, j in found.pairs)
    assert found.localisation == near(sum(math.dist(x[i], y[j]) ** p for i, j in found.pairs))
    assert found.missed == near(c**p / 2 * (len(x) - len(found.pairs)))
    other = gospa(y, x, c, p)
    assert other.distance == near(found.distance)


def trajectories(rng, ids, instants, spread):
    """Random walks that come and go."""
    rows = []
    for one in range(ids):
        place = rng.uniform(-10, 10, 3)
        for t in range(instants):
            place = place + rng.normal(0, spread, 3)
            if rng.random() < 0.8:
                rows.append((float(t), one, place))
    rng.shuffle(rows)
    return Trajectories([r[0] for r in rows], [r[1] for r in rows], np.array([r[2] for r in rows]).reshape(-1, 3))


@pytest.mark.parametrize(("order", "base_order"), [(1.0, 1.0), (2.0, 1.0), (1.0, 2.0)])
@pytest.mark.parametrize("window", [1, 3, None])
def test_ospa2_is_its_definition(order, base_order, window):
    rng = np.random.default_rng(8)
    truth, tracks = trajectories(rng, 3, 9, 2.0), trajectories(rng, 4, 9, 2.0)

    def by_id(one):
        result = {}
        for t, i, place in zip(one.times, one.ids, one.positions, strict=True):
            result.setdefault(int(i), {})[int(t)] = place
        return result

    times, values = ospa2(truth, tracks, 12.0, order, base_order=base_order, window=window)
    assert times.tolist() == list(range(9))
    for t, value in enumerate(values):
        inside = range(0 if window is None else max(0, t - window + 1), t + 1)
        expected = reference.ospa2(by_id(truth), by_id(tracks), inside, 12.0, order, base_order)
        assert value.distance == near(expected)


@pytest.mark.parametrize("order", [1.0, 2.0, 3.5])
def test_the_parts_add_up_to_the_whole_over_time(order):
    rng = np.random.default_rng(0)
    times, ids = np.repeat(np.arange(30), 4), np.tile(np.arange(4), 30)
    truth = Trajectories(times, ids, rng.normal(0, 20, (120, 2)))
    kept = rng.random(120) < 0.8
    tracks = Trajectories(times[kept], ids[kept] + 9, truth.positions[kept] + rng.normal(0, 15, (kept.sum(), 2)))
    _, values = gospa_over_time(truth, tracks, 25.0, order)
    mean = mean_gospa(values, order)
    parts = [mean[name] for name in ("localisation", "missed", "false")]
    assert mean["distance"] ** order == pytest.approx(sum(part**order for part in parts))
    assert min(parts) > 0 and max(parts) < mean["distance"]
    # each part as a plain sum over the instants
    assert mean["missed"] ** order == pytest.approx(np.mean([one.missed for one in values]))
    assert mean["distance"] ** order == pytest.approx(np.mean([one.distance**order for one in values]))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ospa([[0, 0]], [[1, 1]], -1.0), "cutoff: expected metres > 0"),
        (lambda: ospa([[0, 0]], [[1, 1]], 1.0, 0.5), "order: expected a number >= 1"),
        (lambda: gospa([[0, 0]], [[1, 1, 1]], 1.0), "truth has 2 dimensions, estimates have 3"),
        (lambda: gospa([[0, np.nan]], [[1, 1]], 1.0), "truth must be finite"),
        (lambda: Trajectories([0, 0], [1, 1], np.zeros((2, 3))), "ids: 1 occurs twice at 0 s"),
        (lambda: Trajectories([0, np.inf], [1, 1], np.zeros((2, 3))), "times must be finite"),
        (lambda: Trajectories([0, 1], [1, 1], np.zeros((3, 3))), "positions must have shape"),
        (lambda: ospa2(Trajectories([], [], []), Trajectories([], [], []), 1.0, window=0), "window: expected"),
    ],
)
def test_bad_input(call, message):
    with pytest.raises(InvalidInputError, match=message):
        call()
