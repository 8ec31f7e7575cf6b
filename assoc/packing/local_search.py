"""The local search that metaheuristics share: how covers of a component are made, improved, and left for others."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.kernels.sorting import ascending
from assoc._types import Floats
from assoc.packing.component import Component, Owner
from assoc.packing.cover import Cover
from assoc.packing.neighbourhoods.dimensionwise import improve_dimensionwise
from assoc.packing.neighbourhoods.insertion import insert_and_eject, search_arrays
from assoc.packing.neighbourhoods.random_cover import Trail, walk
from assoc.packing.run import Run

# cluster searches between two checks of the gap and of the clock
_AT_ONCE = 10
# share of the gap that a round of exact sub-steps must gain for the next
_GAIN = 0.01
# share of the time left in which the first linear program of dives must be solved, or there are no dives
_FOR_PROGRAM = 0.25


class LocalSearch:
    """What improves the covers of one component.

    ``refinement`` "none": nothing; "local": insertion with ejection, and dimensionwise search; "full": also what the
    run has of dives and of cluster search (`Methods`), ``clusters`` exact sub-steps on each cover.
    """

    def __init__(self, component: Component, run: Run, refinement: str = "full", clusters: int = 5) -> None:
        self.component, self.run, self.clusters = component, run, clusters
        self.refinement = refinement
        self.inserts = refinement != "none"
        self.full = refinement == "full"
        self.arrays = search_arrays(component.packing)
        self.rows = np.arange(component.packing.num_rows, dtype=np.int32)
        self._cluster_search: Any = None
        self._diver: Any = None
        self._may_dive: bool | None = None
        self._escapes = 0

    @property
    def deadline(self) -> float:
        """Time limit by the kernels' clock (clock.py), which compiling has moved on."""
        return self.run.deadline()

    @property
    def over(self) -> bool:
        """Whether nothing is left to gain, or time is over."""
        return self.component.closed or self._late

    @property
    def _late(self) -> bool:
        return self.run.remaining() < 0.0

    def greedy(self) -> Owner:
        """Return the greedy cover by reduced cost, improved by insertion."""
        cover = Cover.empty(self.component.packing)
        cover.add_greedily(ascending(self.component.reduced))
        self.insert(cover.owner)
        return cover.owner

    def offer_greedy(self) -> None:
        """Offer the greedy cover."""
        owner = self.greedy()
        self.component.offer(owner, self.component.weight_of(owner))

    def offer_start(self) -> None:
        """Offer the run's start, restricted to this component."""
        if self.run.start is not None:
            component = self.component
            cover = Cover.of(component.packing, np.flatnonzero(np.isin(component.origin, self.run.start)))
            component.offer(cover.owner, cover.weight)

    def random_cover(self, strictness: float) -> Owner:
        """Return a random greedy cover; with larger ``strictness`` the reduced costs decide more."""
        return self.walk(Trail.without_pheromone(self.component.costs, strictness, self.component.temperature), 1)

    def walk(self, trail: Trail, ants: int) -> Owner:
        """Return the best of the covers that some ants build."""
        owner, _ = walk(self.arrays, self.component.costs, trail, ants, self.inserts, self.run.rng, self.deadline)
        return np.asarray(owner)

    def insert(self, owner: Owner) -> None:
        """Improve a cover in place by insertion with ejection, complete or not; refinement "none": leave it."""
        if self.inserts:
            insert_and_eject(self.arrays, owner, self.rows, self.deadline)

    def improve(self, owner: Owner, *, exactly: bool = True) -> float:
        """Improve a new cover in place, by exact sub-steps only if ``exactly``; return its weight."""
        component = self.component
        weight = component.weight_of(owner)
        if not self.inserts or not component.is_complete(owner) or self._has_nothing_to_gain(weight):
            return weight
        improve_dimensionwise(component.packing, owner, self.deadline)
        weight = component.weight_of(owner)
        return self.search_clusters(owner, weight, self.clusters) if exactly else weight

    def search_clusters(self, owner: Owner, weight: float, tries: int) -> float:
        """Improve a complete cover of this weight in place by exact sub-steps, if refined fully; return its weight."""
        kind = self.run.methods.clusters
        if kind is None or not self.full or not tries or self._has_nothing_to_gain(weight):
            return weight
        if self._cluster_search is None:
            self._cluster_search = kind(self.component)
        packing, rng = self.component.packing, self.run.rng
        return float(self._cluster_search.improve(packing, owner, weight, rng, tries, self.deadline))

    def _has_nothing_to_gain(self, weight: float) -> bool:
        return weight - self.component.bound <= self.component.tolerance or self._late

    def settle(self, owner: Owner, *, exactly: bool = True) -> float:
        """Improve a new cover in place and offer it; return its weight."""
        weight = self.improve(owner, exactly=exactly)
        self.component.offer(owner, weight)
        return weight

    def refine(self, rounds: int = 1) -> None:
        """Improve the best cover by exact sub-steps: rounds of ``clusters`` for every 30 rows, while they gain."""
        component = self.component
        for _ in range(rounds):
            left, before = self.clusters * max(1, component.packing.num_rows // 30), component.weight
            while component.best is not None and self.full and left > 0:
                if component.closed or self.run.should_stop():
                    return
                self.search_clusters(component.best, component.weight, min(left, _AT_ONCE))
                # recomputed: rounding errors would add up to a false improvement
                component.weight = component.weight_of(component.best)
                left -= _AT_ONCE
            if before - component.weight <= _GAIN * (component.weight - component.bound):
                return

    @property
    def escapes(self) -> bool:
        """Whether covers can also be had from elsewhere: built in the linear program."""
        if self._may_dive is None:
            kind, packing = self.run.methods.diver, self.component.packing
            pays = kind is not None and self.full and kind.pays(packing)
            self._may_dive = pays and self.run.memory_allows(kind.memory(packing))
        return self._may_dive and not self.over

    def escape(self, number: int, trail: Floats | None = None, beta: float = 1.0) -> Owner:
        """Return a cover from elsewhere: built in the linear program (`Diver.dive`) and completed by insertion.

        The strictness varies with ``number``. ``trail`` is tau_j^alpha of each column. Where the program itself takes
        too much of the time left, the cover is a `random_cover`, and no further ones are had so.
        """
        component, strictness = self.component, beta * 2.0 ** (2 + number % 4)
        if self._diver is None and self._may_dive:
            self._may_dive = self._solves_program()
        if self._diver is None:
            return self.random_cover(strictness)
        if trail is None:
            trail = np.ones(component.packing.num_columns)
        cutoff = component.weight - component.tolerance
        owner: Owner = self._diver.dive(trail, strictness, self.run.rng, cutoff, self.deadline)
        insert_and_eject(self.arrays, owner, self.rows, self.deadline)
        return owner

    def settle_best(self, owner: Owner, tries: int, trail: Floats, beta: float) -> tuple[Owner, float]:
        """Settle a cover, and some from elsewhere; return the best of them with its weight."""
        weight = self.settle(owner)
        for _ in range(tries):
            if not self.escapes:
                break
            other = self.escape(self._escapes, trail, beta)
            self._escapes += 1
            reached = self.settle(other)
            if reached < weight and self.component.is_complete(other):
                owner, weight = other, reached
        return owner, weight

    def _solves_program(self) -> bool:
        """Solve the first linear program of dives; False if that takes too much of the time left."""
        component, run = self.component, self.run
        columns: NDArray[np.int64] = np.zeros(0, dtype=np.int64) if component.best is None else component.best_columns()
        for _ in range(2):
            left = run.remaining()
            diver = run.methods.diver(component, columns, run.deadline(_FOR_PROGRAM))
            if diver.in_time:
                self._diver = diver
                return True
            # once more if kernels were loaded meanwhile, which is not the program's time
            if left - run.remaining() > 0.5 * _FOR_PROGRAM * left:
                break
        return False
