"""A component of a packing with the best cover known, and how it is split."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.bounds.dual_ascent import component_bounds, hard_pass, reduced_costs
from assoc.packing.bounds.priced import TOLERANCE, Priced
from assoc.packing.cover import best_of_both, chosen_columns, is_complete, weight_of
from assoc.packing.packing import Packing
from assoc.packing.run import infeasible

Owner = NDArray[np.int32]

# rows from which a cover that is worse as a whole may be better in places
_LARGE = 150


@dataclass(slots=True)
class Component(Priced):
    """An independent component of the problem with its multipliers and the best cover known."""

    origin: NDArray[np.int64]
    """Indices of the columns in the solver's packing, (N,)."""
    best: Owner | None = None
    """Owner of each row in the best complete cover known, (R,)."""
    weight: float = np.inf
    """Its weight; ``inf`` when none is known."""
    proven: float = -np.inf
    """A lower bound by branch and bound, above that of the multipliers."""
    worker: int = 0
    """Number of the worker that searches it (solvers/improve.py)."""
    iterations: int = 0
    """Iterations of a metaheuristic."""
    stalled: int = 0
    """Iterations since the best cover improved."""

    @property
    def closed(self) -> bool:
        """Whether the best cover is optimal."""
        return self.weight - max(self.bound, self.proven) <= self.tolerance

    @property
    def lower_bound(self) -> float:
        """Lower bound on all covers, by the multipliers or by branch and bound."""
        if self.closed and self.packing.granularity:
            # no weight is possible between the bound and the cover
            return self.weight
        return min(max(self.bound, self.proven), self.weight)

    @property
    def temperature(self) -> float:
        """Scale of the relevant reduced costs: a share of the gap, but at most of the weights' spread."""
        weights = self.packing.weights
        # equal weights have no spread, so take their size
        spread = float(np.ptp(weights)) or abs(float(weights[0]))
        widest = max(0.02 * spread, 1e-12)
        if self.weight < np.inf:
            return min(max((self.weight - self.bound) / 4.0, TOLERANCE * max(1.0, abs(self.bound))), widest)
        return widest

    def best_columns(self) -> NDArray[np.int64]:
        """Columns of the best cover, ascending; there must be one."""
        assert self.best is not None
        return np.asarray(chosen_columns(self.packing.arrays.cols, self.best), dtype=np.int64)

    def is_complete(self, owner: Owner) -> bool:
        """Whether a cover covers all rows that must be covered."""
        return is_complete(self.packing, owner)

    def weight_of(self, owner: Owner) -> float:
        """Weight of a cover."""
        return weight_of(self.packing, owner)

    def offer(self, owner: Owner, weight: float) -> bool:
        """Keep a complete cover if it is better than the best, or what is better of it (large ones); return whether."""
        if self.best is not None and self.packing.num_rows >= _LARGE and self.is_complete(owner):
            packing, rows = self.packing, self.packing.num_rows
            both, owner = owner, self.best.copy()
            parent, gain = np.empty(rows, dtype=np.int32), np.empty(rows)
            weight = best_of_both(packing.arrays.cols, packing.arrays.weights, 0, rows, owner, both, parent, gain)
        if weight < self.weight - self.tolerance and self.is_complete(owner):
            # recomputed: moves accumulate rounding errors, and bounds of whole-numbered weights are rounded up to it
            self.best, self.weight = owner.copy(), self.weight_of(owner)
            return True
        return False


def split_components(packing: Packing, duals: Floats, origin: NDArray[np.int64]) -> list[Component]:
    """Return the components of a packing, without covers.

    InfeasibleError where a row that must be covered has no column.
    """
    bounds = component_bounds(packing, duals)
    if np.isposinf(bounds).any():
        raise infeasible(packing)
    reduced = reduced_costs(packing, duals)
    components: list[Component] = []
    for c in range(packing.num_components):
        alone = packing.component(c) if packing.num_components > 1 else packing
        top, end = packing.row_start[c], packing.row_start[c + 1]
        first, last = packing.col_start[c], packing.col_start[c + 1]
        components.append(Component(alone, duals[top:end], reduced[first:last], float(bounds[c]), origin[first:last]))
    return components


def split_component(
    whole: Component, share: float = 2 / 3, useful: NDArray[np.bool_] | None = None
) -> list[Component] | None:
    """Drop the columns that no better solution can use; None if more than ``share`` of them are left.

    No better solution uses a column that is not ``useful``, or whose reduced cost is above the gap.

    The rest may split into components, each with its part of the best cover and of the bound. A cover of one
    component and the best covers of the others together cover the whole, and weigh no less than the whole's bound.
    """
    if whole.best is None:
        return None
    step = whole.tolerance if whole.packing.granularity else 0.0
    keep = whole.reduced <= whole.weight - whole.bound - step
    if useful is not None:
        keep &= useful
    keep[chosen_columns(whole.packing.arrays.cols, whole.best)] = True
    if np.count_nonzero(keep) > share * keep.size:
        return None
    smaller = whole.packing.restrict(keep)
    duals = whole.duals[smaller.row_origin]
    duals = np.ascontiguousarray(np.where(smaller.slack, np.minimum(duals, 0.0), duals))
    hard_pass(smaller, duals)
    index = np.full(whole.packing.num_columns, -1, dtype=np.int32)
    index[smaller.origin] = np.arange(smaller.num_columns, dtype=np.int32)
    owner = whole.best[smaller.row_origin]
    owner = np.where(owner >= 0, index[owner], -1).astype(np.int32)
    components = split_components(smaller, duals, whole.origin[smaller.origin])
    give_covers(components, smaller, owner)
    rounding = 1e-12 * (sum(abs(component.weight) for component in components) + abs(whole.weight))
    for component in components:
        component.iterations, component.stalled = whole.iterations, whole.stalled
        component.proven = whole.proven - (whole.weight - component.weight) - rounding
    return components


def give_covers(components: list[Component], packing: Packing, owner: NDArray[np.int32]) -> None:
    """Give each component of a packing its part of a complete cover (owner of each row of the packing)."""
    for c, component in enumerate(components):
        part = owner[packing.row_start[c] : packing.row_start[c + 1]]
        component.best = np.where(part >= 0, part - packing.col_start[c], -1).astype(np.int32)
        component.weight = component.weight_of(component.best)
