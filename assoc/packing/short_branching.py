"""Branch and bound on a component, during and after other searches, for its bound and its covers."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.component import Component, give_covers, split_components
from assoc.packing.cover import Cover
from assoc.packing.packing import Packing
from assoc.packing.run import Run, TreeSearch

# nodes for a component that a metaheuristic leaves open
_NODES = 2000
# nodes times columns between two checks for a stop by the user
_AT_ONCE = 20_000


class Branching:
    """Branch and bound (``search``) on one component, some nodes at a time.

    ``search_kind`` is called as `BranchAndBound` is; ``to_the_end`` as there.
    """

    def __init__(
        self, component: Component, run: Run, search_kind: Callable[..., TreeSearch], *, to_the_end: bool = True
    ) -> None:
        self._component = component
        self.search = search_kind(
            component.packing,
            component.duals,
            component.weight,
            component.tolerance,
            run.deadline,
            run.memory_allows,
            to_the_end=to_the_end,
            floor=component.proven,
        )

    def advance(self, nodes: int, *, gives: bool = True) -> int:
        """Search some nodes from the component's best cover, and raise the component's bound.

        With ``gives`` the component also gets a better cover, if one is found. Returns the number of nodes done.
        """
        component, search, before = self._component, self.search, self.search.nodes
        search.weight = min(search.weight, component.weight)
        search.run(nodes)
        if gives and search.columns is not None and search.weight < component.weight:
            # even a cover better by less than the tolerance: the search has proved this one optimal, not the other
            owner = Cover.of(component.packing, search.columns).owner
            component.best, component.weight = owner, component.weight_of(owner)
        component.proven = max(component.proven, min(search.lower_bound, component.weight))
        return search.nodes - before


def close(component: Component, run: Run) -> None:
    """Raise the bound of an open component by a short branch and bound; its cover stays."""
    kind = run.methods.tree_search
    if kind is None or component.closed or run.should_stop():
        return
    branching = Branching(component, run, kind)
    # few nodes between two checks for a stop where each takes long, since Ctrl-C does not interrupt kernels
    at_once = min(max(_AT_ONCE // component.packing.num_columns, 1), 50)
    while not branching.search.done and branching.search.nodes < _NODES and not run.should_stop():
        branching.advance(at_once, gives=False)


def bound_of_choice(packing: Packing, columns: NDArray[np.integer], run: Run) -> tuple[float, Floats]:
    """Return a valid bound, tight enough to prove a complete choice of columns if that is optimal; its multipliers."""
    duals = dual_bound(packing, run=run)
    components = split_components(packing, duals, np.arange(packing.num_columns))
    give_covers(components, packing, Cover.of(packing, columns).owner)
    for component in components:
        close(component, run)
    return math.fsum(component.lower_bound for component in components), duals
