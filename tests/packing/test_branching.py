"""Branch and bound on packings against enumeration."""

import numpy as np
import pytest

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.depth_first import Limits, search_depth_first
from assoc.packing.branching.node import branch, drop, new_work, open_node
from assoc.packing.branching.open_nodes import OpenNodes
from assoc.packing.branching.pairs import (
    NEITHER,
    TOGETHER,
    answer,
    any_open_pair,
    decide,
    doubtful_pairs,
    is_dropped,
    new_trials,
)
from assoc.packing.branching.root import plain_root
from assoc.packing.branching.search import BranchAndBound, first_solution
from assoc.packing.packing import assemble
from assoc.packing.prepare import prepare
from assoc.packing.run import Run, infeasible
from assoc.packing.simplex.basis import primal_values
from assoc.packing.simplex.dual import Effort
from assoc.packing.simplex.program import all_allowed, program_of
from assoc.problem import AssignmentProblem
from assoc.solvers.assign import assign
from tests.oracles import all_solutions, axial_problem, brute_force, gated_problem, small_problems
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


def test_a_bound_holds_when_the_search_is_stopped_early():
    rng = np.random.default_rng(72)
    stopped = 0
    for number in range(12):
        # enough to branch on
        sizes = (7, 7, 7)
        problem = axial_problem(rng, sizes, 1.0, "positive") if number % 2 else gated_problem(rng, sizes, 0.3)
        prepared = prepare(problem)
        whole = search_of(prepared.packing)
        whole.run(100_000)
        assert whole.done
        for nodes in (0, 1, 2, 5):
            search = search_of(prepared.packing)
            search.run(nodes)
            stopped += not search.done
            assert search.nodes <= nodes
            assert search.lower_bound <= whole.weight + 1e-9
            assert search.weight >= whole.weight - 1e-9
            # and it goes on where it stopped
            search.run(100_000)
            assert search.done and search.weight == pytest.approx(whole.weight, abs=1e-9)
    assert stopped > 12


def test_only_better_solutions_are_looked_for():
    for problem, optimum in feasible(20, 73):
        prepared = prepare(problem)
        search = search_of(prepared.packing, optimum - prepared.offset)
        search.run(10_000)
        assert search.done and search.columns is None


def test_without_memory_the_deepest_node_is_given_up():
    packing = prepare(axial_problem(np.random.default_rng(74), (4, 4, 4))).packing
    nodes = OpenNodes(plain_root(packing, np.zeros(packing.num_rows)))
    nodes.arrays.bound[0] = -7.0
    nodes.grow(lambda needed: False)
    assert nodes.count == 0 and nodes.given_up == nodes.least_bound == -7.0


def test_without_memory_for_its_tables_a_search_gives_up_its_root():
    packing = prepare(axial_problem(np.random.default_rng(74), (4, 4, 4))).packing
    search = BranchAndBound(packing, dual_bound(packing), np.inf, 1e-9, memory_allows=lambda needed: False)
    search.run(10)
    assert search.done and search.out_of_memory and search.nodes == 0 and search.lower_bound == -np.inf


def test_nodes_that_hold_nothing_better_need_no_room():
    """Nodes that can be pruned are closed even without room for children, not given up."""
    packing = prepare(axial_problem(np.random.default_rng(74), (4, 4, 4))).packing
    root = plain_root(packing, dual_bound(packing))
    stack = OpenNodes(root).arrays
    stack.bound[:] = -7.0
    work = new_work(packing.arrays, root.program, root.slack)
    full = stack.first.size - 1
    num_open, weight, count, nodes = search_depth_first(work, stack, full, -7.0, Limits(1e-9, np.inf, 10, np.inf))
    assert (num_open, weight, count, nodes) == (0, -7.0, -1, 0)


def test_a_bound_that_is_no_number_drops_no_column():
    packing = prepare(axial_problem(np.random.default_rng(79), (4, 4, 4))).packing
    root = plain_root(packing, dual_bound(packing))
    work = new_work(packing.arrays, root.program, root.slack)
    work.duals[:] = np.nan
    assert drop(work, packing.num_columns, np.nan, 1.0) == packing.num_columns
    assert work.node.columns.all() and np.array_equal(work.node.slack, packing.slack)


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


@pytest.mark.slow
def test_the_two_children_of_a_node_partition_its_solutions():
    """Two rows of different sensors are together in one child, apart in the other: each solution is in one of them."""
    for problem, _ in feasible(30, 75):
        prepared = prepare(problem)
        packing = prepared.packing
        pairs = [(a, b) for cols in packing.cols.tolist() for a in cols for b in cols if 0 <= a < b]
        if not pairs:
            continue
        one, two = pairs[len(pairs) // 2]
        root = plain_root(packing, dual_bound(packing))
        stack = OpenNodes(root).arrays
        work = new_work(packing.arrays, root.program, root.slack)
        num = open_node(work, stack, 0, -1)
        assert num == packing.num_columns
        assert branch(work, stack, 0, num, (one, two), True, -5.0) == 2
        children = [set(stack.arena[stack.first[t] : stack.first[t] + stack.size[t]].tolist()) for t in range(2)]
        # the likelier one is on top
        for columns, joined in zip(children, (False, True), strict=True):
            assert columns == {j for j in range(num) if not is_dropped(packing.cols, j, one, two, joined)}
        assert (stack.bound[:2] == -5.0).all()
        assert not stack.slack[1, [one, two]].any() and np.array_equal(stack.slack[0], packing.slack)
        for solution in all_covers(packing):
            together = any({one, two} <= set(packing.cols[j].tolist()) for j in solution)
            inside = [
                set(solution) <= columns and must_be_covered(packing, stack.slack[t], solution)
                for t, columns in enumerate(children)
            ]
            # both uncovered, or in two columns: apart
            assert inside == [not together, together]


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


def test_an_open_pair_is_answered_both_ways_by_columns():
    rng = np.random.default_rng(78)
    for _ in range(20):
        packing = prepare(gated_problem(rng, (3, 3, 3), 0.3)).packing
        allowed = all_allowed(program_of(packing.arrays), packing.slack)
        one, two = any_open_pair(packing.cols, allowed, np.empty(packing.num_rows, dtype=np.int32))
        rows = [set(cols) - {-1} for cols in packing.cols.tolist()]
        if one >= 0:
            uses = [len({one, two} & own) for own in rows]
            assert 2 in uses and 1 in uses
        else:
            assert all(a == b or not a & b for a in rows for b in rows)


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
