"""Dives: covers built column by column in the linear program, and completed by a short branch and bound.

The linear program is solved for the columns of small reduced cost, with cuts. A dive draws some of its fractional
columns, each column j with a probability proportional to

    tau_j^alpha x_j^beta

where x_j, the visibility, is its value in the program. The drawn columns are fixed, columns that share a row with them
are dropped, and the dual simplex method continues with a few pivots. So each choice takes into account the cost of the
choices before it and the potential of the remaining columns. The first choices cost very little, and several are made
at a time. The last ones cause most of a dive's loss: the remaining rows fit together badly, without any single choice
at fault. So the dive stops while a share of the rows is open, or before choices that raise the bound beyond the best
cover, and branch and bound (branching/short_search.py) covers the rest as a separate problem. The share grows when
these searches end early, and shrinks when they do not finish.

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
from assoc.packing.branching.short_search import Subproblem, search_shortly, short_memory
from assoc.packing.kernels.columns import choose_all
from assoc.packing.packing import Packing
from assoc.packing.simplex.basis import basis_of
from assoc.packing.simplex.cuts import with_cuts
from assoc.packing.simplex.dual import OPTIMAL, STOPPED
from assoc.packing.simplex.linear_program import LinearProgram, Relaxation
from assoc.packing.simplex.program import all_allowed, all_reduced_costs

# rows for which a dive pays: fewer are solved exactly, and for more the inverse takes too long
_LEAST, _MOST = 30, 900
# share of the rows still to be covered by choices that is covered before the program is solved again
_BATCH = 0.1
# share of the rows left to branch and bound: at first (but this many rows), least and largest (all rows would make an
# exact solver), and how it changes
_START, _ROWS = 0.35, 40
_LOWEST, _HIGHEST = 0.2, 0.9
_GROW, _SHRINK = 0.03, 0.02
# nodes of one of these searches
_NODES = 24
# values this near to 0 and 1 count as whole
_WHOLE = 1e-6


class Diver:
    """The solved linear program of one component, from which dives start.

    The component's multipliers should be near the optimal ones; ``known`` are the columns of the best known cover, if
    there is one. The program has the ``core`` columns of least reduced cost for each row, chosen again at most
    ``rounds`` times where cuts change the reduced costs.
    """

    root = staticmethod(root_with_cuts)

    def __init__(
        self, priced: Priced, known: NDArray[np.int64], deadline: float, *, core: int = 40, rounds: int = 3
    ) -> None:
        packing = priced.packing
        self._packing, self._tolerance = packing, priced.tolerance
        cutoff = float(packing.weights[known].sum()) if known.size else np.inf
        reduced = priced.reduced
        count = min(core * packing.num_rows, packing.num_columns - 1)
        near = np.zeros(packing.num_columns, dtype=np.bool_)
        # the columns near the bound may have no cover at all
        near[known] = True
        for _ in range(rounds):
            near |= reduced <= np.partition(reduced, count)[count]
            # rows that must be covered keep at least one column: insertion may bring back the others
            self._core: Packing = packing.restrict(near)
            self._root = self.root(self._core, priced.duals[self._core.row_origin], cutoff, deadline)
            reduced = priced.reduced if is_over(deadline) else self._reduced_costs(priced.duals)
            if reduced[~near].min(initial=0.0) >= -priced.tolerance:
                break
        root = self._root
        basis = basis_of(root.program, all_allowed(root.program, root.slack), root.variable, root.duals)
        self._program = LinearProgram.extended(self._core, root.program, root.slack, basis)
        self._relaxed = self._program.solve(deadline=deadline)
        self._program.mark()
        self.in_time: bool = self._relaxed.status == OPTIMAL or not is_over(deadline)
        """Whether the program was solved before the deadline."""
        self.share = min(max(_START, _ROWS / self._core.num_rows), _HIGHEST)

    def _reduced_costs(self, duals: Floats) -> Floats:
        """Reduced costs of all columns by the root's multipliers, or by ``duals`` for rows that the root lacks.

        Those at or above 0 without the cuts do not include the cuts.
        """
        rows, root = self._core.row_origin, self._root
        size, count = self._packing.num_rows, self._core.num_rows
        sets = np.zeros((len(root.sets), size), dtype=np.bool_)
        sets[:, rows] = root.sets
        extended = np.concatenate([duals, root.duals[count:]])
        extended[rows] = root.duals[:count]
        # cuts only raise reduced costs, so that only columns below 0 need them
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
        """Bytes that dives take in a component."""
        rows = MOST_ROWS * packing.num_rows
        # including the mark of its root
        program = 2.0 * LinearProgram.memory(packing, int(rows) - packing.num_rows)
        return program + short_memory(packing, rows)

    def dive(
        self, trail: Floats, strictness: float, rng: np.random.Generator, cutoff: float, deadline: float
    ) -> NDArray[np.int32]:
        """Return a cover that weighs less than ``cutoff``, perhaps of only a part of the rows.

        ``trail`` (N,) is tau_j^alpha of each column of the component, ``strictness`` beta: the larger, the more weight
        the program's values have.
        """
        self._program.back()
        at = _Descent(self._core, self._program, self._relaxed, cutoff)
        left = self.share * self._core.num_rows
        while at.open_rows > left and at.relaxed.status == OPTIMAL:
            drawn = at.draw(trail[self._core.origin], strictness, rng)
            if not drawn.size or not at.fix(drawn, _BATCH * (at.open_rows - left), deadline):
                break
        found, done = at.completed(Limits(self._tolerance, np.inf, _NODES, deadline))
        self.share = min(self.share + _GROW, _HIGHEST) if done else max(self.share - _SHRINK, _LOWEST)
        owner = np.full(self._packing.num_rows, -1, dtype=np.int32)
        choose_all(self._packing.arrays.cols, self._core.origin[found], owner)
        return owner


class _Descent:
    """A dive in progress: the solved program and the fixed columns; for covers that weigh less than ``cutoff``."""

    def __init__(self, packing: Packing, program: LinearProgram, relaxed: Relaxation, cutoff: float) -> None:
        self._packing, self._program, self._cutoff = packing, program, cutoff
        self.relaxed = relaxed
        self._fixed: list[int] = []
        # columns that are still allowed, and those that are fixed
        self._columns = np.ones(packing.num_columns, dtype=np.bool_)
        self._covered = np.zeros(packing.num_rows, dtype=np.bool_)

    @property
    def open_rows(self) -> int:
        """Rows that no fixed column covers."""
        return int(np.count_nonzero(~self._covered))

    def open_columns(self) -> NDArray[np.int64]:
        """Columns with a fractional value in the program."""
        primal = self.relaxed.primal
        return np.flatnonzero((primal > _WHOLE) & (primal < 1.0 - _WHOLE) & self._columns)

    def draw(self, trail: Floats, strictness: float, rng: np.random.Generator) -> NDArray[np.int64]:
        """The open columns in random order, drawn one after the other with their probabilities."""
        columns = self.open_columns()
        chances = trail[columns] * self.relaxed.primal[columns] ** strictness
        likely = chances > 0.0
        # Gumbel trick: sorting log probabilities plus Gumbel noise draws without replacement
        keys = np.log(chances[likely]) + rng.gumbel(size=np.count_nonzero(likely))
        return columns[likely][np.argsort(-keys, kind="stable")]

    def fix(self, drawn: NDArray[np.int64], rows: float, deadline: float) -> bool:
        """Fix the columns that fit, in this order, until they cover ``rows`` rows, but at least one column.

        If no cover below the cutoff would remain, nothing is fixed. Returns whether columns were fixed.
        """
        packing = self._packing
        before = self._columns.copy(), self._covered.copy(), len(self._fixed)
        # columns that no lighter cover can use are dropped for good
        self._columns &= self.relaxed.reduced <= self._cutoff - self.relaxed.bound
        self._columns[self._fixed] = True
        more = 0
        for j in drawn:
            rows_of_column = packing.cols[j][packing.cols[j] >= 0]
            if self._covered[rows_of_column].any():
                continue
            for r in rows_of_column:
                self._columns[packing.row_cols[packing.row_ptr[r] : packing.row_ptr[r + 1]]] = False
            self._covered[rows_of_column] = True
            self._columns[j] = True
            self._fixed.append(int(j))
            more += rows_of_column.size
            if more >= rows:
                break
        slack = packing.slack & ~self._covered
        self.relaxed = self._program.solve(columns=self._columns, slack=slack, cutoff=self._cutoff, deadline=deadline)
        if self.relaxed.status in (OPTIMAL, STOPPED):
            return True
        self._columns, self._covered, count = before
        del self._fixed[count:]
        # the mark is a nearer start than the basis of the rejected choice
        self._program.back()
        slack = packing.slack & ~self._covered
        self.relaxed = self._program.solve(columns=self._columns, slack=slack, deadline=deadline)
        return False

    @property
    def fixed(self) -> NDArray[np.int64]:
        """The fixed columns."""
        return np.array(self._fixed, dtype=np.int64)

    def completed(self, limits: Limits) -> tuple[NDArray[np.int64], bool]:
        """Search for a cover lighter than the cutoff with the fixed columns; if none is found, return only these.

        Also returns whether the search came to its end.
        """
        relaxed = self.relaxed
        columns = self._columns & (relaxed.reduced <= self._cutoff - relaxed.bound)
        slack = self._packing.slack & ~self._covered
        part = Subproblem(columns, slack, self.fixed)
        found, done = search_shortly(self._packing, self._program, part, self._cutoff, limits)
        return (found if found.size else self.fixed), done
