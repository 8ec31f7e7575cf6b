"""Packings that several rooms test: how they are made, their covers by enumeration, their programs by HiGHS."""

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_array

from assoc.costs import build_problem
from assoc.packing.bounds.dual_ascent import certified_bound, dual_bound
from assoc.packing.packing import assemble
from assoc.packing.prepare import prepare
from assoc.packing.simplex.basis import begin_from_duals, new_basis
from assoc.packing.simplex.dual import OPTIMAL, Effort, solve_dual
from assoc.packing.simplex.program import all_allowed, make_feasible, program_of, weight_limit
from experiments.common.instances.scenes import ghost


def random_packing(seed, rigid=0.0):
    """Three sensors with three rows each, a third of all columns; a share of the rows must be covered."""
    rng = np.random.default_rng(seed)
    ids = np.stack(np.meshgrid(*[np.arange(-1, 3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    ids = ids[((ids >= 0).sum(axis=1) >= 1) & (rng.random(len(ids)) < 0.35)]
    cols = np.where(ids >= 0, ids + 3 * np.arange(3), -1).astype(np.int32)
    weights = 0.5 - (cols >= 0).sum(axis=1) - 0.3 * rng.random(len(cols))
    packing = assemble(cols, weights, rng.random(9) >= rigid, np.arange(len(cols), dtype=np.int32))
    return packing.component(0)


def ghosts(targets, seed):
    """The largest component of a scene of ghosts, multipliers, and a bound that they give."""
    packing = prepare(build_problem(ghost(targets, seed), 0)).packing
    packing = max((packing.component(c) for c in range(packing.num_components)), key=lambda one: one.num_columns)
    duals = dual_bound(packing)
    return packing, duals, certified_bound(packing, duals)


def finished(search, nodes=1000):
    """A search or a ranking, run to its end, so many nodes at a time."""
    while not search.done:
        search.run(nodes)
    return search


def all_covers(packing):
    """Every choice of disjoint columns that covers the rows without slack."""
    masks = [sum(1 << r for r in cols if r >= 0) for cols in packing.cols.tolist()]
    begin = [[] for _ in range(packing.num_rows)]
    for j, mask in enumerate(masks):
        begin[(mask & -mask).bit_length() - 1].append(j)
    found = []

    def extend(row, covered, chosen):
        while covered >> row & 1:
            row += 1
        if row == packing.num_rows:
            found.append(chosen)
            return
        if packing.slack[row]:
            extend(row + 1, covered, chosen)
        for j in begin[row]:
            if not masks[j] & covered:
                extend(row + 1, covered | masks[j], (*chosen, j))

    extend(0, 0, ())
    return found


def weights_of(packing, covers):
    """The weight of each cover."""
    return np.array([packing.weights[list(cover)].sum() for cover in covers])


def is_cover(packing, columns):
    """Whether the columns are disjoint and cover every row that must be covered."""
    used = packing.cols[columns]
    count = np.bincount(used[used >= 0], minlength=packing.num_rows)
    return count.max(initial=0) <= 1 and bool((packing.slack | (count == 1)).all())


def relaxed(packing):
    """The linear program of a packing and its optimal basis."""
    program = program_of(packing.arrays)
    allowed = all_allowed(program, packing.slack)
    basis = new_basis(program)
    duals = dual_bound(packing)
    make_feasible(program, allowed, duals)
    begin_from_duals(program, allowed, duals, basis)
    assert solve_dual(program, allowed, basis, Effort(weight_limit(program), 10_000, np.inf))[0] == OPTIMAL
    return program, allowed, basis


def matrix_of(packing):
    """Rows by columns."""
    used = packing.cols >= 0
    column = np.repeat(np.arange(packing.num_columns), used.sum(axis=1))
    return csr_array(
        (np.ones(column.size), (packing.cols[used], column)), shape=(packing.num_rows, packing.num_columns)
    )


def matrix_of_program(program):
    """The same of a program, in which a column may be twice in a row."""
    matrix = np.zeros((program.sides.size, program.weights.size))
    for j in range(program.weights.size):
        np.add.at(matrix[:, j], program.rows[program.start[j] : program.start[j + 1]], 1.0)
    return matrix


def optimum(packing, columns=None, slack=None, fixed=(), *, whole=False):
    """Optimum of a packing's linear program by HiGHS, or of its covers; with these columns, some of them fixed."""
    columns = np.ones(packing.num_columns, dtype=bool) if columns is None else columns
    slack = packing.slack if slack is None else slack
    if not packing.num_columns:
        return 0.0 if slack.all() else np.inf
    sides = np.ones(packing.num_rows)
    return by_highs(packing.weights, matrix_of(packing), sides, slack, columns, fixed, whole=whole)


def by_highs(weights, matrix, sides, slack, columns, fixed, *, whole=False):
    """The optimum of a program, whose rows without slack are equations; infinite where there is no solution."""
    least, most = np.zeros(weights.size), np.where(columns, np.inf, 0.0)
    least[list(fixed)] = most[list(fixed)] = 1.0
    answer = linprog(
        weights,
        A_ub=matrix[slack] if slack.any() else None,
        b_ub=sides[slack] if slack.any() else None,
        A_eq=matrix[~slack] if not slack.all() else None,
        b_eq=sides[~slack] if not slack.all() else None,
        bounds=np.column_stack([least, most]),
        integrality=np.full(weights.size, int(whole)),
        # 0 would mean HiGHS's own gap, 1e-4
        options={
            "primal_feasibility_tolerance": 1e-10,
            "dual_feasibility_tolerance": 1e-10,
            "mip_rel_gap": 1e-9,
        },
    )
    assert answer.status in (0, 2)
    return answer.fun if answer.status == 0 else np.inf
