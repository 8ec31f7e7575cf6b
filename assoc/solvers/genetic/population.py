"""Crossover that keeps tuples, repair, and survival of the fittest without duplicates.

A child first takes the tuples that both parents have. The other tuples of both are then offered in an order
drawn by their reduced costs, and taken where they fit; what mutation gives up and what then lies open is
repaired by insertion with ejection (local_search.py) and exact sub-steps (cluster_search.py). A child
replaces the worst member if it is better and no member costs the same.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assoc._system import memory
from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.components.component import Part, incomplete
from assoc.packing.neighbourhoods.insertion import _improve, penalised
from assoc.packing.neighbourhoods.random_cover import random_cover

if TYPE_CHECKING:
    from assoc.solvers.genetic.parameters import GeneticParameters


# generations without improvement after which a population is renewed
_RENEWAL = 10


class Breeding:
    """The population of one part."""

    def __init__(self, part: Part, parameters: GeneticParameters) -> None:
        self.parameters = parameters
        # the members in a list, and again as an array
        memory.require(
            8.0 * parameters.population * part.packing.num_rows,
            f"population = {parameters.population} on {part.packing.num_rows} measurements",
            "take a smaller population",
        )
        self.weights = penalised(part.packing) if part.packing.is_axial else part.packing.weights
        self.members = np.empty((0, part.packing.num_rows), dtype=np.int32)
        self.fitness = np.empty(0)

    def iterate(self, part: Part, rng: np.random.Generator) -> None:
        """One generation; the first one fills the population."""
        if self.fitness.size == 0:
            self._populate(part, rng)
            return
        for _ in range(self.parameters.offspring):
            one, two = self._parent(rng), self._parent(rng)
            owner = self._child(part, one, two, rng)
            weight = part.polish(owner)
            if weight - part.bound > part.tolerance:
                weight += part.improve(owner, rng, self.parameters.clusters)
            part.offer(owner, weight)
            self._admit(part, owner, weight)
            if part.closed or part.late:
                return
        # a population that has become one family starts anew, around its best and without it by turns
        if part.stalled and part.stalled % _RENEWAL == 0:
            keep = int(np.argmin(self.fitness))
            kept = slice(keep, keep + (part.stalled // _RENEWAL) % 2)
            self.members, self.fitness = self.members[kept], self.fitness[kept]
            self._populate(part, rng)

    def _populate(self, part: Part, rng: np.random.Generator) -> None:
        members = [*self.members]
        fitness = [*self.fitness]
        if part.best is not None and not members and part.iterations == 0:
            members.append(part.best.copy())
            fitness.append(part.weight)
        while len(members) < self.parameters.population:
            # random greedy solutions, strict and loose ones by turns
            strictness = 2.0 ** (len(members) % 10)
            owner = random_cover(part, self.weights, strictness, rng)
            weight = part.polish(owner)
            part.offer(owner, weight)
            members.append(owner)
            fitness.append(weight + (np.inf if incomplete(part, owner) else 0.0))
            if part.closed or part.late:
                break
        self.members, self.fitness = np.array(members, dtype=np.int32), np.array(fitness)

    def _parent(self, rng: np.random.Generator) -> int:
        drawn = rng.integers(0, self.fitness.size, size=self.parameters.tournament)
        return int(drawn[np.argmin(self.fitness[drawn])])

    def _child(self, part: Part, one: int, two: int, rng: np.random.Generator) -> NDArray[np.int32]:
        packing = part.packing
        return _cross(
            packing.cols,
            self.weights,
            packing.slack,
            packing.row_ptr,
            packing.row_cols,
            part.reduced,
            self.members[one],
            self.members[two],
            part.temperature,
            self.parameters.mutation,
            rng,
            part.deadline,
        )

    def _admit(self, part: Part, owner: NDArray[np.int32], weight: float) -> None:
        if incomplete(part, owner):
            return
        worst = int(np.argmax(self.fitness))
        if weight < self.fitness[worst] and not bool((np.abs(self.fitness - weight) <= part.tolerance).any()):
            self.members[worst], self.fitness[worst] = owner, weight


@njit
def _cross(
    cols: Any,
    weights: Floats,
    slack: Any,
    row_ptr: Any,
    row_cols: Any,
    reduced: Floats,
    mother: Any,
    father: Any,
    temperature: float,
    mutation: float,
    rng: Any,
    deadline: float,
) -> Any:
    num_sensors = cols.shape[1]
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
            if k >= 0:
                first = -1
                for s in range(num_sensors):
                    if cols[k, s] >= 0:
                        first = cols[k, s]
                        break
                if first == r:
                    rest[count] = k
                    # exponential races: small reduced costs tend to come first
                    key[count] = reduced[k] / temperature - np.log(-np.log(rng.random() + 1e-300) + 1e-300)
                    count += 1
    order = np.argsort(key[:count])
    for i in order:
        j = rest[i]
        fits = True
        for s in range(num_sensors):
            if cols[j, s] >= 0 and owner[cols[j, s]] >= 0:
                fits = False
                break
        if fits:
            for s in range(num_sensors):
                if cols[j, s] >= 0:
                    owner[cols[j, s]] = j
    for r in range(num_rows):
        j = owner[r]
        if j >= 0 and rng.random() < mutation / num_sensors:
            for s in range(num_sensors):
                if cols[j, s] >= 0:
                    owner[cols[j, s]] = -1
    _improve(cols, weights, row_ptr, row_cols, owner, np.arange(num_rows).astype(np.int32), deadline)
    return owner
