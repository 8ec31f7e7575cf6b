"""Short searches below a solved linear program, against scipy's MILP."""

import numpy as np
import pytest

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching import short_search
from assoc.packing.branching.depth_first import Limits
from assoc.packing.branching.open_nodes import OpenNodes
from assoc.packing.branching.short_search import Subproblem, arrays_within, remainder_within, search_shortly
from assoc.packing.simplex.basis import basis_of
from assoc.packing.simplex.dual import OPTIMAL, bound_of
from assoc.packing.simplex.linear_program import LinearProgram
from assoc.packing.simplex.program import all_allowed
from tests.packing.test_trial import packings
from tests.packings import is_cover, optimum

NO_LIMITS = Limits(1e-9, np.inf, 100_000, np.inf)
NONE = np.zeros(0, dtype=np.int64)


def begun(packing):
    """Its program, solved."""
    linear = LinearProgram(packing)
    linear.solve(duals=dual_bound(packing))
    linear.mark()
    return linear


def everything(packing):
    return Subproblem(np.ones(packing.num_columns, dtype=bool), packing.slack, NONE)


def part_of(packing, rng, share, most):
    """Some columns of a packing, of which some are fixed."""
    columns = rng.random(packing.num_columns) < share
    fixed, covered = [], np.zeros(packing.num_rows + 1, dtype=bool)
    for j in rng.permutation(np.flatnonzero(columns)):
        rows = packing.cols[j][packing.cols[j] >= 0]
        if len(fixed) < most and not covered[rows].any():
            fixed.append(j)
            covered[rows] = True
    columns &= ~covered[packing.cols].any(axis=1)
    columns[fixed] = True
    return Subproblem(columns, packing.slack & ~covered[:-1], np.array(fixed, dtype=np.int64))


def test_what_is_found_is_the_best_of_its_part():
    """And empty, if that is not below the cutoff."""
    rng = np.random.default_rng(3)
    feasible = 0
    for packing in packings(12, 41):
        linear = begun(packing)
        for share, most in ((1.0, 0), (1.0, 2), (0.8, 4), (0.6, 1), (1.0, 100)):
            part = part_of(packing, rng, share, most)
            linear.back()
            linear.solve(columns=part.columns, slack=part.slack)
            best = optimum(packing, part.columns, fixed=part.fixed, whole=True)
            found, done = search_shortly(packing, linear, part, np.inf, NO_LIMITS)
            assert done
            if best == np.inf:
                assert not found.size
                continue
            feasible += 1
            assert part.columns[found].all() and np.isin(part.fixed, found).all()
            assert is_cover(packing, found)
            assert packing.weights[found].sum() == pytest.approx(best, abs=1e-8)
            found, done = search_shortly(packing, linear, part, best - 1e-6, NO_LIMITS)
            assert done and not found.size
    assert feasible > 25


def test_it_searches_what_is_left_alone():
    """Neither rows that fixed columns cover nor columns that are not allowed are in its program."""
    rng = np.random.default_rng(5)
    for packing in packings(6, 42):
        linear = begun(packing)
        part = part_of(packing, rng, 0.9, 2)
        linear.solve(columns=part.columns, slack=part.slack)
        rest = remainder_within(packing, linear, part)
        arrays, program = arrays_within(packing, rest), rest[0].program
        covered = np.unique(packing.cols[part.fixed][packing.cols[part.fixed] >= 0]).size
        assert arrays.cols.shape[0] == program.weights.size == part.columns.sum() - part.fixed.size
        assert arrays.slack.size == program.sides.size <= packing.num_rows - covered


def test_it_begins_where_the_program_of_the_whole_is(monkeypatch):
    """Its root needs no pivot: its bound plus the fixed columns' weight is the whole program's bound."""
    rng, warm, roots = np.random.default_rng(6), 0, []
    monkeypatch.setattr(short_search, "OpenNodes", lambda root: roots.append(root) or OpenNodes(root))
    for packing in packings(6, 45):
        linear = begun(packing)
        part = part_of(packing, rng, 1.0, 2)
        relaxed = linear.solve(columns=part.columns, slack=part.slack)
        if relaxed.status != OPTIMAL:
            continue
        search_shortly(packing, linear, part, np.inf, NO_LIMITS)
        root = roots.pop()
        begin = basis_of(root.program, all_allowed(root.program, root.slack), root.variable, root.duals)
        fixed = float(packing.weights[part.fixed].sum())
        assert bound_of(root.program, begin) + fixed == pytest.approx(relaxed.bound, abs=1e-6)
        warm += int((begin.position >= 0).sum())
    assert warm > 10


def test_a_search_of_few_nodes_says_that_it_did_not_end():
    ended = []
    for packing in packings(8, 44):
        linear = begun(packing)
        for nodes in (1, 100_000):
            limits = NO_LIMITS._replace(nodes=nodes)
            ended.append(search_shortly(packing, linear, everything(packing), np.inf, limits)[1])
        assert ended[-1]
    assert not all(ended)
