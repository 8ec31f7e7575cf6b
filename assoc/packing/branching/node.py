"""Operations on the current node: load it from the stack, solve it, drop columns, branch.

Used by the search for the best solution (search.py) and for the k best (ranking/component_ranking.py).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Floats
from assoc.packing.branching.kept_bases import KeptBases, keep_basis, kept_memory, no_kept_bases, take_kept
from assoc.packing.branching.open_nodes import Stack, push_node, take_node
from assoc.packing.branching.pairs import Trials, answer, new_trials
from assoc.packing.packing import PackingArrays
from assoc.packing.simplex.basis import Basis, new_basis, refactor
from assoc.packing.simplex.dual import Effort, most_exchanges, solve_dual
from assoc.packing.simplex.program import (
    Allowed,
    Program,
    all_allowed,
    certified,
    make_feasible,
    reduced_cost,
    weight_limit,
)


class Work(NamedTuple):
    """Data and buffers of the search of one packing."""

    cols: NDArray[np.int32]
    """Rows of the packing's columns, (N, S)."""
    weights: Floats
    """Weights of the columns, (N,); those of the program may be smaller."""
    program: Program
    basis: Basis
    """Basis of the current node."""
    node: Allowed
    """What the current node allows; ``active`` is a buffer."""
    trials: Trials
    kept: KeptBases
    """Bases of the latest branchings."""
    duals: Floats
    """Multipliers of the node's bound, feasible, (rows of the program,)."""
    key: Floats
    """Buffer for the sort keys of columns, (N,)."""
    found: NDArray[np.int32]
    """Columns of the best solution found, (R,)."""
    trial: NDArray[np.int32]
    """Buffer for another one."""
    limit: float
    """More than any solution weighs."""


def work_memory(rows: float, columns: int, sensors: int) -> float:
    """Bytes that `new_work` takes: the inverse by columns and by rows, kept bases, pseudo-costs of pairs."""
    # per column: two lists for pricing, masks, and its rows, in the program and in two orders for pricing
    return 34.0 * rows * rows + kept_memory(rows) + (200.0 + 12.0 * max(sensors - 8, 0)) * columns


def new_work(packing: PackingArrays, program: Program, slack: NDArray[np.bool_]) -> Work:
    """Allocate the search of a program whose first rows are those of the packing."""
    num_rows = packing.slack.size
    return Work(
        packing.cols, packing.weights, program, new_basis(program), all_allowed(program, slack),
        new_trials(program, num_rows), no_kept_bases(program), np.empty(slack.size), np.empty(program.weights.size),
        np.empty(num_rows, np.int32), np.empty(num_rows, np.int32), weight_limit(program),
    )  # fmt: skip


def knowing(work: Work, trials: Trials) -> Work:
    """The same buffers, sharing the pseudo-costs of other trials on the same packing."""
    return work._replace(trials=work.trials._replace(gain=trials.gain, tried=trials.tried))


@inner_njit
def drop(work: Work, num: int, bound: float, cut: float) -> int:
    """Drop the columns and the slack that no solution below the cut has; return the number of columns left.

    Leaves their reduced costs in ``key``.
    """
    program, duals, key = work.program, work.duals, work.key
    active, columns, slack = work.node.active, work.node.columns, work.node.slack
    kept = 0
    for a in range(num):
        j = active[a]
        reduced = reduced_cost(program, duals, j)
        # a column at the cut itself stays, and all columns stay if the bound is NaN
        if bound + reduced > cut:
            columns[j] = False
        else:
            active[kept] = j
            key[kept] = reduced
            kept += 1
    for r in range(slack.size):
        if slack[r] and bound - duals[r] > cut:
            slack[r] = False
    return kept


@inner_njit
def allowed_at(work: Work, num: int) -> Allowed:
    """What the current node allows, with its first ``num`` columns."""
    return Allowed(work.node.active[:num], work.node.columns, work.node.slack)


@inner_njit
def open_node(work: Work, stack: Stack, top: int, at_work: int) -> int:
    """Load the node at ``top``, unless its basis is loaded; return its number of columns."""
    basis = work.basis
    num = take_node(stack, top, work.node)
    if at_work != top:
        copy_to(basis.variable, stack.variable[top])
        copy_to(basis.duals, stack.duals[top])
        copy_to(basis.anchors, stack.duals[top])
        # the other side of a branching waits below the first one, with the same basis
        again = top > 0
        for i in range(basis.variable.size):
            again = again and stack.variable[top - 1, i] == basis.variable[i]
        if not take_kept(work.kept, work.program, basis, again):
            refactor(work.program, allowed_at(work, num), basis)
    return num


@inner_njit
def relax(work: Work, num: int, cutoff: float, deadline: float) -> Any:
    """Solve the current node's linear program; return the status, and a valid bound."""
    allowed = allowed_at(work, num)
    status, _ = solve_dual(work.program, allowed, work.basis, Effort(cutoff, most_exchanges(work.program), deadline))
    copy_to(work.duals, work.basis.duals)
    make_feasible(work.program, allowed, work.duals)
    return status, certified(work.program, allowed, work.duals)


@inner_njit
def keep_side(work: Work, num: int, pair: tuple[int, int], joined: bool) -> int:
    """Replace the current node by its only remaining side; return its number of columns."""
    side, node = work.trials.side, work.node
    num = answer(work.cols, allowed_at(work, num), pair, joined, side)
    copy_to(node.active[:num], side.active[:num])
    copy_to(node.columns, side.columns)
    copy_to(node.slack, side.slack)
    return num


@inner_njit
def branch(work: Work, stack: Stack, top: int, num: int, pair: tuple[int, int], likely: bool, lower: float) -> int:
    """Push both sides of the current node, the likelier last, to be searched first; return the number of open nodes."""
    side = work.trials.side
    keep_basis(work.kept, work.basis)
    for turn in range(2):
        # the likelier side: together or apart
        joined = likely if turn == 1 else not likely
        count = answer(work.cols, allowed_at(work, num), pair, joined, side)
        push_node(stack, top + turn, Allowed(side.active[:count], side.columns, side.slack), work.basis, lower)
    return top + 2
