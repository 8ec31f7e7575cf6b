"""The genetic algorithm against a plain one, generation by generation, same random numbers."""

import numpy as np
import pytest

from assoc.solvers.genetic.parameters import GeneticParameters
from assoc.solvers.genetic.population import Breeding
from tests.solvers.pieces import (
    Incumbent,
    columns_of,
    component,
    cover_of,
    is_complete,
    iterate,
    open_problem,
    problems,
    random_covers,
    rows_of,
    search_of,
    temperature,
    with_greedy_cover,
)

PROBLEMS = problems()
RENEWAL = 10


def reference_child(one, mother, father, scale, rng):
    """What both have, then the rest in an order drawn by reduced cost where it fits."""
    packing = one.packing
    taken, child = set(), []
    for j in sorted(set(mother) & set(father)):
        child.append(j)
        taken |= set(rows_of(packing, j))
    owners = cover_of(packing, mother), cover_of(packing, father)
    rest = []
    for r in range(packing.num_rows):
        if owners[0][r] == owners[1][r]:
            continue
        for j in (owner[r] for owner in owners):
            # each column is met in its first row
            if j >= 0 and rows_of(packing, j)[0] == r:
                gumbel = -np.log(-np.log(rng.random()))
                rest.append((one.reduced[j] / scale + gumbel, int(j)))
    for _, j in sorted(rest):
        if not taken & set(rows_of(packing, j)):
            child.append(j)
            taken |= set(rows_of(packing, j))
    return sorted(child)


def reference_filling(one, child, scale, rng):
    """Columns that fit, in an order drawn by reduced cost, where they save something or cover what must be covered."""
    packing = one.packing
    taken = {r for j in child for r in rows_of(packing, j)}
    keys = one.reduced / scale - np.log(-np.log(1.0 - rng.random(packing.num_columns)))
    for j in np.argsort(keys, kind="stable").tolist():
        rows = set(rows_of(packing, j))
        if not taken & rows and (packing.weights[j] < 0 or not packing.slack[[*rows]].all()):
            child = [*child, j]
            taken |= rows
    return sorted(child)


class Reference(Incumbent):
    """A population of column lists, bred without any local search."""

    def __init__(self, one, parameters, rng):
        super().__init__(one, parameters, rng)
        self.members, self.fitness = [], []

    def populate(self):
        """Fill up with random greedy covers, strict and loose ones by turns."""
        while len(self.members) < self.p.population:
            columns, cost = self.random_cover(2.0 ** (len(self.members) % 10))
            self.members.append(columns)
            self.fitness.append(cost if is_complete(self.one.packing, columns) else np.inf)

    def parent(self):
        """Best of some members drawn with replacement."""
        drawn = self.rng.integers(0, len(self.members), size=self.p.tournament)
        return self.members[min(drawn, key=lambda i: self.fitness[i])]

    def generation(self):
        """Children replace the worst where they are better and new; a population without progress is renewed."""
        before = self.least
        if not self.members:
            self.populate()
        else:
            for _ in range(self.p.offspring):
                mother, father = self.parent(), self.parent()
                scale = temperature(self.one, self.least)
                child = reference_child(self.one, mother, father, scale, self.rng)
                child = reference_filling(self.one, child, scale, self.rng)
                cost = self.offer(child)
                worst = int(np.argmax(self.fitness))
                new = all(abs(cost - other) > self.one.tolerance for other in self.fitness)
                if is_complete(self.one.packing, child) and new and cost < self.fitness[worst]:
                    self.members[worst], self.fitness[worst] = child, cost
            if self.stalled and self.stalled % RENEWAL == 0:
                best = int(np.argmin(self.fitness))
                keep = [best] if (self.stalled // RENEWAL) % 2 else []
                self.members = [self.members[i] for i in keep]
                self.fitness = [self.fitness[i] for i in keep]
                self.populate()
        self.ends_iteration(before)


@pytest.mark.parametrize("name", PROBLEMS)
def test_generation_by_generation(name):
    one = component(PROBLEMS[name])
    parameters = GeneticParameters(population=8, offspring=5, tournament=3, refinement="none")
    breeding, search = Breeding(one, parameters), search_of(one, 11)
    expected = Reference(one, parameters, np.random.default_rng(11))
    renewals = 0
    for _ in range(35):
        renewals += expected.stalled > 0 and expected.stalled % RENEWAL == 0
        expected.generation()
        best = iterate(one, breeding, search)
        assert [columns_of(member) for member in breeding.members] == expected.members
        np.testing.assert_allclose(breeding.fitness, expected.fitness, rtol=1e-12)
        assert (best, one.stalled) == (expected.best, expected.stalled)
    assert renewals >= 2, "renewals with the best and without it were not seen"


def test_breeding_starts_from_the_best_known():
    one = with_greedy_cover(component(PROBLEMS["mixed"]))
    known = one.best.copy()
    breeding = Breeding(one, GeneticParameters(refinement="none"))
    breeding.iterate(search_of(one))
    np.testing.assert_array_equal(breeding.members[0], known)
    assert breeding.members.shape == (20, one.packing.num_rows)


def test_a_population_learns_what_others_found():
    """A better cover from elsewhere becomes a member."""
    one = component(open_problem())
    breeding = Breeding(one, GeneticParameters(population=4, offspring=1, refinement="none"))
    breeding.iterate(search_of(one))
    found = min(random_covers(one, 4.0, 200), key=one.weight_of)
    assert one.offer(found, one.weight_of(found))
    breeding.iterate(search_of(one, 1))
    assert found.tolist() in breeding.members.tolist()
