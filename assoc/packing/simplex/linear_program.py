"""The linear program of a packing: solved once for its bound, or repeatedly while the allowed columns change.

    program = LinearProgram(packing)
    relaxed = program.solve(duals=dual_bound(packing))       # from the multipliers of the dual ascent
    program.mark()
    program.solve(columns=relaxed.reduced <= gap)            # warm: a few exchanges from the basis at hand
    program.back()                                           # where the mark is

Search kernels take the same steps: `begin_from_duals`, `solve_dual`, `certified`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.packing import Packing
from assoc.packing.simplex.basis import Basis, begin_from_duals, copy_basis, new_basis, primal_values
from assoc.packing.simplex.dual import INFEASIBLE, Effort, solve_dual
from assoc.packing.simplex.program import (
    Allowed,
    Program,
    all_reduced_costs,
    certified,
    least_reduced,
    make_feasible,
    program_of,
    weight_limit,
)

# columns for each row in the first round, and their growth from round to round
_FEW = 20
_MORE = 4
# a reduced cost this far below 0, as a share of the largest weight, is not rounding
_LACK = 1e-11


@dataclass(frozen=True, slots=True)
class Relaxation:
    """The state of a linear program when solving ended."""

    status: int
    """``OPTIMAL``; ``CUT``: the bound has reached the cutoff; ``INFEASIBLE``; ``STOPPED`` before the end."""
    bound: float
    """Lower bound on the allowed solutions, whatever the status; ``inf`` if there is none."""
    duals: Floats
    """Multipliers that give the bound, (R,), <= 0 on rows that may stay uncovered; further rows come last."""
    reduced: Floats
    """Their reduced costs, (N,): at least 0 on the columns that are allowed, but for rounding."""
    primal: Floats
    """LP value of each column, (N,); optimal where the status is ``OPTIMAL``."""
    exchanges: int
    """Steps of the simplex method."""


class LinearProgram:
    """The linear program of a packing with a basis that is kept from one call to the next.

    Several components are one program. Memory grows with the square of the rows.
    """

    def __init__(self, packing: Packing) -> None:
        self._packing = packing
        self.program = program_of(packing.arrays)
        self.slack = packing.slack
        self.basis: Basis = new_basis(self.program)
        self._marked: Basis | None = None
        self._begun = False

    @classmethod
    def extended(cls, packing: Packing, program: Program, slack: NDArray[np.bool_], basis: Basis) -> LinearProgram:
        """The program of a packing with more rows and columns after its own, from a basis that is changed in place."""
        self = cls.__new__(cls)
        self._packing, self.program, self.slack, self.basis = packing, program, slack, basis
        self._marked, self._begun = None, True
        return self

    @staticmethod
    def memory(packing: Packing, more_rows: int = 0) -> float:
        """Bytes of the program of a packing, with ``more_rows`` further rows."""
        rows = float(packing.num_rows + more_rows)
        # a column's rows are stored in the program and in two orders for pricing
        return 8.0 * rows * rows + (120.0 + 12.0 * max(packing.num_sensors - 8, 0)) * packing.num_columns

    def solve(
        self,
        *,
        columns: NDArray[np.bool_] | None = None,
        slack: NDArray[np.bool_] | None = None,
        duals: Floats | None = None,
        cutoff: float = np.inf,
        exchanges: int | None = None,
        deadline: float = np.inf,
    ) -> Relaxation:
        """Solve the program for the allowed columns (N,) and slack (R,), by default all and those of the packing.

        The only allowed column of a row that must be covered is fixed. Multipliers (R,) to start from need not be
        feasible; by default the basis of the last call is the start. It ends when the bound has reached the cutoff,
        after so many exchanges (pivots), or at the deadline (clock.py).
        """
        packing, program, basis = self._packing, self.program, self.basis
        mask = np.ones(program.weights.size, dtype=np.bool_)
        may_stay = self.slack.copy()
        if columns is not None:
            mask[: columns.size] = columns
        if slack is not None:
            may_stay[: slack.size] = slack
        allowed = Allowed(np.flatnonzero(mask).astype(np.int32), mask, may_stay)
        limit = float(weight_limit(program))
        most = 10_000 + 100 * packing.num_rows if exchanges is None else exchanges
        effort = Effort(min(cutoff, limit), most, deadline)
        if duals is not None or not self._begun:
            start = np.zeros(packing.num_rows) if duals is None else duals.copy()
            status, done = self._from_duals(allowed, start, effort)
        else:
            status, done = solve_dual(program, allowed, basis, effort)
        self._begun = True
        found = basis.duals.copy()
        make_feasible(program, allowed, found)
        bound = float(certified(program, allowed, found))
        primal = np.empty(program.weights.size)
        primal_values(program, basis, primal)
        primal, reduced = primal[: packing.num_columns], all_reduced_costs(program, found)[: packing.num_columns]
        return Relaxation(status, np.inf if bound >= limit else bound, found, reduced, primal, done)

    def mark(self) -> None:
        """Save the basis for `back`; takes as much memory again."""
        if self._marked is None:
            self._marked = new_basis(self.program)
        copy_basis(self.basis, self._marked)

    def back(self) -> None:
        """Return to the marked basis."""
        assert self._marked is not None, "nothing was marked"
        copy_basis(self._marked, self.basis)

    def _from_duals(self, allowed: Allowed, duals: Floats, effort: Effort) -> Any:
        """Solve from multipliers: first with the columns of small reduced cost, then adding columns that violate them.

        Most columns are far from any optimum, and pricing them in every step would be most of the work.
        """
        program, basis = self.program, self.basis
        tolerance = _LACK * float(np.abs(program.weights).max(initial=0.0))
        few = _FEW * duals.size
        done = 0
        while True:
            make_feasible(program, allowed, duals)
            near = allowed
            if allowed.active.size > 2 * few:
                reduced = all_reduced_costs(program, duals)[allowed.active]
                chosen = allowed.active[reduced <= np.partition(reduced, few)[few]]
                mask = np.zeros(allowed.columns.size, dtype=np.bool_)
                mask[chosen] = True
                near = Allowed(chosen, mask, allowed.slack)
            begin_from_duals(program, near, duals, basis)
            status, more = solve_dual(program, near, basis, effort)
            done += more
            if near is allowed or more >= effort.exchanges:
                break
            # the bound of the chosen columns is not yet one of all columns
            if least_reduced(program, allowed, basis.duals) >= -tolerance:
                break
            effort = effort._replace(exchanges=effort.exchanges - more)
            few *= _MORE
            if status != INFEASIBLE:
                duals = basis.duals.copy()
        return status, done
