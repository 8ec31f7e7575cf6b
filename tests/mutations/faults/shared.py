"""What the metaheuristics share: the search of components, dives, neighbourhoods, the simplex method."""

from __future__ import annotations

from tests.mutations.faults.fault import Fault

_COLONY = "assoc/solvers/aco/max_min.py"
_BREEDING = "assoc/solvers/genetic/population.py"
_TABU = "assoc/solvers/tabu/moves.py"
_SEARCH = "assoc/packing/components/search.py"
_TEAM = "assoc/packing/components/team.py"
_SPLITTING = "assoc/packing/components/splitting.py"
_DIVER = "assoc/packing/neighbourhoods/diving.py"
_COMPONENT = "assoc/packing/components/component.py"
_SIMPLEX = "assoc/packing/simplex/dual.py"
_PRICING = "assoc/packing/simplex/pricing.py"
_TRIAL = "assoc/packing/simplex/trial.py"
_BRANCHING = "assoc/packing/branching/search.py"
_OF_TRIALS = "tests/packing/test_trial.py"
_NODE = "assoc/packing/branching/node.py"
_KEPT = "assoc/packing/branching/kept_bases.py"
_OF_KEPT = "tests/packing/test_kept_bases.py"
_EXTREMES = "assoc/packing/kernels/extremes.py"
_OF_EXTREMES = "tests/packing/test_extremes.py"
_OF_PASSES = "tests/packing/test_passes.py"
_COUNTS = "assoc/packing/branching/counts.py"
_OF_COUNTS = "tests/packing/test_counts_small.py"

_OF_COLONY = "tests/solvers/test_aco_max_min.py"
_OF_GENETIC = "tests/solvers/test_genetic.py"
_OF_DIVES = "tests/packing/test_diving.py"
_SHORT = "assoc/packing/branching/short_search.py"
_OF_SHORT = "tests/packing/test_short_search.py"
_REMAINDER = "assoc/packing/simplex/remainder.py"
_OF_REMAINDER = "tests/packing/test_remainder.py"
_OF_PARTS = "tests/packing/test_dives_in_parts.py"
_OF_SEARCH = "tests/packing/test_search_components.py"

FAULTS = (
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
    Fault(
        "no branch and bound beside",
        _TEAM,
        "            self._branching.advance()\n",
        "            pass\n",
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
    Fault("workers use a seed up", _TEAM, "map(np.random.default_rng, seeds)", "run.rng.spawn(workers)", _OF_SEARCH),
    Fault("what was proved is forgotten", _SPLITTING, "components[0].proven = whole.proven", "pass", _OF_SEARCH),
    Fault(
        "a search beside that ended does not close its component",
        "assoc/packing/components/proof.py",
        "component.best, component.weight = owner, component.weight_of(owner)",
        "component.offer(owner, search.weight)",
        _OF_SEARCH,
    ),
    Fault(
        "weights that are all alike have no size",
        _COMPONENT,
        "float(np.ptp(weights)) or abs(float(weights[0]))",
        "float(np.ptp(weights))",
        _OF_SEARCH,
    ),
    Fault(
        "columns of many rows are miscounted",
        _COUNTS,
        "np.array(times, dtype=np.int32)",
        "np.array(times, dtype=np.int8)",
        _OF_COUNTS,
    ),
    Fault(
        "parts are forgotten when time ends",
        _COUNTS,
        "            leaves = [part.leaf for part in parts]\n",
        "",
        _OF_COUNTS,
    ),
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
    Fault("divers ignore the pheromone", _DIVER, "trail[self._core.origin[columns]] * at", "at", _OF_DIVES),
    Fault(
        "divers ignore the linear program",
        _DIVER,
        "at.relaxed.primal[columns] ** strictness",
        "1.0",
        _OF_DIVES,
    ),
    Fault("divers begin in no part", _DIVER, "if whole or not self._parts else", "if True else", _OF_PARTS),
    Fault(
        "divers begin in parts alone", _DIVER, "if whole or not self._parts else", "if not self._parts else", _OF_PARTS
    ),
    Fault(
        "parts without better covers are kept",
        _DIVER,
        "[part for part in self._parts if part.relaxed.bound < cutoff]",
        "list(self._parts)",
        _OF_PARTS,
    ),
    Fault("divers fix nothing", _DIVER, "            self._covered[own_rows] = True\n", "", _OF_DIVES),
    Fault(
        "divers do not end with branch and bound",
        _DIVER,
        "        found, done = search.run(self._program, Part(columns, slack, self.fixed), self._cutoff, limits)\n",
        "        found, done = np.zeros(0, dtype=np.int64), True\n",
        _OF_DIVES,
    ),
    Fault("what ends a dive is lost", _DIVER, "(found if found.size else", "(found if False else", _OF_DIVES),
    Fault("the core is chosen once", _DIVER, "for _ in range(_ROUNDS):", "for _ in range(1):", _OF_DIVES),
    Fault("dives may hold no cover at all", _DIVER, "        near[known] = True\n", "", _OF_DIVES),
    Fault(
        "dives begin without cuts",
        _DIVER,
        "duals[self._core.row_origin], cutoff,",
        "duals[self._core.row_origin], -np.inf,",
        _OF_DIVES,
    ),
    Fault("a split may take all of the time", _DIVER, "now() + _SPLIT * (deadline - now())", "deadline", _OF_PARTS),
    Fault(
        "short searches learn nothing of pairs",
        _SHORT,
        "        self.gain[pairs], self.tried[pairs] = work.trials.gain, work.trials.tried\n",
        "",
        _OF_SHORT,
    ),
    Fault("short searches look for what is no better", _SHORT, "1, below, limits", "1, np.inf, limits", _OF_SHORT),
    Fault(
        "a short search forgets what fixed columns weigh",
        _SHORT,
        "cutoff - float(packing.weights[part.fixed].sum())",
        "cutoff",
        _OF_SHORT,
    ),
    Fault(
        "what fixed columns take of cuts is forgotten",
        _REMAINDER,
        "program.sides - np.bincount(_entries(program, fixed)[0], minlength=program.sides.size)",
        "program.sides"
        " - (program.sides == 1.0) * np.bincount(_entries(program, fixed)[0], minlength=program.sides.size)",
        _OF_REMAINDER,
    ),
    Fault(
        "a rest without a variable of the basis begins with a column",
        _REMAINDER,
        "else columns.size + size",
        "else 0",
        _OF_REMAINDER,
    ),
    Fault(
        "short searches begin with anchors",
        _SHORT,
        "rest.slack, rest.variable, rest.duals",
        "rest.slack, rest.variable * 0 + rest.columns.size + rest.rows.size, rest.duals",
        _OF_SHORT,
    ),
    Fault(
        "rows that must be covered go where nothing can cover them",
        _REMAINDER,
        "used | (~slack & (sides > 0.0))",
        "used",
        _OF_REMAINDER,
    ),
    Fault(
        "what is left of a program begins anew",
        _REMAINDER,
        "numbered = numbered[numbered >= 0]",
        "numbered = numbered[:0]",
        _OF_REMAINDER,
    ),
    Fault(
        "a diver keeps what leaves nothing better",
        _DIVER,
        "        return False\n\n    @property\n    def fixed",
        "        return True\n\n    @property\n    def fixed",
        _OF_DIVES,
    ),
    Fault("dives end at once", _DIVER, "while at.open_rows > left and", "while False and", _OF_DIVES),
    Fault(
        "a diver draws what is likely, always", _DIVER, "rng.gumbel(size=np.count_nonzero(likely))", "0.0", _OF_DIVES
    ),
    Fault(
        "a diver leaves the same share to branch and bound, always",
        _DIVER,
        "min(self.share + _GROW, _HIGHEST) if done else max(self.share - _SHRINK, _LOWEST)",
        "self.share",
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
    Fault("no ant dives", _COLONY, "for _ in range(p.divers):", "for _ in range(0):", _OF_DIVES),
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
        "the simplex method moves its multipliers the other way",
        _SIMPLEX,
        "duals[r] += sign * step * row[r]",
        "duals[r] -= sign * step * row[r]",
        _OF_DIVES,
    ),
    Fault(
        "a kept basis has the values of other right-hand sides",
        _KEPT,
        "basis.values[i] += program.sides[r] * entry",
        "basis.values[i] += entry",
        _OF_KEPT,
    ),
    Fault(
        "a basis that was taken back is kept on",
        _KEPT,
        "kept.latest[0] = place if again else (place + count - 1) % count",
        "pass",
        _OF_KEPT,
    ),
    Fault("the basis of a branching is not kept", _KEPT, "place = (kept.latest[0] + 1) % count", "return", _OF_KEPT),
    Fault("what both sides of a branching need is taken once", _KEPT, "place if again else ", "", _OF_KEPT),
    Fault("branchings keep no basis", _NODE, "    keep_basis(work.kept, work.basis)\n", "", _OF_KEPT),
    Fault("any kept basis will do", _KEPT, "        if i == size:\n", "        if i >= 0:\n", _OF_KEPT),
    Fault(
        "the last of the largest is taken",
        _EXTREMES,
        "place = min(place, a if bits[a] == most else count)",
        "place = a if bits[a] == most else place",
        _OF_EXTREMES,
    ),
    Fault("only the last is looked at", _EXTREMES, "least = min(least, bits[a])", "least = bits[a]", _OF_EXTREMES),
    Fault(
        "columns are priced by the rows of one sensor less",
        _PRICING,
        "padded[codes[0, a]] + padded[codes[1, a]] + padded[codes[2, a]]",
        "padded[codes[0, a]] + padded[codes[1, a]]",
        _OF_TRIALS,
    ),
    Fault(
        "trials forget their first exchange",
        _TRIAL,
        "for k in range(done - 1, -1, -1):",
        "for k in range(done - 1, 0, -1):",
        _OF_TRIALS,
    ),
    Fault(
        "branch and bound makes no passes",
        _BRANCHING,
        "self._aim = aim if 0.0 < gap < np.inf and farther else np.inf",
        "self._aim = np.inf",
        _OF_PASSES,
    ),
    Fault(
        "the aim of a pass may be that of the last one",
        _BRANCHING,
        "farther = max(root, self._floor) < aim < root + _LAST * gap",
        "farther = aim < root + _LAST * gap",
        _OF_PASSES,
    ),
    Fault(
        "a pass proves more than its aim",
        _BRANCHING,
        "self._floor = max(self._floor, self._aim)",
        "self._floor = self.weight",
        _OF_PASSES,
    ),
    Fault(
        "a split on counts leaves out the number between",
        _COUNTS,
        "part.counts.within(k, below + 1, most)",
        "part.counts.within(k, below + 2, most)",
        _OF_COUNTS,
    ),
    Fault(
        "both sides of a split have the number between",
        _COUNTS,
        "part.counts.within(k, least, below), ",
        "part.counts.within(k, least, below + 1), ",
        _OF_COUNTS,
    ),
    Fault(
        "parts that wait are forgotten",
        _BRANCHING,
        "return self._waiting[-1].bound if self._waiting else np.inf",
        "return np.inf",
        _OF_COUNTS,
    ),
    Fault(
        "a pass is not split before it ends",
        _BRANCHING,
        "if self._open.count and self._splits():",
        "if False:",
        _OF_COUNTS,
    ),
)
