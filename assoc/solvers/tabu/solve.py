"""Tabu search: always the best insertion that is not tabu, even when it makes the solution worse."""

from __future__ import annotations

from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run
from assoc.solvers.improve import search_components
from assoc.solvers.tabu.moves import TabuSearch
from assoc.solvers.tabu.parameters import TabuParameters


def solve(packing: Packing, parameters: TabuParameters, run: Run) -> Outcome:
    """Search by moves; one iteration is ``moves`` moves on one component.

    References
    ----------
    I. Turkmen and K. Guney, Tabu search tracker with adaptive neuro-fuzzy inference system for multiple
    target tracking, Progress in Electromagnetics Research 65 (2006), for the approach; the moves are this
    package's own.
    """
    return search_components(lambda search: TabuSearch(search.component, parameters), packing, run, parameters)
