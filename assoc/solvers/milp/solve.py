"""Mixed-integer programming by OR-Tools: the field's general exact methods behind the same door.

The model is the packing itself: x_j in {0, 1} for each column, for each row sum x_j <= 1, or = 1 where the
row has no slack. The backends are

- ``scip`` and ``highs``: float costs, scaled by a power of two (exact) so that the largest is of order 100;
  relative gap, dual feasibility and integrality tolerances 1e-9, all set explicitly. The bound reported is
  theirs less what these tolerances can add up to.
- ``cp_sat``: integer costs round(2^k w). k is the largest with sum |2^k w| < 2^57, but no larger than
  needed to keep the rounding of a whole solution below 1e-7 (or 1e-7 max |w|, if smaller). The largest
  rounding that occurred, times the columns a solution can have, is taken off its bound.

When the time is over the better of the backend's solution and a greedy one, improved by insertion, is
returned, with the better of the backend's bound and the dual bound. A backend that is not back by then is left
behind in a thread of its own.
"""

from __future__ import annotations

import atexit
import datetime
import math
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system import memory
from assoc.packing.run import Outcome, Run
from assoc.solvers.milp.parameters import MilpParameters

if TYPE_CHECKING:
    from assoc.packing.packing import Packing


_TOLERANCE = 1e-9
_LARGEST_COST = 7  # costs for the float backends are below 2^7
_ROUNDING = 1e-7
# CP-SAT's sums must stay below 2^63, and its presolve, which substitutes equations, needs room for some more
_LARGEST_SUM = 57
# bytes for each tuple of three sensors, measured on 1e5 tuples (docs/reliability.md)
_MODEL = {"scip": 7_000.0, "cp_sat": 6_000.0, "highs": 2_300.0}
# seconds that CP-SAT is given to stop when Python ends
_FAREWELL = 10.0
# seconds that a model takes for each entry of its matrix, at the least (measured: 1.3e-6 and 2.8e-6)
_ENTRY_MATH_OPT, _ENTRY_CP_SAT = 3e-6, 6e-6


class _Answer(NamedTuple):
    """A backend's answer in the packing's own units."""

    columns: NDArray[np.int64] | None
    bound: float
    proven: bool
    infeasible: bool
    nodes: int


def solve(packing: Packing, parameters: MilpParameters, run: Run) -> Outcome:
    """Solve by branch and cut; one iteration is one node (or branch of CP-SAT).

    Raises
    ------
    InfeasibleError
        There is no solution, or none was found in the time.
    """
    from assoc.packing.bounds.dual_ascent import certified_bound, dual_bound
    from assoc.packing.branching.feasibility import infeasible

    if packing.num_columns == 0:
        if packing.is_axial:
            raise infeasible(packing)
        return Outcome(np.zeros(0, dtype=np.int64), 0, 0.0)
    _require_memory(packing, parameters)
    bound, duals = -math.inf, None
    columns: NDArray[np.integer] | None = None
    if run.time_limit is None:
        answer = _backend(packing, parameters, math.inf, _Stop())
    else:
        # made first: when the time is over it would be too late
        columns = _quick(packing, run)
        duals = dual_bound(packing, run=Run(run.rng, time_limit=0.3 * run.time_limit, started=run.started))
        bound = certified_bound(packing, duals)
        answer = _within(packing, parameters, run)
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


def _require_memory(packing: Packing, parameters: MilpParameters) -> None:
    """Refuse a model that would take more memory than there is."""
    workers = parameters.workers if parameters.backend == "cp_sat" else 1
    # with each worker come a stack and a copy of the model
    needed = _MODEL[parameters.backend] * packing.num_columns * (1.0 + 0.5 * (workers - 1)) + 10e6 * (workers - 1)
    memory.require(
        needed,
        f"milp: backend {parameters.backend} on {packing.num_columns} tuples"
        + (f" with workers = {workers}" if workers > 1 else ""),
        "take fewer workers" if workers > 1 else "take solver exact, which needs less",
    )


class _Stop:
    """What ends a backend that is at work in another thread."""

    def __init__(self) -> None:
        self._over = False
        self._stop: Callable[[], object] | None = None

    def by(self, stop: Callable[[], object]) -> None:
        """Say how the backend is stopped, before it starts."""
        self._stop = stop
        if self._over:
            stop()

    def __call__(self) -> None:
        self._over = True
        if self._stop is not None:
            self._stop()


_left: list[threading.Thread] = []


def _leave(thread: threading.Thread) -> None:
    """Leave a thread behind that was told to stop; when Python ends, it is given some seconds to do so.

    CP-SAT would take the whole process with it (SIGABRT, whatever the program's exit code was to be).
    """
    if not _left:
        # registered once more where all have ended: that does no harm
        atexit.register(_take_leave)
    _left[:] = [one for one in _left if one.is_alive()]
    _left.append(thread)


def _take_leave() -> None:
    for one in _left:
        one.join(_FAREWELL)


def _backend(packing: Packing, parameters: MilpParameters, seconds: float, stop: _Stop) -> _Answer:
    if parameters.backend == "cp_sat":
        return _cp_sat(packing, parameters, seconds, stop)
    # MathOpt's own interrupter makes SCIP 9 complain on stderr: its time limit must do
    return _math_opt(packing, parameters, seconds)


def _within(packing: Packing, parameters: MilpParameters, run: Run) -> _Answer:
    """Solve in the time that is left, or give up.

    Backends look at the clock between steps of their own, and before their first step not at all: a large one
    may be late by many seconds. So the backend works in a thread, which is left behind when time is over (CP-
    SAT is told to stop); and where already the model would take longer than there is time it is not made.
    """
    entry = _ENTRY_CP_SAT if parameters.backend == "cp_sat" else _ENTRY_MATH_OPT
    nothing = _Answer(None, -math.inf, False, False, 0)
    if run.remaining() < entry * packing.row_cols.size:
        run.stopped_by = run.stopped_by or "time_limit"
        return nothing
    answers: list[_Answer | BaseException] = []
    stop = _Stop()

    def work() -> None:
        try:
            answers.append(_backend(packing, parameters, 0.98 * run.remaining(), stop))
        except BaseException as error:  # handed to the caller below
            answers.append(error)

    thread = threading.Thread(target=work, name="milp", daemon=True)
    thread.start()
    thread.join(max(run.remaining(), 0.0))
    if not answers:
        stop()
        if parameters.backend == "cp_sat":
            _leave(thread)
        run.stopped_by = run.stopped_by or "time_limit"
        return nothing
    if isinstance(answers[0], BaseException):
        raise answers[0]
    return answers[0]


def _quick(packing: Packing, run: Run) -> NDArray[np.integer] | None:
    """Return a greedy solution improved by insertion; None if there is none."""
    from assoc.packing.kernels.sorting import ascending
    from assoc.packing.neighbourhoods.cover import Cover

    if run.fallback is None:
        cover = Cover.empty(packing)
        cover.add_greedily(ascending(packing.weights))
    else:
        cover = Cover.of(packing, run.fallback)
    cover.improve(run.deadline())
    return cover.columns() if cover.complete(run) else None


def _better(
    packing: Packing, one: NDArray[np.integer] | None, other: NDArray[np.integer] | None
) -> NDArray[np.integer] | None:
    """Return the lighter of two solutions, of which there may be none."""
    if one is None or other is None:
        return other if one is None else one
    return one if float(packing.weights[one].sum()) <= float(packing.weights[other].sum()) else other


def _most_columns(packing: Packing) -> int:
    """Return how many columns a solution can have at the most."""
    sizes = np.count_nonzero(packing.cols >= 0, axis=1)
    return packing.num_rows // max(int(sizes.min()), 1)


def _math_opt(packing: Packing, parameters: MilpParameters, seconds: float) -> _Answer:
    """Solve by SCIP or HiGHS through MathOpt."""
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
    result = mathopt.solve(model, kind, params=options)
    reason = result.termination.reason
    columns = None
    if result.has_primal_feasible_solution():
        values = np.array(list(result.variable_values().values()))
        columns = _checked(packing, np.flatnonzero(values > 0.5))
    bound = result.best_objective_bound()
    # reduced costs may be negative by the tolerance, in each column of a solution; nodes are cut off by gap
    bound -= _TOLERANCE * (_most_columns(packing) + 2.0 * abs(bound)) if math.isfinite(bound) else 0.0
    return _Answer(
        columns,
        -math.inf if math.isnan(bound) or bound == math.inf else math.ldexp(bound, -exponent),
        reason == mathopt.TerminationReason.OPTIMAL and columns is not None,
        reason == mathopt.TerminationReason.INFEASIBLE,
        int(result.solve_stats.node_count),
    )


def _model(packing: Packing, weights: NDArray[np.float64]) -> Any:
    """Return the packing as MathOpt's protocol buffer: much quicker to fill than a model by names."""
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


def _cp_sat(packing: Packing, parameters: MilpParameters, seconds: float, stop: _Stop) -> _Answer:
    """Solve by CP-SAT on integer weights."""
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
    solver = cp_model.CpSolver()
    solver.parameters.num_workers = parameters.workers
    solver.parameters.relative_gap_limit = 0.0
    solver.parameters.absolute_gap_limit = 0.0
    if math.isfinite(seconds):
        solver.parameters.max_time_in_seconds = max(seconds, 0.001)
    stop.by(solver.stop_search)
    status = solver.solve(model)
    states = cp_model_pb2.CpSolverStatus
    columns = None
    if status in (states.OPTIMAL, states.FEASIBLE):
        chosen = np.fromiter((solver.boolean_value(x) for x in take), dtype=np.bool_, count=len(take))
        columns = _checked(packing, np.flatnonzero(chosen))
    rounding = float(np.abs(scaled - integers).max()) * _most_columns(packing)
    # before CP-SAT has a bound of its own, it reports 0
    least = float(integers[integers < 0].sum())
    bound = solver.best_objective_bound
    known = status == states.OPTIMAL or (status == states.FEASIBLE and bound != 0.0)
    return _Answer(
        columns,
        math.ldexp((bound if known else least) - rounding, -exponent),
        status == states.OPTIMAL and columns is not None,
        status == states.INFEASIBLE,
        int(solver.num_branches),
    )


def _integer_exponent(packing: Packing) -> int:
    """Return k: weights times 2^k are rounded to integers."""
    # frexp: x < 2^e
    room = _LARGEST_SUM - math.frexp(float(np.abs(packing.weights).sum()))[1]
    rounding = _ROUNDING * min(1.0, float(np.abs(packing.weights).max()))
    wanted = math.frexp(0.5 * _most_columns(packing) / rounding)[1] if rounding > 0.0 else 0
    return min(room, wanted)


def _checked(packing: Packing, columns: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """Return the columns if they are a solution, else None."""
    rows = packing.cols[columns]
    covered = np.bincount(rows[rows >= 0], minlength=packing.num_rows)
    wrong = (covered > 1).any() or (covered[~packing.slack] != 1).any()
    return None if wrong else columns


parameters = MilpParameters
