"""Truncated sweeps against enumeration and exact sums, and orders against entropies counted anew."""

import numpy as np
import pytest

import assoc
from assoc.packing.run import Run
from assoc.ranking.clusters import cluster_problems
from assoc.ranking.columns import price_all_columns
from assoc.ranking.estimates.mean_field import mean_field
from assoc.ranking.estimates.row_order import row_order
from assoc.ranking.estimates.swept import swept
from assoc.ranking.estimates.truncated_sweep import truncated_sweep
from assoc.ranking.marginals import bounded
from experiments.common.instances import scenes
from tests.oracles import all_solutions, small_problems
from tests.reliability.exact import exact_marginals
from tests.sizes import few_or_all


@few_or_all("count", 20, 400)
def test_sweeps_that_keep_all_states_are_exact(count):
    """In any order, with dummies and without; with few states they are still probabilities."""
    checked, rng = 0, np.random.default_rng(91)
    for problem in small_problems(2 * count, 90):
        try:
            if not all_solutions(problem, 4000):
                continue
        except MemoryError:
            continue
        columns = price_all_columns(problem, Run(0))
        rows, order = columns.rows, rng.permutation(columns.slack.size)
        weights, alone = np.exp(-columns.reduced), np.exp(-columns.slack_reduced)
        truth = exact_marginals(problem)
        exact = np.array([truth[tuple(key)] for key in problem.tuples[columns.origin].tolist()])
        found, dropped = truncated_sweep(rows, order, weights, alone, np.inf)
        assert found == pytest.approx(exact, abs=1e-9) and dropped == pytest.approx(0.0, abs=1e-12)
        few = truncated_sweep(rows, order, weights, alone, np.inf, 3 / 2048)
        # without dummies the states kept may all come to nothing
        assert few is not None or not columns.slack.all()
        if few is not None:
            few, dropped = few
            assert 0.0 <= dropped + 1e-12 and (dropped > 1e-3 or few == pytest.approx(exact, abs=0.1))
            covered = np.bincount(rows[rows >= 0], np.repeat(few, rows.shape[1])[rows.ravel() >= 0], order.size)
            assert few.min(initial=0.0) >= 0.0 and covered.max(initial=0.0) <= 1.0 + 1e-9
        checked += 1
    assert checked > count


@pytest.fixture(scope="module")
def crowd():
    """The columns of a cluster of a few dozen measurements."""
    cluster = max(cluster_problems(assoc.build_problem(scenes.gated(3, 60, 3), 0)), key=lambda found: len(found[1]))[0]
    return price_all_columns(cluster, Run(0))


def test_the_doubt_of_an_order_falls_by_moves_and_is_what_entropies_add_up_to(crowd):
    rows = crowd.slack.size
    share, _ = mean_field(crowd.rows, np.exp(-crowd.weights), np.ones(rows))

    def doubt(order):
        turn = np.empty(rows, int)
        turn[order] = np.arange(rows)
        likely = share >= 1e-3
        first = np.where(crowd.rows >= 0, turn[crowd.rows], rows)[likely].min(axis=1)
        found = []
        for t in range(rows):
            decided = crowd.rows[likely][first <= t]
            m = np.bincount(decided[decided >= 0], np.repeat(share[likely][first <= t], 3)[decided.ravel() >= 0], rows)
            m = np.clip(m[turn > t], 1e-300, 1.0 - 1e-16)
            found.append(float((-m * np.log(m) - (1.0 - m) * np.log(1.0 - m)).sum()))
        return float(np.log(np.exp(found).sum()))

    best, said = row_order(crowd.rows, share, rows, np.inf)
    begun, before = row_order(crowd.rows, share, rows, -np.inf)
    assert sorted(best) == sorted(begun) == list(range(rows))
    assert said == pytest.approx(doubt(best), abs=0.02)
    assert before == pytest.approx(doubt(begun), abs=0.02)
    assert said < before - 0.2 and before < doubt(np.arange(rows)) - 2.0


def test_estimates_are_near_exact_sums(crowd):
    """Clusters that are summed exactly, when told to be too wide for that."""
    errors = []
    for seed in range(2):
        problem = assoc.build_problem(scenes.gated(3, 80, seed), 0)
        exact, found = bounded(problem, 1, Run(0), "certified"), bounded(problem, 1, Run(0), "estimate", 3)
        assert exact.unseen < 1e-8 and found.unseen == 1.0
        errors.append(np.abs(found.probability - exact.probability).max())
        assert errors[-1] <= found.error + 1e-3 and found.error < 0.1
        assert found.probability.tolist() == bounded(problem, 1, Run(0), "estimate", 3).probability.tolist()
    assert max(errors) < 0.02
    assert swept(crowd, 0.0) is None


def test_scenes_in_which_too_many_states_matter_are_left_to_sampling():
    assert swept(price_all_columns(assoc.build_problem(scenes.ghost(20, 3), 0), Run(0)), np.inf) is None
