"""Mixed-integer programming by OR-Tools: general exact solvers with the interface of the others.

The model is the packing itself: x_j in {0, 1} for each column, for each row sum x_j <= 1, or = 1 where the
row has no slack. The backends, ``scip`` and ``highs``, take float costs, scaled by a power of two (exact) so that the
largest is of order 100; relative gap, dual feasibility and integrality tolerances are 1e-9, all set explicitly. What
these tolerances can add up to is subtracted from the backend's bound.

At the time limit the better of the backend's solution and a greedy one, improved by insertion, is returned, with the
better of the backend's bound and the dual bound. A backend that has not returned by then is abandoned in its thread.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from assoc._system.interrupts import in_time
from assoc._system.kernels.sorting import ascending
from assoc.packing.bounds.dual_ascent import certified_bound, dual_bound
from assoc.packing.cover import Cover
from assoc.packing.packing import Packing
from assoc.packing.run import Outcome, Run, infeasible
from assoc.solvers.milp.answer import Answer
from assoc.solvers.milp.math_opt import solve_by_math_opt
from assoc.solvers.milp.parameters import MilpParameters

# least seconds that building a model takes for each entry of its matrix (measured: 1.3e-6)
_ENTRY = 3e-6


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


def _solve_in_time(packing: Packing, parameters: MilpParameters, run: Run) -> Answer:
    """Solve in the remaining time, or give up; Ctrl-C is handled meanwhile.

    Backends check the time only between their own steps, and not before the first: on a large problem they may be late
    by many seconds. So the backend works in a thread, which is abandoned at the time limit. A model that
    would take longer to build than the time left is not built.
    """
    answer = None
    if run.remaining() >= _ENTRY * packing.row_cols.size:
        # with MathOpt's interrupter SCIP 9 prints warnings on stderr: use its time limit instead
        answer = in_time(
            lambda: solve_by_math_opt(packing, parameters, 0.98 * run.remaining(), run.start), run.remaining(), "milp"
        )
    # a backend with no more to say has used up the share of the time that it was given
    if answer is None or (run.time_limit is not None and not (answer.proven or answer.infeasible)):
        run.stopped_by = run.stopped_by or "time_limit"
    return Answer(None, -math.inf, False, False, 0) if answer is None else answer


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
