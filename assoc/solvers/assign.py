"""``assign``: one door to all solvers, which checks what comes in and certifies what goes out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from numbers import Real
from typing import Any

import numpy as np

from assoc._files.output import FilePath, check_writable
from assoc._system import memory
from assoc._system.compile_time import compile_seconds
from assoc._system.interrupts import interruptible
from assoc.errors import InfeasibleError, InvalidInputError, warn
from assoc.packing.packing import Packing
from assoc.packing.prepare import prepare
from assoc.packing.run import Callback, Outcome, Run
from assoc.problem import AssignmentProblem
from assoc.solution import Solution
from assoc.solvers import registry
from assoc.solvers.certificate import certify
from assoc.solvers.doubts import doubts_about_costs
from assoc.solvers.greedy.fallback import better_of, prepare_fallback


def assign(
    problem: AssignmentProblem,
    solver: str = "exact",
    *,
    seed: int | np.random.SeedSequence | np.random.Generator = 0,
    time_limit: float | None = None,
    callback: Callback | None = None,
    watch: Callable[[Any], object] | None = None,
    advise: bool = True,
    proof: FilePath | None = None,
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
    watch : callable, optional
        Of ``aco``: called after each cycle with its ``Cycle``, in numbers of the packing. ``assoc.solvers.pheromone``
        gives the same by tuples of the problem.
    advise : bool, default True
        Whether to warn of costs that hardly mean what they should. Trackers, whose costs are in order, do not ask.
    proof : path-like, optional
        Write a proof of the answer there, as JSON, that ``python -m assoc.check`` replays in exact arithmetic
        (``assoc.proofs.write_proof``). It is found after the answer, and has no time limit.
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

    Warns
    -----
    AssocWarning
        No tuple costs less than its measurements as false alarms, so that nothing can be a target.
    """
    started, compiled = time.perf_counter(), compile_seconds()
    if not isinstance(problem, AssignmentProblem):
        raise InvalidInputError(f"problem: expected an AssignmentProblem, got {type(problem).__name__}")
    chosen = registry.make_parameters(solver, parameters)
    solve = registry.solver(solver)
    limit = checked_time_limit(time_limit)
    if proof is not None:
        check_writable(proof)
    run = Run(_seed(seed), time_limit=limit, callback=callback, watch=watch, started=started, compiled=compiled)
    with interruptible():
        prepared = prepare(problem)
        run.offset = prepared.offset
        packing = prepared.packing
        estimate = chosen.memory(packing.num_columns, packing.num_rows)
        if estimate is not None:
            memory.require(*estimate)
        if solver != "greedy":
            prepare_fallback(packing, run)
        try:
            outcome = solve(packing, chosen, run)
        except InfeasibleError:
            if run.fallback is None:
                raise
            outcome = Outcome(run.fallback, 0)
        if run.stopped_by == "time_limit":
            outcome = _not_worse(packing, outcome, run)
        solution = certify(problem, prepared, outcome, run, solver, chosen)
        if proof is not None:
            from assoc.proofs import write_proof  # loads what few calls need

            write_proof(proof, problem, solution)
    # only where nothing was found is it worth a look why
    if advise and problem.dummy and not (np.count_nonzero(solution.tuples, axis=1) > 1).any():
        for line in doubts_about_costs(problem):
            warn(line)
    return solution


def _not_worse(packing: Packing, outcome: Outcome, run: Run) -> Outcome:
    """Take the greedy choice where the solver's is worse when time is over."""
    columns = np.asarray(outcome.columns, dtype=np.int64)
    better = better_of(packing, columns, run)
    if better is columns:
        return outcome
    run.record(outcome.iterations, float(packing.weights[better].sum()), outcome.lower_bound)
    return replace(outcome, columns=better)


def _seed(seed: object) -> int | np.random.SeedSequence | np.random.Generator:
    if isinstance(seed, (np.random.Generator, np.random.SeedSequence)):
        return seed
    if isinstance(seed, (int, np.integer)) and not isinstance(seed, bool) and seed >= 0:
        return int(seed)
    raise InvalidInputError(f"seed: expected a whole number >= 0, got {seed!r}")


def checked_time_limit(time_limit: object) -> float | None:
    """Return a time limit as a float, or None; refuse what is no number of seconds above 0."""
    if time_limit is None:
        return None
    if isinstance(time_limit, Real) and not isinstance(time_limit, bool) and float(time_limit) > 0:
        return float(time_limit)
    raise InvalidInputError(f"time_limit: expected seconds > 0, got {time_limit!r}")
