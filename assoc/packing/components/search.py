"""A metaheuristic on all components of a packing, in turns."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.components.closing import close
from assoc.packing.components.component import Component, split_component, split_components
from assoc.packing.components.parameters import SearchParameters
from assoc.packing.components.team import Make, Team
from assoc.packing.components.turns import Turns, complete_greedily
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run

# covers from the linear program with which a search begins
_DIVES = 3
# components of fewer rows are bounded before the search, too: it takes less time than an iteration, and the search
# can stop at a proved optimum
_SMALL = 30


def search_components(
    make: Make,
    packing: Packing,
    run: Run,
    parameters: SearchParameters,
) -> Outcome:
    """Run a metaheuristic, whose searcher of a component ``make`` returns, on every component of the packing.

    InfeasibleError where a component has no complete cover, or none was found.
    """
    # the bound gets only a share of the time: without a solution at the time limit there would be nothing to return
    share = run.part(run.rng, run.time_limit and 0.3 * run.time_limit)
    duals = dual_bound(packing, run=share)
    components = split_components(packing, duals, np.arange(packing.num_columns))
    parts: list[Component] = []
    for component in components:
        component.run, component.refinement = run, parameters.refinement
        component.offer_greedy()
        if not component.closed:
            component.offer_start(run)
        if component.closed:
            parts.append(component)
            continue
        if not share.should_stop():
            component.sharpen(share)
        for number in range(_DIVES):
            # the first one in any case: it gains more than all later ones
            if component.dives and (number == 0 or not share.should_stop()):
                component.settle(component.dive(number, run.rng), run.rng, parameters.clusters)
        # drop columns that no better cover can use before the search begins
        parts.extend(split_component(component) or [component])
    workers = parameters.workers
    pool = ThreadPoolExecutor(workers, "assoc-search") if workers > 1 else None
    with pool or nullcontext():
        # the first covers count as iterations
        searches = _Searches(run=run, iterations=len(parts), make=make, parameters=parameters, pool=pool)
        tasks = [_Task(component, searches) for component in parts]
        searches.record(tasks)
        searches.take(tasks)
    if searches.cut_off:
        # set only now: a run that is stopped neither searches other components nor raises their bounds
        run.stopped_by = run.stopped_by or "iterations"
    return searches.outcome(duals)


@dataclass(slots=True, kw_only=True)
class _Searches(Turns):
    make: Make
    parameters: SearchParameters
    pool: ThreadPoolExecutor | None
    # whether the number of iterations ended a search
    cut_off: bool = False


@dataclass(slots=True)
class _Task:
    """A component that a team searches."""

    component: Component
    all: _Searches
    team: Team | None = None

    def turn(self) -> bool:
        """Do up to ten iterations, until one improves the cover; then raise the bound by a short branch and bound."""
        component, limits, run = self.component, self.all.parameters, self.all.run
        if self.team is None:
            if component.packing.num_rows < _SMALL and component.best is not None:
                close(component, run)
            self.team = Team(self.all.make, component, run, limits.clusters, limits.workers, self.all.pool)
        for _ in range(10):
            before = component.weight
            self.team.iterate()
            component.iterations += 1
            self.all.iterations += 1
            component.stalled = 0 if component.weight < before - component.tolerance else component.stalled + 1
            in_vain, spent = component.stalled >= limits.patience, component.iterations >= limits.iterations
            if component.closed or in_vain or spent or run.should_stop():
                self.all.cut_off |= spent and not (component.closed or in_vain)
                if component.best is None:
                    complete_greedily(component, run)
                close(component, run)
                return True
            if component.stalled == 0:
                # fewer columns may suffice now
                return False
        return False

    def split(self) -> list[_Task]:
        """Tasks for the remaining components."""
        return [_Task(part, self.all) for part in split_component(self.component) or ()]
