"""The remainder of a linear program after fixing some columns: a smaller program, and its starting basis.

The fixed columns are subtracted from the right-hand sides. Columns that are no longer allowed are removed, and so are
rows that are satisfied. The cost of a search on the remainder grows with the square of its rows.

No remaining column has an entry in a removed row. So the multipliers of the remaining rows stay feasible, and the
remaining variables of the basis are part of a basis; anchors fill the free positions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.simplex.basis import Basis
from assoc.packing.simplex.program import Program


class Remainder(NamedTuple):
    """The remainder of a program; n columns, m rows."""

    program: Program
    slack: NDArray[np.bool_]
    """Whether a row may stay uncovered, (m,)."""
    columns: NDArray[np.int64]
    """Indices in the whole program, ascending, (n,)."""
    rows: NDArray[np.int64]
    """The same of the rows, (m,)."""
    variable: NDArray[np.int32]
    """A basis, (m,), and its multipliers. Where a variable is repeated the basis has an anchor."""
    duals: Floats


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
    return Remainder(rest, slack[rows], columns, rows, variable, basis.duals[rows])


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
