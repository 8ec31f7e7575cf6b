"""SCIP and HiGHS through MathOpt, with float costs; their tolerances are subtracted from the bound."""

from __future__ import annotations

import datetime
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.compile_time import loading
from assoc.packing.packing import Packing
from assoc.solvers.milp.answer import Answer, most_columns, solution_or_none
from assoc.solvers.milp.parameters import MilpParameters

# relative gap, dual feasibility and integrality
_TOLERANCE = 1e-9
# scaled costs are below 2^7
_LARGEST_COST = 7


def solve_by_math_opt(
    packing: Packing, parameters: MilpParameters, seconds: float, start: NDArray[np.integer] | None
) -> Answer:
    """Solve by SCIP or HiGHS through MathOpt; SCIP starts from the columns of a known solution."""
    # imported here: not needed with the other backend
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
    columns = None
    if result.has_primal_feasible_solution():
        values = np.array(list(result.variable_values().values()))
        columns = solution_or_none(packing, np.flatnonzero(values > 0.5))
    bound = result.best_objective_bound()
    # the reduced cost of each column in a solution may be negative by the tolerance; nodes are pruned by the gap
    bound -= _TOLERANCE * (most_columns(packing) + 2.0 * abs(bound)) if math.isfinite(bound) else 0.0
    return Answer(
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
