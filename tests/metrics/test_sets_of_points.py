"""OSPA and GOSPA are what their definitions say, and what Stone Soup says."""

import datetime
import math
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from assoc.errors import InvalidInputError
from assoc.metrics import Trajectories, gospa, gospa_over_time, mean_gospa, ospa, ospa2, ospa_over_time
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


@settings(max_examples=60)
@given(points, points, points, cutoffs, orders)
def test_both_are_metrics(x, y, z, c, p):
    for metric in (ospa, gospa):
        assert metric(x, x, c, p).distance == 0.0
        assert metric(x, z, c, p).distance <= metric(x, y, c, p).distance + metric(y, z, c, p).distance + 1e-9


def test_empty_sets():
    nothing = np.zeros((0, 3))
    one = np.ones((1, 3))
    assert ospa(nothing, nothing, 10.0).distance == 0.0
    assert ospa(one, nothing, 10.0) == (10.0, 0.0, 10.0)
    assert gospa(nothing, nothing, 10.0).distance == 0.0
    assert gospa(one, nothing, 10.0)[:4] == pytest.approx((50**0.5, 0, 50, 0))
    assert gospa([], one, 10.0)[:4] == pytest.approx((50**0.5, 0, 0, 50))


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


def test_stone_soup_agrees():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pytest.importorskip("stonesoup")
        from stonesoup.metricgenerator.ospametric import GOSPAMetric, OSPAMetric
        from stonesoup.types.state import State

    start = datetime.datetime(2020, 1, 1)
    rng = np.random.default_rng(5)
    truth, tracks = trajectories(rng, 6, 12, 1.0), trajectories(rng, 7, 12, 1.0)

    def states(one):
        made = [
            State(place[:, None], timestamp=start + datetime.timedelta(seconds=float(t)))
            for t, place in zip(one.times, one.positions, strict=True)
        ]
        return made, one.ids.tolist()

    for order, cutoff in ((1.0, 5.0), (2.0, 8.0), (3.0, 20.0)):
        theirs = GOSPAMetric(p=order, c=cutoff).compute_over_time(*states(tracks), *states(truth))
        times, ours = gospa_over_time(truth, tracks, cutoff, order)
        assert len(times) == len(theirs.value) == 12
        for one, other in zip(ours, theirs.value, strict=True):
            for name in ("distance", "localisation", "missed", "false"):
                assert getattr(one, name) == near(other.value[name])
        theirs = OSPAMetric(p=order, c=cutoff).compute_over_time(*states(tracks), *states(truth))
        _, ours = ospa_over_time(truth, tracks, cutoff, order)
        found, others = (np.array(x) for x in ([one.distance for one in ours], [one.value for one in theirs.value]))
        # it pairs by distance, not by distance to the power of the order: above order 1 it may miss the minimum
        assert (found <= others + 1e-9).all()
        assert np.isclose(found, others, rtol=1e-9).mean() > 0.5
        if order == 1.0:
            assert found == near(others)


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


def test_ospa2_of_one_instant_is_ospa_and_switches_cost():
    rng = np.random.default_rng(9)
    truth = trajectories(rng, 4, 8, 1.0)
    tracks = trajectories(rng, 4, 8, 1.0)
    _, single = ospa2(truth, tracks, 5.0, window=1)
    _, plain = ospa_over_time(truth, tracks, 5.0)
    assert [one.distance for one in single] == near([one.distance for one in plain])
    swapped = np.where(truth.times >= 4, np.where(truth.ids < 2, 1 - truth.ids, truth.ids), truth.ids)
    crossed = Trajectories(truth.times, swapped, truth.positions)
    assert all(one.distance == 0 for one in ospa_over_time(truth, crossed, 5.0)[1])
    _, values = ospa2(truth, crossed, 5.0, window=None)
    assert values[3].distance == 0 < values[-1].distance


def test_mean_gospa():
    truth = Trajectories([0, 1], [1, 1], np.zeros((2, 3)))
    _, values = gospa_over_time(truth, Trajectories([0], [7], [[3.0, 0, 0]]), 10.0)
    mean = mean_gospa(values)
    assert mean == pytest.approx({"distance": 29.5**0.5, "localisation": 4.5**0.5, "missed": 5.0, "false": 0.0})
    assert values[0].pairs.tolist() == [[1, 7]]


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


def test_parts_that_are_none_stay_none_where_powers_overflow():
    one = gospa([[0, 0]], [[0, 0]], cutoff=100.0, order=200.0)
    assert one[:4] == (0.0, 0.0, 0.0, 0.0)


def test_identities_are_compared_as_whole_numbers():
    large = Trajectories([0, 0], [2**53, 2**53 + 1], np.zeros((2, 3)))
    assert large.ids.tolist() == [2**53, 2**53 + 1]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ospa([[0, 0]], [[1, 1]], -1.0), "cutoff: expected metres > 0"),
        (lambda: ospa([[0, 0]], [[1, 1]], 1.0, 0.5), "order: expected a number >= 1"),
        (lambda: gospa([[0, 0]], [[1, 1, 1]], 1.0), "truth has 2 dimensions, estimates have 3"),
        (lambda: gospa([[0, np.nan]], [[1, 1]], 1.0), "truth must be finite"),
        (lambda: gospa([["a"]], [[1]], 1.0), "truth must be numbers"),
        (lambda: Trajectories([0, 0], [1, 1], np.zeros((2, 3))), "ids: 1 occurs twice at 0 s"),
        (lambda: Trajectories([0, 1], [1.5, 1], np.zeros((2, 3))), "ids must be integers"),
        (lambda: Trajectories(np.array([0, 1], "datetime64[ns]"), [1, 1], np.zeros((2, 3))), "times must be numbers"),
        (lambda: mean_gospa([gospa([[0, 0]], [[1, 1]], 9.0)], 0), "order: expected a number >= 1"),
        (lambda: Trajectories([0, np.inf], [1, 1], np.zeros((2, 3))), "times must be finite"),
        (lambda: Trajectories([0, 1], [1, 1], np.zeros((3, 3))), "positions must have shape"),
        (lambda: ospa2(Trajectories([], [], []), Trajectories([], [], []), 1.0, window=0), "window: expected"),
    ],
)
def test_bad_input(call, message):
    with pytest.raises(InvalidInputError, match=message):
        call()
