"""A short branch and bound where columns are fixed: some nodes, in what is left of a linear program.

What is left is a program of its own (simplex/remainder.py): with half of the rows an exchange takes a quarter of the
time. A search that fills the room for its open nodes ends there, as with its last node.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.ahead import wait_for_kernels
from assoc.packing.branching.counts import with_counts
from assoc.packing.branching.depth_first import Limits, search_depth_first
from assoc.packing.branching.node import new_work, work_memory
from assoc.packing.branching.open_nodes import OpenNodes
from assoc.packing.branching.root import Root
from assoc.packing.packing import Packing, PackingArrays
from assoc.packing.simplex.linear_program import LinearProgram
from assoc.packing.simplex.remainder import Remainder, remainder_of


class Part(NamedTuple):
    """What is searched: what the program was just solved for.

    Attributes
    ----------
    columns : bool array, shape (N,)
        Columns that may be used.
    slack : bool array, shape (R,)
        Rows that may stay uncovered.
    fixed : int array
        Columns that must be used; of those that share a row with them none but themselves is in ``columns``.
    """

    columns: NDArray[np.bool_]
    slack: NDArray[np.bool_]
    fixed: NDArray[np.int64]


class ShortSearch:
    """Such searches of one packing, and what they have learnt of pairs.

    Parameters
    ----------
    packing : Packing

    Attributes
    ----------
    gain, tried : float32 and uint8 arrays, shape (2, R, R)
        As in pairs.py (`Trials`); true in every program of the packing.
    """

    def __init__(self, packing: Packing) -> None:
        wait_for_kernels()
        self._packing = packing
        rows = packing.num_rows
        self.gain = np.zeros((2, rows, rows), np.float32)
        self.tried = np.zeros((2, rows, rows), np.uint8)

    @staticmethod
    def memory(packing: Packing, rows: float) -> float:
        """Bytes that it takes at the most for a program of so many rows."""
        # open nodes, and what is known of pairs with a copy of it
        nodes = 60.0 * packing.num_columns
        return 20.0 * packing.num_rows**2 + nodes + work_memory(rows, packing.num_columns, packing.num_sensors)

    def run(self, linear: LinearProgram, part: Part, cutoff: float, limits: Limits) -> tuple[NDArray[np.int64], bool]:
        """Search the part that a program was just solved for.

        Parameters
        ----------
        linear : LinearProgram
            Of the packing, perhaps with further rows and columns.
        part : Part
        cutoff : float
            Only solutions of less weight are looked for.
        limits : Limits

        Returns
        -------
        int array, bool
            Columns of the best solution found (none: nothing was found), and whether nothing was left to search.
        """
        packing = self._packing
        nothing = np.zeros(0, dtype=np.int64)
        rest = _remainder(packing, linear, part)
        if rest is None:
            return nothing, True
        work = new_work(with_counts(_arrays(packing, rest), rest.program), rest.program, rest.slack)
        rows = rest.rows[rest.rows < packing.num_rows]
        pairs = np.ix_(np.arange(2), rows, rows)
        work.trials.gain[:], work.trials.tried[:] = self.gain[pairs], self.tried[pairs]
        no_sets = np.zeros((0, rows.size), dtype=np.bool_)
        nodes = OpenNodes(Root(rest.program, rest.slack, rest.variable, rest.duals, no_sets))
        below = cutoff - float(packing.weights[part.fixed].sum())
        left, _, count, _ = search_depth_first(work, nodes.arrays, 1, below, limits)
        self.gain[pairs], self.tried[pairs] = work.trials.gain, work.trials.tried
        found = nothing if count < 0 else np.concatenate([part.fixed, rest.columns[work.found[:count]]])
        return found, left == 0


def _remainder(packing: Packing, linear: LinearProgram, part: Part) -> Remainder | None:
    """What is left of the program with those columns fixed."""
    slack = linear.slack.copy()
    slack[: packing.num_rows] = part.slack
    own = part.columns.copy()
    own[part.fixed] = False
    # columns of counts are always there
    counts = np.arange(packing.num_columns, linear.program.weights.size)
    columns = np.concatenate([np.flatnonzero(own), counts])
    return remainder_of(linear.program, linear.basis, part.fixed, columns, slack)


def _arrays(packing: Packing, rest: Remainder) -> PackingArrays:
    """The columns of a packing that are left, over the rows that are left, as branch and bound takes them."""
    own = rest.columns[rest.columns < packing.num_columns]
    rows = rest.rows[rest.rows < packing.num_rows]
    place = np.full(packing.num_rows + 1, -1, dtype=np.int32)
    place[rows] = np.arange(rows.size)
    return packing.arrays._replace(
        cols=place[packing.cols[own]], weights=packing.weights[own], slack=rest.slack[: rows.size]
    )
