"""Operations on the current node: load it from the stack, solve it, drop columns, branch.

Used by the search for the best solution (search.py) and for the k best (ranking/component_ranking.py).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, lean_inner_njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Floats
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

# The bases of the latest branchings: depth first, the second side of a branching is searched after the whole subtree of
# the first. Recomputing the inverse of its basis takes as long as dozens of pivots, copying it as long as one. A kept
# basis is identified by its variables, which determine the inverse. At most so many bases, and elements of all their
# inverses, are kept:
_BASES, _ELEMENTS = 8, 4_000_000


class KeptBases(NamedTuple):
    """Up to ``K`` bases of ``m`` rows; a new one replaces the oldest."""

    variable: NDArray[np.int32]
    """As in `Basis`; -1 in unused entries, (K, m)."""
    inverse: Floats
    """(K, m, m); norms (K, m), ages (K,)."""
    norms: Floats
    age: NDArray[np.int64]
    latest: NDArray[np.int64]
    """Index of the latest one, (1,)."""


def kept_memory(rows: float) -> float:
    """Bytes of the inverses."""
    return 8.0 * min(_BASES * rows * rows, _ELEMENTS)


def no_kept_bases(program: Program, elements: int = _ELEMENTS) -> KeptBases:
    """Allocate kept bases of a program, fewer where they are large: at most so many elements of all their inverses."""
    size = program.sides.size
    count = min(_BASES, elements // max(size * size, 1))
    return KeptBases(
        np.full((count, size), -1, np.int32), np.empty((count, size, size)), np.empty((count, size)),
        np.zeros(count, np.int64), np.zeros(1, np.int64),
    )  # fmt: skip


@lean_inner_njit
def keep_basis(kept: KeptBases, basis: Basis) -> None:
    """Keep a copy of a basis."""
    count = kept.age.size
    if count > 0:
        position = (kept.latest[0] + 1) % count
        kept.latest[0] = position
        copy_to(kept.variable[position], basis.variable)
        for r in range(basis.values.size):
            copy_to(kept.inverse[position, r], basis.inverse[r])
        copy_to(kept.norms[position], basis.norms)
        kept.age[position] = basis.age[0]


@lean_inner_njit
def take_kept(kept: KeptBases, program: Program, basis: Basis, again: bool) -> bool:
    """Copy the kept basis of the same variables, except multipliers and anchors, to ``basis``; False if there is none.

    ``again``: it will be needed once more.
    """
    count, num, size = kept.age.size, program.weights.size, program.sides.size
    position = -1
    for back in range(count):
        candidate = (kept.latest[0] + count - back) % count
        i = 0
        while i < size and kept.variable[candidate, i] == basis.variable[i]:
            i += 1
        if i == size:
            position = candidate
            break
    if position >= 0:
        # bases kept after it belong to nodes that are done
        kept.latest[0] = position if again else (position + count - 1) % count
        # right-hand sides may have changed (counts.py)
        basis.values[:] = 0.0
        for r in range(size):
            for i in range(size):
                entry = kept.inverse[position, r, i]
                basis.inverse[r, i] = entry
                basis.values[i] += program.sides[r] * entry
        copy_to(basis.norms, kept.norms[position])
        basis.age[0] = kept.age[position]
        basis.position[:] = -1
        basis.slack_position[:] = -1
        for i in range(size):
            code = basis.variable[i]
            if code < num:
                basis.position[code] = i
            elif code < num + size:
                basis.slack_position[code - num] = i
    return position >= 0


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


@lean_inner_njit
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
