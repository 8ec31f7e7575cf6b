"""Split a packing into components, and a component again after columns were dropped."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.bounds.dual_ascent import component_bounds, hard_pass, reduced_costs
from assoc.packing.branching.feasibility import infeasible
from assoc.packing.components.component import Component
from assoc.packing.neighbourhoods.cover import chosen_columns
from assoc.packing.packing import Packing


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
        component.run, component.refinement = whole.run, whole.refinement
        component.proven = whole.proven - (whole.weight - component.weight) - rounding
    return components


def give_covers(components: list[Component], packing: Packing, owner: NDArray[np.int32]) -> None:
    """Give each component of a packing its part of a complete cover (owner of each row of the packing)."""
    for c, component in enumerate(components):
        part = owner[packing.row_start[c] : packing.row_start[c + 1]]
        component.best = np.where(part >= 0, part - packing.col_start[c], -1).astype(np.int32)
        component.weight = component.weight_of(component.best)
