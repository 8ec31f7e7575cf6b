"""The faults: what text becomes what in which file, and the test file that must fail then.

Each old text occurs exactly once in its file (test_faults_fit.py); where the code changes, the fault changes
with it.
"""

from __future__ import annotations

from typing import NamedTuple


class Fault(NamedTuple):
    """One fault.

    Attributes
    ----------
    what : str
        What is wrong then.
    file : str
        The file, from the folder of the project.
    old, new : str
        The text, and what replaces it.
    test : str
        The test file that must fail.
    """

    what: str
    file: str
    old: str
    new: str
    test: str


_PAPER = "assoc/solvers/aco/paper.py"
_COLONY = "assoc/solvers/aco/max_min.py"
_WALK = "assoc/packing/neighbourhoods/random_cover.py"
_CYCLE = "assoc/solvers/aco/cycle.py"
_BREEDING = "assoc/solvers/genetic/population.py"
_TABU = "assoc/solvers/tabu/moves.py"
_SEARCH = "assoc/packing/components/search.py"
_TEAM = "assoc/packing/components/team.py"
_DIVER = "assoc/packing/neighbourhoods/diving.py"
_COMPONENT = "assoc/packing/components/component.py"

_OF_PAPER = "tests/solvers/test_aco_paper.py"
_OF_COLONY = "tests/solvers/test_aco_max_min.py"
_OF_GENETIC = "tests/solvers/test_genetic.py"
_OF_TABU = "tests/solvers/test_tabu.py"
_LARGE = "assoc/packing/neighbourhoods/large.py"
_SIMPLEX = "assoc/packing/simplex/dual.py"

_OF_LARGE = "tests/packing/test_large.py"
_OF_DIVES = "tests/packing/test_diving.py"
_OF_SEARCH = "tests/packing/test_search_components.py"

FAULTS = (
    # mode paper
    Fault(
        "the first cycle is not greedy",
        _PAPER,
        "owners = _cycle(nodes, value, cycle == 0,",
        "owners = _cycle(nodes, value, False,",
        _OF_PAPER,
    ),
    Fault("rho and 1 - rho are swapped", _PAPER, "pheromone[j] *= rho", "pheromone[j] *= 1.0 - rho", _OF_PAPER),
    Fault(
        "alpha is ignored",
        _PAPER,
        "probability = pheromone**parameters.alpha *",
        "probability = pheromone *",
        _OF_PAPER,
    ),
    Fault(
        "beta is ignored",
        _PAPER,
        "visibility**parameters.beta  # numerator",
        "visibility  # numerator",
        _OF_PAPER,
    ),
    Fault(
        "the visibility is constant", _PAPER, "1.0 / positive  # eq. 7", "np.ones_like(positive)  # eq. 7", _OF_PAPER
    ),
    Fault(
        "an ant lays L and not 1 / L",
        _PAPER,
        "pheromone[tours[ant, i]] += 1.0 / total",
        "pheromone[tours[ant, i]] += total",
        _OF_PAPER,
    ),
    Fault(
        "only the first ant lays pheromone",
        _PAPER,
        "for ant in range(tours.shape[0]):",
        "for ant in range(1):",
        _OF_PAPER,
    ),
    Fault(
        "pheromone starts at 1",
        _PAPER,
        "pheromone = visibility.copy()",
        "pheromone = np.ones_like(visibility)",
        _OF_PAPER,
    ),
    Fault(
        "ants start on the same node",
        _PAPER,
        "[np.arange(parameters.ants) % costs.size]",
        "[np.zeros(parameters.ants, dtype=int)]",
        _OF_PAPER,
    ),
    Fault(
        "later cycles start anywhere",
        _PAPER,
        "starts = tours[np.arange(parameters.ants), run.rng.integers(0, lengths)].astype(np.int64)",
        "starts = run.rng.integers(0, costs.size, parameters.ants)",
        _OF_PAPER,
    ),
    Fault(
        "it never ends by agreement",
        _PAPER,
        "if (owners == owners[0]).all() or run.should_stop():",
        "if run.should_stop():",
        _OF_PAPER,
    ),
    Fault(
        "two ants that agree are enough",
        _PAPER,
        "(owners == owners[0]).all()",
        "(owners[1:2] == owners[0]).all()",
        _OF_PAPER,
    ),
    Fault(
        "the tabu list is empty",
        _PAPER,
        "                        fits = False\n",
        "                        fits = j != node\n",
        _OF_PAPER,
    ),
    Fault("the last best tour wins, not the cheapest", _PAPER, "if walked[k] < best_weight:", "if True:", _OF_PAPER),
    # mode mmas
    Fault(
        "the default mode has no ants",
        _COLONY,
        "        weight = component.settle(owner, rng, p.clusters)\n",
        "        owner = owner if component.best is None else component.best.copy()\n"
        "        weight = component.settle(owner, rng, p.clusters)\n",
        _OF_COLONY,
    ),
    Fault(
        "the default mode lays no pheromone",
        _COLONY,
        "        self._deposit(packing.cols, elite, 1.0 - p.rho)\n",
        "",
        _OF_COLONY,
    ),
    Fault(
        "rho and 1 - rho are swapped in mode mmas",
        _COLONY,
        "self._deposit(packing.cols, elite, 1.0 - p.rho)",
        "self._deposit(packing.cols, elite, p.rho)",
        _OF_COLONY,
    ),
    Fault("one ant in place of all", _COLONY, "trail, p.ants, inserts", "trail, 1, inserts", _OF_COLONY),
    Fault("the limit below is missing", _COLONY, "        pheromone[j] = max(pheromone[j], lowest)\n", "", _OF_COLONY),
    Fault("the best since the renewal never lays", _COLONY, "component.iterations % 3 == 2", "False", _OF_COLONY),
    Fault(
        "pheromone is never laid anew",
        _COLONY,
        "if component.stalled and component.stalled % _RENEWAL == 0:",
        "if False:",
        _OF_COLONY,
    ),
    Fault(
        "staying uncovered gets no pheromone",
        _COLONY,
        "            slack_pheromone[r] += share\n",
        "            pass\n",
        _OF_COLONY,
    ),
    Fault(
        "a colony forgets the best known at its start",
        _COLONY,
        "if component.best is not None:",
        "if False:",
        _OF_COLONY,
    ),
    Fault(
        "alpha is ignored in mode mmas",
        _WALK,
        "trace[j] = trail.pheromone[j] ** alpha",
        "trace[j] = trail.pheromone[j]",
        _OF_COLONY,
    ),
    Fault("beta is ignored in mode mmas", _WALK, "strictness = beta * 2.0", "strictness = 2.0", _OF_COLONY),
    Fault(
        "the visibility is constant in mode mmas", _WALK, "trace[j] * math.exp(-power) if", "trace[j] if", _OF_COLONY
    ),
    Fault("all ants are equally strict", _WALK, "2.0 ** (ant % 10)", "1.0", _OF_COLONY),
    Fault("no row stays uncovered", _WALK, "            if draw < 0.0:\n                continue\n", "", _OF_COLONY),
    Fault("the last ant wins, not the best", _WALK, "if weight < best_weight:", "if True:", _OF_COLONY),
    Fault(
        "p_j without the visibility",
        _CYCLE,
        "value = colony.pheromone**parameters.alpha * seen**parameters.beta",
        "value = colony.pheromone**parameters.alpha",
        _OF_COLONY,
    ),
    # genetic
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
    Fault("no mutation", _BREEDING, "rng.random() < mutation / num_sensors", "rng.random() < 0.0", _OF_GENETIC),
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
    # tabu
    Fault(
        "tenure is 0",
        _TABU,
        "until[ejected[i]] = clock + tenure + rng.integers(0, tenure + 1)",
        "until[ejected[i]] = clock",
        _OF_TABU,
    ),
    Fault(
        "no aspiration", _TABU, "(until[j] < clock or current + gain[j] < record - 1e-9)", "until[j] < clock", _OF_TABU
    ),
    Fault(
        "what is tabu is chosen all the same",
        _TABU,
        "(until[j] < clock or current + gain[j] < record - 1e-9)",
        "until[j] > -1",
        _OF_TABU,
    ),
    Fault(
        "the worst insertion is made",
        _TABU,
        "if gain[j] < least and (until",
        "if -gain[j] < least and (until",
        _OF_TABU,
    ),
    Fault(
        "open rows stay open",
        _TABU,
        "            if fill >= 0 and num",
        "            if False and fill >= 0 and num",
        _OF_TABU,
    ),
    Fault(
        "gains are not kept up to date",
        _TABU,
        "                gain[row_cols[k]] = insertion_gain(cols, weights, owner, row_cols[k])\n",
        "                pass\n",
        _OF_TABU,
    ),
    Fault("a forced column is not held", _TABU, "held = forced if 3 * move < moves else -1", "held = -1", _OF_TABU),
    Fault("the best cover met is not kept", _TABU, "            best[:] = owner\n", "            pass\n", _OF_TABU),
    Fault(
        "never back to the best",
        _TABU,
        "                self.owner = component.best.copy()\n                forced",
        "                forced",
        _OF_TABU,
    ),
    Fault("never a new cover", _TABU, "if self.restarts % _FRESH == 0:", "if False:", _OF_TABU),
    Fault("the tabu list outlives a restart", _TABU, "            self.until[:] = 0\n", "", _OF_TABU),
    Fault("rows are forced whatever they cost", _TABU, "p=excess / total", "p=None", _OF_TABU),
    # what the three share
    Fault(
        "patience has no end",
        _SEARCH,
        "component.stalled >= limits.patience or component.iterations",
        "component.iterations",
        _OF_SEARCH,
    ),
    Fault("iterations have no end", _SEARCH, " or component.iterations >= limits.iterations\n", "\n", _OF_SEARCH),
    Fault(
        "small components are bounded only after their search",
        _SEARCH,
        "component.proven = bound_of_component(component, run)",
        "pass",
        _OF_SEARCH,
    ),
    Fault("the best cover is not refined", _TEAM, "        component.refine(run, self._clusters)\n", "", _OF_SEARCH),
    Fault(
        "workers refine one and the same cover",
        _TEAM,
        "best = None if component.best is None else component.best.copy()",
        "best = component.best",
        _OF_SEARCH,
    ),
    Fault("workers do not exchange", _TEAM, "own.offer(whole.best, whole.weight)", "pass", _OF_SEARCH),
    Fault("what other workers find is lost", _TEAM, "whole.offer(own.best, own.weight)", "pass", _OF_SEARCH),
    Fault("workers draw the same numbers", _TEAM, "Run(rng, time_limit", "Run(0, time_limit", _OF_SEARCH),
    Fault(
        "a colony learns nothing from others",
        _COLONY,
        "self.recent, self.least = component.best.copy(), component.weight",
        "pass",
        _OF_COLONY,
    ),
    Fault(
        "a population learns nothing from others",
        _BREEDING,
        "            self._admit(component, component.best.copy(), component.weight)\n",
        "            pass\n",
        _OF_GENETIC,
    ),
    Fault("divers ignore the pheromone", _DIVER, "trail[at.origin[open_columns]] * at", "at", _OF_DIVES),
    Fault(
        "divers ignore the linear program",
        _DIVER,
        "at.relaxed.primal[open_columns] ** strictness",
        "1.0",
        _OF_DIVES,
    ),
    Fault("divers fix nothing", _DIVER, "            self._slack[r] = False\n", "", _OF_DIVES),
    Fault(
        "a diver takes any price",
        _DIVER,
        "relaxed.bound + _AIM * (cutoff - relaxed.bound)",
        "cutoff",
        _OF_DIVES,
    ),
    Fault("a diver never goes back", _DIVER, "self._columns, self._slack = columns, slack\n", "return\n", _OF_DIVES),
    Fault(
        "a diver never aims at less",
        _DIVER,
        "self._aim = min(before.bound + 2.0 * room, self._cutoff)",
        "break",
        _OF_DIVES,
    ),
    Fault(
        "a smaller program forgets what was fixed",
        _DIVER,
        "[*self._chosen, *self.origin[fixed].tolist()]",
        "[*self._chosen]",
        _OF_DIVES,
    ),
    Fault(
        "tabu search does not dive",
        _TABU,
        "        if component.dives:\n            self.dives += 1",
        "        if False:\n            self.dives += 1",
        _OF_DIVES,
    ),
    Fault(
        "breeding does not dive",
        _BREEDING,
        "        if component.dives:\n            self.dives += 1",
        "        if False:\n            self.dives += 1",
        _OF_DIVES,
    ),
    Fault(
        "what a diver fixed is not excluded", _DIVER, "row_ptr[r + 1]]] = False", "row_ptr[r + 1]]] = True", _OF_DIVES
    ),
    Fault("no ant dives", _COLONY, "p.divers if component.dives else 0", "0", _OF_DIVES),
    Fault(
        "a cover that is worse is kept",
        _COMPONENT,
        "if weight < self.weight - self.tolerance and self",
        "if self",
        _OF_SEARCH,
    ),
    Fault(
        "an incomplete cover is kept",
        _COMPONENT,
        "self.tolerance and self.is_complete(owner):",
        "self.tolerance:",
        _OF_SEARCH,
    ),
    Fault("refinement none refines", _COMPONENT, 'or self.refinement == "none":', "or False:", _OF_SEARCH),
    Fault(
        "refinement local is full",
        _COMPONENT,
        'move.on_new(clusters if self.refinement == "full" else 0)',
        "move.on_new(clusters)",
        _OF_SEARCH,
    ),
    Fault("refinement none inserts", _COMPONENT, 'return self.refinement != "none"', "return True", _OF_SEARCH),
    Fault(
        "what a large neighbourhood finds is lost",
        _LARGE,
        "                own_all(packing.cols, smaller.origin[part.origin[search.columns]], owner)\n",
        "",
        _OF_LARGE,
    ),
    Fault(
        "large neighbourhoods have no columns beyond the bound",
        _LARGE,
        "limit = max(weight - priced.bound, 0.0) + priced.tolerance",
        "limit = priced.tolerance",
        _OF_LARGE,
    ),
    Fault(
        "the simplex method moves its multipliers the other way",
        _SIMPLEX,
        "basis.duals[r] += sign * step * basis.row[r]",
        "basis.duals[r] -= sign * step * basis.row[r]",
        _OF_DIVES,
    ),
)
