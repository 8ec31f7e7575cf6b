"""Everybody who is compared on assignment problems, ours and others' (peers): one way to run, time and check them.

A contestant gets a problem and a time limit; its time runs from the tuples to the chosen tuples: it includes building
the model, but not importing the package, nor compiling. The cost of its answer is computed by
`experiments.common.checking`, not by the contestant. Ours have one core, and with a limit they use all of it.

======================  ==========================================================================
``cp_sat``              OR-Tools CP-SAT, two workers, costs times 1e6 rounded to integers
``cp_sat_1``            the same with one worker
``scip``, ``scip_1``    SCIP through OR-Tools MathOpt on two threads (concurrent mode), and on one
``highs``               HiGHS through ``scipy.optimize.milp``, relative gap 1e-9
``sequential``          sensor by sensor, one 2-D assignment each: what most trackers do
``chils``               CHILS, local search for the heaviest independent set
``branch_reduce``       KaMIS's branch and reduce for it
``mmwis``               KaMIS's memetic algorithm for it
======================  ==========================================================================
"""

import contextlib
import importlib.util
import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial
from typing import Any

import assoc
from assoc._types import Ints
from assoc.errors import InfeasibleError
from assoc.problem import AssignmentProblem
from experiments.common import annealing, peers
from experiments.common.checking import check_answer
from experiments.common.measuring import clocked, fresh, one_core

HEURISTICS = ("aco", "genetic", "tabu")
OURS = ("exact", "milp", "lagrangian", *HEURISTICS, "greedy", "annealing")
STOPPED = (*HEURISTICS, "greedy", "annealing")
"""Those of ours that are stopped at a cost that is known to be the best: of themselves they cannot see that it is."""
ONE_CORE = {"cp_sat": "cp_sat_1", "scip": "scip_1"}
"""Peers that take two cores, and what they are called on one."""
_INDEPENDENT_SETS = ("chils", "branch_reduce", "mmwis")
# of the extra `peers`: what others need comes with the package, or they look for it themselves
_PACKAGES = dict.fromkeys(_INDEPENDENT_SETS, "chszlablib")
_UNLIMITED = 1_000_000_000
_TINY = AssignmentProblem([[1, 1]], [-1.0], [1, 1])

Told = Callable[[float, float], bool]
"""Told of a cost and a bound; a true answer stops the solver."""


@dataclass(frozen=True)
class Answer:
    """What a contestant found.

    cost: Cost of its solution as our checker reads it; ``inf`` when it found none in time.
    bound: Its lower bound, where it gives one.
    seconds: Wall time from the tuples to the chosen tuples.
    proven: Whether the contestant itself says that this is the optimum.
    cpu: The same time as the process's CPU time, all threads together.
    """

    cost: float
    bound: float | None
    seconds: float
    tuples: Ints
    proven: bool = False
    cpu: float = 0.0


def _ours(name: str, problem: AssignmentProblem, limit: float, told: Told | None) -> tuple[Any, ...]:
    # what a limit gives them they use: by default they leave a part that has not become better for a while
    options = {"patience": _UNLIMITED, "iterations": _UNLIMITED} if name in HEURISTICS else {}
    callback = None if told is None else lambda point: told(point.cost, point.lower_bound)
    try:
        found = assoc.assign(fresh(problem), name, time_limit=limit, callback=callback, advise=False, **options)
    except InfeasibleError:
        return None, None, False
    return found.indices, found.lower_bound, found.status == "optimal", found.cost


LISTENED: dict[str, Callable[[AssignmentProblem, float, Told | None], tuple[Any, ...]]] = {
    **{name: partial(_ours, name) for name in OURS},
    "cp_sat": partial(peers.cp_sat, 2),
    "cp_sat_1": partial(peers.cp_sat, 1),
}
"""Contestants that may be listened to while they search; all return indices of tuples, a bound, whether it is proven,
and may add the cost that they claim."""
_OTHERS: dict[str, Callable[[AssignmentProblem, float], tuple[Any, ...]]] = {
    "scip": partial(peers.scip, 2),
    "scip_1": partial(peers.scip, 1),
    "highs": peers.highs,
    "sequential": peers.assign_in_turn,
    **{name: partial(peers.independent_set, name) for name in _INDEPENDENT_SETS},
}


def run(name: str, problem: AssignmentProblem, limit: float, told: Told | None = None) -> Answer:
    """Run a contestant, for so many seconds; those of `LISTENED` tell what they find.

    Raises AssertionError: Its answer is no solution, or costs something else than it says.
    """
    if name == "annealing":
        annealing.make_known()
    solve = partial(LISTENED[name], told=told) if name in LISTENED else _OTHERS[name]
    with one_core() if name in OURS else contextlib.nullcontext():
        (indices, bound, proven, *said), seconds, cpu = clocked(lambda: solve(problem, limit))
    if indices is None:
        return Answer(math.inf, bound, seconds, problem.tuples[:0], cpu=cpu)
    tuples = problem.tuples[indices]
    cost = check_answer(problem, tuples)
    if any(abs(cost - other) > 1e-7 * max(1.0, abs(cost)) for other in said):
        raise AssertionError(f"{name}: says {said[0]}, its tuples cost {cost}")
    return Answer(cost, bound, seconds, tuples, proven, cpu)


def warm_up(names: Collection[str]) -> None:
    """Compile what ours need and import the packages of peers, so that no measured run pays for it."""
    if "annealing" in names:
        annealing.make_known()
    if own := [name for name in OURS if name in names]:
        assoc.warm_up(own)
    for name in sorted({*names} - {*OURS}):
        if takes(name, _TINY):
            run(name, _TINY, 1.0)


def not_installed() -> list[str]:
    """Packages of peers that are not installed (extra ``peers``)."""
    return sorted({package for package in _PACKAGES.values() if importlib.util.find_spec(package) is None})


def takes(name: str, problem: AssignmentProblem = _TINY) -> bool:
    """Whether a contestant is installed and can take a problem; without one, whether it is installed."""
    if importlib.util.find_spec(_PACKAGES.get(name, "scipy")) is None:
        return False
    # the heaviest independent set is a solution where measurements may be left alone
    return name in LISTENED or (name in _OTHERS and (problem.dummy or name not in _PACKAGES))
