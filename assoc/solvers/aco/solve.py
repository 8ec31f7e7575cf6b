"""Ant colony optimisation: ants build solutions from pheromone and visibility."""

from __future__ import annotations

from assoc.packing.component import Component
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run
from assoc.solvers.aco.colony import Colony, cycle_of
from assoc.solvers.aco.paper import solve_as_in_the_paper
from assoc.solvers.aco.parameters import AcoParameters
from assoc.solvers.improve import search_components


def solve(packing: Packing, parameters: AcoParameters, run: Run) -> Outcome:
    """Search with ants; one iteration is one cycle of all ants on one component.

    References
    ----------
    Mode paper: the ant colony paper, eqs. 7-11. Mode mmas: T. Stuetzle and H. H. Hoos, MAX-MIN ant system,
    Future Generation Computer Systems 16 (2000); pheromone in the hyper-cube form of C. Blum and M. Dorigo,
    IEEE Transactions on Systems, Man, and Cybernetics B 34 (2004).
    """
    if parameters.mode == "paper":
        return solve_as_in_the_paper(packing, parameters, run)

    def report(component: Component, colony: Colony) -> None:
        if run.watch is not None and component.worker == 0:
            run.watch(cycle_of(packing, component, colony))

    return search_components(lambda search: Colony(search.component, parameters, report), packing, run, parameters)
