"""Peers that are general solvers: how each is given the tuples, and what it chooses."""

import datetime
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csc_array

from assoc._types import Array, Ints
from assoc.problem import AssignmentProblem
from experiments.common.packing_peers import Chosen

CP_SAT_SCALE = 1e6


def _rows(problem: AssignmentProblem) -> tuple[Ints, Ints, Array]:
    """Return (measurement, tuple) of each non-zero index, and which measurements must be covered."""
    sizes = problem.sizes.astype(np.int64)
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    column, sensor = np.nonzero(problem.tuples)
    row = (offsets[sensor] + problem.tuples[column, sensor] - 1).astype(np.int64)
    must = np.repeat(problem.dummy | (sizes == sizes.min()), sizes)
    return row, column.astype(np.int64), must.astype(np.bool_)


def cp_sat(
    workers: int, problem: AssignmentProblem, time_limit: float, told: Callable[[float, float], bool] | None = None
) -> Chosen:
    """CP-SAT, which may be listened to as it finds solutions: `told` of a cost and a bound; a true answer stops it."""
    from ortools.sat import cp_model_pb2
    from ortools.sat.python import cp_model

    row, column, must = _rows(problem)
    model = cp_model.CpModel()
    take = [model.new_bool_var("") for _ in range(problem.num_tuples)]
    members: list[list[cp_model.IntVar]] = [[] for _ in must]
    for r, c in zip(row.tolist(), column.tolist(), strict=True):
        members[r].append(take[c])
    for needed, literals in zip(must.tolist(), members, strict=True):
        if needed:
            model.add_exactly_one(literals)
        else:
            model.add_at_most_one(literals)
    scaled = np.round(problem.costs * CP_SAT_SCALE).astype(np.int64)
    model.minimize(cp_model.LinearExpr.weighted_sum(take, scaled.tolist()))
    solver = cp_model.CpSolver()
    solver.parameters.num_workers = workers
    solver.parameters.max_time_in_seconds = time_limit
    solver.parameters.relative_gap_limit = 0.0
    status = solver.solve(model, None if told is None else _listener(told))
    # Each of at most sum(sizes) chosen tuples is off by half a unit at most.
    bound = solver.best_objective_bound / CP_SAT_SCALE - 0.5 * float(problem.sizes.sum()) / CP_SAT_SCALE
    if status not in (cp_model_pb2.CpSolverStatus.OPTIMAL, cp_model_pb2.CpSolverStatus.FEASIBLE):
        return None, bound, False
    values = np.fromiter((solver.boolean_value(x) for x in take), dtype=bool, count=len(take))
    return np.flatnonzero(values), bound, status == cp_model_pb2.CpSolverStatus.OPTIMAL


def _listener(told: Callable[[float, float], bool]) -> Any:
    from ortools.sat.python import cp_model

    class Listener(cp_model.CpSolverSolutionCallback):
        def on_solution_callback(self) -> None:
            if told(self.objective_value / CP_SAT_SCALE, self.best_objective_bound / CP_SAT_SCALE):
                self.stop_search()

    return Listener()


def scip(threads: int, problem: AssignmentProblem, time_limit: float) -> Chosen:
    """SCIP on so many threads."""
    from ortools.math_opt import model_pb2
    from ortools.math_opt.python import mathopt

    row, column, must = _rows(problem)
    order = np.lexsort((column, row))
    proto = model_pb2.ModelProto()
    num, rows = problem.num_tuples, len(must)
    proto.variables.ids.extend(range(num))
    proto.variables.lower_bounds.extend([0.0] * num)
    proto.variables.upper_bounds.extend([1.0] * num)
    proto.variables.integers.extend([True] * num)
    proto.objective.linear_coefficients.ids.extend(range(num))
    proto.objective.linear_coefficients.values.extend(problem.costs.tolist())
    proto.linear_constraints.ids.extend(range(rows))
    proto.linear_constraints.lower_bounds.extend(must.astype(float).tolist())
    proto.linear_constraints.upper_bounds.extend([1.0] * rows)
    proto.linear_constraint_matrix.row_ids.extend(row[order].tolist())
    proto.linear_constraint_matrix.column_ids.extend(column[order].tolist())
    proto.linear_constraint_matrix.coefficients.extend([1.0] * len(row))
    result = mathopt.solve(
        mathopt.Model.from_model_proto(proto),
        mathopt.SolverType.GSCIP,
        params=mathopt.SolveParameters(
            threads=threads, relative_gap_tolerance=0.0, time_limit=datetime.timedelta(seconds=time_limit)
        ),
    )
    bound = result.best_objective_bound()
    if not result.has_primal_feasible_solution():
        return None, bound, False
    values = np.array(list(result.variable_values().values()))
    return np.flatnonzero(values > 0.5), bound, result.termination.reason == mathopt.TerminationReason.OPTIMAL


def by_milp(problem: AssignmentProblem, time_limit: float, forbidden: Iterable[Ints] = ()) -> Any:
    """HiGHS's result; forbidden are solutions that do not count, each by the indices of its tuples."""
    row, column, must = _rows(problem)
    matrix = csc_array((np.ones(row.size), (row, column)), shape=(len(must), problem.num_tuples))
    constraints = [LinearConstraint(matrix, must.astype(float), 1.0)]
    for indices in forbidden:
        taken = np.isin(np.arange(problem.num_tuples), indices).astype(float)
        constraints.append(LinearConstraint(taken, ub=taken.sum() - 1.0))
    return milp(
        problem.costs,
        integrality=np.ones(problem.num_tuples, dtype=np.int64),
        bounds=Bounds(0, 1),
        constraints=constraints,
        # 0 would mean "the default, 1e-4", and wrong answers called optimal
        options={"mip_rel_gap": 1e-9, "time_limit": time_limit},
    )


def highs(problem: AssignmentProblem, time_limit: float) -> Chosen:
    """HiGHS on one thread."""
    result = by_milp(problem, time_limit)
    bound = None if result.mip_dual_bound is None else float(result.mip_dual_bound)
    if result.x is None:
        return None, bound, False
    return np.flatnonzero(result.x > 0.5), bound, result.status == 0
