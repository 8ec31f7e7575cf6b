"""motile's tracking problems as assignment problems: its models and costs, our solvers.

A node is selected or not, has at most one parent and at most one child. Each node then stands once in a list of parents
and once in a list of children; a tuple is an edge, a track's end, its beginning, or, of a node with itself, that the
node is not selected.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.problem import AssignmentProblem
from assoc.solution import Solution
from assoc.solvers.assign import assign

_NODES, _EDGES = ("NodeSelected", "NodeAppear", "NodeDisappear"), ("EdgeSelected", "EdgeContinuation")
"""Kinds of variables that may be 1 in tracks that neither split nor merge."""
_EXACT = 1e-6  # by how much motile's 32-bit costs and rows may be off


def problem_of(solver: Any) -> AssignmentProblem:
    """Convert a problem of motile into an assignment problem of two lists.

    Parameters
    ----------
    solver : motile.Solver
        With its costs and constraints, ``MaxParents(1)`` and ``MaxChildren(1)`` among them.

    Returns
    -------
    AssignmentProblem
        Both lists are the nodes in the order of ``solver.graph.nodes``. Costs of solutions are those of motile.

    Raises
    ------
    InvalidInputError
        A node may have several parents or children.
    """
    nodes = {node: i for i, node in enumerate(solver.graph.nodes)}
    selected, appears, ends = (_costs(solver, kind, nodes) for kind in _NODES)
    edges = list(solver.graph.edges)
    _check_degrees(solver, edges)
    ends_of = np.array([(nodes[u], nodes[v]) for u, v in edges], dtype=np.int64).reshape(-1, 2)
    cost = sum(_costs(solver, kind, edges) for kind in _EDGES) + selected[ends_of[:, 0]]
    node, none = np.arange(len(nodes)) + 1, np.zeros(len(nodes), dtype=np.int64)
    alone = [np.column_stack(pair) for pair in ((node, node), (node, none), (none, node))]
    costs = [cost, np.zeros(len(nodes)), selected + ends, appears]
    return AssignmentProblem(np.concatenate([ends_of + 1, *alone]), np.concatenate(costs), (len(nodes), len(nodes)))


def solve(solver: Any, method: str = "exact", **options: Any) -> Any:
    """Solve a problem of motile; in place of ``solver.solve()``.

    Parameters
    ----------
    solver : motile.Solver
        As for `problem_of`. Its ``solution`` is set, so that ``solver.get_selected_subgraph()`` gives the tracks.
    method : str, default "exact"
        One of ``assoc.solvers.names()``.
    **options
        Of ``assoc.assign``: time_limit, seed, parameters of the solver.

    Returns
    -------
    ilpy.Solution
        Its ``native_status`` is our `Solution`, with a lower bound.

    Raises
    ------
    InvalidInputError
        A node may have several parents or children, or a constraint of another kind is violated by the least cost.
    """
    import ilpy

    solution = assign(problem_of(solver), method, **{"advise": False, **options})
    values = values_of(solver, solution)
    _check_constraints(solver, values)
    status = ilpy.SolverStatus.OPTIMAL if solution.status == "optimal" else ilpy.SolverStatus.SUBOPTIMAL
    solver.solution = ilpy.Solution(values.tolist(), solution.cost, status, solution.runtime, solution)
    return solver.solution


def values_of(solver: Any, solution: Solution) -> NDArray[np.float64]:
    """Return the value of each variable of motile's problem, from a solution of `problem_of`."""
    nodes, values = list(solver.graph.nodes), np.zeros(solver.num_variables)
    parents, children = solution.tuples.T - 1
    first = {nodes[v] for u, v in zip(parents, children, strict=True) if u < 0}
    last = {nodes[u] for u, v in zip(parents, children, strict=True) if v < 0}
    pairs = {(nodes[u], nodes[v]) for u, v in zip(parents, children, strict=True) if u >= 0 and v >= 0}
    chosen = {
        "NodeSelected": {node for node in nodes if (node, node) not in pairs},
        "NodeAppear": first, "NodeDisappear": last,
        **dict.fromkeys(_EDGES, pairs),
    }  # fmt: skip
    for kind, indices in solver.variables.items():
        for key in chosen.get(kind.__name__, set()) & set(indices):
            values[int(indices[key])] = 1.0
    return values


def _costs(solver: Any, kind: str, keys: Any) -> Array:
    """Costs of a kind's variables by key; 0 where a problem has no such variables."""
    found = np.zeros(len(keys))
    for variable, indices in solver.variables.items():
        if variable.__name__ == kind:
            found[:] = np.asarray(solver.costs, dtype=np.float64)[[int(indices[key]) for key in keys]]
    return found


def _check_degrees(solver: Any, edges: Any) -> None:
    """Each node must have at most one parent and one child by a constraint, or by the graph."""
    index = next(dict(indices.items()) for kind, indices in solver.variables.items() if kind.__name__ == "EdgeSelected")
    limited = {frozenset(row) for row, relation, value in _rows(solver) if relation == "LessEqual" and value == 1.0}
    for end, words in ((0, "MaxChildren(1)"), (1, "MaxParents(1)")):
        groups: dict[Any, set[int]] = {}
        for edge in edges:
            groups.setdefault(edge[end], set()).add(int(index[edge]))
        for node, group in groups.items():
            if len(group) > 1 and frozenset(group) not in limited:
                raise InvalidInputError(f"solver: expected the constraint {words}: node {node!r} may split or merge")


def _rows(solver: Any) -> Any:
    """Constraints as coefficients by variable, relation and right side."""
    for bound in solver.constraints:
        yield bound.get_coefficients(), bound.get_relation().name, bound.get_value()


def _check_constraints(solver: Any, values: Array) -> None:
    for row, relation, value in _rows(solver):
        left = sum(weight * values[i] for i, weight in row.items()) - value
        if not {"LessEqual": left <= _EXACT, "GreaterEqual": left >= -_EXACT, "Equal": abs(left) <= _EXACT}[relation]:
            raise InvalidInputError(
                "solver: a constraint is not of tracks that neither split nor merge (a pinned or exclusive node, say); "
                "solve it with motile's own solver"
            )
