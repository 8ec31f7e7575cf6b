"""Crossover that keeps tuples, repair, and survival of the fittest without duplicates.

A child first takes the tuples that both parents have. The other tuples of both are then offered in an order
drawn by their reduced costs, and taken where they fit. Open rows are repaired by insertion with ejection
(insertion.py) and exact sub-steps (cluster.py), or without refinement filled with columns that fit. A child replaces
the worst member if it is better and no member has the same cost.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc._system.kernels.sorting import ascending, order_of
from assoc._types import Floats
from assoc.packing.component import Component
from assoc.packing.cover import Cover
from assoc.packing.kernels.columns import choose, first_row, fits
from assoc.packing.local_search import LocalSearch
from assoc.packing.packing import PackingArrays

if TYPE_CHECKING:
    from assoc.solvers.genetic.parameters import GeneticParameters


# generations without improvement after which a population is renewed
_RENEWAL = 10
# members of a new population that come from elsewhere (`LocalSearch.escape`)
_ESCAPES = 4


class Breeding:
    """The population of one component."""

    def __init__(self, component: Component, parameters: GeneticParameters) -> None:
        self.parameters = parameters
        self.members = np.empty((0, component.packing.num_rows), dtype=np.int32)
        self.fitness = np.empty(0)
        # the least weight known after the last generation
        self.least_before = np.inf
        self.escapes = 0

    def iterate(self, search: LocalSearch) -> None:
        """One generation; the first one fills the population."""
        component = search.component
        if (
            component.best is not None
            and component.weight < self.least_before - component.tolerance
            and self.fitness.size
        ):
            # a better solution came from refinement or another worker meanwhile
            self._admit(component, component.best.copy(), component.weight)
        self._breed(search)
        self.least_before = component.weight

    def _breed(self, search: LocalSearch) -> None:
        component, rng = search.component, search.run.rng
        if self.fitness.size == 0:
            self._populate(search)
            return
        if search.escapes:
            self.escapes += 1
            owner = search.escape(self.escapes)
            self._admit(component, owner, search.settle(owner))
        for _ in range(self.parameters.offspring):
            mother, father = self._parent(rng), self._parent(rng)
            owner = self._child(search, mother, father)
            self._admit(component, owner, search.settle(owner))
            if search.over:
                return
        # a population of near copies starts anew, alternately around its best member and without it
        if component.stalled and component.stalled % _RENEWAL == 0:
            keep = int(np.argmin(self.fitness))
            kept = slice(keep, keep + (component.stalled // _RENEWAL) % 2)
            self.members, self.fitness = self.members[kept], self.fitness[kept]
            self._populate(search)

    def _populate(self, search: LocalSearch) -> None:
        component = search.component
        members = [*self.members]
        fitness = [*self.fitness]
        if component.best is not None and self.least_before == np.inf:
            # only in the first population: a later one may be meant to do without it
            members.append(component.best.copy())
            fitness.append(component.weight)
        while len(members) < self.parameters.population:
            number, escapes = len(members), search.escapes
            if escapes and number < _ESCAPES:
                owner = search.escape(number)
                weight = search.settle(owner)
            else:
                # random greedy solutions, from strict to loose
                owner = search.random_cover(2.0 ** (number % 10))
                # beside covers from the linear program they provide diversity, not quality
                weight = component.weight_of(owner) if escapes else search.settle(owner, exactly=False)
                component.offer(owner, weight)
            members.append(owner)
            fitness.append(weight if component.is_complete(owner) else np.inf)
            if search.over:
                break
        self.members, self.fitness = np.array(members, dtype=np.int32), np.array(fitness)

    def _parent(self, rng: np.random.Generator) -> int:
        drawn = rng.integers(0, self.fitness.size, size=self.parameters.tournament)
        return int(drawn[np.argmin(self.fitness[drawn])])

    def _child(self, search: LocalSearch, first: int, second: int) -> NDArray[np.int32]:
        component, rng = search.component, search.run.rng
        mother, father = self.members[first], self.members[second]
        owner = _cross(search.arrays, component.reduced, mother, father, component.temperature, rng)
        if search.inserts:
            search.insert(owner)
        else:
            # fill open rows with columns that fit, in an order drawn by reduced cost: else no child could gain a tuple
            order = ascending(component.reduced / component.temperature + rng.gumbel(size=component.reduced.size))
            Cover(component.packing, owner).add_greedily(order)
        return np.asarray(owner)

    def _admit(self, component: Component, owner: NDArray[np.int32], weight: float) -> None:
        if not component.is_complete(owner):
            return
        worst = int(np.argmax(self.fitness))
        if weight < self.fitness[worst] and not bool((np.abs(self.fitness - weight) <= component.tolerance).any()):
            self.members[worst], self.fitness[worst] = owner, weight


@njit
def _cross(
    packing: PackingArrays,
    reduced: Floats,
    mother: NDArray[np.int32],
    father: NDArray[np.int32],
    temperature: float,
    rng: np.random.Generator,
) -> NDArray[np.int32]:
    """Return a child of two covers: the columns they share, then those of the rest that fit."""
    cols, slack = packing.cols, packing.slack
    num_rows = slack.size
    owner = np.full(num_rows, -1, np.int32)
    rest = np.empty(2 * num_rows, np.int32)
    key = np.empty(2 * num_rows)
    count = 0
    for r in range(num_rows):
        if mother[r] >= 0 and mother[r] == father[r]:
            owner[r] = mother[r]
            continue
        for k in (mother[r], father[r]):
            if k >= 0 and first_row(cols, k) == r:
                rest[count] = k
                # exponential races: small reduced costs tend to come first
                key[count] = reduced[k] / temperature - math.log(-math.log(rng.random() + 1e-300) + 1e-300)
                count += 1
    order = order_of(key[:count])
    for i in order:
        j = rest[i]
        if fits(cols, owner, j):
            choose(cols, j, owner)
    return owner
