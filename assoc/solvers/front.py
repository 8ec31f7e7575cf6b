"""``assign``: one door to all solvers, which checks what comes in and certifies what goes out."""

from __future__ import annotations

import math
import time
from dataclasses import fields
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc.errors import InfeasibleError, InvalidInputError
from assoc.problem import AssignmentProblem
from assoc.solution import Solution
from assoc.solvers import registry
from assoc.solvers.bounds import certified_bound, dual_bound
from assoc.solvers.packing import Prepared, prepare
from assoc.solvers.run import Callback, Outcome, Run


def assign(
    problem: AssignmentProblem,
    solver: str = "exact",
    *,
    seed: int | np.random.SeedSequence | np.random.Generator = 0,
    time_limit: float | None = None,
    callback: Callback | None = None,
    **parameters: Any,
) -> Solution:
    """Solve an assignment problem.

    Parameters
    ----------
    problem : AssignmentProblem
        What to solve.
    solver : str, default "exact"
        One of ``assoc.solvers.names()``.
    seed : int, SeedSequence or Generator, default 0
        Source of all randomness: the same seed gives the same solution.
    time_limit : float, optional
        Seconds; when they are over the best solution found is returned.
    callback : callable, optional
        Called with each ``TracePoint``; a true answer stops the solver.
    **parameters
        Parameters of that solver (``assoc.solvers.parameters(name)``).

    Returns
    -------
    Solution
        Feasible, with a lower bound that is valid whatever the solver.

    Raises
    ------
    InvalidInputError
        Unknown solver or parameter, or a value out of range.
    InfeasibleError
        The problem (without dummies) has no solution, or the solver found none in its time.
    """
    started = time.perf_counter()
    if not isinstance(problem, AssignmentProblem):
        raise InvalidInputError(f"problem: expected an AssignmentProblem, got {type(problem).__name__}")
    chosen = registry.make_parameters(solver, parameters)
    solve = registry.solver(solver)
    run = Run(_generator(seed), time_limit=_limit(time_limit), callback=callback, started=started)
    prepared = prepare(problem)
    run.offset = prepared.offset
    outcome = solve(prepared.packing, chosen, run)
    return _certify(problem, prepared, outcome, run, solver, chosen)


def _certify(
    problem: AssignmentProblem, prepared: Prepared, outcome: Outcome, run: Run, solver: str, parameters: Any
) -> Solution:
    packing = prepared.packing
    columns = np.asarray(outcome.columns, dtype=np.int64)
    indices = _indices(problem, prepared, columns)
    tuples = problem.tuples[indices]
    bound, duals = outcome.lower_bound, outcome.duals
    if bound == -np.inf:
        duals = dual_bound(packing, run=run)
        bound = certified_bound(packing, duals)
    # packing weights are differences of costs: what they lose to rounding is taken off the bound
    rounding = 4.0 * np.finfo(float).eps * (np.abs(packing.weights[columns]).sum() + np.abs(prepared.single_cost).sum())
    cost = math.fsum(problem.costs[indices])
    return Solution(
        tuples=tuples,
        indices=indices,
        cost=cost,
        lower_bound=min(bound + prepared.offset - rounding, cost),
        solver=solver,
        iterations=outcome.iterations,
        runtime=run.elapsed(),
        stopped_by=run.stopped_by or "converged",
        duals=_duals_by_sensor(problem, prepared, duals) if duals is not None else (),
        trace=tuple(run.trace),
        parameters={f.name: getattr(parameters, f.name) for f in fields(parameters)},
    )


def _indices(problem: AssignmentProblem, prepared: Prepared, columns: NDArray[np.int64]) -> NDArray[np.intp]:
    """Rows of ``problem.tuples`` of a choice of columns, completed by singletons and checked."""
    packing = prepared.packing
    rows = packing.cols[columns]
    covered = np.bincount(rows[rows >= 0], minlength=packing.num_rows)
    if covered.size and (covered.max() > 1 or (covered[~packing.slack] != 1).any()):
        raise InfeasibleError("the solver's answer does not use every measurement exactly once")
    indices = packing.origin[columns].astype(np.intp)
    if problem.dummy:
        alone = np.ones(prepared.single.size, dtype=bool)
        alone[packing.row_origin[covered > 0]] = False
        indices = np.concatenate([indices, prepared.single[alone]])
    chosen = problem.tuples[indices]
    return indices[np.lexsort(chosen.T[::-1])]


def _duals_by_sensor(
    problem: AssignmentProblem, prepared: Prepared, duals: NDArray[np.float64]
) -> tuple[NDArray[np.float64], ...]:
    """Multipliers of the problem's measurements: those of the packing plus the singletons' costs."""
    total = prepared.single_cost.copy() if problem.dummy else np.zeros(int(problem.sizes.sum()))
    total[prepared.packing.row_origin] += duals
    return tuple(np.split(total, np.cumsum(problem.sizes)[:-1]))


def _generator(seed: object) -> np.random.Generator:
    if isinstance(seed, np.random.Generator):
        return seed
    if isinstance(seed, np.random.SeedSequence):
        return np.random.default_rng(seed)
    if isinstance(seed, (int, np.integer)) and not isinstance(seed, bool) and seed >= 0:
        return np.random.default_rng(int(seed))
    raise InvalidInputError(f"seed: expected a whole number >= 0, got {seed!r}")


def _limit(time_limit: object) -> float | None:
    if time_limit is None:
        return None
    if isinstance(time_limit, Real) and not isinstance(time_limit, bool) and float(time_limit) > 0:
        return float(time_limit)
    raise InvalidInputError(f"time_limit: expected seconds > 0, got {time_limit!r}")
