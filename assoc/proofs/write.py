"""Proofs on disk: what a solution's optimality rests on, for `assoc.check` to replay (docs/proofs.md)."""

from __future__ import annotations

import json
from itertools import accumulate
from typing import Any

import numpy as np

from assoc import check
from assoc._files.output import FilePath, check_writable, write_text
from assoc._system.door import door
from assoc._types import Floats
from assoc.errors import InvalidInputError
from assoc.packing.bounds.dual_ascent import component_bounds, dual_bound
from assoc.packing.components.component import Component
from assoc.packing.components.splitting import give_covers, split_components
from assoc.packing.neighbourhoods.cover import Cover
from assoc.packing.prepare import Prepared, prepare
from assoc.problem import AssignmentProblem
from assoc.proofs.tree import Node, prove_by_tree
from assoc.solution import Solution

_NODES = 100_000
# share of the cost, or of a component's weight, up to which a gap is rounding
_CLOSED = 1e-9


@door
def write_proof(path: FilePath, problem: AssignmentProblem, solution: Solution, *, nodes: int = _NODES) -> float:
    """Write a proof of how far a solution can be from the optimum; ``python -m assoc.check`` replays it.

    Any solver's solution will do. The bound is proved anew, component by component: by multipliers where they suffice,
    and else by a tree of linear programs. Before it is written the proof is replayed in exact arithmetic.

    Parameters
    ----------
    path : path-like
        The proof, as JSON.
    problem : AssignmentProblem
        ``problem.save("problem.txt")`` writes the form that `assoc.check` reads beside the proof.
    solution : Solution
    nodes : int
        Nodes of all trees at the most; what is then open lowers the bound.

    Returns
    -------
    float
        The lower bound that the proof gives.

    Raises
    ------
    InvalidInputError
        The solution is not one of this problem, or the file cannot be written.
    """
    if not isinstance(problem, AssignmentProblem):
        raise InvalidInputError(f"problem: expected an AssignmentProblem, got {type(problem).__name__}")
    if not isinstance(solution, Solution):
        raise InvalidInputError(f"solution: expected a Solution, got {type(solution).__name__}")
    check_writable(path)
    exact = exact_problem(problem)
    chosen = [tuple(one) for one in solution.tuples.tolist()]
    try:
        cost = check.cost_of(exact, chosen)
    except check.RefusedError as error:
        raise InvalidInputError(f"solution: does not belong to the problem ({error})") from None
    multipliers, trees = _proved(problem, solution, nodes)
    content: dict[str, Any] = {
        "format": "assoc-proof",
        "version": 1,
        "problem": exact.digest,
        "tuples": chosen,
        "cost": decimal(cost),
        "multipliers": multipliers,
        "trees": trees,
    }
    # as the checker reads it
    bound = check.proved(exact, json.loads(json.dumps(content), parse_float=str, parse_int=str))
    content["bound"] = decimal(bound)
    write_text(path, json.dumps(content, separators=(",", ":")) + "\n")
    return float(bound / 10**check.DECIMALS)


def exact_problem(problem: AssignmentProblem) -> check.Problem:
    """Return a problem as the checker reads it from text: each cost is the shortest decimal that stands for it."""
    costs: dict[tuple[int, ...], int] = {}
    for one, cost in zip(map(tuple, problem.tuples.tolist()), problem.costs.tolist(), strict=True):
        value = check.number(repr(cost))
        costs[one] = min(value, costs.get(one, value))
    return check.Problem(problem.sizes.tolist(), problem.dummy, costs)


def decimal(value: int) -> str:
    """Return a multiple of 1e-60 as the decimal number that it is."""
    digits = str(abs(value)).rjust(check.DECIMALS + 1, "0")
    whole, fraction = digits[: -check.DECIMALS], digits[-check.DECIMALS :].rstrip("0")
    return ("-" if value < 0 else "") + whole + ("." + fraction if fraction else "")


def _proved(problem: AssignmentProblem, solution: Solution, nodes: int) -> tuple[list[list[float]], list[Any]]:
    """Multipliers of all measurements, by sensor, and a tree for each component that they leave open."""
    prepared = prepare(problem)
    packing = prepared.packing
    duals = dual_bound(packing)
    components = split_components(packing, duals, np.arange(packing.num_columns))
    give_covers(components, packing, Cover.of(packing, _columns(prepared, solution)).owner)
    offsets = np.array([0, *accumulate(problem.sizes.tolist())])
    alone = prepared.single_cost if problem.dummy else np.zeros(offsets[-1])
    allowed = _CLOSED * max(1.0, abs(solution.cost))
    bounds = component_bounds(packing, duals)
    gaps = [component.weight - bound for component, bound in zip(components, bounds, strict=True)]
    trees, total = [], sum(gaps)
    # the widest gaps first, until what is left is allowed
    for c in np.argsort(np.negative(gaps), kind="stable"):
        if total <= allowed:
            break
        component = components[c]
        rows = packing.row_origin[packing.row_start[c] : packing.row_start[c + 1]]
        tree = prove_by_tree(component.packing, component.duals, _goal(component), max(nodes, 1))
        nodes -= len(tree)
        total -= gaps[c] - max(component.weight - _least(tree), 0.0)
        trees.append(_written(tree, rows, alone, offsets))
    whole = np.array(alone, dtype=np.float64)
    whole[packing.row_origin] += duals
    by_sensor = [whole[first:last].tolist() for first, last in zip(offsets[:-1], offsets[1:], strict=True)]
    return by_sensor, trees


def _goal(component: Component) -> float:
    """The bound at which a node is closed."""
    return component.weight - _CLOSED * max(1.0, abs(component.weight))


def _least(tree: list[Node]) -> float:
    return min(node.bound for node in tree if node.pair is None)


def _columns(prepared: Prepared, solution: Solution) -> Any:
    """The chosen columns of the packing, which are tuples that are better than their measurements alone."""
    chosen = np.zeros(int(solution.indices.max(initial=0)) + 1, dtype=np.bool_)
    chosen[solution.indices] = True
    origin = prepared.packing.origin
    inside = origin < chosen.size
    return np.flatnonzero(inside & chosen[np.where(inside, origin, 0)])


def _written(tree: list[Node], rows: Any, alone: Floats, offsets: Any) -> dict[str, Any]:
    """A tree with the names of its rows: sensor and index, counted from 1."""
    sensors = np.searchsorted(offsets, rows, side="right")
    names = [[int(s), int(row - offsets[s - 1] + 1)] for s, row in zip(sensors, rows, strict=True)]
    nodes: list[dict[str, Any]] = []
    for node in tree:
        if node.pair is None:
            nodes.append({"multipliers": (node.duals + alone[rows]).tolist()})
        else:
            nodes.append({"pair": [names[row] for row in node.pair], "children": list(node.children)})
    return {"rows": names, "nodes": nodes}
