"""A short branch and bound on the remainder of a linear program whose other columns are fixed.

The remainder is a separate program: with half of the rows a pivot takes a quarter of the time. The fixed columns are
subtracted from the right-hand sides. Columns that are no longer allowed are removed, and so are satisfied rows. No
remaining column has an entry in a removed row. So the multipliers of the remaining rows stay feasible, and the
remaining variables of the basis are part of a basis; anchors fill the free positions.

The search ends after its last node, or when the memory for open nodes is full.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import wait_for_kernels
from assoc.packing.branching.depth_first import Limits, search_depth_first
from assoc.packing.branching.node import new_work, work_memory
from assoc.packing.branching.open_nodes import OpenNodes
from assoc.packing.branching.root import Root
from assoc.packing.packing import Packing, PackingArrays
from assoc.packing.simplex.basis import Basis
from assoc.packing.simplex.linear_program import LinearProgram
from assoc.packing.simplex.program import Program


class Subproblem(NamedTuple):
    """The part of the solutions to search, for which the program was just solved."""

    columns: NDArray[np.bool_]
    """Columns that may be used, (N,)."""
    slack: NDArray[np.bool_]
    """Rows that may stay uncovered, (R,)."""
    fixed: NDArray[np.int64]
    """Columns that must be used; ``columns`` has no other column that shares a row with them."""


Remainder = tuple[Root, NDArray[np.int64], NDArray[np.int64]]
"""The remainder of a program, and the indices of its columns, ascending, and rows in the whole program.

Where a variable of its basis is repeated the basis has an anchor.
"""


def short_memory(packing: Packing, rows: float) -> float:
    """Most bytes that such a search takes in a program of ``rows`` rows."""
    return 60.0 * packing.num_columns + work_memory(rows, packing.num_columns, packing.num_sensors)


def search_shortly(
    packing: Packing, linear: LinearProgram, part: Subproblem, cutoff: float, limits: Limits
) -> tuple[NDArray[np.int64], bool]:
    """Search the part for which a program, perhaps with cuts, was just solved, for solutions lighter than the cutoff.

    Returns the columns of the best solution found (empty: none was found), and whether the search was exhaustive.
    """
    wait_for_kernels()
    nothing = np.zeros(0, dtype=np.int64)
    rest = remainder_within(packing, linear, part)
    if rest is None:
        return nothing, True
    root, columns, _ = rest
    work = new_work(arrays_within(packing, rest), root.program, root.slack)
    below = cutoff - float(packing.weights[part.fixed].sum())
    left, _, count, _ = search_depth_first(work, OpenNodes(root).arrays, 1, below, limits)
    found = nothing if count < 0 else np.concatenate([part.fixed, columns[work.found[:count]]])
    return found, left == 0


def remainder_within(packing: Packing, linear: LinearProgram, part: Subproblem) -> Remainder | None:
    """The remainder of the program with a part's columns fixed; None if they do not fit together."""
    slack = linear.slack.copy()
    slack[: packing.num_rows] = part.slack
    columns = part.columns.copy()
    columns[part.fixed] = False
    return remainder_of(linear.program, linear.basis, part.fixed, np.flatnonzero(columns), slack)


def arrays_within(packing: Packing, rest: Remainder) -> PackingArrays:
    """The remaining columns of a packing over the remaining rows, as branch and bound takes them."""
    root, columns, rows = rest
    rows = rows[rows < packing.num_rows]
    index = np.full(packing.num_rows + 1, -1, dtype=np.int32)
    index[rows] = np.arange(rows.size)
    return packing.arrays._replace(
        cols=index[packing.cols[columns]], weights=packing.weights[columns], slack=root.slack[: rows.size]
    )


def remainder_of(
    program: Program, basis: Basis, fixed: NDArray[np.int64], columns: NDArray[np.int64], slack: NDArray[np.bool_]
) -> Remainder | None:
    """Return the remainder of a program with a basis; None if the fixed columns do not fit together.

    Other ``columns`` that may be used are ascending, and share no measurement with a fixed one; ``slack``: rows that
    may stay uncovered.
    """
    sides = program.sides - np.bincount(_entries(program, fixed)[0], minlength=program.sides.size)
    if sides.min(initial=0.0) < 0.0:
        return None
    entries, counts = _entries(program, columns)
    used = np.bincount(entries, minlength=sides.size) > 0
    # a row that must be covered stays even if no column covers it: then there is no solution
    rows = np.flatnonzero(used | (~slack & (sides > 0.0)))
    row_index = np.full(sides.size, -1, dtype=np.int32)
    row_index[rows] = np.arange(rows.size)
    start = np.concatenate([[0], np.cumsum(counts)])
    rest = Program(program.weights[columns], start, row_index[entries], sides[rows], program.width)
    variable = _variables(program, basis.variable, columns, row_index, rows.size)
    no_sets = np.zeros((0, sides.size), dtype=np.bool_)
    return Root(rest, slack[rows], variable, basis.duals[rows], no_sets), columns, rows


def _entries(program: Program, columns: NDArray[np.int64]) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """The rows of the columns, concatenated, and the number of each column."""
    first = program.start[columns]
    counts = program.start[columns + 1] - first
    ends = np.cumsum(counts)
    total = int(ends[-1]) if ends.size else 0
    return program.rows[np.arange(total) + np.repeat(first - ends + counts, counts)], counts


def _variables(
    program: Program,
    variable: NDArray[np.int32],
    columns: NDArray[np.int64],
    row_index: NDArray[np.int32],
    size: int,
) -> NDArray[np.int32]:
    """The remaining variables of a basis, renumbered; the first is repeated where there are too few."""
    num = program.weights.size
    index = np.full(num, -1, dtype=np.int64)
    index[columns] = np.arange(columns.size)
    is_column = variable < num
    kind, row = np.divmod(np.where(is_column, 0, variable - num), row_index.size)
    there = row_index[row] >= 0
    alone = np.where(there, columns.size + kind * size + row_index[row], -1)
    numbered = np.where(is_column, index[np.where(is_column, variable, 0)], alone)
    numbered = numbered[numbered >= 0]
    # a basis without remaining variables has only anchors
    first = numbered[0] if numbered.size else columns.size + size
    return np.concatenate([numbered, np.full(size - numbered.size, first)]).astype(np.int32)
