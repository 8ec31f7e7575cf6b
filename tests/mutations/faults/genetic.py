"""The genetic algorithm."""

from __future__ import annotations

from tests.mutations.faults.fault import Fault

_BREEDING = "assoc/solvers/genetic/population.py"

_OF_GENETIC = "tests/solvers/test_genetic.py"

FAULTS = (
    Fault(
        "no crossover",
        _BREEDING,
        "        for k in (mother[r], father[r]):",
        "        for k in (mother[r],):",
        _OF_GENETIC,
    ),
    Fault(
        "what both parents have is lost",
        _BREEDING,
        "            owner[r] = mother[r]\n            continue\n",
        "            continue\n",
        _OF_GENETIC,
    ),
    Fault(
        "what lies open is not filled without refinement",
        _BREEDING,
        "            Cover(component.packing, owner).add_greedily(order)\n",
        "",
        _OF_GENETIC,
    ),
    Fault(
        "selection is inverted",
        _BREEDING,
        "drawn[np.argmin(self.fitness[drawn])]",
        "drawn[np.argmax(self.fitness[drawn])]",
        _OF_GENETIC,
    ),
    Fault("no selection", _BREEDING, "drawn[np.argmin(self.fitness[drawn])]", "drawn[0]", _OF_GENETIC),
    Fault(
        "a child replaces the best",
        _BREEDING,
        "worst = int(np.argmax(self.fitness))",
        "worst = int(np.argmin(self.fitness))",
        _OF_GENETIC,
    ),
    Fault(
        "members may be alike",
        _BREEDING,
        "not bool((np.abs(self.fitness - weight) <= component.tolerance).any())",
        "True",
        _OF_GENETIC,
    ),
    Fault(
        "reduced costs do not order the crossover",
        _BREEDING,
        "reduced[k] / temperature - math.log",
        "-math.log",
        _OF_GENETIC,
    ),
    Fault(
        "a population is never renewed",
        _BREEDING,
        "if component.stalled and component.stalled % _RENEWAL == 0:",
        "if False:",
        _OF_GENETIC,
    ),
    Fault(
        "the best known is no member",
        _BREEDING,
        "if component.best is not None and self.known == np.inf:",
        "if False:",
        _OF_GENETIC,
    ),
)
