"""The loop that the metaheuristics share: bound, first covers, iterations on each component in turns, stop.

Several searchers (``workers``) may work on copies of one component, each in its own thread. In every round each does
one iteration and refines its best cover; branch and bound searches some more nodes where that pays; then all adopt the
best cover of the round. They have separate random generators and wait for one another, so that the result depends only
on the seed and their number, not on timing.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.component import Component, split_component, split_components
from assoc.packing.local_search import LocalSearch
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run
from assoc.packing.short_branching import Branching, close
from assoc.packing.turns import Turns, complete_greedily
from assoc.solvers.search_parameters import SearchParameters

# covers from elsewhere with which a search begins
_FIRST = 3
# rows up to which the linear program bounds a component in time: an exchange of its basis takes the square of them
_PROGRAM = 2000
# components of fewer rows are bounded before the search, too: it takes less time than an iteration, and the search
# can stop at a proved optimum
_SMALL = 30
# rows from which branch and bound during the search no longer pays: it seldom ends in time
_LARGE = 150
# nodes of that branch and bound after each iteration
_NODES = 10


class Searcher(Protocol):
    """A metaheuristic at work on one component."""

    def iterate(self, search: LocalSearch) -> None:
        """Do one iteration and ``offer`` the covers found to the component."""


Make = Callable[[LocalSearch], Searcher]


def search_components(make: Make, packing: Packing, run: Run, parameters: SearchParameters) -> Outcome:
    """Run a metaheuristic, whose searcher of a component ``make`` returns, on every component of the packing.

    InfeasibleError where a component has no complete cover, or none was found.
    """
    # the bound gets only a share of the time: without a solution at the time limit there would be nothing to return
    share = run.part(run.rng, run.time_limit and 0.3 * run.time_limit)
    duals = dual_bound(packing, run=share)
    parts: list[LocalSearch] = []
    for component in split_components(packing, duals, np.arange(packing.num_columns)):
        search = LocalSearch(component, run, parameters.refinement, parameters.clusters)
        # drop columns that no better cover can use before the search begins
        smaller = split_component(component) if _first_covers(search, share) else None
        parts += [_alike(search, part) for part in smaller] if smaller else [search]
    workers = parameters.workers
    pool = ThreadPoolExecutor(workers, "assoc-search") if workers > 1 else None
    with pool or nullcontext():
        # the first covers count as iterations
        searches = _Searches(run=run, iterations=len(parts), make=make, parameters=parameters, pool=pool)
        tasks = [_Task(search.component, search, searches) for search in parts]
        searches.record(tasks)
        searches.take(tasks)
    if searches.cut_off:
        # set only now: a run that is stopped neither searches other components nor raises their bounds
        run.stopped_by = run.stopped_by or "iterations"
    return searches.outcome(duals)


def _first_covers(search: LocalSearch, share: Run) -> bool:
    """Bound a component, and find its first covers, within a share of the run; False: the greedy one is optimal."""
    component, bound = search.component, search.run.methods.bound_by_linear_program
    search.offer_greedy()
    if not component.closed:
        search.offer_start()
    if component.closed:
        return False
    if bound is not None and component.packing.num_rows <= _PROGRAM and not share.should_stop():
        bound(component, share)
    for number in range(_FIRST):
        # the first one in any case: it gains more than all later ones
        if search.escapes and (number == 0 or not share.should_stop()):
            search.settle(search.escape(number))
    return True


def _alike(search: LocalSearch, component: Component, run: Run | None = None) -> LocalSearch:
    """The same search of another component, perhaps with another generator."""
    return LocalSearch(component, run or search.run, search.refinement, search.clusters)


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
    search: LocalSearch
    all: _Searches
    team: Team | None = None

    def turn(self) -> bool:
        """Do up to ten iterations, until one improves the cover; then raise the bound by a short branch and bound."""
        component, limits, run = self.component, self.all.parameters, self.all.run
        if self.team is None:
            if component.packing.num_rows < _SMALL and component.best is not None:
                close(component, run)
            self.team = Team(self.all.make, self.search, limits.workers, self.all.pool)
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
        parts = split_component(self.component) or ()
        return [_Task(part, _alike(self.search, part), self.all) for part in parts]


class Team:
    """One searcher, or several (``workers``) on the threads of ``pool``; the component gets their best cover."""

    def __init__(self, make: Make, search: LocalSearch, workers: int, pool: ThreadPoolExecutor | None) -> None:
        self._whole, self._pool = search, pool
        self._branching: Branching | None = None
        if pool is None:
            self._members = [(search, make(search))]
            return
        self._members = []
        component, run = search.component, search.run
        # seeds are drawn: Generator.spawn depends on the number of earlier calls, and ignores a state set later
        seeds = np.random.SeedSequence(run.rng.integers(2**63, size=4).tolist()).spawn(workers)
        for number, rng in enumerate(map(np.random.default_rng, seeds)):
            # copy the cover, too: it is refined in place
            best = None if component.best is None else component.best.copy()
            # a separate run: the same clock, another generator
            member_run = run.part(rng, run.time_limit)
            member_run.reserve = run.reserve
            member = _alike(search, replace(component, best=best, worker=number), member_run)
            self._members.append((member, make(member)))

    def iterate(self) -> None:
        """Do one iteration of every member and refine the result; the component and all members get the best cover."""
        whole = self._whole.component
        for member, _ in self._members:
            member.component.iterations, member.component.stalled = whole.iterations, whole.stalled
        if self._pool is None:
            self._step(0)
        else:
            list(self._pool.map(self._step, range(len(self._members))))
        for member, _ in self._members:
            if member.component.best is not None:
                whole.offer(member.component.best, member.component.weight)
        self._branch()
        for member, _ in self._members:
            if whole.best is not None:
                member.component.offer(whole.best, whole.weight)

    def _branch(self) -> None:
        """Search some nodes by branch and bound, where that pays."""
        component, run = self._whole.component, self._whole.run
        kind = run.methods.tree_search
        pays = self._whole.full and _SMALL <= component.packing.num_rows < _LARGE
        if kind is None or not pays or component.best is None or component.closed or run.should_stop():
            return
        if self._branching is None:
            self._branching = Branching(component, run, kind)
        self._branching.advance(_NODES)

    def _step(self, number: int) -> None:
        search, searcher = self._members[number]
        searcher.iterate(search)
        search.refine()
