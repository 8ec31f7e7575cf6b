"""CP-SAT, with integer costs; their rounding is subtracted from the bound."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from assoc._system.compile_time import loading
from assoc._system.interrupts import StopSignal
from assoc.packing.packing import Packing
from assoc.solvers.milp.answer import Answer, most_columns, solution_or_none
from assoc.solvers.milp.parameters import MilpParameters

# largest rounding of a whole solution's costs
_ROUNDING = 1e-7
# CP-SAT's sums must stay below 2^63, and its presolve, which substitutes equations, needs some more room
_LARGEST_SUM = 57


def solve_by_cp_sat(
    packing: Packing,
    parameters: MilpParameters,
    seconds: float,
    start: NDArray[np.integer] | None,
    stop: StopSignal | None,
) -> Answer:
    """Solve by CP-SAT on integer weights, starting from the columns of a known solution."""
    # imported here: not needed with the other backends
    with loading():
        from ortools.sat import cp_model_pb2
        from ortools.sat.python import cp_model

    exponent = _integer_exponent(packing)
    scaled = np.ldexp(packing.weights, exponent)
    integers = np.rint(scaled)
    model = cp_model.CpModel()
    take = [model.new_bool_var("") for _ in range(packing.num_columns)]
    for r, slack in enumerate(packing.slack.tolist()):
        members = [take[j] for j in packing.row_cols[packing.row_ptr[r] : packing.row_ptr[r + 1]].tolist()]
        if slack:
            model.add_at_most_one(members)
        else:
            model.add_exactly_one(members)
    model.minimize(cp_model.LinearExpr.weighted_sum(take, integers.astype(np.int64).tolist()))
    if start is not None:
        chosen_before = np.isin(np.arange(packing.num_columns), start).tolist()
        for variable, value in zip(take, chosen_before, strict=True):
            model.add_hint(variable, value)
    solver = cp_model.CpSolver()
    solver.parameters.num_workers = parameters.workers
    solver.parameters.relative_gap_limit = 0.0
    solver.parameters.absolute_gap_limit = 0.0
    if math.isfinite(seconds):
        solver.parameters.max_time_in_seconds = max(seconds, 0.001)
    if stop is not None:
        stop.connect(solver.stop_search)
    status = solver.solve(model)
    states = cp_model_pb2.CpSolverStatus
    columns = None
    if status in (states.OPTIMAL, states.FEASIBLE):
        chosen = np.fromiter((solver.boolean_value(x) for x in take), dtype=np.bool_, count=len(take))
        columns = solution_or_none(packing, np.flatnonzero(chosen))
    rounding = float(np.abs(scaled - integers).max()) * most_columns(packing)
    # CP-SAT reports 0 while it has no bound
    least = float(integers[integers < 0].sum())
    bound = solver.best_objective_bound
    known = status == states.OPTIMAL or (status == states.FEASIBLE and bound != 0.0)
    return Answer(
        columns,
        math.ldexp((bound if known else least) - rounding, -exponent),
        status == states.OPTIMAL and columns is not None,
        status == states.INFEASIBLE,
        int(solver.num_branches),
    )


def _integer_exponent(packing: Packing) -> int:
    """Return k, the exponent: weights times 2^k are rounded to integers."""
    # frexp: x < 2^e
    room = _LARGEST_SUM - math.frexp(float(np.abs(packing.weights).sum()))[1]
    rounding = _ROUNDING * min(1.0, float(np.abs(packing.weights).max()))
    wanted = math.frexp(0.5 * most_columns(packing) / rounding)[1] if rounding > 0.0 else 0
    return min(room, wanted)
