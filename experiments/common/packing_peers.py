"""Codes for weighted independent sets as peers.

Tuples that save something against false alarms are the vertices of a graph, weighted by what they save; those that
share a measurement are joined. The heaviest independent set is the best association with dummies. Three of the best
codes for it, all in the package ``chszlablib``: CHILS (Grossmann, Langedal and Schulz; concurrent local search with
reductions; also a package of its own, which takes a graph edge by edge), and KaMIS's weighted branch and reduce and its
memetic algorithm (Lamm, Schulz, Strash and others).
"""

import os
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from assoc._types import Floats, Ints
from assoc.problem import AssignmentProblem

Chosen = tuple[Ints | None, float | None, bool]

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
