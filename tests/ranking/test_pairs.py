"""Probabilities of pairs against the enumeration of all joint events, closed forms, and the ranking of solutions."""

import itertools
import math

import numpy as np
import pytest

from assoc.ranking.pairs.events import FAINT, pair_probabilities, reduced
from assoc.ranking.pairs.graph import pair_graph
from assoc.ranking.pairs.messages import bound_pairs, log_beliefs
from assoc.ranking.pairs.permutations import without_permutations
from tests.sizes import few_or_all

WIDE = 2**14
"""States with which every problem here is summed exactly."""


def drawn(rng, spread=3.0, largest=5):
    """Pairs of two short lists, not all of them, and their log weights."""
    n, m = rng.integers(1, largest + 1, 2)
    first, second = np.nonzero(rng.random((n, m)) < rng.uniform(0.3, 1.0))
    return first, second, rng.normal(rng.uniform(-2.0, 4.0), spread, len(first)), (int(n), int(m))


def enumerated(first, second, log_weight, *, permutations=True):
    """Probability of each pair by all joint events, or by the best permutations alone, in logarithms."""
    choices = [[-1, *np.flatnonzero(first == one).tolist()] for one in np.unique(first)]
    events = []
    for way in itertools.product(*choices):
        chosen = [pair for pair in way if pair >= 0]
        if len(set(second[chosen].tolist())) == len(chosen):
            events.append((chosen, float(log_weight[chosen].sum())))
    top = max(log for _, log in events)
    total, pair, best = 0.0, np.zeros(len(first)), {}
    for chosen, log in sorted(events, key=lambda event: -event[1]):
        members = frozenset(first[chosen]), frozenset(second[chosen])
        counted = chosen if permutations else best.setdefault(members, chosen)
        total += math.exp(log - top)
        pair[counted] += math.exp(log - top)
    return pair / total


@few_or_all("count", 40, 400)
def test_small_problems_are_those_of_all_joint_events(count):
    for seed in range(count):
        rng = np.random.default_rng(seed)
        # the last weights are beyond the range of floats
        first, second, log_weight, sizes = drawn(rng, [0.5, 3.0, 30.0, 700.0][seed % 4], 4)
        expected = enumerated(first, second, log_weight)
        exact = pair_probabilities(first, second, log_weight, sizes, WIDE)
        digits = 1e-11 * max(1.0, np.abs(log_weight).max(initial=0.0))
        np.testing.assert_allclose(exact.probability, expected, atol=digits)
        for states in (1, 8, WIDE):
            found = pair_probabilities(first, second, log_weight, sizes, states)
            assert (found.lower <= expected).all() and (expected <= found.upper).all()
            assert (found.lower <= found.probability).all() and (found.probability <= found.upper).all()
            assert (np.bincount(first, found.probability, sizes[0]) <= 1.0 + 1e-9).all()
            share = without_permutations(first, second, log_weight, sizes, exact.probability, states)
            np.testing.assert_allclose(np.bincount(first, share), np.bincount(first, exact.probability), atol=1e-9)
        # pairs below 1e-4 keep their probability
        np.testing.assert_allclose(share, enumerated(first, second, log_weight, permutations=False), atol=2e-3)
        if len(first):
            graph, bounds = pair_graph(first, second, sizes), np.empty((2, len(first)))
            weights, free = reduced(graph, log_weight, np.ones(len(first), bool), np.zeros(sum(sizes)), sizes[0])
            work = np.empty((3, 2 * len(first)))
            bound_pairs(graph, weights, free, np.arange(sum(sizes)), work, bounds)
            low, high = bounds
            assert (low <= expected + 1e-12).all() and (expected <= high + 1e-12).all()


def test_sets_of_wide_clusters_are_the_likeliest_ones():
    """Six members each, all near each other: with 256 sets of some 900 shares are nearly those of all."""
    first, second = (one.reshape(-1) for one in np.indices((6, 6)))
    for seed in range(3):
        rng = np.random.default_rng(seed)
        log_weight = 5.0 - 0.3 * (first - second - rng.normal(0.0, 0.8, 6)[second]) ** 2
        exact = pair_probabilities(first, second, log_weight, (6, 6), WIDE)
        expected = enumerated(first, second, log_weight, permutations=False)
        share = without_permutations(first, second, log_weight, (6, 6), exact.probability, 2048)
        np.testing.assert_allclose(share, expected, atol=0.01)
        assert np.abs(exact.probability - expected).max() > 0.2


def test_huge_weights_give_numbers():
    """Where rounding of sums is above all that events differ by, probabilities are numbers, and bounds say nothing."""
    for seed in range(40):
        rng = np.random.default_rng(seed)
        first, second, _, sizes = drawn(rng, largest=8)
        log_weight = rng.choice([-1.0, 1.0, 0.3, 0.0, rng.normal()], len(first)) * 10.0 ** rng.integers(13, 300)
        for states in (1, 8, WIDE):
            found = pair_probabilities(first, second, log_weight, sizes, states)
            assert (found.lower <= found.probability).all() and (found.probability <= found.upper).all()
            assert (found.lower >= 0.0).all() and (found.upper <= 1.0).all()
            assert (np.bincount(first, found.probability, sizes[0]) <= 1.0 + 1e-9).all()
            share = without_permutations(first, second, log_weight, sizes, found.probability, states)
            assert np.isfinite(share).all()


def test_pairs_left_out_are_missed_by_little():
    """With four states hardly anything is summed exactly: belief propagation estimates the rest."""
    wrong, alone, widest = [], [], 0.0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        first, second, log_weight, sizes = drawn(rng, 1.0, 4)
        expected = enumerated(first, second, log_weight - 3.0)
        found = pair_probabilities(first, second, log_weight - 3.0, sizes, 4)
        wrong.append(np.abs(found.probability - expected).max(initial=0.0))
        weight = np.exp(log_weight - 3.0)
        alone.append(np.abs(weight / (1.0 + weight) - expected).max(initial=0.0))
        widest = max(widest, (found.upper - found.lower).max(initial=0.0))
    assert widest > 0.1
    assert np.mean(wrong) < 0.005 and np.mean(wrong) < 0.1 * np.mean(alone)


def test_faint_pairs_between_clusters_are_in_the_intervals():
    """Small clusters, all joined by pairs that are left out first: wrong by what they weigh, and no more is claimed."""
    first, second = (one.reshape(-1) for one in np.indices((12, 12)))
    rng = np.random.default_rng(11)
    log_weight = np.where(first // 2 == second // 2, rng.normal(0.0, 1.0, 144), rng.uniform(-26.0, -23.5, 144))
    exact = pair_probabilities(first, second, log_weight, (12, 12), WIDE)
    assert (exact.upper - exact.lower).max() < 1e-10
    found = pair_probabilities(first, second, log_weight, (12, 12), 16)
    assert (found.lower <= exact.probability).all() and (exact.probability <= found.upper).all()
    faint = exact.probability < FAINT
    assert faint.any() and (found.upper - found.lower).max() < 40 * FAINT
    np.testing.assert_allclose(found.probability[faint], exact.probability[faint], rtol=1e-6)


@pytest.mark.parametrize("size", [6, 9])
def test_every_pair_of_two_lists_alike(size):
    """All pairs weigh the same: events of k pairs are counted by the rook polynomial."""
    first, second = (one.reshape(-1) for one in np.indices((size, size)))
    weight = 0.7
    counts = np.array([math.comb(size, k) ** 2 * math.factorial(k) * weight**k for k in range(size + 1)])
    expected = float(counts @ np.arange(size + 1) / counts.sum()) / size**2
    found = pair_probabilities(first, second, np.full(size**2, math.log(weight)), (size, size), WIDE)
    np.testing.assert_allclose(found.probability, expected, rtol=1e-12)
    narrow = pair_probabilities(first, second, np.full(size**2, math.log(weight)), (size, size), 16)
    assert (narrow.lower <= expected).all() and (expected <= narrow.upper).all()


def test_belief_propagation_is_exact_where_the_graph_is_a_tree():
    rng = np.random.default_rng(3)
    # 0 - 0 - 1 - 1 - 2 ..., a path, with a leaf at each member of the first list
    first = np.array([0, 1, 1, 2, 2, 3, 0, 1, 2])
    second = np.array([0, 0, 1, 1, 2, 2, 3, 4, 5])
    log_weight = rng.normal(1.0, 2.0, len(first))
    graph = pair_graph(first, second, (4, 6))
    heard = np.exp(log_beliefs(graph, log_weight, np.ones(len(first), dtype=bool)))[graph.mate]
    weight = np.exp(log_weight)[graph.edge] * heard
    vertex = np.repeat(np.arange(10), np.diff(graph.ptr))
    share = weight / (1.0 + np.bincount(vertex, weight))[vertex]
    expected = enumerated(first, second, log_weight)
    np.testing.assert_allclose(share, expected[graph.edge], rtol=1e-8)
