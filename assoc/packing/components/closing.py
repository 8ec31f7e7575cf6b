"""Branch and bound beside a metaheuristic and after it: proofs, and the covers that it meets on the way."""

from __future__ import annotations

import math

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

# nodes of the proof of what a metaheuristic leaves open, and of the search beside it, after each of its iterations
_PROOF_NODES = 2000
_NODES = 10
# nodes times columns between two looks at the user
_AT_ONCE = 20_000
# rows for which the search beside it pays: fewer are bounded before, and with more it seldom ends in time
_LEAST, _MOST = 30, 150


class Branching:
    """Branch and bound on one component, some nodes at a time; it takes over the best cover, and gives what it finds.

    Parameters
    ----------
    component : Component
    run : Run
    """

    def __init__(self, component: Component, run: Run) -> None:
        self._component, self._run = component, run
        self._search: BranchAndBound | None = None

    @staticmethod
    def pays(component: Component) -> bool:
        """Whether a component is large enough for a search beside the metaheuristic, and small enough."""
        return component.refinement == "full" and _LEAST <= component.packing.num_rows < _MOST

    def advance(self) -> None:
        """Do some nodes; what is known then is the component's."""
        component = self._component
        if component.best is None or component.closed or self._run.should_stop():
            return
        if self._search is None:
            self._search = _search(component, self._run)
        search = self._search
        search.weight = min(search.weight, component.weight)
        search.run(_NODES)
        if search.columns is not None and search.weight < component.weight:
            # where it is better by less than the tolerance, too: a search that ended so has proved this cover alone
            owner = Cover.of(component.packing, search.columns).owner
            component.best, component.weight = owner, component.weight_of(owner)
        component.proven = max(component.proven, min(search.lower_bound, component.weight))


def close(component: Component, run: Run) -> None:
    """Raise what is proved of an open component by a short branch and bound; its cover stays."""
    if component.closed or run.should_stop():
        return
    search = _search(component, run)
    # kernels do not hear Ctrl-C: few nodes at a time where each takes long
    at_once = min(max(_AT_ONCE // component.packing.num_columns, 1), 50)
    while not search.done and search.nodes < _PROOF_NODES and not run.should_stop():
        search.run(at_once)
    component.proven = max(component.proven, search.lower_bound)


def _search(component: Component, run: Run) -> BranchAndBound:
    return BranchAndBound(
        component.packing,
        component.duals,
        component.weight,
        component.tolerance,
        run.deadline(),
        run.memory_allows,
        to_the_end=True,
    )


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
    for component in components:
        close(component, run)
    return math.fsum(component.lower_bound for component in components), duals
