"""Bounds of what a metaheuristic leaves open."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.components.component import Component
from assoc.packing.components.splitting import give_covers, split_components
from assoc.packing.neighbourhoods.cover import Cover
from assoc.packing.packing import Packing
from assoc.packing.run import Run

_PROOF_NODES = 2000


def bound_of_component(component: Component, run: Run) -> float:
    """Raise the bound of an open component by a short branch and bound."""
    if component.closed:
        # whole-numbered weights: nothing fits between the bound and the cover
        known = max(component.bound, component.proven)
        return component.weight if component.packing.granularity else min(known, component.weight)
    if run.should_stop():
        return max(component.bound, component.proven)
    search = BranchAndBound(
        component.packing,
        component.duals,
        component.weight,
        component.tolerance,
        run.deadline(),
        run.memory_allows,
        to_the_end=True,
    )
    while not search.done and search.nodes < _PROOF_NODES and not run.should_stop():
        search.run(50)
    return min(max(component.bound, component.proven, search.lower_bound), component.weight)


def bound_of_choice(packing: Packing, columns: NDArray[np.integer], run: Run) -> tuple[float, Floats]:
    """Return a valid bound, made tight enough to prove this choice of columns where it is optimal.

    Parameters
    ----------
    packing : Packing
        The problem.
    columns : int array
        A complete choice of columns.
    run : Run
        Clock.

    Returns
    -------
    float, float array
        The bound and the multipliers that give its dual part.
    """
    duals = dual_bound(packing, run=run)
    components = split_components(packing, duals, np.arange(packing.num_columns))
    give_covers(components, packing, Cover.of(packing, columns).owner)
    return sum((bound_of_component(component, run) for component in components), 0.0), duals
