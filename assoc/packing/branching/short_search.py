"""A short branch and bound on the remainder of a linear program whose other columns are fixed.

The remainder is a separate program (simplex/remainder.py): with half of the rows a pivot takes a quarter of the time.
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
from assoc.packing.simplex.linear_program import LinearProgram
from assoc.packing.simplex.remainder import Remainder, remainder_of


class Part(NamedTuple):
    """The part of the solutions to search, for which the program was just solved."""

    columns: NDArray[np.bool_]
    """Columns that may be used, (N,)."""
    slack: NDArray[np.bool_]
    """Rows that may stay uncovered, (R,)."""
    fixed: NDArray[np.int64]
    """Columns that must be used; ``columns`` has no other column that shares a row with them."""


def short_memory(packing: Packing, rows: float) -> float:
    """Most bytes that such a search takes in a program of ``rows`` rows."""
    return 60.0 * packing.num_columns + work_memory(rows, packing.num_columns, packing.num_sensors)


def search_shortly(
    packing: Packing, linear: LinearProgram, part: Part, cutoff: float, limits: Limits
) -> tuple[NDArray[np.int64], bool]:
    """Search the part for which a program, perhaps with cuts, was just solved, for solutions lighter than the cutoff.

    Returns the columns of the best solution found (empty: none was found), and whether the search was exhaustive.
    """
    wait_for_kernels()
    nothing = np.zeros(0, dtype=np.int64)
    rest = remainder_within(packing, linear, part)
    if rest is None:
        return nothing, True
    work = new_work(arrays_within(packing, rest), rest.program, rest.slack)
    no_sets = np.zeros((0, packing.num_rows), dtype=np.bool_)
    nodes = OpenNodes(Root(rest.program, rest.slack, rest.variable, rest.duals, no_sets))
    below = cutoff - float(packing.weights[part.fixed].sum())
    left, _, count, _ = search_depth_first(work, nodes.arrays, 1, below, limits)
    found = nothing if count < 0 else np.concatenate([part.fixed, rest.columns[work.found[:count]]])
    return found, left == 0


def remainder_within(packing: Packing, linear: LinearProgram, part: Part) -> Remainder | None:
    """The remainder of the program with a part's columns fixed; None if they do not fit together."""
    slack = linear.slack.copy()
    slack[: packing.num_rows] = part.slack
    columns = part.columns.copy()
    columns[part.fixed] = False
    return remainder_of(linear.program, linear.basis, part.fixed, np.flatnonzero(columns), slack)


def arrays_within(packing: Packing, rest: Remainder) -> PackingArrays:
    """The remaining columns of a packing over the remaining rows, as branch and bound takes them."""
    rows = rest.rows[rest.rows < packing.num_rows]
    index = np.full(packing.num_rows + 1, -1, dtype=np.int32)
    index[rows] = np.arange(rows.size)
    return packing.arrays._replace(
        cols=index[packing.cols[rest.columns]], weights=packing.weights[rest.columns], slack=rest.slack[: rows.size]
    )
