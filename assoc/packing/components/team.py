"""Several searchers on copies of one component, each in its own thread; they exchange their best covers.

In every round each member does one iteration and refines its best cover; branch and bound searches some more nodes
where that pays; then all take over the best cover of the round. Members have separate random generators and wait for
one another, so that the result depends only on the seed and the number of members, not on timing.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Protocol

import numpy as np

from assoc.packing.components.closing import Branching
from assoc.packing.components.component import Component
from assoc.packing.run import Run

# rows for which branch and bound during the search pays: fewer are bounded before, with more it seldom ends in time
_LEAST, _MOST = 30, 150
# nodes of that branch and bound after each iteration
_NODES = 10


class Searcher(Protocol):
    """A metaheuristic at work on one component."""

    def iterate(self, component: Component, rng: np.random.Generator) -> None:
        """Do one iteration and ``offer`` the covers found to the component."""


Make = Callable[[Component, np.random.Generator], Searcher]


class Team:
    """One searcher, or several (``workers``) on the threads of ``pool``; the component gets their best cover."""

    def __init__(
        self,
        make: Make,
        component: Component,
        run: Run,
        clusters: int,
        workers: int,
        pool: ThreadPoolExecutor | None,
    ) -> None:
        self._component, self._run, self._clusters, self._pool = component, run, clusters, pool
        self._branching: Branching | None = None
        if pool is None:
            self._members = [(component, make(component, run.rng), run)]
            return
        self._members = []
        # seeds are drawn: Generator.spawn depends on the number of earlier calls, and ignores a state set later
        seeds = np.random.SeedSequence(run.rng.integers(2**63, size=4).tolist()).spawn(workers)
        for number, rng in enumerate(map(np.random.default_rng, seeds)):
            # copy the cover, too: it is refined in place
            best = None if component.best is None else component.best.copy()
            member = replace(component, best=best, worker=number, _cluster_search=None, _diver=None)
            # a separate run: the same clock, another generator
            member_run = run.part(rng, run.time_limit)
            member_run.reserve = run.reserve
            self._members.append((member, make(member, rng), member_run))

    def iterate(self) -> None:
        """Do one iteration of every member and refine the result; the component and all members get the best cover."""
        whole = self._component
        for member, _, _ in self._members:
            member.iterations, member.stalled = whole.iterations, whole.stalled
        if self._pool is None:
            self._step(0)
        else:
            list(self._pool.map(self._step, range(len(self._members))))
        for member, _, _ in self._members:
            if member.best is not None:
                whole.offer(member.best, member.weight)
        self._branch()
        for member, _, _ in self._members:
            if whole.best is not None:
                member.offer(whole.best, whole.weight)

    def _branch(self) -> None:
        """Search some nodes by branch and bound, where that pays."""
        component = self._component
        pays = component.refinement == "full" and _LEAST <= component.packing.num_rows < _MOST
        if not pays or component.best is None or component.closed or self._run.should_stop():
            return
        if self._branching is None:
            self._branching = Branching(component, self._run)
        self._branching.advance(_NODES)

    def _step(self, number: int) -> None:
        component, searcher, run = self._members[number]
        searcher.iterate(component, run.rng)
        component.refine(run, self._clusters)
