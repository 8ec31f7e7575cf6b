"""The quick ways of the track-oriented tracker give what the slow ones give."""

import numpy as np
import pytest

from assoc import assign
from assoc.problem import AssignmentProblem
from assoc.tracking.growth import Births, Offers
from assoc.tracking.mht.best_hypothesis import VISITS, choose
from assoc.tracking.mht.branches import Tables, extend
from assoc.tracking.mht.losses import priced
from assoc.tracking.mht.pruning import decide, keep_best
from assoc.tracking.records.track_batch import ID, SCORE


def branches(seed, trees, measurements, columns=3):
    rng = np.random.default_rng(seed)
    tree = np.repeat(np.sort(rng.choice(100, trees, replace=False)), rng.integers(1, 9, trees))
    history = rng.integers(0, measurements + 1, (len(tree), columns)).astype(np.int32)
    history[rng.random(history.shape) < 0.3] = 0
    return tree.astype(np.int64), rng.normal(3.0, 5.0, len(tree)), history


def by_solver(tree, score, history):
    rows = np.flatnonzero(score > 0)
    number = np.unique(tree, return_inverse=True)[1] + 1
    tuples = np.column_stack([number, history])[rows]
    sizes = np.maximum(tuples.max(axis=0), 1)
    return assign(AssignmentProblem(tuples, -score[rows], sizes)).cost


@pytest.mark.parametrize("seed", range(60))
def test_the_best_hypothesis_is_that_of_a_solver(seed):
    tree, score, history = branches(seed, trees=2 + seed % 12, measurements=2 + seed % 17)
    chosen, doubtful, _ = choose(score, history, priced(tree, score, history), VISITS)
    assert not doubtful.any()
    assert -score[chosen].sum() == pytest.approx(by_solver(tree, score, history), abs=1e-9)
    assert len(set(tree[chosen])) == chosen.sum()
    for column in history[chosen].T:
        used = column[column > 0]
        assert len(set(used)) == len(used)


@pytest.mark.parametrize("seed", range(20))
def test_prices_that_say_nothing_change_nothing_but_the_work(seed):
    tree, score, history = branches(seed, trees=2 + seed % 6, measurements=3 + seed % 5)
    known = priced(tree, score, history)
    top = np.array([max(score[known.number == t].max(), 0.0) for t in range(len(known.trees))])
    plain = known._replace(trees=top, measurements=np.zeros_like(known.measurements), loss=top[known.number] - score)
    chosen, doubtful, _ = choose(score, history, plain, 10**9)
    assert not doubtful.any()
    assert -score[chosen].sum() == pytest.approx(by_solver(tree, score, history), abs=1e-9)


@pytest.mark.parametrize("visits", [20, 92])
def test_when_the_work_is_too_much_a_hypothesis_is_found_and_its_branches_are_named(visits):
    """Below 12 * 11 / 2 visits there is one descent; above, the search is broken off."""
    tree, score, history = branches(3, trees=12, measurements=9)
    chosen, doubtful, _ = choose(score, history, priced(tree, score, history), visits)
    assert chosen.any()
    assert doubtful.any()
    assert (score[doubtful] > 0).all()
    assert len(set(tree[chosen])) == chosen.sum()
    assert all(len(set(c[c > 0])) == np.count_nonzero(c) for c in history[chosen].T)


def test_a_group_that_takes_too_long_costs_others_nothing():
    hard = branches(1, trees=12, measurements=9)
    # two trees want one measurement that no other wants
    tree = np.concatenate([hard[0], [1000, 1000, 1001, 1001]])
    score = np.concatenate([hard[1], [9.0, 8.0, 9.5, 4.0]])
    history = np.concatenate([hard[2], np.array([[10, 0, 0], [0, 0, 0]] * 2, dtype=np.int32)])
    chosen, doubtful, _ = choose(score, history, priced(tree, score, history), 20)
    own = tree >= 1000
    assert doubtful[~own].any() and not doubtful[own].any()
    assert score[chosen & own].tolist() == [8.0, 9.5]


def test_a_solver_is_asked_where_the_search_takes_too_long():
    """Branches are cut around the best hypothesis, also where it is hard to find."""
    tree, score, history = branches(1, trees=12, measurements=9)
    numbers, counts = np.zeros((len(tree), 5)), np.zeros((len(tree), 5), dtype=np.int64)
    numbers[:, SCORE], counts[:, ID] = score, tree
    tables = Tables(numbers, counts, history, np.zeros(len(tree), dtype=np.int64))
    asked = []

    def solve(tree, score, history):
        asked.append(len(tree))
        rows = np.flatnonzero(score > 0)
        tuples = np.column_stack([np.unique(tree, return_inverse=True)[1] + 1, history])[rows]
        solution = assign(AssignmentProblem(tuples, -score[rows], np.maximum(tuples.max(axis=0), 1)))
        mask = np.zeros(len(tree), dtype=np.bool_)
        mask[rows[solution.indices[solution.indices < len(rows)]]] = True
        return mask

    births = Births(np.zeros(0, dtype=np.int64), np.zeros((0, 3), dtype=np.int32), np.zeros(0), np.zeros(0))
    offers = Offers(np.zeros(len(tree)), *np.zeros((2, 0), dtype=np.int64), *np.zeros((2, 0)), births)
    _, after, chosen, _ = extend(tables, offers, 0, 0, 30, 15.0, solve, 20)
    assert asked
    assert -after.numbers[chosen, SCORE].sum() == pytest.approx(by_solver(tree, score, history), abs=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_prices_are_good_where_tracks_are_old_and_side_by_side(seed):
    """A track's score grows with every scan; what its branches differ by does not."""
    rng = np.random.default_rng(seed)
    tree = np.repeat(np.arange(12), 12)
    # each measurement suits its own track, and its neighbours hardly less
    history = np.clip(tree[:, None] + 1 + rng.integers(-1, 2, (len(tree), 6)), 1, 12).astype(np.int32)
    history[rng.random(history.shape) < 0.1] = 0
    history[::12] = np.arange(1, 13)[:, None]
    off = np.where(history == 0, 8.0, 2.0 * np.abs(history - tree[:, None] - 1)).sum(axis=1)
    score = 1_500.0 - off + rng.normal(0.0, 2.0, len(tree))
    known = priced(tree, score, history)
    bound = known.trees.sum() + known.measurements.sum()
    assert bound + by_solver(tree, score, history) == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("seed", range(5))
def test_the_branches_of_each_tree_that_cost_least(seed):
    rng = np.random.default_rng(seed)
    tree, score, loss = rng.integers(0, 12, 80), rng.normal(0, 8, 80).round(), rng.exponential(8, 80).round()
    wanted = []
    for one in np.unique(tree):
        own = sorted(np.flatnonzero(tree == one).tolist(), key=lambda b: loss[b])
        limit = 9.0 + max(0.0, -score[own].max())
        wanted += [b for b in own[:4] if loss[b] <= limit]
    assert keep_best(tree, score, loss, 4, 9.0).tolist() == wanted


@pytest.mark.parametrize("seed", range(40))
def test_a_loss_is_a_bound_on_what_the_branch_costs_the_best_hypothesis(seed):
    tree, score, history = branches(seed, trees=2 + seed % 9, measurements=4 + seed % 9)
    loss = priced(tree, score, history).loss
    best = by_solver(tree, score, history)
    assert loss.min() >= -1e-9
    for b in range(0, len(tree), 3):
        # a large reward puts the branch into every best hypothesis
        forced = score.copy()
        forced[b] += 1e4
        true = by_solver(tree, forced, history) + 1e4 - best
        assert loss[b] <= true + GAP


GAP = 1.5
"""Between the best hypothesis of these random branches and the bound, at the most."""


def test_losses_of_trees_that_share_nothing_are_differences_of_scores():
    tree, score = np.array([1, 1, 2, 2, 3]), np.array([9.0, 4.0, 7.0, -1.0, -2.0])
    history = np.array([[1, 0], [0, 0], [2, 1], [0, 0], [3, 0]], dtype=np.int32)
    np.testing.assert_allclose(priced(tree, score, history).loss, [0.0, 5.0, 0.0, 8.0, 2.0], atol=1e-12)


def test_losses_know_who_needs_a_measurement_more():
    # the first tree is 6 better with measurement 1, the second 2 better: the first has it. The other way costs 4;
    # the price of the measurement says how the two trees share that
    tree, score = np.array([1, 1, 2, 2]), np.array([16.0, 10.0, 22.0, 20.0])
    history = np.array([[1], [0], [1], [0]], dtype=np.int32)
    found = priced(tree, score, history).loss
    np.testing.assert_allclose(found[[0, 3]], 0.0, atol=1e-9)
    assert found[1] + found[2] == pytest.approx(4.0)


def test_what_is_decided_of_the_oldest_scan():
    #             tree 1 (chosen)  tree 2 (waits)  tree 3 (waits)  tree 4 (young)
    tree = np.array([1, 1, 2, 2, 3, 4])
    score = np.array([9.0, 5.0, 8.0, 3.0, 4.0, 1.0])
    chosen = np.array([True, False, False, False, False, False])
    old = np.array([True, True, True, True, True, False])
    oldest = np.array([[1], [2], [1], [2], [2], [0]], dtype=np.int32)
    kept, speakers = decide(tree, score, chosen, old, oldest, np.array([2]))
    # tree 2's best branch contradicts tree 1; tree 3 scores more than the other one and takes measurement 2
    assert kept.tolist() == [True, False, False, False, True, True]
    assert speakers.tolist() == [0, 4]
