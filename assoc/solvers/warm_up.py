"""Compile all kernels that solvers may need, before the first scan with a time limit.

Kernels are compiled at their first call and kept on disk. Which ones a scan needs depends on its difficulty: easy scans
never use branch and bound, so the first hard one would wait for half a minute.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from dataclasses import fields
from typing import Any

import numpy as np

from assoc._system.compiled import wait_for_kernels
from assoc._system.interpreted import compiled_only
from assoc._system.kernels.sorting import ascending
from assoc.errors import InfeasibleError
from assoc.packing import prepare as packing_form
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.compiling import compile_all_branching_ahead
from assoc.packing.component import split_components
from assoc.packing.local_search import LocalSearch
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.solvers import registry
from assoc.solvers.assign import assign
from assoc.solvers.methods import EXACT_METHODS

# measurements of each sensor, and tuples: enough for large components, few enough for tenths of a second
_ROWS = 24
_TUPLES = 2000
# iterations without improvement, or nodes, after which a search has used all its kernels
_LIMITS = {"patience": 12}
_EXACT = {"nodes": 60}

# solvers that need branch and bound, at least on hard problems; a second process compiles it, half of all kernels,
# while this process compiles the rest
_BRANCHING = ("exact", "aco", "genetic", "tabu")
# solvers whose iterations `exact` uses in large components
_WITH_EXACT = ("genetic", "tabu")


def warm_up(solvers: Iterable[str] | None = None) -> None:
    """Compile the kernels of solvers, or load them; see `assoc.warm_up`."""
    names = [name for name in registry.names() if name != "milp"] if solvers is None else list(solvers)
    for name in names:
        registry.parameters(name)
    if "exact" in names:
        names += [name for name in _WITH_EXACT if name not in names]
    branching = [name for name in names if name in _BRANCHING]
    if branching:
        compile_all_branching_ahead()
    with compiled_only():
        prepare(name for name in names if name not in branching)
        if branching:
            _begin_searches(branching)
        # the first branch and bound waits for the other process
        prepare(branching)
        wait_for_kernels()
        # only large problems use this sort, and their time limits are the hardest to keep
        ascending(np.zeros(10_000))


def _begin_searches(names: list[str]) -> None:
    """Compile the kernels that solvers use before their first branch and bound, and between two of them."""
    packing = packing_form.prepare(_small_problem()).packing
    run = Run(0, methods=EXACT_METHODS)
    if "exact" in names:
        from assoc.solvers.exact.reduction import Reduction

        reduction = Reduction(packing, run)
        reduction.reduce()
        # the sum that decides whether these multipliers alone are a proof
        _ = reduction.proof
    component = split_components(packing, dual_bound(packing, run=run), np.arange(packing.num_columns))[0]
    search = LocalSearch(component, run)
    search.offer_greedy()
    if "tabu" in names:
        from assoc.solvers.tabu.moves import TabuSearch
        from assoc.solvers.tabu.parameters import TabuParameters

        TabuSearch(component, TabuParameters()).iterate(search)
    if "genetic" in names:
        from assoc.solvers.genetic.parameters import GeneticParameters
        from assoc.solvers.genetic.population import Breeding

        breeding = Breeding(component, GeneticParameters())
        for _ in range(2):
            # a population, then its children
            breeding.iterate(search)
    if "aco" in names:
        from assoc.solvers.aco.colony import Colony
        from assoc.solvers.aco.parameters import AcoParameters

        Colony(component, AcoParameters(), lambda component, colony: None).iterate(search)


def prepare(names: Iterable[str]) -> None:
    """Compile the kernels of some solvers."""
    with compiled_only():
        for name in names:
            _solve_all(name, _problems())


def _solve_all(name: str, problems: list[AssignmentProblem]) -> None:
    known = {field.name for field in fields(registry.parameters(name))}  # type: ignore[arg-type]
    limits: dict[str, Any] = {key: value for key, value in _LIMITS.items() if key in known}
    limits |= _EXACT if name == "exact" else {}
    for problem in problems:
        # with and without a time limit: kernels that check the time take another path
        for limit in (None, 1e3):
            with contextlib.suppress(InfeasibleError):
                assign(problem, name, time_limit=limit, **limits)
            # a copy, so that it is prepared anew
            problem._prepared = None


def _problems() -> list[AssignmentProblem]:
    """Problems with random costs and dummies, an axial one, easy ones of two sensors, and an empty one."""
    rng = np.random.default_rng(1)
    dense = _random_problem(rng, _ROWS, _TUPLES)
    axial = AssignmentProblem.from_dense(rng.integers(0, 30, size=(11, 11, 11)).astype(float), dummy=False)
    costs = rng.normal(size=(5, 6))
    costs[0, 0] = 0.0
    planar = AssignmentProblem.from_dense(costs)
    pairs = AssignmentProblem.from_dense(costs, dummy=False)
    empty = AssignmentProblem(np.zeros((0, 3), dtype=int), [], [2, 0, 1])
    return [_small_problem(), axial, dense, planar, pairs, empty]


def _small_problem() -> AssignmentProblem:
    """A problem that its bound does not close, and that is too small for dives in the linear program."""
    return _random_problem(np.random.default_rng(2), 8, 150)


def _random_problem(rng: np.random.Generator, rows: int, count: int) -> AssignmentProblem:
    tuples = rng.integers(0, rows + 1, size=(count, 3))
    tuples = tuples[np.count_nonzero(tuples, axis=1) >= 2]
    return AssignmentProblem(tuples, -rng.gamma(4.0, 1.0, size=len(tuples)), [rows] * 3)
