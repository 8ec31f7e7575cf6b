"""``assign``: one door to all solvers, which checks what comes in and certifies what goes out."""

from __future__ import annotations

import math
import sys
import time
from dataclasses import fields, replace
from itertools import accumulate, pairwise
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc._system.interrupts import interruptible
from assoc.errors import InfeasibleError, InvalidInputError
from assoc.packing.bounds.dual_ascent import certified_bound, dual_bound
from assoc.packing.packing import Packing, Prepared, prepare
from assoc.packing.run import Callback, Outcome, Run
from assoc.problem import AssignmentProblem
from assoc.solution import Solution
from assoc.solvers import registry
from assoc.solvers.greedy.fallback import best_of, provide


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
    run = Run(_seed(seed), time_limit=_limit(time_limit), callback=callback, started=started)
    with interruptible():
        prepared = prepare(problem)
        run.offset = prepared.offset
        packing = prepared.packing
        if solver != "greedy":
            provide(packing, run)
        try:
            outcome = solve(packing, chosen, run)
        except InfeasibleError:
            if run.fallback is None:
                raise
            outcome = Outcome(run.fallback, 0)
        if run.stopped_by == "time_limit":
            outcome = _not_worse(packing, outcome, run)
        return _certify(problem, prepared, outcome, run, solver, chosen)


def _not_worse(packing: Packing, outcome: Outcome, run: Run) -> Outcome:
    """Take the greedy choice where the solver's is worse when time is over."""
    columns = np.asarray(outcome.columns, dtype=np.int64)
    better = best_of(packing, columns, run)
    if better is columns:
        return outcome
    run.record(outcome.iterations, float(packing.weights[better].sum()), outcome.lower_bound)
    return replace(outcome, columns=better)


def _certify(
    problem: AssignmentProblem, prepared: Prepared, outcome: Outcome, run: Run, solver: str, parameters: Any
) -> Solution:
    packing = prepared.packing
    columns = np.asarray(outcome.columns, dtype=np.int64)
    exact, indices, tuples, costs, magnitude = _complete(
        problem.tuples, problem.costs, problem.sizes, packing.cols, packing.weights, packing.slack, packing.origin,
        packing.row_origin, prepared.single, columns,
    )  # fmt: skip
    if not exact:
        raise InfeasibleError("the solver's answer does not use every measurement exactly once")
    bound, duals = outcome.lower_bound, outcome.duals
    if bound == -np.inf:
        duals = dual_bound(packing, run=run)
        bound = certified_bound(packing, duals)
    # packing weights are differences of costs: what they lose to rounding is taken off the bound
    rounding = 4.0 * sys.float_info.epsilon * (magnitude + float(np.abs(prepared.single_cost).sum()))
    cost = math.fsum(costs)
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


@njit
def _complete(
    tuples: Any, costs: Any, sizes: Any, cols: Any, weights: Any, slack: Any, origin: Any, row_origin: Any, single: Any,
    columns: Any,
) -> Any:  # fmt: skip
    """A choice of columns as rows of ``problem.tuples`` in lexicographic order, completed by singletons.

    Returns whether each measurement is used exactly once (each that must be, without dummies), the indices, their
    tuples and costs, and the sum of the chosen weights' magnitudes.
    """
    num_sensors = sizes.size
    start = np.zeros(num_sensors + 1, np.int64)
    for s in range(num_sensors):
        start[s + 1] = start[s] + sizes[s]
    # no two tuples share a measurement: each is found by its first one
    found = np.full(start[num_sensors], -1, np.int64)
    covered = np.zeros(slack.size, np.bool_)
    exact = True
    count = columns.size
    magnitude = 0.0
    for k in range(columns.size):
        j = columns[k]
        if j < 0 or j >= weights.size:
            exact = False
            continue
        magnitude += abs(weights[j])
        for s in range(num_sensors):
            r = cols[j, s]
            if r >= 0:
                exact = exact and not covered[r]
                covered[r] = True
        for s in range(num_sensors):
            i = tuples[origin[j], s]
            if i > 0:
                found[start[s] + i - 1] = origin[j]
                break
    if single.size > 0:
        taken = np.zeros(single.size, np.bool_)
        for r in range(slack.size):
            taken[row_origin[r]] = covered[r]
        for r in range(single.size):
            if not taken[r]:
                found[r] = single[r]
                count += 1
    for r in range(slack.size):
        exact = exact and (slack[r] or covered[r])
    indices = np.empty(count, np.int64)
    chosen = np.empty((count, num_sensors), tuples.dtype)
    prices = np.empty(count)
    count = 0
    # those that the first sensors missed come first
    for s in range(num_sensors - 1, -1, -1):
        for r in range(start[s], start[s + 1]):
            if found[r] >= 0 and exact:
                indices[count] = found[r]
                chosen[count] = tuples[found[r]]
                prices[count] = costs[found[r]]
                count += 1
    return exact, indices, chosen, prices, magnitude


def _duals_by_sensor(
    problem: AssignmentProblem, prepared: Prepared, duals: NDArray[np.float64]
) -> tuple[NDArray[np.float64], ...]:
    """Multipliers of the problem's measurements: those of the packing plus the singletons' costs."""
    ends = list(accumulate(problem.sizes.tolist(), initial=0))
    total = prepared.single_cost.copy() if problem.dummy else np.zeros(ends[-1])
    total[prepared.packing.row_origin] += duals
    return tuple(total[first:last] for first, last in pairwise(ends))


def _seed(seed: object) -> int | np.random.SeedSequence | np.random.Generator:
    if isinstance(seed, (np.random.Generator, np.random.SeedSequence)):
        return seed
    if isinstance(seed, (int, np.integer)) and not isinstance(seed, bool) and seed >= 0:
        return int(seed)
    raise InvalidInputError(f"seed: expected a whole number >= 0, got {seed!r}")


def _limit(time_limit: object) -> float | None:
    if time_limit is None:
        return None
    if isinstance(time_limit, Real) and not isinstance(time_limit, bool) and float(time_limit) > 0:
        return float(time_limit)
    raise InvalidInputError(f"time_limit: expected seconds > 0, got {time_limit!r}")
