"""Genetic algorithm: solutions are bred, and children keep the tuples that their parents share."""

from __future__ import annotations

from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run
from assoc.solvers.genetic.parameters import GeneticParameters
from assoc.solvers.genetic.population import Breeding
from assoc.solvers.improve import search_components


def solve(packing: Packing, parameters: GeneticParameters, run: Run) -> Outcome:
    """Breed solutions; one iteration is one generation of one component.

    References
    ----------
    G. Chen and L. Hong, A genetic algorithm based multi-dimensional data association algorithm for
    multi-sensor multi-target tracking, Mathematical and Computer Modelling 26 (1997), for the approach;
    crossover and local search are this package's own.
    """
    return search_components(lambda search: Breeding(search.component, parameters), packing, run, parameters)
