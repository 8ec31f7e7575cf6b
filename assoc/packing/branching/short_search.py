"""A short branch and bound below a linear program that is solved: some nodes, from the basis at hand."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.ahead import wait_for_kernels
from assoc.packing.branching.counts import with_counts
from assoc.packing.branching.depth_first import Limits, search_depth_first
from assoc.packing.branching.kept_bases import keep_alone
from assoc.packing.branching.node import knowing, new_work, work_memory
from assoc.packing.branching.open_nodes import OpenNodes
from assoc.packing.branching.pairs import Trials
from assoc.packing.branching.root import Root
from assoc.packing.packing import Packing
from assoc.packing.simplex.linear_program import LinearProgram


class Part(NamedTuple):
    """What is searched: what the program's last solution allows.

    Attributes
    ----------
    columns : bool array, shape (N,)
        Columns that may be used.
    slack : bool array, shape (R,)
        Rows that may stay uncovered.
    bound : float
        No solution of these weighs less.
    """

    columns: NDArray[np.bool_]
    slack: NDArray[np.bool_]
    bound: float


class ShortSearch:
    """Room for such searches of one program, and what they have learnt of pairs.

    Parameters
    ----------
    packing : Packing
    linear : LinearProgram
        Of this packing, perhaps with further rows and columns.
    like : ShortSearch, optional
        Another one of the same packing: what is known of pairs is shared.
    """

    def __init__(self, packing: Packing, linear: LinearProgram, like: ShortSearch | None = None) -> None:
        wait_for_kernels()
        self._linear = linear
        program, slack, basis = linear.program, linear.slack, linear.basis
        self._work = new_work(with_counts(packing.arrays, program), program, slack)
        if like is not None:
            self._work = knowing(self._work, like.trials)
        no_sets = np.zeros((0, packing.num_rows), dtype=np.bool_)
        self._open = OpenNodes(Root(program, slack, basis.variable, basis.duals, no_sets))

    @property
    def trials(self) -> Trials:
        """What is known of pairs."""
        return self._work.trials

    @staticmethod
    def memory(packing: Packing, rows: float) -> float:
        """Bytes that it takes for a program of so many rows."""
        return work_memory(rows, packing.num_columns, packing.num_sensors)

    def run(self, part: Part, cutoff: float, limits: Limits) -> tuple[NDArray[np.int32], bool]:
        """Search the part that the program was just solved for.

        Parameters
        ----------
        part : Part
        cutoff : float
            Only solutions of less weight are looked for.
        limits : Limits

        Returns
        -------
        int32 array, bool
            Columns of the best solution found (none: nothing was found), and whether nothing was left to search.
        """
        basis = self._linear.basis
        slack = self._linear.slack.copy()
        slack[: part.slack.size] = part.slack
        # columns of counts are always there
        counts = np.arange(part.columns.size, self._linear.program.weights.size)
        columns = np.concatenate([np.flatnonzero(part.columns), counts])
        self._open.hold(columns, slack, basis.variable, basis.duals, part.bound)
        keep_alone(self._work.kept, basis)
        left, _, count, _ = search_depth_first(self._work, self._open.arrays, 1, cutoff, limits)
        found = self._work.found[:count].copy() if count >= 0 else np.zeros(0, dtype=np.int32)
        return found, left == 0
