"""The parts of the three metaheuristics, and how each is taken out."""

import inspect
import textwrap
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple
from unittest import mock

import numba  # noqa: TID251  (a changed kernel is not kept)
import numpy as np

from assoc.packing import local_search
from assoc.packing.branching.root import Root, plain_root
from assoc.packing.component import Component
from assoc.packing.local_search import LocalSearch
from assoc.packing.neighbourhoods.diving import Diver
from assoc.packing.packing import Packing
from assoc.solvers import assign
from assoc.solvers.aco import colony
from assoc.solvers.genetic import population
from assoc.solvers.genetic.population import Breeding
from assoc.solvers.improve import Team
from assoc.solvers.methods import EXACT_METHODS
from assoc.solvers.tabu import moves

SOLVERS = ("aco", "genetic", "tabu")
WHOLE, ALONE = "all parts", 'refinement="none"'
_UNDIVED, _LOCAL = "no dives in the linear program", 'refinement="local"'
# iterations
_NEVER = 1_000_000_000


class Part(NamedTuple):
    """One variant of a solver.

    words: What is left out.
    solvers: Which have this part.
    parameters: Of the solver.
    without: Makes the context in which the part is missing.
    base: Words of what it is compared with.
    """

    words: str
    solvers: tuple[str, ...]
    parameters: dict[str, Any] = {}
    without: Callable[[], AbstractContextManager[Any]] = nullcontext
    base: str = WHOLE


def _uncut(packing: Packing, duals: Any, *_: Any) -> Root:
    """The root of dives without cuts."""
    return plain_root(packing, duals)


def _replaced(owner: Any, name: str, new: Any) -> Callable[[], AbstractContextManager[Any]]:
    return lambda: mock.patch.object(owner, name, new)


def _without(*methods: str) -> Callable[[], AbstractContextManager[Any]]:
    """Some exact methods are not handed in."""
    less = replace(EXACT_METHODS, **dict.fromkeys(methods))
    return _replaced(assign, "EXACT_METHODS", less)


_no_rematching = _replaced(local_search, "improve_dimensionwise", lambda *_: 0.0)


_walk = LocalSearch.walk


def _best_known(self: Any, trail: Any, ants: int) -> Any:
    """The best cover known in place of the ants'; where nothing is known yet one ant has to walk."""
    best = self.component.best
    return _walk(self, trail, 1) if best is None else best.copy()


_child, _parent = Breeding._child, Breeding._parent


def _child_of_one(self: Any, search: Any, first: int, second: int) -> Any:
    """A child has one parent."""
    return _child(self, search, first, first)


def _worst_parent(self: Any, rng: Any) -> int:
    """The worst of those drawn breed."""
    self.fitness = -self.fitness
    try:
        return _parent(self, rng)
    finally:
        self.fitness = -self.fitness


def _admit_equals(self: Any, component: Component, owner: Any, weight: float) -> None:
    """A child replaces the worst member if it is better, whatever the others cost."""
    worst = int(np.argmax(self.fitness))
    if component.is_complete(owner) and weight < self.fitness[worst]:
        self.members[worst], self.fitness[worst] = owner, weight


def _deposit_unlimited(self: Any, owner: Any, share: float) -> None:
    """Pheromone that may fade away."""
    colony._update(self.pheromone, self.slack_pheromone, owner, share, 0.0)


def _rewritten(kernel: Any, old: str, new: str, **kernels: Any) -> Any:
    """A kernel with a part of its text replaced, perhaps to call other kernels, compiled when it is called."""
    function = getattr(kernel, "py_func", kernel)
    text = textwrap.dedent(inspect.getsource(function))
    if text.count(old) != 1:
        raise ValueError(f"{function.__name__}: expected {old!r} once")
    names = {**function.__globals__, **kernels}
    names["njit"] = names["inner_njit"] = lambda plain: plain
    exec(compile(text.replace(old, new), function.__code__.co_filename, "exec"), names)
    return numba.njit(nogil=True, error_model="numpy")(names[function.__name__])


@cache
def _moves_without_aspiration() -> Any:
    rule = "(until[j] < clock or current + gain[j] < record - 1e-9)"
    chosen = _rewritten(moves._best_insertion, rule, "until[j] < clock")
    return _rewritten(moves._moves, "_best_insertion(", "_without(", _without=chosen)


def _no_moves(*arguments: Any) -> int:
    """Covers are only improved, and the search begins anew from other covers."""
    return int(arguments[4].clock + arguments[4].moves)


OWN = (
    Part("no ants that walk", ("aco",), without=_replaced(LocalSearch, "walk", _best_known)),
    Part("no ants that dive", ("aco",), {"divers": 0}),
    Part("alpha 0: pheromone ignored", ("aco",), {"alpha": 0.0}),
    Part("beta 0: visibility ignored", ("aco",), {"beta": 0.0}),
    Part("no pheromone laid", ("aco",), without=_replaced(colony.Colony, "_deposit", lambda *_: None)),
    Part("no lower limit of pheromone", ("aco",), without=_replaced(colony.Colony, "_deposit", _deposit_unlimited)),
    Part("pheromone never laid anew", ("aco",), without=_replaced(colony, "_RENEWAL", _NEVER)),
    Part("no crossover", ("genetic",), without=_replaced(Breeding, "_child", _child_of_one)),
    Part("no selection", ("genetic",), {"tournament": 1}),
    Part("selection inverted", ("genetic",), without=_replaced(Breeding, "_parent", _worst_parent)),
    Part("population never renewed", ("genetic",), without=_replaced(population, "_RENEWAL", _NEVER)),
    Part("equal members admitted", ("genetic",), without=_replaced(Breeding, "_admit", _admit_equals)),
    Part("no moves", ("tabu",), without=_replaced(moves, "_moves", _no_moves)),
    Part("tenure 0", ("tabu",), {"tenure": 0}),
    Part("no aspiration", ("tabu",), without=lambda: _replaced(moves, "_moves", _moves_without_aspiration())()),
    Part("no column forced in", ("tabu",), without=_replaced(moves.TabuSearch, "_force", lambda *_: -1)),
    Part("no restarts", ("tabu",), {"restart": _NEVER}),
)
"""Parts that one of the three has and the others have not."""

SHARED = (
    Part(_UNDIVED, SOLVERS, without=_without("diver")),
    Part("no cuts in the linear program of dives", SOLVERS, without=_replaced(Diver, "root", staticmethod(_uncut))),
    Part("no branch and bound beside", SOLVERS, without=_replaced(Team, "_branch", lambda self: None)),
    Part("no cluster search", SOLVERS, without=_without("clusters")),
    Part("no dimensionwise search", SOLVERS, without=_no_rematching),
    Part("no dives, no cluster search", SOLVERS, without=_without("diver", "clusters"), base=_UNDIVED),
    Part(_LOCAL, SOLVERS, {"refinement": "local"}),
    Part("local, no dimensionwise search", SOLVERS, {"refinement": "local"}, _no_rematching, _LOCAL),
    Part(ALONE, SOLVERS, {"refinement": "none"}),
)
"""What all three have."""


def _alone(part: Part) -> Part:
    """The same part taken out of the metaheuristic without any refinement."""
    return part._replace(words=f"alone, {part.words}", parameters={"refinement": "none", **part.parameters}, base=ALONE)


PARTS = (
    Part(WHOLE, SOLVERS),
    *OWN,
    *SHARED,
    # nothing dives without refinement
    *(_alone(part) for part in OWN if part.words != "no ants that dive"),
)
"""All variants, the whole first."""
