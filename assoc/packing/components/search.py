"""A metaheuristic on all components of a packing, in turns."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext

import numpy as np
from numpy.typing import NDArray

from assoc.errors import InfeasibleError
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.feasibility import infeasible
from assoc.packing.components.closing import bound_of_component
from assoc.packing.components.component import Component
from assoc.packing.components.parameters import SearchParameters
from assoc.packing.components.splitting import split_component, split_components
from assoc.packing.components.team import Make, Team
from assoc.packing.kernels.sorting import ascending
from assoc.packing.neighbourhoods.cover import Cover
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run

# covers from the linear program with which a search begins
_DIVES = 3
# components of fewer rows are bounded before they are searched, and not only after that: it takes less time than an
# iteration, and a search that has the optimum knows it
_SMALL = 30


def search_components(
    make: Make,
    packing: Packing,
    run: Run,
    parameters: SearchParameters,
) -> Outcome:
    """Run a metaheuristic on every component of the packing.

    Parameters
    ----------
    make : callable
        Makes the searcher of a component.
    packing : Packing
        The whole problem.
    run : Run
        Clock, random generator, trace.
    parameters : SearchParameters

    Raises
    ------
    InfeasibleError
        A component has no complete cover, or none was found.
    """
    # without a solution at the time limit there would be nothing to return: the bound gets a share of the time
    share = Run(run.rng, time_limit=run.time_limit and 0.3 * run.time_limit, started=run.started)
    duals = dual_bound(packing, run=share)
    components = split_components(packing, duals, np.arange(packing.num_columns))
    deadline = run.deadline()
    parts: list[Component] = []
    for component in components:
        component.deadline, component.refinement = deadline, parameters.refinement
        component.offer_greedy()
        if not component.closed:
            component.offer_start(run)
        if component.closed:
            parts.append(component)
            continue
        if not share.should_stop():
            component.sharpen(share)
        for number in range(_DIVES):
            # the first one whatever the share: what it finds is worth more than all that comes after it
            if component.dives and (number == 0 or not share.should_stop()):
                component.settle(component.dive(number, run.rng), run.rng, parameters.clusters)
        # what no better cover can use is gone before the search begins
        parts.extend(split_component(component) or [component])
    components = parts
    columns: list[NDArray[np.int64]] = []
    bounds: list[float] = []
    weights: list[float] = []
    done = len(components)
    cut_off = False
    root_bound = math.fsum(component.bound for component in components)
    _record_all(run, done, weights, root_bound, components)
    queue: list[tuple[Component, Team | None]] = [(component, None) for component in components]
    workers = parameters.workers
    pool = ThreadPoolExecutor(workers, "assoc-search") if workers > 1 else None
    with pool or nullcontext():
        while queue:
            component, team = queue.pop(0)
            # who has a cover takes no turn after time is over, or thousands of components would take one each
            over = component.closed or (component.best is not None and run.should_stop())
            if not over:
                if team is None:
                    if component.packing.num_rows < _SMALL and component.best is not None:
                        component.proven = bound_of_component(component, run)
                    team = Team(make, component, run, parameters.clusters, workers, pool)
                before, iterations_before = component.weight, component.iterations
                over = _take_turn(component, team, run, parameters)
                done += component.iterations - iterations_before
                cut_off |= component.iterations >= parameters.iterations and not (
                    component.closed or component.stalled >= parameters.patience
                )
                if component.best is None and over:
                    complete_greedily(component, run)
                if component.weight < before:
                    waiting = [component, *(other for other, _ in queue)]
                    _record_all(run, done, weights, root_bound, waiting)
                smaller = None if over else split_component(component)
                if smaller is not None:
                    queue.extend((one, None) for one in smaller)
                    continue
            if over:
                columns.append(component.origin[component.best_columns()])
                bounds.append(bound_of_component(component, run))
                weights.append(component.weight)
            else:
                queue.append((component, team))
    chosen = np.concatenate(columns) if columns else np.zeros(0, dtype=np.int64)
    # thousands of parts: a plain sum can lose more than the bounds' margins for rounding
    bound = math.fsum(bounds)
    run.record(done, math.fsum(weights), bound)
    if cut_off:
        # said only now: a run that is stopped neither searches other components nor raises their bounds
        run.stopped_by = run.stopped_by or "iterations"
    return Outcome(chosen, done, bound, duals)


def _take_turn(component: Component, team: Team, run: Run, limits: SearchParameters) -> bool:
    """Give a component up to ten iterations, until one improves its cover; whether its search is over."""
    for _ in range(10):
        before = component.weight
        team.iterate()
        component.iterations += 1
        component.stalled = 0 if component.weight < before - component.tolerance else component.stalled + 1
        ended = component.stalled >= limits.patience or component.iterations >= limits.iterations
        if component.closed or ended or run.should_stop():
            return True
        if component.stalled == 0:
            # fewer columns may do now
            return False
    return False


def _record_all(run: Run, iterations: int, weights: list[float], bound: float, components: list[Component]) -> None:
    known = math.fsum([*weights, *(component.weight for component in components)])
    if known < np.inf:
        run.record(iterations, known, bound)


def complete_greedily(component: Component, run: Run) -> None:
    """Last resort for a component in which no iteration covered all that must be covered."""
    cover = Cover.empty(component.packing)
    cover.add_greedily(ascending(component.reduced))
    if not cover.complete(run):
        raise infeasible(component.packing, run)
    component.offer(cover.owner, cover.weight)
    if component.best is None:
        raise InfeasibleError("no complete solution was found")
