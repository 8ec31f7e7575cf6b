"""What `assign` hands to searches besides themselves: proofs, dives, exact sub-steps, and the last resort."""

from __future__ import annotations

from assoc.packing.branching.search import BranchAndBound, first_solution
from assoc.packing.component import Component
from assoc.packing.local_search import LocalSearch
from assoc.packing.neighbourhoods.cluster import ClusterSearch
from assoc.packing.neighbourhoods.diving import Diver
from assoc.packing.run import Methods, Run
from assoc.solvers.exact.search import bound_by_linear_program
from assoc.solvers.genetic.parameters import GeneticParameters
from assoc.solvers.genetic.population import Breeding
from assoc.solvers.tabu.moves import TabuSearch
from assoc.solvers.tabu.parameters import TabuParameters

# rounds of exact sub-steps on the first cover, at most
_ROUNDS = 10


class IncumbentSearch:
    """Improves the incumbent of `exact`: tabu search and breeding in turns, as they get stuck in different places."""

    def __init__(self, component: Component, run: Run) -> None:
        self._search = LocalSearch(component, run, clusters=TabuParameters.clusters)
        self._searchers = TabuSearch(component, TabuParameters()), Breeding(component, GeneticParameters())
        self._iterations = 0

    def iterate(self) -> None:
        """Do one iteration of the next one, and exact sub-steps on the incumbent."""
        if self._iterations:
            self._searchers[0 if self._iterations % 4 else 1].iterate(self._search)
        self._search.refine(1 if self._iterations else _ROUNDS)
        self._iterations += 1


EXACT_METHODS = Methods(
    first_solution=first_solution,
    tree_search=BranchAndBound,
    bound_by_linear_program=bound_by_linear_program,
    diver=Diver,
    clusters=ClusterSearch,
    improver=IncumbentSearch,
)
