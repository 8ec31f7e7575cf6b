"""A component of a packing with the best cover known: how covers are made and improved, and how it is split."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.bounds.dual_ascent import component_bounds, hard_pass, reduced_costs
from assoc.packing.bounds.priced import TOLERANCE, Priced
from assoc.packing.branching.feasibility import infeasible
from assoc.packing.kernels.sorting import ascending
from assoc.packing.neighbourhoods.cluster import ClusterSearch
from assoc.packing.neighbourhoods.cover import Cover, chosen_columns, is_complete, weight_of
from assoc.packing.neighbourhoods.dimensionwise import improve_dimensionwise
from assoc.packing.neighbourhoods.diving import Diver
from assoc.packing.neighbourhoods.insertion import insert_and_eject, search_arrays
from assoc.packing.neighbourhoods.random_cover import Trail, walk
from assoc.packing.packing import Packing, PackingArrays
from assoc.packing.run import Run, memory_allows

Owner = NDArray[np.int32]


# cluster searches between two checks of the gap and of the clock
_AT_ONCE = 10
# share of the time left in which the first linear program of dives must be solved, or there are no dives
_FOR_PROGRAM = 0.25


@dataclass(slots=True)
class Component(Priced):
    """An independent component of the problem with its multipliers and the best cover known."""

    origin: NDArray[np.int64]
    """Indices of the columns in the solver's packing, (N,)."""
    best: Owner | None = None
    """Owner of each row in the best complete cover known, (R,)."""
    weight: float = np.inf
    """Its weight; ``inf`` when none is known."""
    run: Run | None = None
    """The run whose time limit holds."""
    refinement: str = "full"
    """What improves covers (`SearchParameters`)."""
    proven: float = -np.inf
    """A lower bound by branch and bound, above that of the multipliers."""
    worker: int = 0
    """Number of the worker that searches it (team.py)."""
    iterations: int = 0
    """Iterations of a metaheuristic."""
    stalled: int = 0
    """Iterations since the best cover improved."""
    _cluster_search: ClusterSearch | None = None
    _arrays: PackingArrays | None = None
    _diver: Diver | None = None
    _may_dive: bool = True

    @property
    def arrays(self) -> PackingArrays:
        """The packing with search weights (``insertion.search_arrays``)."""
        if self._arrays is None:
            self._arrays = search_arrays(self.packing)
        return self._arrays

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
    def deadline(self) -> float:
        """Time limit by the kernels' clock (clock.py), which compiling has moved on."""
        return np.inf if self.run is None else self.run.deadline()

    @property
    def late(self) -> bool:
        """Whether time is over."""
        return self.run is not None and self.run.remaining() < 0.0

    @property
    def inserts(self) -> bool:
        """Whether new covers are improved by insertion with ejection."""
        return self.refinement != "none"

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
        """Keep a cover if it is complete and better than the best; return whether it was."""
        if weight < self.weight - self.tolerance and self.is_complete(owner):
            # recomputed: moves accumulate rounding errors, and bounds of whole-numbered weights are rounded up to it
            self.best, self.weight = owner.copy(), self.weight_of(owner)
            return True
        return False

    def offer_greedy(self) -> None:
        """Offer the greedy cover by reduced cost, improved by insertion."""
        cover = Cover.empty(self.packing)
        cover.add_greedily(ascending(self.reduced))
        if self.inserts:
            cover.improve(self.deadline)
        self.offer(cover.owner, cover.weight)

    def offer_start(self, run: Run) -> None:
        """Offer the run's start, restricted to this component."""
        if run.start is not None:
            cover = Cover.of(self.packing, np.flatnonzero(np.isin(self.origin, run.start)))
            self.offer(cover.owner, cover.weight)

    def random_cover(self, strictness: float, rng: np.random.Generator) -> Owner:
        """Return a random greedy cover; with larger ``strictness`` the reduced costs decide more."""
        trail = Trail.without_pheromone(self.prices, strictness, self.temperature)
        owner, _ = walk(self.arrays, self.prices, trail, 1, self.inserts, rng, self.deadline)
        return np.asarray(owner)

    @property
    def dives(self) -> bool:
        """Whether covers are also built in the linear program."""
        if self._diver is None and self._may_dive:
            pays = self.refinement == "full" and Diver.pays(self.packing)
            self._may_dive = pays and memory_allows(Diver.memory(self.packing))
        return self._may_dive and not self.closed and not self.late

    def dive(self, number: int, rng: np.random.Generator, trail: Floats | None = None, beta: float = 1.0) -> Owner:
        """Return a cover built in the linear program (`Diver.dive`) and completed by insertion.

        The strictness varies with ``number``. ``trail`` is tau_j^alpha of each column. Where the program itself takes
        too much of the time left, the cover is a `random_cover`, and no further dives are made.
        """
        strictness = beta * 2.0 ** (2 + number % 4)
        if self._diver is None and self._may_dive:
            self._diver = self._new_diver()
            self._may_dive = self._diver is not None
        if self._diver is None:
            return self.random_cover(strictness, rng)
        if trail is None:
            trail = np.ones(self.packing.num_columns)
        owner = self._diver.dive(trail, strictness, rng, self.weight - self.tolerance, self.deadline)
        insert_and_eject(self.arrays, owner, np.arange(owner.size, dtype=np.int32), self.deadline)
        return owner

    def _new_diver(self) -> Diver | None:
        """A diver with its first program solved, or None if that takes too much of the time left."""
        known = np.zeros(0, dtype=np.int64) if self.best is None else self.best_columns()
        if self.run is None:
            return Diver(self, known, np.inf)
        for _ in range(2):
            left = self.run.remaining()
            diver = Diver(self, known, self.run.deadline(_FOR_PROGRAM))
            if diver.in_time:
                return diver
            # once more if kernels were loaded meanwhile, which is not the program's time
            if left - self.run.remaining() > 0.5 * _FOR_PROGRAM * left:
                break
        return None

    def improve(self, owner: Owner, rng: np.random.Generator, clusters: int) -> float:
        """Improve a new cover in place; return its weight."""
        weight = self.weight_of(owner)
        if self.refinement == "none" or not self.is_complete(owner) or self._has_nothing_to_gain(weight):
            return weight
        improve_dimensionwise(self.packing, owner, self.deadline)
        return self.search_clusters(owner, self.weight_of(owner), rng, clusters)

    def search_clusters(self, owner: Owner, weight: float, rng: np.random.Generator, tries: int) -> float:
        """Improve a complete cover of this weight in place by exact sub-steps, if refined fully; return its weight."""
        if self.refinement != "full" or not tries or self._has_nothing_to_gain(weight):
            return weight
        if self._cluster_search is None:
            self._cluster_search = ClusterSearch(self)
        return self._cluster_search.improve(self.packing, owner, weight, rng, tries, self.deadline)

    def _has_nothing_to_gain(self, weight: float) -> bool:
        return weight - self.bound <= self.tolerance or self.late

    def settle(self, owner: Owner, rng: np.random.Generator, clusters: int) -> float:
        """Improve a new cover in place and offer it; return its weight."""
        weight = self.improve(owner, rng, clusters)
        self.offer(owner, weight)
        return weight

    def refine(self, run: Run, clusters: int) -> None:
        """Improve the best cover by exact sub-steps: ``clusters`` for every 30 rows."""
        left = clusters * max(1, self.packing.num_rows // 30)
        while self.best is not None and self.refinement == "full" and left > 0:
            if self.closed or run.should_stop():
                return
            self.search_clusters(self.best, self.weight, run.rng, min(left, _AT_ONCE))
            # recomputed: rounding errors would add up to a false improvement
            self.weight = self.weight_of(self.best)
            left -= _AT_ONCE


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
