"""A packing priced by multipliers: reduced costs and a valid bound."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from assoc._types import Floats
from assoc.packing.bounds.dual_ascent import certified_bound, reduced_costs
from assoc.packing.packing import Packing

TOLERANCE = 1e-9
"""Share of the bound up to which a gap counts as closed."""


class ReducedCosts(NamedTuple):
    """A priced packing as kernels take it: reduced costs of the columns (N,), multipliers of the rows (R,)."""

    reduced: Floats
    duals: Floats


@dataclass(slots=True)
class Priced:
    """A packing, one component or several, and feasible multipliers of its rows."""

    packing: Packing
    duals: Floats
    """Feasible multipliers, (R,)."""
    reduced: Floats
    """Their reduced costs, (N,)."""
    bound: float
    """Lower bound on the packing's solutions."""

    @classmethod
    def of(cls, packing: Packing, duals: Floats) -> Priced:
        """Price a packing by multipliers."""
        return Priced(packing, duals, reduced_costs(packing, duals), certified_bound(packing, duals))

    @property
    def costs(self) -> ReducedCosts:
        """Reduced costs and multipliers as kernels take them."""
        return ReducedCosts(self.reduced, self.duals)

    @property
    def tolerance(self) -> float:
        """Gains below this do not count: they are rounding, or impossible with whole-numbered weights."""
        return max(TOLERANCE * max(1.0, abs(self.bound)), 0.999 * self.packing.granularity)

    def adopt_if_better(self, duals: Floats) -> None:
        """Adopt feasible multipliers if their bound is better."""
        bound = certified_bound(self.packing, duals)
        if bound > self.bound:
            self.bound, self.duals, self.reduced = bound, duals, reduced_costs(self.packing, duals)
