"""Mixed-integer programming by OR-Tools: general exact solvers with the interface of the others.

The model is the packing itself: x_j in {0, 1} for each column, for each row sum x_j <= 1, or = 1 where the
row has no slack. The backends, ``scip`` and ``highs``, take float costs, scaled by a power of two (exact) so that the
largest is of order 100; relative gap, dual feasibility and integrality tolerances are 1e-9, all set explicitly. What
these tolerances can add up to is subtracted from the backend's bound.

At the time limit the better of the backend's solution and a greedy one, improved by insertion, is returned, with the
better of the backend's bound and the dual bound. A backend that has not returned by then is abandoned in its thread.
"""

from __future__ import annotations

import datetime
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compile_time import loading
from assoc._system.interrupts import in_time
from assoc._system.kernels.sorting import ascending
from assoc.packing.bounds.dual_ascent import certified_bound, dual_bound
from assoc.packing.cover import Cover
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run, infeasible
from assoc.solvers.milp.parameters import MilpParameters

# least seconds that building a model takes for each entry of its matrix (measured: 1.3e-6)
_ENTRY = 3e-6
# relative gap, dual feasibility and integrality
_TOLERANCE = 1e-9
# scaled costs are below 2^7
_LARGEST_COST = 7


class _Answer(NamedTuple):
    """A backend's answer."""

    columns: NDArray[np.int64] | None
    """The chosen columns, where there is a solution."""
    bound: float
    """No solution has less weight; -inf where the backend has no bound."""
    proven: bool
    """Whether the columns are optimal."""
    infeasible: bool
    """Whether there is no solution."""
    nodes: int
    """Nodes of the search."""


def solve(packing: Packing, parameters: MilpParameters, run: Run) -> Outcome:
    """Solve by branch and cut; one iteration is one node.

    Raises
    ------
    InfeasibleError
        There is no solution, or none was found in time.
    """
    if packing.num_columns == 0:
        if packing.is_axial:
            raise infeasible(packing)
        return Outcome(np.zeros(0, dtype=np.int64), 0, 0.0)
    bound, duals = -math.inf, None
    columns: NDArray[np.integer] | None = None
    if run.time_limit is not None:
        # computed first: at the time limit it would be too late
        columns = _quick(packing, run)
        duals = dual_bound(packing, run=run.part(run.rng, 0.3 * run.time_limit))
        bound = certified_bound(packing, duals)
    answer = _solve_in_time(packing, parameters, run)
    if answer.infeasible:
        raise infeasible(packing)
    if not answer.proven:
        if run.time_limit is None:
            columns = _quick(packing, run)
        run.should_stop()
    columns = _better(packing, answer.columns, columns)
    if columns is None:
        raise infeasible(packing, run)
    if answer.bound > bound:
        bound, duals = answer.bound, None
    run.record(answer.nodes, float(packing.weights[columns].sum()), bound)
    return Outcome(columns, answer.nodes, bound, duals)


def _solve_in_time(packing: Packing, parameters: MilpParameters, run: Run) -> _Answer:
    """Solve in the remaining time, or give up; Ctrl-C is handled meanwhile.

    Backends check the time only between their own steps, and not before the first: on a large problem they may be late
    by many seconds. So the backend works in a thread, which is abandoned at the time limit. A model that
    would take longer to build than the time left is not built.
    """
    answer = None
    if run.remaining() >= _ENTRY * packing.row_cols.size:
        # with MathOpt's interrupter SCIP 9 prints warnings on stderr: use its time limit instead
        answer = in_time(
            lambda: _by_math_opt(packing, parameters, 0.98 * run.remaining(), run.start), run.remaining(), "milp"
        )
    # a backend with no more to say has used up the share of the time that it was given
    if answer is None or (run.time_limit is not None and not (answer.proven or answer.infeasible)):
        run.stopped_by = run.stopped_by or "time_limit"
    return _Answer(None, -math.inf, False, False, 0) if answer is None else answer


def _quick(packing: Packing, run: Run) -> NDArray[np.integer] | None:
    """Return a greedy solution improved by insertion; None if there is none."""
    if run.fallback is None:
        cover = Cover.empty(packing)
        cover.add_greedily(ascending(packing.weights))
    else:
        cover = Cover.of(packing, run.fallback)
    cover.improve(run.deadline())
    return cover.columns() if cover.complete(run) else None


def _better(
    packing: Packing, first: NDArray[np.integer] | None, second: NDArray[np.integer] | None
) -> NDArray[np.integer] | None:
    """Return the solution of less weight; either may be missing."""
    if first is None or second is None:
        return second if first is None else first
    return first if float(packing.weights[first].sum()) <= float(packing.weights[second].sum()) else second


def _by_math_opt(
    packing: Packing, parameters: MilpParameters, seconds: float, start: NDArray[np.integer] | None
) -> _Answer:
    """Solve by SCIP or HiGHS through MathOpt; SCIP starts from the columns of a known solution."""
    # imported here: it takes long
    with loading():
        from ortools.math_opt.python import mathopt

    exponent = _LARGEST_COST - math.frexp(float(np.abs(packing.weights).max()))[1]
    model = mathopt.Model.from_model_proto(_model(packing, np.ldexp(packing.weights, exponent)))
    kind = mathopt.SolverType.GSCIP if parameters.backend == "scip" else mathopt.SolverType.HIGHS
    options = mathopt.SolveParameters(relative_gap_tolerance=_TOLERANCE, absolute_gap_tolerance=_TOLERANCE)
    if math.isfinite(seconds):
        options.time_limit = datetime.timedelta(seconds=max(seconds, 0.001))
    if parameters.backend == "scip":
        options.threads = parameters.workers
        options.gscip.real_params["numerics/feastol"] = _TOLERANCE
        options.gscip.real_params["numerics/dualfeastol"] = _TOLERANCE
    else:
        for name in ("mip_feasibility", "primal_feasibility", "dual_feasibility"):
            options.highs.double_options[f"{name}_tolerance"] = _TOLERANCE
    known = mathopt.ModelSolveParameters()
    if start is not None and parameters.backend == "scip":  # MathOpt passes no hints to HiGHS
        values = np.isin(np.arange(packing.num_columns), start).astype(float).tolist()
        known.solution_hints = [mathopt.SolutionHint(dict(zip(model.variables(), values, strict=True)))]
    result = mathopt.solve(model, kind, params=options, model_params=known)
    reason = result.termination.reason
    columns: NDArray[np.int64] | None = None
    if result.has_primal_feasible_solution():
        values = np.array(list(result.variable_values().values()))
        found = np.flatnonzero(values > 0.5)
        rows = packing.cols[found]
        covered = np.bincount(rows[rows >= 0], minlength=packing.num_rows)
        if (covered <= 1).all() and (covered[~packing.slack] == 1).all():
            columns = found
    bound = result.best_objective_bound()
    # the reduced cost of each column in a solution may be negative by the tolerance; nodes are pruned by the gap
    most_columns = packing.num_rows // max(int(np.count_nonzero(packing.cols >= 0, axis=1).min()), 1)
    bound -= _TOLERANCE * (most_columns + 2.0 * abs(bound)) if math.isfinite(bound) else 0.0
    return _Answer(
        columns,
        -math.inf if math.isnan(bound) or bound == math.inf else math.ldexp(bound, -exponent),
        reason == mathopt.TerminationReason.OPTIMAL and columns is not None,
        reason == mathopt.TerminationReason.INFEASIBLE,
        int(result.solve_stats.node_count),
    )


def _model(packing: Packing, weights: NDArray[np.float64]) -> Any:
    """Return the packing as MathOpt's protocol buffer, which is much quicker to fill than a model by names."""
    from ortools.math_opt import model_pb2

    num, rows = packing.num_columns, packing.num_rows
    proto = model_pb2.ModelProto()
    proto.variables.ids.extend(range(num))
    proto.variables.lower_bounds.extend([0.0] * num)
    proto.variables.upper_bounds.extend([1.0] * num)
    proto.variables.integers.extend([True] * num)
    proto.objective.linear_coefficients.ids.extend(range(num))
    proto.objective.linear_coefficients.values.extend(weights.tolist())
    proto.linear_constraints.ids.extend(range(rows))
    proto.linear_constraints.lower_bounds.extend((~packing.slack).astype(float).tolist())
    proto.linear_constraints.upper_bounds.extend([1.0] * rows)
    matrix = proto.linear_constraint_matrix
    matrix.row_ids.extend(np.repeat(np.arange(rows), np.diff(packing.row_ptr)).tolist())
    matrix.column_ids.extend(packing.row_cols.tolist())
    matrix.coefficients.extend([1.0] * packing.row_cols.size)
    return proto
