"""Dives: covers begun in the linear program, column by column, and ended by a short branch and bound.

The linear program is solved for the columns of small reduced cost, with cuts. A diver draws some of its fractional
columns, each column j with a probability proportional to

    tau_j^alpha x_j^beta

where x_j, the visibility, is how much of it the program takes; they are fixed, what shares a row with them goes, and
the dual simplex method goes on from where it was, some exchanges each time. So each choice knows what the choices
before it cost, and what is left can still bring. The first choices cost next to nothing, and some are made at a time.
The last ones cost nearly all that a dive loses: what then lies open fits together badly, and no single one of them is
the fault. So the dive ends while a share of the rows is open, or before the choices that lift the bound beyond the best
cover, and branch and bound (branching/short_search.py) covers what is left, as a problem of its own. The share grows
while these searches end early, and shrinks when they do not end at all. What they learn of pairs is kept from dive to
dive.

References
----------
V. Maniezzo, "Exact and approximate nondeterministic tree-search procedures for the quadratic assignment problem",
INFORMS Journal on Computing 11 (1999), 358-369 (ants guided by bounds).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._types import Floats
from assoc.packing.bounds.dual_ascent import reduced_costs
from assoc.packing.bounds.priced import Priced
from assoc.packing.branching.depth_first import Limits
from assoc.packing.branching.root import MOST_ROWS, root_with_cuts
from assoc.packing.branching.short_search import Lessons, Part, no_lessons, search_shortly, short_memory
from assoc.packing.neighbourhoods.cover import own_all
from assoc.packing.packing import Packing
from assoc.packing.simplex.basis import basis_of
from assoc.packing.simplex.cuts import with_cuts
from assoc.packing.simplex.dual import OPTIMAL, STOPPED
from assoc.packing.simplex.linear_program import LinearProgram, Relaxation
from assoc.packing.simplex.program import all_allowed, all_reduced_costs

# rows for which a dive pays: fewer are solved exactly, and the inverse of more takes too long
_LEAST, _MOST = 30, 900
# columns of the program for each row, those of least reduced cost; how often they are chosen anew where the program
# with cuts would take others
_CORE = 40
_ROUNDS = 3
# of the rows that are still to be covered by choices: those covered before the program is solved again
_BATCH = 0.1
# shares of the rows that are left to branch and bound: at first (but so many rows), at the least and at the most (all
# would be an exact solver), and how they change
_START, _ROWS = 0.35, 40
_LOWEST, _HIGHEST = 0.2, 0.9
_GROW, _SHRINK = 0.03, 0.02
# nodes of one such search
_NODES = 24
# values this near to 0 and 1 are whole
_WHOLE = 1e-6


class Diver:
    """The linear program of one component, solved; dives start there.

    Parameters
    ----------
    priced : Priced
        One component, with multipliers near the optimal ones.
    known : int array
        Columns of the best cover known; none of them: none is known.
    deadline : float
        When time is over (clock.py).
    """

    def __init__(self, priced: Priced, known: NDArray[np.int64], deadline: float) -> None:
        packing = priced.packing
        self._packing, self._tolerance = packing, priced.tolerance
        cutoff = float(packing.weights[known].sum()) if known.size else np.inf
        reduced = priced.reduced
        count = min(_CORE * packing.num_rows, packing.num_columns - 1)
        near = np.zeros(packing.num_columns, dtype=np.bool_)
        # what lies near the bound may hold no cover at all
        near[known] = True
        for _ in range(_ROUNDS):
            near |= reduced <= np.partition(reduced, count)[count]
            # rows that must be covered keep a column each: what the program leaves out insertion may bring back
            self._core: Packing = packing.restrict(near)
            self._root = root_with_cuts(self._core, priced.duals[self._core.row_origin], cutoff, deadline)
            reduced = priced.reduced if is_over(deadline) else self._reduced_costs(priced.duals)
            if reduced[~near].min(initial=0.0) >= -priced.tolerance:
                break
        root = self._root
        basis = basis_of(root.program, all_allowed(root.program, root.slack), root.variable, root.duals)
        self._program = LinearProgram.extended(self._core, root.program, root.slack, basis)
        self._relaxed = self._program.solve(deadline=deadline)
        self._program.mark()
        self._lessons = no_lessons(self._core)
        self.share = min(max(_START, _ROWS / self._core.num_rows), _HIGHEST)

    def _reduced_costs(self, duals: Floats) -> Floats:
        """Reduced costs of all columns by the multipliers of the root, by these where it has no such row.

        Of those at or above 0 less than all is told: without cuts.
        """
        rows, root = self._core.row_origin, self._root
        size, own = self._packing.num_rows, self._core.num_rows
        sets = np.zeros((len(root.sets), size), dtype=np.bool_)
        sets[:, rows] = root.sets
        extended = np.concatenate([duals, root.duals[own:]])
        extended[rows] = root.duals[:own]
        # cuts make columns dearer, never cheaper: of most no more need be known
        reduced = reduced_costs(self._packing, extended[:size])
        below = np.flatnonzero(reduced < 0.0)
        program = with_cuts(self._packing.cols[below], self._packing.weights[below], size, sets)
        reduced[below] = all_reduced_costs(program, extended)
        return reduced

    @staticmethod
    def pays(packing: Packing) -> bool:
        """Whether a component has a size for dives."""
        return _LEAST <= packing.num_rows <= _MOST

    @staticmethod
    def memory(packing: Packing) -> float:
        """Bytes that dives in a component take."""
        rows = MOST_ROWS * packing.num_rows
        # with the mark of its root
        program = 2.0 * LinearProgram.memory(packing, int(rows) - packing.num_rows)
        return program + short_memory(packing, rows)

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
            Covers of this weight or more are not looked for.
        deadline : float
            When time is over (clock.py).
        """
        self._program.back()
        at = _Descent(self._core, self._program, self._relaxed, cutoff)
        left = self.share * self._core.num_rows
        while at.open_rows > left and at.relaxed.status == OPTIMAL:
            columns = at.open_columns()
            chances = trail[self._core.origin[columns]] * at.relaxed.primal[columns] ** strictness
            if not chances.any():
                break
            if not at.fix(_drawn(columns, chances, rng), _BATCH * (at.open_rows - left), deadline):
                break
        found, done = at.completed(Limits(self._tolerance, np.inf, _NODES, deadline), self._lessons)
        self.share = min(self.share + _GROW, _HIGHEST) if done else max(self.share - _SHRINK, _LOWEST)
        owner = np.full(self._packing.num_rows, -1, dtype=np.int32)
        own_all(self._packing.arrays.cols, self._core.origin[found], owner)
        return owner


def _drawn(columns: NDArray[np.int64], chances: Floats, rng: np.random.Generator) -> NDArray[np.int64]:
    """Columns in the order in which they are drawn, one after the other, by their chances."""
    likely = chances > 0.0
    # the largest of Gumbel numbers added to the logarithms is a draw by the chances, the next one is of those left
    keys = np.log(chances[likely]) + rng.gumbel(size=np.count_nonzero(likely))
    return columns[likely][np.argsort(-keys, kind="stable")]


class _Descent:
    """A dive on its way: the program, and what has been fixed.

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
        self._fixed: list[int] = []
        # columns that may still be taken, and those that are fixed
        self._columns = np.ones(packing.num_columns, dtype=np.bool_)
        self._covered = np.zeros(packing.num_rows, dtype=np.bool_)

    @property
    def open_rows(self) -> int:
        """Rows that no fixed column covers."""
        return int(np.count_nonzero(~self._covered))

    def open_columns(self) -> NDArray[np.int64]:
        """Columns of which the program takes a part."""
        primal = self.relaxed.primal
        return np.flatnonzero((primal > _WHOLE) & (primal < 1.0 - _WHOLE) & self._columns)

    def fix(self, drawn: NDArray[np.int64], rows: float, deadline: float) -> bool:
        """Fix columns in their order, those that fit, until they cover so many rows (one at the least).

        Where nothing below the cutoff is left then, nothing is fixed; whether it was.
        """
        packing = self._packing
        before = self._columns.copy(), self._covered.copy(), len(self._fixed)
        # what nothing lighter can use goes for good
        self._columns &= self.relaxed.reduced <= self._cutoff - self.relaxed.bound
        self._columns[self._fixed] = True
        more = 0
        for j in drawn:
            own_rows = packing.cols[j][packing.cols[j] >= 0]
            if self._covered[own_rows].any():
                continue
            for r in own_rows:
                self._columns[packing.row_cols[packing.row_ptr[r] : packing.row_ptr[r + 1]]] = False
            self._covered[own_rows] = True
            self._columns[j] = True
            self._fixed.append(int(j))
            more += own_rows.size
            if more >= rows:
                break
        slack = packing.slack & ~self._covered
        self.relaxed = self._program.solve(columns=self._columns, slack=slack, cutoff=self._cutoff, deadline=deadline)
        if self.relaxed.status in (OPTIMAL, STOPPED):
            return True
        self._columns, self._covered, count = before
        del self._fixed[count:]
        # from the mark it is nearer than from what was taken back
        self._program.back()
        slack = packing.slack & ~self._covered
        self.relaxed = self._program.solve(columns=self._columns, slack=slack, deadline=deadline)
        return False

    @property
    def fixed(self) -> NDArray[np.int64]:
        """Columns that are fixed."""
        return np.array(self._fixed, dtype=np.int64)

    def completed(self, limits: Limits, lessons: Lessons) -> tuple[NDArray[np.int64], bool]:
        """Search a cover lighter than the cutoff with what is fixed; what is fixed alone where none was found.

        And whether the search came to its end.
        """
        relaxed = self.relaxed
        columns = self._columns & (relaxed.reduced <= self._cutoff - relaxed.bound)
        slack = self._packing.slack & ~self._covered
        part = Part(columns, slack, self.fixed)
        found, done = search_shortly(self._packing, self._program, part, self._cutoff, limits, lessons)
        return (found if found.size else self.fixed), done
