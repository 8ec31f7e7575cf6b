"""Dives: covers built in the linear program, one column after the other, each fixed before the next is drawn.

The linear program is solved for the columns of small reduced cost. A diver draws one of its fractional columns j with a
probability proportional to

    tau_j^alpha x_j^beta

where x_j, the visibility, is how much of it the program takes; the column is fixed, what shares a row with it goes, and
the dual simplex method goes on from where it was, some exchanges each time. So each choice knows what the choices
before it cost, and what is left can still bring. A choice that lifts the bound beyond an aim between the bound and the
best cover is taken back, and its column excluded; where neither way meets the aim, it is raised. The dive ends when
nothing is fractional, or when its bound says that nothing better than the best cover can follow; what is then open is
left to insertion.

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
from assoc.packing.packing import Packing, assemble
from assoc.packing.run import memory_allows
from assoc.packing.simplex.dual import OPTIMAL, STOPPED
from assoc.packing.simplex.linear_program import LinearProgram, Relaxation

# rows for which a dive pays: fewer are solved exactly, and the inverse of more takes too long
_LEAST, _MOST = 30, 900
# columns of the program for each row, those of least reduced cost
_CORE = 40
# of the way from the bound to the best cover: the increase with which a dive is content at first
_AIM = 0.4
# open rows, as a share of a program's, at which a smaller one takes its place
_SHRINK = 0.75
# the mark of a step, beside that of the root
_STEP = 1
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
        self._packing, self._rows = packing, packing.num_rows
        self._program = LinearProgram(self._core)
        self._root = self._program.solve(duals=priced.duals[self._core.row_origin], deadline=deadline)
        self._program.mark()

    @staticmethod
    def pays(packing: Packing) -> bool:
        """Whether a component has a size for dives, and there is memory for its program."""
        if not _LEAST <= packing.num_rows <= _MOST:
            return False
        # with the marks of the root and of a step, and smaller programs
        return memory_allows(5.0 * LinearProgram.memory(packing.num_columns, packing.num_rows))

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
        self._program.back()
        at = _Descent(self._core, self._program, self._root, cutoff)
        # each column fixed is whole from then on: a dive has at most as many of them as rows
        for _ in range(2 * self._rows):
            if at.relaxed.status != OPTIMAL:
                break
            open_columns = at.open_columns()
            if not open_columns.size:
                break
            if at.may_shrink:
                at = at.shrunk(deadline)
                continue
            chances = trail[at.origin[open_columns]] * at.relaxed.primal[open_columns] ** strictness
            at.step(int(rng.choice(open_columns, p=chances / chances.sum())), deadline)
        return at.cover(self._packing)


class _Descent:
    """A dive on its way: a packing of what is still open, its program, and what has been fixed.

    Parameters
    ----------
    packing : Packing
    program : LinearProgram
        Of this packing, solved.
    relaxed : Relaxation
    cutoff : float
        Covers of this weight or more are not looked for.
    """

    def __init__(self, packing: Packing, program: LinearProgram, relaxed: Relaxation, cutoff: float) -> None:
        self._packing, self._program, self._cutoff = packing, program, cutoff
        self.relaxed = relaxed
        # columns in the numbering of the whole component
        self.origin: NDArray[np.int32] = packing.origin
        self._columns = np.ones(packing.num_columns, dtype=np.bool_)
        self._slack = packing.slack.copy()
        self._fixed = np.zeros(packing.num_columns, dtype=np.bool_)
        self._open_rows = packing.num_rows
        # columns of the whole component that were fixed before the packing became smaller
        self._chosen: list[int] = []
        # a bound beyond this is too much; nothing to aim at where no cover is known
        self._aim = cutoff if cutoff == np.inf else relaxed.bound + _AIM * (cutoff - relaxed.bound)

    def open_columns(self) -> NDArray[np.int64]:
        """Columns of which the program takes a part."""
        primal = self.relaxed.primal
        return np.flatnonzero((primal > _WHOLE) & (primal < 1.0 - _WHOLE) & self._columns)

    def step(self, j: int, deadline: float) -> None:
        """Fix column j; or exclude it, where the program says that fixing it costs too much."""
        packing, program = self._packing, self._program
        # what nothing lighter can use goes for good
        self._columns &= self._fixed | (self.relaxed.reduced <= self._cutoff - self.relaxed.bound)
        columns, slack, before = self._columns.copy(), self._slack.copy(), self.relaxed
        program.mark(_STEP)
        rows = packing.cols[j][packing.cols[j] >= 0]
        for r in rows:
            self._columns[packing.row_cols[packing.row_ptr[r] : packing.row_ptr[r + 1]]] = False
            self._slack[r] = False
        self._columns[j] = self._fixed[j] = True
        self._solve(deadline)
        if self.relaxed.status in (OPTIMAL, STOPPED):
            self._open_rows -= rows.size
            return
        self._columns, self._slack = columns, slack
        self._fixed[j] = self._columns[j] = False
        while True:
            program.back(_STEP)
            self._solve(deadline)
            if self.relaxed.status in (OPTIMAL, STOPPED) or self._aim >= self._cutoff:
                break
            # nor is there anything without it: be content with less
            room = max(self._aim - before.bound, 1e-3 * (self._cutoff - before.bound))
            self._aim = min(before.bound + 2.0 * room, self._cutoff)

    def _solve(self, deadline: float) -> None:
        self.relaxed = self._program.solve(
            columns=self._columns, slack=self._slack, cutoff=self._aim, deadline=deadline
        )

    @property
    def may_shrink(self) -> bool:
        """Whether a program of the open rows alone is worth its beginning."""
        return self._packing.num_rows >= _LEAST and self._open_rows <= _SHRINK * self._packing.num_rows

    def shrunk(self, deadline: float) -> _Descent:
        """Return the same dive on the open rows alone: the inverse is dense, and steps then take a part of the time."""
        packing, relaxed = self._packing, self.relaxed
        fixed = np.flatnonzero(self._fixed)
        weight = float(packing.weights[fixed].sum())
        open_rows = np.ones(packing.num_rows, dtype=np.bool_)
        for j in fixed:
            open_rows[packing.cols[j][packing.cols[j] >= 0]] = False
        keep = np.flatnonzero(self._columns & ~self._fixed).astype(np.int32)
        smaller = assemble(
            packing.cols[keep], packing.weights[keep], packing.slack | ~open_rows, keep, packing.granularity
        )
        cutoff, aim = self._cutoff - weight, self._aim - weight
        program = LinearProgram(smaller)
        solved = program.solve(duals=relaxed.duals[smaller.row_origin], cutoff=aim, deadline=deadline)
        after = _Descent(smaller, program, solved, cutoff)
        after._aim = aim
        after._chosen = [*self._chosen, *self.origin[fixed].tolist()]
        after.origin = self.origin[smaller.origin]
        return after

    def cover(self, whole: Packing) -> NDArray[np.int32]:
        """Return the owners of the rows of the component: what is fixed, and what the program takes mostly."""
        owner = np.full(whole.num_rows, -1, dtype=np.int32)
        order = np.argsort(-self.relaxed.primal, kind="stable")
        likely = self.origin[order[self.relaxed.primal[order] > 0.5]]
        for j in [*self._chosen, *self.origin[self._fixed].tolist(), *likely.tolist()]:
            rows = whole.cols[j][whole.cols[j] >= 0]
            if (owner[rows] < 0).all():
                own(whole.cols, j, owner)
        return owner
