"""A packing with multipliers that price it: reduced costs and a bound that holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from assoc._types import Floats
from assoc.packing.bounds.dual_ascent import certified_bound, hard_pass, reduced_costs
from assoc.packing.packing import Packing
from assoc.packing.run import Run
from assoc.packing.simplex.linear_program import LinearProgram

TOLERANCE = 1e-9
"""Share of the bound up to which a gap counts as closed."""


class Prices(NamedTuple):
    """What kernels take of a priced packing: reduced costs of the columns (N,), multipliers of the rows (R,)."""

    reduced: Floats
    duals: Floats


@dataclass(slots=True)
class Priced:
    """A packing and feasible multipliers of its rows.

    Attributes
    ----------
    packing : Packing
        One component or several.
    duals, reduced : float arrays, shapes (R,) and (N,)
        Feasible multipliers and the reduced costs that they give.
    bound : float
        No solution of the packing weighs less.
    """

    packing: Packing
    duals: Floats
    reduced: Floats
    bound: float

    @classmethod
    def of(cls, packing: Packing, duals: Floats) -> Priced:
        """Price a packing by multipliers."""
        return Priced(packing, duals, reduced_costs(packing, duals), certified_bound(packing, duals))

    @property
    def prices(self) -> Prices:
        """The prices as kernels take them."""
        return Prices(self.reduced, self.duals)

    @property
    def tolerance(self) -> float:
        """Gains below this do not exist or do not count: rounding, or whole-numbered weights."""
        return max(TOLERANCE * max(1.0, abs(self.bound)), 0.999 * self.packing.granularity)

    def take_over(self, duals: Floats) -> None:
        """Take over feasible multipliers if their bound is better."""
        bound = certified_bound(self.packing, duals)
        if bound > self.bound:
            self.bound, self.duals, self.reduced = bound, duals, reduced_costs(self.packing, duals)

    def sharpen(self, run: Run) -> None:
        """Take the multipliers of the linear program itself, where there is memory for it."""
        packing = self.packing
        if not run.memory_allows(LinearProgram.memory(packing)):
            return
        duals = LinearProgram(packing).solve(duals=self.duals, deadline=run.deadline()).duals
        hard_pass(packing, duals)
        self.take_over(duals)
