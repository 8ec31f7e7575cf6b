"""What `assign` hands to searches besides themselves: proofs, dives, exact sub-steps, and the last resort."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

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

# rows from which tabu search begins with the greedy cover
_FAR = 150
# iterations for which a move rests at the most that gained nothing
_REST = 16


class IncumbentSearch:
    """Improves the incumbent of `exact` by the moves of metaheuristics, as they get stuck in different places.

    A move that gains nothing rests for one iteration, then for two, four and so on, until it gains: time goes to what
    gains, and as rests are counted, not timed, the same seed gives the same answer.
    """

    def __init__(self, component: Component, run: Run) -> None:
        self._component, self._run = component, run
        search = LocalSearch(component, run, clusters=TabuParameters.clusters)
        tabu, breeding = TabuSearch(component, TabuParameters()), Breeding(component, GeneticParameters())
        if component.packing.num_rows >= _FAR:
            # from the rounded multipliers exact sub-steps reach less, and what is better of them is kept in any case
            tabu.owner = search.greedy()
        self._moves = (
            _Move("tabu", partial(tabu.iterate, search)),
            _Move("genetic", partial(breeding.iterate, search)),
        )
        self._sub_steps = _Move("sub-steps", search.refine)
        self._iterations = 0

    def iterate(self) -> None:
        """Do the move that is due first, and exact sub-steps on the incumbent if these are due."""
        now = self._iterations
        if self._do(min(self._moves, key=lambda move: move.due), now):
            self._sub_steps.due = now
        if self._sub_steps.due <= now:
            self._do(self._sub_steps, now)
        self._iterations += 1

    def _do(self, move: _Move, now: int) -> bool:
        """Do a move; returns whether it gained."""
        before = self._component.weight
        move.make()
        self._run.note_gain(move.name, before - self._component.weight)
        gained = self._component.weight < before - self._component.tolerance
        move.rest = 1 if gained else min(2 * move.rest, _REST)
        move.due = now + move.rest
        return gained


@dataclass(slots=True)
class _Move:
    """A move, the iteration in which it is due, and the iterations that it rests."""

    name: str
    make: Callable[[], object]
    due: int = 0
    rest: int = 1


EXACT_METHODS = Methods(
    first_solution=first_solution,
    tree_search=BranchAndBound,
    bound_by_linear_program=bound_by_linear_program,
    diver=Diver,
    clusters=ClusterSearch,
    improver=IncumbentSearch,
)
