"""Branch and bound on packings against enumeration."""

import numpy as np
import pytest

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.pairs import (
    NEITHER,
    TOGETHER,
    answer,
    decide,
    doubtful_pairs,
    new_trials,
)
from assoc.packing.branching.search import BranchAndBound, first_solution
from assoc.packing.packing import assemble
from assoc.packing.prepare import prepare
from assoc.packing.run import Run, infeasible
from assoc.packing.simplex.basis import primal_values
from assoc.packing.simplex.dual import Effort
from assoc.problem import AssignmentProblem
from assoc.solvers.assign import assign
from tests.oracles import all_solutions, brute_force, gated_problem, small_problems
from tests.packings import all_covers, finished, is_cover, relaxed, weights_of


def feasible(count, seed):
    """Small problems that have a solution, with their optimal cost."""
    for problem in small_problems(count, seed):
        if all_solutions(problem):
            yield problem, brute_force(problem)


def search_of(packing, incumbent=np.inf):
    return BranchAndBound(packing, dual_bound(packing), incumbent, 1e-9)


def test_the_optimum_is_that_of_enumeration():
    for problem, optimum in feasible(60, 71):
        prepared = prepare(problem)
        search = finished(search_of(prepared.packing), 7)
        assert search.columns is not None and is_cover(prepared.packing, search.columns)
        weight = prepared.packing.weights[search.columns].sum()
        assert weight == pytest.approx(search.weight, abs=1e-9)
        assert weight + prepared.offset == pytest.approx(optimum, abs=1e-8)
        assert search.lower_bound + prepared.offset <= optimum + 1e-9


def test_only_better_solutions_are_looked_for():
    for problem, optimum in feasible(20, 73):
        prepared = prepare(problem)
        search = search_of(prepared.packing, optimum - prepared.offset)
        search.run(10_000)
        assert search.done and search.columns is None


@pytest.mark.parametrize("granularity", [0.0, 1.0])
def test_where_nothing_is_left_to_cover_nothing_is_chosen(granularity):
    """Dives can end with such a packing; whole-numbered weights then caused a division by zero."""
    none = np.empty((0, 3), dtype=np.int32)
    packing = assemble(none, np.empty(0), np.ones(4, dtype=np.bool_), np.empty(0, dtype=np.int32), granularity)
    assert packing.num_rows == 0
    for incumbent, weight in ((2.0, 0.0), (-2.0, -2.0)):
        search = BranchAndBound(packing, np.zeros(0), incumbent, 1e-9)
        search.run(10)
        assert search.done and search.weight == weight and (search.columns is not None) is (weight == 0.0)


def test_a_verdict_on_a_pair_is_true():
    """Pairs are fractional by the LP's values; an excluded side has no solution below the cutoff."""
    rng = np.random.default_rng(77)
    verdicts, asked = 0, 0
    for _ in range(60):
        packing = prepare(gated_problem(rng, (4, 4, 4), 0.5)).packing
        if not packing.num_columns:
            continue
        program, allowed, basis = relaxed(packing)
        primal = np.zeros(packing.num_columns)
        primal_values(program, basis, primal)
        trials = new_trials(program, packing.num_rows)
        count = doubtful_pairs(packing.cols, basis, trials)
        doubts = trials.values[:count] * (1.0 - trials.values[:count])
        assert (np.diff(doubts) <= 1e-12).all() and not trials.mass.any()
        for (one, two), value in zip(trials.pairs[:count].tolist(), trials.values, strict=False):
            with_both = ((packing.cols == one).any(axis=1)) & ((packing.cols == two).any(axis=1))
            assert primal[with_both].sum() == pytest.approx(value) and 0.0 < value < 1.0
        if not count:
            continue
        asked += 1
        solutions = all_covers(packing)
        best = weights_of(packing, solutions).min()
        cutoff = best + 0.01 * abs(best)
        which, verdict = decide(program, packing.cols, allowed, basis, trials, count, Effort(cutoff, 0, np.inf))
        if verdict == NEITHER:
            continue
        verdicts += 1
        side = trials.side
        left_over = answer(packing.cols, allowed, trials.pairs[which], verdict != TOGETHER, side)
        left = set(side.active[:left_over].tolist())
        for cover in solutions:
            if set(cover) <= left and must_be_covered(packing, side.slack, cover):
                assert packing.weights[list(cover)].sum() >= cutoff - 1e-9
    assert asked > 15 and verdicts > 3


def must_be_covered(packing, slack, solution):
    used = packing.cols[list(solution)]
    covered = np.zeros(packing.num_rows, dtype=bool)
    covered[used[used >= 0]] = True
    return bool((slack | covered).all())


def test_first_solution_is_one_or_there_is_none():
    found = 0
    for problem in small_problems(60, 76, dummy=False):
        packing = prepare(problem).packing
        columns = first_solution(packing, Run(0))
        if all_solutions(problem):
            assert columns is not None and is_cover(packing, columns)
            found += 1
        else:
            assert columns is None
    assert found > 20


def test_search_for_a_first_solution_ends():
    """Without dummies even a first solution is hard to find: heuristics give up, and say so."""
    rng = np.random.default_rng(1)
    planted = np.stack([rng.permutation(14) + 1 for _ in range(4)], axis=1)
    # enough tuples that dives in the linear program end without a solution, too
    tuples = np.unique(np.vstack([planted, rng.integers(1, 15, (160, 4))]), axis=0)
    problem = AssignmentProblem(tuples, rng.random(len(tuples)), [14] * 4, dummy=False)
    packing, run = prepare(problem).packing, Run(0)
    assert first_solution(packing, run, nodes=0) is None
    assert "no complete solution was found in 20,000 nodes; solver exact" in str(infeasible(packing, run))
    assert first_solution(packing, Run(0)) is not None
    assert assign(problem, "genetic", iterations=5).cost > 0.0 and assign(problem, "exact").status == "optimal"
