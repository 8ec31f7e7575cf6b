"""``assign``: the entrance to all solvers; checks their input and certifies their output."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assoc._files.output import FilePath, check_writable
from assoc._parameters import Parameters, checked_time_limit, whole_seed
from assoc._system import memory
from assoc._system.compile_time import compile_seconds
from assoc._system.interrupts import interruptible
from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InfeasibleError, InvalidInputError, warn
from assoc.packing.cover import Cover
from assoc.packing.packing import Packing
from assoc.packing.prepare import Prepared, prepare, with_capped_costs
from assoc.packing.run import Callback, Outcome, Run, SolveFunction
from assoc.problem import AssignmentProblem, taken_problem
from assoc.solution import Solution
from assoc.solvers import registry
from assoc.solvers.certificate import certify, costs_of
from assoc.solvers.greedy.fallback import better_of, prepare_fallback
from assoc.solvers.methods import EXACT_METHODS
from assoc.solvers.pairs import proved_pairs
from assoc.solvers.plausibility import cost_warnings

# reasons that end a call, however good its answer is
_EARLY = ("time_limit", "callback", "interrupted", "memory_limit")


@explains_wrong_types
def assign(
    problem: AssignmentProblem | ArrayLike,
    solver: str = "exact",
    *,
    seed: int | np.random.SeedSequence | np.random.Generator | None = 0,
    time_limit: float | None = None,
    callback: Callback | None = None,
    start: Solution | None = None,
    watch: Callable[[Any], object] | None = None,
    advise: bool = True,
    proof: FilePath | None = None,
    **parameters: Any,
) -> Solution:
    """Solve an assignment problem.

    Parameters
    ----------
    problem : AssignmentProblem or array_like
        The problem to solve. An array of costs is taken as by scipy's ``linear_sum_assignment``, whose rows and columns
        are then ``solution.pairs``.
    solver : str, default "exact"
        One of ``assoc.solvers.names()``.
    seed : int, SeedSequence, Generator or None, default 0
        Source of all randomness: the same seed gives the same solution; None: a random seed.
    time_limit : float, optional
        Seconds, after which the best solution found is returned; compiling kernels does not count.
    callback : callable, optional
        Called with each ``TracePoint``; if it returns a true value the solver stops.
    start : Solution, optional
        A solution to begin with, from another solver or an earlier call: the answer costs no more.
        One of an earlier problem is used as far as this problem has its tuples.
    watch : callable, optional
        For ``aco``: called after each cycle with its ``Cycle``: pheromone, visibility and probability of the tuples.
        With several ``workers`` it is called from their threads. ``assoc.solvers.pheromone`` keeps all cycles.
    advise : bool, default True
        Whether to warn of costs that are probably not likelihood ratios. Trackers switch it off.
    proof : path-like, optional
        Write a proof of the answer to this file, without time limit; see ``assoc.proofs.write_proof``.
    **parameters
        Parameters of the solver (``assoc.solvers.parameters(name)``).

    Returns
    -------
    Solution
        Feasible, with a lower bound that is valid for every solver.

    Raises
    ------
    InvalidInputError
        Unknown solver or parameter, a value out of range, or a start that does not fit the problem.
    InfeasibleError
        The problem (without dummies) has no solution, or the solver found none in its time.
    LimitExceededError
        The solver would need more memory than is available.

    Warns
    -----
    AssocWarning
        No tuple costs less than its measurements as false alarms. The proof could not be written. An array may be
        meant in another way. Costs are so large that rounding keeps the answer from being proved.
    """
    options: Any = {"started": time.perf_counter(), "compiled": compile_seconds(), "callback": callback, "watch": watch}
    problem = taken_problem(problem)
    chosen = registry.make_parameters(solver, parameters)
    make_run = partial(Run, _seed(seed), time_limit=checked_time_limit(time_limit), **options)
    for name in ("callback", "watch"):
        if options[name] is not None and not callable(options[name]):
            raise InvalidInputError(f"{name}: expected a function, got {type(options[name]).__name__}")
    if proof is not None:
        check_writable(proof)
    with interruptible():
        solution = _solution(problem, (solver, registry.solver(solver)), chosen, make_run, start)
        if proof is not None:
            _prove(proof, problem, solution)
    _warn_of_rounding(problem, solution)
    # checked only where nothing was found: every column of a problem with dummies is a target
    if advise and problem.dummy and len(solution.tuples) == problem.sizes.sum():
        for line in cost_warnings(problem):
            warn(line)
    return solution


def _prove(file: FilePath, problem: AssignmentProblem, solution: Solution) -> None:
    """Write a proof; the answer is returned even where that fails."""
    from assoc.proofs import write_proof  # loads what few calls need

    try:
        write_proof(file, problem, solution)
    except ValueError as error:
        warn(f"proof: not written: {error}")


def _solution(
    problem: AssignmentProblem,
    called: tuple[str, SolveFunction],
    chosen: Parameters,
    make_run: Callable[[], Run],
    start: Solution | None,
) -> Solution:
    """Solve a problem, first with large costs lowered; again, from there, while the answer has one of these."""
    at_once = proved_pairs(problem, make_run(), chosen) if called[0] == "exact" and start is None else None
    if at_once is not None:
        return at_once
    for posed in with_capped_costs(problem):
        run = make_run()
        run.methods = EXACT_METHODS
        run.unit, run.trace_ceiling = posed.unit, posed.trace_ceiling
        solution = start = posed.restored(problem, _answer(problem, posed.problem, called, chosen, run, start))
        if not posed.alters(solution) or run.stopped_by in _EARLY:
            break
    return solution


def _answer(
    whole: AssignmentProblem,
    problem: AssignmentProblem,
    called: tuple[str, SolveFunction],
    chosen: Parameters,
    run: Run,
    start: Solution | None,
) -> Solution:
    """Run a solver, given by name and function, on a problem and certify its answer.

    Where costs were lowered for the solver, answer and start are compared by the original costs.
    """
    solver, solve = called
    prepared = prepare(problem, every_tuple=chosen.every_tuple)
    run.offset = prepared.offset
    packing = prepared.packing
    if run.watch is not None:
        run.watch = _by_tuple(run.watch, problem, packing)
    if start is not None:
        run.start = start_columns(problem, prepared, start, run)
    estimate = chosen.memory(packing.num_columns, packing.num_rows)
    if estimate is not None:
        memory.require(*estimate)
    if solver != "greedy":
        prepare_fallback(packing, run)
    try:
        outcome = solve(packing, chosen, run)
    except InfeasibleError:
        last_resort = run.start if run.fallback is None else run.fallback
        if last_resort is None:
            raise
        outcome = Outcome(last_resort, 0)
    others = [] if run.start is None else [run.start]
    if run.stopped_by == "time_limit":
        others.append(better_of(packing, np.asarray(outcome.columns, dtype=np.int64), run))
    for other in others:
        outcome = _cheaper(whole, prepared, outcome, other, run)
    return certify(problem, prepared, outcome, run, solver, chosen)


def _warn_of_rounding(problem: AssignmentProblem, solution: Solution) -> None:
    """Say so where large costs cancel, so that rounding alone is the gap of an answer."""
    if solution.status == "optimal" or not problem.num_tuples:
        return
    chosen = np.append(solution.indices, problem.costs.argmin())
    largest = int(chosen[np.abs(problem.costs[chosen]).argmax()])
    if solution.gap <= 1e-12 * abs(problem.costs[largest]):
        warn(
            f"costs[{largest}] = {problem.costs[largest]:.6g}: too large for doubles beside differences below"
            f" {solution.gap:.2g}; the solution may cost that much more than the best"
        )


def _by_tuple(watch: Callable[[Any], object], problem: AssignmentProblem, packing: Packing) -> Callable[[Any], object]:
    """Add tuples to the cycles that a solver reports: it knows only columns and rows."""

    def with_tuples(state: Any) -> object:
        add = getattr(state, "with_tuples", None)
        return watch(state if add is None else add(problem.tuples, problem.sizes, packing))

    return with_tuples


def _cheaper(
    problem: AssignmentProblem, prepared: Prepared, outcome: Outcome, other: NDArray[np.integer], run: Run
) -> Outcome:
    """Take the other choice if it costs less than the solver's: by costs, as sums of weights lose the last digits."""
    costs, its = costs_of(problem, prepared, outcome.columns), costs_of(problem, prepared, other)
    # a sum that is rounded only once has the sign of the exact one
    if costs is None or its is None or math.fsum([*its, *-costs]) >= 0.0:
        return outcome
    weight = float(prepared.packing.weights[other].sum())
    run.record(outcome.iterations, weight, min(outcome.lower_bound, weight))
    return replace(outcome, columns=other)


def _seed(seed: object) -> int | np.random.SeedSequence | np.random.Generator:
    if isinstance(seed, (np.random.Generator, np.random.SeedSequence)):
        return seed
    return whole_seed(seed)


def start_columns(
    problem: AssignmentProblem, prepared: Prepared, start: object, run: Run
) -> NDArray[np.integer] | None:
    """Return the columns of a packing that a start solution chooses, as far as the packing has them.

    Without dummies, rows that stay uncovered are covered by ejections; None where that fails. A start with other
    sensors, tuples that are not whole numbers, or a measurement in two is refused.
    """
    if not isinstance(start, Solution):
        raise InvalidInputError(f"start: expected a Solution, got {type(start).__name__}")
    tuples = np.asarray(start.tuples)
    if tuples.ndim != 2 or tuples.shape[1] != problem.num_sensors:
        shape = " x ".join(map(str, tuples.shape))
        raise InvalidInputError(f"start: expected tuples of {problem.num_sensors} sensors, got an array of {shape}")
    if tuples.size and (tuples.dtype.kind not in "iu" or tuples.min() < 0):
        found = tuples.min() if tuples.dtype.kind in "iu" else tuples.dtype
        raise InvalidInputError(f"start: expected tuples of whole numbers, 0 for a miss, got {found}")
    for s, column in enumerate(tuples.T):
        used = np.sort(column[column > 0])
        if (used[1:] == used[:-1]).any():
            numbers, counts = np.unique(used, return_counts=True)
            which, count = numbers[counts.argmax()], counts.max()
            raise InvalidInputError(
                f"start: expected every measurement once; measurement {which} of sensor {s + 1} is in {count} tuples"
            )
    tuples = tuples[(tuples <= problem.sizes).all(axis=1)].astype(np.int64)
    before = np.cumsum(problem.sizes) - problem.sizes
    packing = prepared.packing
    rows = np.where(packing.cols >= 0, packing.row_origin[packing.cols], -1) if packing.num_columns else packing.cols
    which = _indices_among(rows, np.where(tuples > 0, tuples + before - 1, -1))
    columns = np.flatnonzero(which >= 0)
    # the cheaper one of tuples that are listed twice is written last
    columns = columns[np.argsort(packing.weights[columns], kind="stable")[::-1]]
    found = np.full(len(tuples), -1)
    found[which[columns]] = columns
    columns = np.sort(found[found >= 0])
    cover = Cover.of(packing, columns)
    if cover.is_complete:
        return columns
    cover.improve(run.deadline())
    return cover.columns() if cover.is_complete else None


def _indices_among(rows: NDArray[np.integer], wanted: NDArray[np.integer]) -> NDArray[np.int64]:
    """Index of each line of rows (-1: none) among the wanted ones, which share no row; -1 where it is not there."""
    owner = np.full(max(int(rows.max(initial=-1)), int(wanted.max(initial=-1))) + 2, -1)
    for column in wanted.T:
        owner[column[column >= 0]] = np.flatnonzero(column >= 0)
    if not len(rows):
        return np.zeros(0, dtype=np.int64)
    index = owner[rows[np.arange(len(rows)), np.argmax(rows >= 0, axis=1)]]
    return np.where((index >= 0) & (rows == wanted[index]).all(axis=1), index, -1)
