"""What is left of a linear program once some of its columns are fixed: a smaller one, and where it begins.

What the fixed columns take goes from the right-hand sides; columns that are no longer allowed go, and so do the rows
that nothing is left for. All that a search does then costs as much as the rest has rows, squared.

No column of the rest has an entry in a row that is gone. So the multipliers of the other rows are as good as they were,
and those variables of the basis that are still there are part of a basis; anchors take the places that are open.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.simplex.basis import Basis
from assoc.packing.simplex.program import Program


class Remainder(NamedTuple):
    """The rest of a program; n columns, m rows.

    Attributes
    ----------
    program : Program
    slack : bool array, shape (m,)
        Whether a row may stay uncovered.
    columns, rows : int64 arrays, shapes (n,) and (m,)
        Their places in the whole program, ascending.
    variable : int32 array, duals : float array, shape (m,)
        A basis and its multipliers. Where a variable is named twice the basis has an anchor.
    """

    program: Program
    slack: NDArray[np.bool_]
    columns: NDArray[np.int64]
    rows: NDArray[np.int64]
    variable: NDArray[np.int32]
    duals: Floats


def remainder_of(
    program: Program, basis: Basis, fixed: NDArray[np.int64], columns: NDArray[np.int64], slack: NDArray[np.bool_]
) -> Remainder | None:
    """Return what is left; None where the fixed columns do not fit.

    Parameters
    ----------
    program : Program
    basis : Basis
        Of this program.
    fixed : int array
        Columns that are in every solution of the rest.
    columns : int array
        Columns that may be used besides, ascending; none has a measurement in common with one that is fixed.
    slack : bool array, shape (rows of the program,)
        Rows that may stay uncovered.
    """
    sides = program.sides - np.bincount(_entries(program, fixed)[0], minlength=program.sides.size)
    if sides.min(initial=0.0) < 0.0:
        return None
    entries, counts = _entries(program, columns)
    used = np.bincount(entries, minlength=sides.size) > 0
    # a row that must be covered stays where nothing can: it says that there is no solution
    rows = np.flatnonzero(used | (~slack & (sides > 0.0)))
    row_place = np.full(sides.size, -1, dtype=np.int32)
    row_place[rows] = np.arange(rows.size)
    start = np.concatenate([[0], np.cumsum(counts)])
    rest = Program(program.weights[columns], start, row_place[entries], sides[rows], program.width)
    variable = _variables(program, basis.variable, columns, row_place, rows.size)
    return Remainder(rest, slack[rows], columns, rows, variable, basis.duals[rows])


def _entries(program: Program, columns: NDArray[np.int64]) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """The rows of columns, one after the other, and how many each has."""
    first = program.start[columns]
    counts = program.start[columns + 1] - first
    ends = np.cumsum(counts)
    total = int(ends[-1]) if ends.size else 0
    return program.rows[np.arange(total) + np.repeat(first - ends + counts, counts)], counts


def _variables(
    program: Program,
    variable: NDArray[np.int32],
    columns: NDArray[np.int64],
    row_place: NDArray[np.int32],
    size: int,
) -> NDArray[np.int32]:
    """What is left of a basis, numbered anew; the first one again where there is not enough."""
    num = program.weights.size
    place = np.full(num, -1, dtype=np.int64)
    place[columns] = np.arange(columns.size)
    is_column = variable < num
    kind, row = np.divmod(np.where(is_column, 0, variable - num), row_place.size)
    there = row_place[row] >= 0
    alone = np.where(there, columns.size + kind * size + row_place[row], -1)
    numbered = np.where(is_column, place[np.where(is_column, variable, 0)], alone)
    numbered = numbered[numbered >= 0]
    # a basis without any of them is one of anchors
    first = numbered[0] if numbered.size else columns.size + size
    return np.concatenate([numbered, np.full(size - numbered.size, first)]).astype(np.int32)
