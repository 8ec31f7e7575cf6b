"""Peers: how each is given the tuples, and what it chooses.

**General solvers**: CP-SAT, SCIP, HiGHS. **One sensor after the other**, as most trackers do.

**Independent sets.** Tuples that save something against false alarms are the vertices of a graph, weighted by what they
save; those that share a measurement are joined. The heaviest independent set is the best association with dummies.
Three of the best codes for it, all in the package ``chszlablib``: CHILS (Grossmann, Langedal and Schulz; concurrent
local search with reductions), and KaMIS's weighted branch and reduce and its memetic algorithm (Lamm, Schulz, Strash
and others).
"""

import datetime
import os
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, linear_sum_assignment, milp
from scipy.sparse import csc_array, csr_array

from assoc._types import Array, Floats, Ints
from assoc.problem import AssignmentProblem

Chosen = tuple[Ints | None, float | None, bool]
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


def assign_in_turn(problem: AssignmentProblem, time_limit: float) -> tuple[Ints | None, float | None, bool]:
    """Assign sensor after sensor to the clusters so far; a cluster's cost is its tuple over the sensors seen.

    With dummies a cluster costs what its tuple with all later sensors missed costs, and one that is not
    listed cannot be formed: this is what a tracker knows when it goes from sensor to sensor. An axial
    problem has no such tuples; there a cluster is scored by its best completion.
    """
    tuples, costs = problem.tuples, problem.costs
    num_sensors = problem.num_sensors
    group = np.arange(problem.sizes[0]) + 1
    clusters = group[:, None].astype(np.int32)
    for sensor in range(1, num_sensors):
        size = int(problem.sizes[sensor])
        whole = ~tuples[:, sensor + 1 :].any(axis=1) if problem.dummy else np.ones(len(tuples), dtype=bool)
        price = _prefix_costs(tuples[whole, : sensor + 1], costs[whole])
        now = np.array([price.get((*row, 0), np.inf) for row in clusters.tolist()])
        alone = np.array([price.get((*([0] * sensor), j + 1), np.inf) for j in range(size)])
        matrix = np.full((len(clusters), size), np.inf)
        where = {tuple(row): i for i, row in enumerate(clusters.tolist())}
        for key, cost in price.items():
            i = where.get(key[:-1])
            if i is not None and key[-1]:
                matrix[i, key[-1] - 1] = cost
        clusters = _extend(clusters, matrix, now, alone, must_pair=not problem.dummy)
    listed: dict[tuple[int, ...], int] = {}
    for i in np.argsort(-costs, kind="stable"):
        listed[tuple(tuples[i].tolist())] = int(i)
    chosen: list[int] = []
    for row in clusters.tolist():
        if tuple(row) in listed:
            chosen.append(listed[tuple(row)])
        elif all(row) or problem.dummy:
            return None, None, False
    return np.array(chosen, dtype=np.intp), None, False


def _prefix_costs(prefixes: Ints, costs: Floats) -> dict[tuple[int, ...], float]:
    """Return the least cost of any listed tuple that begins with each prefix."""
    keys, inverse = np.unique(prefixes, axis=0, return_inverse=True)
    least = np.full(len(keys), np.inf)
    np.minimum.at(least, inverse.ravel(), costs)
    return {tuple(key): cost for key, cost in zip(keys.tolist(), least.tolist(), strict=True)}


def _extend(clusters: Ints, matrix: Floats, now: Floats, alone: Floats, *, must_pair: bool) -> Ints:
    """Solve one 2-D assignment of clusters to measurements and append its column."""
    num, size = matrix.shape
    large = 1e6
    if must_pair:
        square = np.where(np.isfinite(matrix), matrix, large)
    else:
        # What pairing gains over leaving both apart; each cluster has a private "missed" column.
        apart = np.where(np.isfinite(now), now, 0.0)[:, None] + np.where(np.isfinite(alone), alone, 0.0)
        square = np.full((num, size + num), large)
        square[:, :size] = np.where(np.isfinite(matrix), matrix - apart, large)
        square[np.arange(num), size + np.arange(num)] = 0.0
    row, column = linear_sum_assignment(square)
    paired = (column < size) & (square[row, column] < large / 2)
    extended = np.concatenate([clusters, np.zeros((num, 1), dtype=np.int32)], axis=1)
    extended[row[paired], -1] = column[paired] + 1
    if must_pair:
        return extended
    left = np.setdiff1d(np.arange(size), column[paired])
    new = np.zeros((len(left), extended.shape[1]), dtype=np.int32)
    new[:, -1] = left + 1
    return np.concatenate([extended, new])


# sums of weights stay below this: two of the codes count in 32 bits
_MOST = 2.0e9
# searches of CHILS side by side: its own default
_CONCURRENT = 4


def _numbered(problem: AssignmentProblem) -> Ints:
    """Measurement of each place of each tuple, numbered through all sensors; -1 for none."""
    offsets = np.concatenate([[0], np.cumsum(problem.sizes.astype(np.int64))[:-1]])
    return np.where(problem.tuples > 0, problem.tuples + offsets - 1, -1)


def _singletons(problem: AssignmentProblem) -> tuple[Ints, Floats]:
    """Tuple and cost of each measurement as a false alarm."""
    rows = _numbered(problem)
    alone = np.flatnonzero((rows >= 0).sum(axis=1) == 1)
    # the cheapest is written last
    alone = alone[np.argsort(-problem.costs[alone], kind="stable")]
    row = rows[alone].max(axis=1)
    where = np.full(int(problem.sizes.sum()), -1, dtype=np.int64)
    cost = np.zeros(where.size)
    where[row], cost[row] = alone, problem.costs[alone]
    return where, cost


def savings(problem: AssignmentProblem) -> Floats:
    """What each tuple saves against its measurements as false alarms."""
    rows = _numbered(problem)
    _, alone = _singletons(problem)
    return np.where(rows >= 0, alone[rows], 0.0).sum(axis=1) - problem.costs


def with_false_alarms(problem: AssignmentProblem, chosen: Ints) -> Ints:
    """Chosen tuples, and the false alarms that are left; places in the problem."""
    where, _ = _singletons(problem)
    rows = _numbered(problem)[chosen]
    free = np.ones(where.size, dtype=np.bool_)
    free[rows[rows >= 0]] = False
    return np.concatenate([chosen, where[free]]).astype(np.intp)


def conflict_graph(problem: AssignmentProblem) -> tuple[Ints, Ints, Any]:
    """Return the vertices (tuples), their weights as whole numbers, and the adjacency as a sparse array.

    Raises ValueError: A problem without dummies: its best solution need not be an independent set of greatest weight.
    """
    if not problem.dummy:
        raise ValueError("expected a problem with dummies")
    saved = savings(problem)
    rows = _numbered(problem)
    vertices = np.flatnonzero((saved > 0) & ((rows >= 0).sum(axis=1) > 1))
    inside, saved = rows[vertices], saved[vertices]
    column, place = np.nonzero(inside >= 0)
    row = inside[column, place]
    most = np.zeros(int(problem.sizes.sum()))
    np.maximum.at(most, row, saved[column])
    # a tuple of two measurements or more counts at half of each at the most
    weights = np.floor(saved * min(1e6, _MOST / max(0.5 * most.sum(), 1e-9))).astype(np.int64)
    incidence = csr_array((np.ones(row.size, dtype=np.int32), (column, row)), shape=(vertices.size, most.size))
    graph = csr_array(incidence @ incidence.T)
    graph.setdiag(0)
    graph.eliminate_zeros()
    graph.sort_indices()
    return vertices, np.maximum(weights, 1), graph


def independent_set(kind: str, problem: AssignmentProblem, time_limit: float) -> Chosen:
    """Search the conflict graph with one of the codes; KaMIS's do not say whether they ended."""
    # their threads are counted when they are loaded, and are theirs to take
    threads = os.environ.pop("OMP_NUM_THREADS", None)
    try:
        from chszlablib import _chils, _kamis_mmwis, _kamis_wmis
    finally:
        if threads is not None:
            os.environ["OMP_NUM_THREADS"] = threads
    vertices, weights, graph = conflict_graph(problem)
    if not graph.nnz:
        # all of them; some of the codes fail on a graph without edges
        return with_false_alarms(problem, vertices), None, True
    ends, neighbours = graph.indptr, graph.indices.astype(np.int32)
    if kind == "chils":
        _, found = _chils.mwis(ends.astype(np.int64), neighbours, weights, time_limit, _CONCURRENT, 0)
    else:
        search = _kamis_wmis.branch_reduce if kind == "branch_reduce" else _kamis_mmwis.mmwis_solver
        _, found = search(ends.astype(np.int32), neighbours, weights.astype(np.int32), time_limit, 0)
    return with_false_alarms(problem, vertices[np.asarray(found, dtype=np.intp)]), None, False
