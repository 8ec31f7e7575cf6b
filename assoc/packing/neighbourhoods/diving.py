"""Dives: covers built in the linear program, one column after the other, each fixed before the next is drawn.

The linear program is solved for the columns of small reduced cost. A diver draws one of its fractional columns j with a
probability proportional to

    tau_j^alpha x_j^beta

where x_j, the visibility, is how much of it the program takes; the column is fixed, what shares a row with it goes, and
the dual simplex method goes on from where it was, some exchanges each time. So each choice knows what the choices
before it cost, and what is left can still bring. The dive ends when nothing is fractional, or when its bound says that
nothing better than the best cover can follow; what is then open is left to insertion.

References
----------
V. Maniezzo, "Exact and approximate nondeterministic tree-search procedures for the quadratic assignment problem",
INFORMS Journal on Computing 11 (1999), 358-369 (ants guided by bounds).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.bounds.priced import Priced
from assoc.packing.neighbourhoods.cover import own
from assoc.packing.packing import Packing
from assoc.packing.run import memory_allows
from assoc.packing.simplex.dual import OPTIMAL
from assoc.packing.simplex.linear_program import LinearProgram

# rows for which a dive pays: fewer are solved exactly, and the inverse of more takes too long
_LEAST, _MOST = 30, 900
# columns of the program for each row, those of least reduced cost
_CORE = 40
# values this near to 0 and 1 are whole
_WHOLE = 1e-6


class Diver:
    """The linear program of one component, solved; dives start there.

    Parameters
    ----------
    priced : Priced
        One component, with multipliers near the optimal ones.
    deadline : float
        When time is over (clock.py).
    """

    def __init__(self, priced: Priced, deadline: float) -> None:
        packing = priced.packing
        count = min(_CORE * packing.num_rows, packing.num_columns - 1)
        limit = np.partition(priced.reduced, count)[count]
        # rows that must be covered keep a column each: what the program leaves out insertion may bring back
        self._core: Packing = packing.restrict(priced.reduced <= limit)
        self._rows = packing.num_rows
        self._program = LinearProgram(self._core)
        self._root = self._program.solve(duals=priced.duals[self._core.row_origin], deadline=deadline)
        self._program.mark()

    @staticmethod
    def pays(packing: Packing) -> bool:
        """Whether a component has a size for dives, and there is memory for its program."""
        if not _LEAST <= packing.num_rows <= _MOST:
            return False
        return memory_allows(2.0 * LinearProgram.memory(packing.num_columns, packing.num_rows))

    def dive(
        self, trail: Floats, strictness: float, rng: np.random.Generator, cutoff: float, deadline: float
    ) -> NDArray[np.int32]:
        """Return a cover, perhaps of a part of the rows alone.

        Parameters
        ----------
        trail : float array, shape (N,)
            tau_j^alpha of each column of the component.
        strictness : float
            beta: the larger, the more the program's values decide.
        rng : Generator
        cutoff : float
            The dive ends when nothing below this can follow.
        deadline : float
            When time is over (clock.py).
        """
        core, relaxed = self._core, self._root
        trail = trail[core.origin]
        columns, slack = np.ones(core.num_columns, dtype=np.bool_), core.slack.copy()
        self._program.back()
        # each fixed column is whole from then on: a dive has at most as many steps as rows
        for _ in range(core.num_rows):
            open_columns = np.flatnonzero((relaxed.primal > _WHOLE) & (relaxed.primal < 1.0 - _WHOLE) & columns)
            if relaxed.status != OPTIMAL or not open_columns.size:
                break
            chances = trail[open_columns] * relaxed.primal[open_columns] ** strictness
            j = rng.choice(open_columns, p=chances / chances.sum())
            for r in core.cols[j][core.cols[j] >= 0]:
                columns[core.row_cols[core.row_ptr[r] : core.row_ptr[r + 1]]] = False
                slack[r] = False
            columns[j] = True
            relaxed = self._program.solve(columns=columns, slack=slack, cutoff=cutoff, deadline=deadline)
        owner = np.full(core.num_rows, -1, dtype=np.int32)
        for j in np.argsort(-relaxed.primal, kind="stable"):
            if relaxed.primal[j] <= 0.5:
                break
            rows = core.cols[j][core.cols[j] >= 0]
            if (owner[rows] < 0).all():
                own(core.cols, j, owner)
        whole = np.full(self._rows, -1, dtype=np.int32)
        whole[core.row_origin] = np.where(owner >= 0, core.origin[owner], -1)
        return whole
