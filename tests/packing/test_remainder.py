"""The remainder of a program with columns fixed, against HiGHS on the whole program."""

import numpy as np
import pytest

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.root import root_with_cuts
from assoc.packing.branching.short_search import remainder_of
from assoc.packing.prepare import prepare
from assoc.packing.simplex.basis import basis_of
from assoc.packing.simplex.dual import OPTIMAL, Effort, bound_of, solve_dual
from assoc.packing.simplex.program import Allowed, all_allowed, weight_limit
from tests.oracles import axial_problem
from tests.packing.test_trial import packings, program_with_cuts, solved
from tests.packings import by_highs, matrix_of_program


def with_random_cuts():
    """Packings, their programs with cuts of which a column may take two, solved."""
    rng = np.random.default_rng(17)
    for packing in packings(24, 18):
        program = program_with_cuts(packing, rng)
        yield packing, program, *solved(packing, program)


def with_cuts_at_work():
    """Packings whose cuts, those of branch and bound, have multipliers."""
    rng = np.random.default_rng(21)
    for _ in range(24):
        packing = prepare(axial_problem(rng, (8, 8, 8), 0.6, "positive")).packing
        root = root_with_cuts(packing, dual_bound(packing), np.inf, np.inf)
        if (root.duals[packing.num_rows :] < -1e-6).any():
            allowed = all_allowed(root.program, root.slack)
            yield packing, root.program, basis_of(root.program, allowed, root.variable, root.duals), allowed


@pytest.mark.parametrize("cuts", [with_random_cuts, with_cuts_at_work])
@pytest.mark.parametrize("share", [1.0, 0.7])
def test_it_has_the_optimum_of_the_whole_and_begins_there(share, cuts):
    """No pivot is made, as the whole program was solved for these columns."""
    rng, solvable, smaller, taken = np.random.default_rng(17), 0, 0, 0
    for packing, program, basis, allowed in cuts():
        columns = rng.random(packing.num_columns) < share
        # columns of large LP value first: a solution remains
        order = np.argsort(-relaxed_values(program, basis) - rng.random(packing.num_columns))
        fixed, covered = [], np.zeros(packing.num_rows + 1, dtype=bool)
        for j in order[columns[order]]:
            rows = packing.cols[j][packing.cols[j] >= 0]
            if len(fixed) < 3 and not covered[rows].any():
                fixed.append(j)
                covered[rows] = True
        open_columns = columns & ~covered[packing.cols].any(axis=1)
        may_stay = allowed.slack.copy()
        may_stay[: packing.num_rows] &= ~covered[:-1]
        both = open_columns.copy()
        both[fixed] = True
        fixed = np.array(fixed, dtype=np.int64)
        matrix = matrix_of_program(program)
        least = by_highs(program.weights, matrix, program.sides, may_stay, open_columns, fixed)
        effort = Effort(weight_limit(program), 10_000, np.inf)
        status, _ = solve_dual(program, Allowed(np.flatnonzero(both).astype(np.int32), both, may_stay), basis, effort)
        rest = remainder_of(program, basis, fixed, np.flatnonzero(open_columns), may_stay)
        if least == np.inf:
            assert status != OPTIMAL
            continue
        solvable += 1
        root, there, rows = rest
        assert (there == np.flatnonzero(open_columns)).all()
        assert not covered[rows[rows < packing.num_rows]].any()
        smaller += rows.size < program.sides.size
        all_of_it = all_allowed(root.program, root.slack)
        begin = basis_of(root.program, all_of_it, root.variable, root.duals)
        status, exchanges = solve_dual(root.program, all_of_it, begin, effort)
        assert status == OPTIMAL and exchanges == 0
        assert bound_of(root.program, begin) + program.weights[fixed].sum() == pytest.approx(least, abs=1e-8)
        # cuts that still bind, partly used by fixed columns
        cut = rows >= packing.num_rows
        part_taken = root.program.sides[cut] < program.sides[rows[cut]]
        taken += int((part_taken & (begin.duals[cut] < -1e-6)).sum())
    assert solvable > 8 and smaller == solvable and (taken > 0 or cuts is with_random_cuts)


def relaxed_values(program, basis):
    """The value of each column in a basis."""
    values = np.zeros(program.weights.size)
    inside = basis.position >= 0
    values[inside] = basis.values[basis.position[inside]]
    return values


def test_columns_that_do_not_fit_leave_nothing():
    """Two columns of one measurement, or one that exceeds the right-hand side of a row."""
    none = np.zeros(0, dtype=np.int64)
    for packing in packings(2, 19):
        program = program_with_cuts(packing, np.random.default_rng(0))
        basis, allowed = solved(packing, program)
        row = int(np.argmax(np.diff(packing.row_ptr)))
        two = packing.row_cols[packing.row_ptr[row] : packing.row_ptr[row] + 2].astype(np.int64)
        assert remainder_of(program, basis, two, none, allowed.slack) is None
        first = np.flatnonzero(program.rows >= packing.num_rows)[0]
        cut, one = program.rows[first], np.searchsorted(program.start, [first], side="right") - 1
        assert remainder_of(program, basis, one, none, allowed.slack) is not None
        full = program._replace(sides=np.where(np.arange(program.sides.size) == cut, 0.0, program.sides))
        assert remainder_of(full, basis, one, none, allowed.slack) is None


def test_nothing_left_is_a_program_without_rows():
    for packing in packings(2, 20):
        program = program_with_cuts(packing, np.random.default_rng(0))
        basis, allowed = solved(packing, program)
        none = np.zeros(0, dtype=np.int64)
        root, _, rows = remainder_of(program, basis, none, none, np.ones_like(allowed.slack))
        assert root.program.sides.size == root.variable.size == rows.size == 0
        # rows that must be covered stay, although no column can cover them
        root, _, rows = remainder_of(program, basis, none, none, np.zeros_like(allowed.slack))
        assert rows.size == program.sides.size and root.variable.size == rows.size


def test_where_no_variable_of_a_basis_is_left_it_begins_with_anchors():
    for packing in packings(2, 20):
        program = program_with_cuts(packing, np.random.default_rng(0))
        basis, allowed = solved(packing, program)
        # the first column at every position, and it is not in the remainder
        alone = basis._replace(variable=np.zeros_like(basis.variable))
        left = np.arange(1, packing.num_columns)
        root, columns, rows = remainder_of(program, alone, np.zeros(0, np.int64), left, allowed.slack)
        begin = basis_of(root.program, all_allowed(root.program, root.slack), root.variable, root.duals)
        assert (begin.variable >= columns.size + rows.size).all()
