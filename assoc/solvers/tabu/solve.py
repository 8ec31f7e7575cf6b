"""Tabu search: always the best insertion that is not forbidden, even when it makes things worse."""

from __future__ import annotations

from typing import TYPE_CHECKING

from assoc.packing.run import Outcome, Run
from assoc.solvers.tabu.parameters import TabuParameters

if TYPE_CHECKING:
    from assoc.packing.packing import Packing


def solve(packing: Packing, parameters: TabuParameters, run: Run) -> Outcome:
    """Search by moves; one iteration is ``moves`` moves on one component.

    References
    ----------
    I. Turkmen and K. Guney, Tabu search tracker with adaptive neuro-fuzzy inference system for multiple
    target tracking, Progress in Electromagnetics Research 65 (2006), for the approach; the moves are this
    package's own.
    """
    from assoc.packing.components.search import search_components
    from assoc.solvers.tabu.moves import TabuSearch

    return search_components(
        lambda component, rng: TabuSearch(component, parameters),
        packing,
        run,
        parameters.iterations,
        parameters.patience,
        parameters.clusters,
    )


parameters = TabuParameters
