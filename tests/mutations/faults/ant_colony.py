"""The ant colony, mode paper and mode mmas."""

from __future__ import annotations

from tests.mutations.faults.fault import Fault

_PAPER = "assoc/solvers/aco/paper.py"
_COLONY = "assoc/solvers/aco/max_min.py"
_WALK = "assoc/packing/neighbourhoods/random_cover.py"
_CYCLE = "assoc/solvers/aco/cycle.py"

_OF_PAPER = "tests/solvers/test_aco_paper.py"
_OF_COLONY = "tests/solvers/test_aco_max_min.py"

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
    Fault(
        "what stays uncovered is a choice where there are no false alarms",
        _PAPER,
        "np.zeros(0, dtype=np.int64) if packing.is_axial",
        "np.flatnonzero(packing.slack) if packing.is_axial",
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
        "the visibility that is told is constant",
        _CYCLE,
        "seen = np.exp(-component.reduced / component.temperature)",
        "seen = np.ones_like(component.reduced)",
        _OF_COLONY,
    ),
    Fault("divers know no pheromone", _COLONY, "rng, self.pheromone**p.alpha, p.beta", "rng, None, p.beta", _OF_COLONY),
    Fault("what a diver found lays no pheromone", _COLONY, "owner, weight = other, reached", "pass", _OF_COLONY),
    Fault("divers go on when time is over", _COLONY, "if not component.dives:", "if self.dives >= 10:", _OF_COLONY),
    Fault(
        "p_j without the visibility",
        _CYCLE,
        "value = colony.pheromone**parameters.alpha * seen**parameters.beta",
        "value = colony.pheromone**parameters.alpha",
        _OF_COLONY,
    ),
)
