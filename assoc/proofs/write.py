"""Write proofs of a solution's optimality for `assoc.check` to replay (docs/proofs.md)."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from typing import Any

import numpy as np

from assoc import check
from assoc._files.output import FilePath, check_writable, write_text
from assoc._parameters import checked_time_limit
from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Floats
from assoc.errors import InvalidInputError
from assoc.packing.bounds.dual_ascent import component_bounds, dual_bound
from assoc.packing.branching.node import work_memory
from assoc.packing.branching.root import MOST_ROWS
from assoc.packing.packing import Packing, assemble
from assoc.packing.prepare import prepare
from assoc.packing.run import memory_allows
from assoc.problem import AssignmentProblem, check_problem
from assoc.proofs.tree import Aim, Tree, prove_by_tree
from assoc.solution import Solution

_NODES = 100_000
# the second stage has the columns that the first does not exclude
_STAGES = 2
_ONE = 10**check.DECIMALS
# gaps up to this share of a component's cost are rounding
_CLOSED = 1e-9
# multipliers below this are 0: a float has up to 17 digits after its leading zeros
_TINY = 10.0 ** (18 - check.DECIMALS)


@explains_wrong_types
def write_proof(
    path: FilePath,
    problem: AssignmentProblem,
    solution: Solution,
    *,
    nodes: int = _NODES,
    time_limit: float | None = None,
) -> float:
    """Write a proof of how far a solution can be from the optimum; ``python -m assoc.check`` replays it.

    The solution may come from any solver. The bound is proved from scratch, component by component: by multipliers
    where they suffice, else by a tree of linear programs. The proof is replayed in exact arithmetic before it is
    written.

    Parameters
    ----------
    path : path-like
        The proof, as JSON.
    problem : AssignmentProblem
        ``problem.save("problem.txt")`` writes the form that `assoc.check` reads beside the proof.
    solution : Solution
    nodes : int
        Most nodes of all trees together; nodes left open lower the bound.
    time_limit : float, optional
        Seconds after which trees stop growing.

    Returns
    -------
    float
        The proved lower bound.

    Raises
    ------
    InvalidInputError
        The solution is not one of this problem, a cost has more decimals than the checker reads, or the file cannot be
        written.
    """
    check_problem(problem)
    if not isinstance(solution, Solution):
        raise InvalidInputError(f"solution: expected a Solution, got {type(solution).__name__}")
    limit = checked_time_limit(time_limit)
    check_writable(path)
    exact = exact_problem(problem)
    chosen = [tuple(row) for row in solution.tuples.tolist()]
    try:
        cost = check.cost_of(exact, chosen)
    except check.RefusedError as error:
        raise InvalidInputError(f"solution: does not belong to the problem ({error})") from None
    deadline = np.inf if limit is None else time.monotonic() + limit
    stages, trees = _proved(problem, exact, chosen, Aim(0.0, 0.0, max(nodes, 1), deadline))
    content: dict[str, Any] = {
        "format": "assoc-proof",
        "version": 1,
        "problem": exact.digest,
        "tuples": chosen,
        "cost": _decimal(cost),
        "multipliers": stages,
        "trees": trees,
    }
    # as the checker reads it
    bound = check.proved(exact, json.loads(json.dumps(content), parse_float=str, parse_int=str), cost)
    content["bound"] = _decimal(bound)
    write_text(path, json.dumps(content, separators=(",", ":")) + "\n")
    return float(bound / _ONE)


def exact_problem(problem: AssignmentProblem) -> check.Problem:
    """Return a problem as the checker reads it from text: each cost as its shortest decimal representation.

    A cost with more decimals than the checker reads is refused.
    """
    costs: dict[tuple[int, ...], int] = {}
    for indices, cost in zip(map(tuple, problem.tuples.tolist()), problem.costs.tolist(), strict=True):
        try:
            value = check.number(repr(cost))
        except ValueError as error:
            raise InvalidInputError(f"problem: cost {error}") from None
        costs[indices] = min(value, costs.get(indices, value))
    return check.Problem(problem.sizes.tolist(), problem.dummy, costs)


def _proved(
    problem: AssignmentProblem, exact: check.Problem, chosen: list[tuple[int, ...]], aim: Aim
) -> tuple[list[list[list[float]]], list[dict[str, Any]]]:
    """The stages (multipliers of all measurements by sensor), and a tree for each component that they leave open."""
    cost = check.cost_of(exact, chosen)
    prepared = prepare(problem)
    offsets = np.cumsum([0, *problem.sizes.tolist()])
    alone = prepared.single_cost if problem.dummy else np.zeros(offsets[-1])
    # whole-numbered weights allow trees a tolerance: not if costs are finer, as where all weights are 0
    granularity = prepared.packing.granularity if exact.unit >= _ONE else 0.0
    columns, packing = exact.columns, replace(prepared.packing, granularity=granularity)
    stages: list[list[list[float]]] = []
    while True:
        duals = dual_bound(packing)
        whole = np.array(alone, dtype=np.float64)
        whole[packing.row_origin] += duals
        # the checker does not read all decimals of numbers this small
        whole[np.abs(whole) < _TINY] = 0.0
        stages.append([whole[first:last].tolist() for first, last in zip(offsets[:-1], offsets[1:], strict=True)])
        u = {row: check.number(repr(value)) for row, value in zip(exact.rows, whole.tolist(), strict=True)}
        bound = check.bounded(columns, exact.needed, u, {})
        if bound is None or cost - bound <= max(max(abs(cost), _ONE) // round(1.0 / _CLOSED), exact.unit - 1):
            return stages, []
        left = check.cheap(columns, u, cost - bound)
        if len(stages) == _STAGES or len(left) == len(columns):
            break
        columns = left
        packing = _packing_of(columns, exact, alone, granularity)
    return stages, _trees_of(packing, duals, alone, exact, _of_columns(exact, chosen), aim)


def _of_columns(exact: check.Problem, chosen: list[tuple[int, ...]]) -> dict[tuple[check.Row, ...], int]:
    """Costs of a solution's columns. A tuple that costs no less than its false alarms is replaced by these.

    The measurements of such a tuple may be in several components.
    """
    cost_of = {rows: cost for cost, rows in exact.columns}
    columns: dict[tuple[check.Row, ...], int] = {}
    for indices in chosen:
        rows = tuple((s, i) for s, i in enumerate(indices) if i)
        for part in [rows] if rows in cost_of else [(row,) for row in rows]:
            columns[part] = cost_of[part]
    return columns


def _packing_of(columns: list[check.Column], exact: check.Problem, alone: Floats, granularity: float) -> Packing:
    """The packing of the remaining columns; a row whose false alarm was dropped has no slack."""
    number = {row: index for index, row in enumerate(exact.rows)}
    slack = np.array([row not in exact.needed for row in exact.rows])
    used = [rows for rows in columns if not exact.dummies or len(rows[1]) > 1]
    table = np.full((len(used), len(exact.sizes)), -1, dtype=np.int32)
    weights = np.empty(len(used))
    for index, (cost, rows) in enumerate(used):
        for row in rows:
            table[index, row[0]] = number[row]
        weights[index] = cost / _ONE
    weights -= np.where(table >= 0, alone[table], 0.0).sum(axis=1)
    if exact.dummies:
        for _, rows in columns:
            if len(rows) == 1:
                slack[number[rows[0]]] = True
    return assemble(table, weights, slack, np.arange(len(used), dtype=np.int32), granularity)


def _trees_of(
    packing: Packing,
    duals: Floats,
    alone: Floats,
    exact: check.Problem,
    chosen: dict[tuple[check.Row, ...], int],
    aim: Aim,
) -> list[dict[str, Any]]:
    """Trees for the components whose multipliers do not prove the chosen tuples optimal, widest gap first.

    Multipliers are relative to ``alone``, the cost of each global row as a false alarm (0 without dummies).
    """
    component_of = np.full(len(exact.rows), -1)
    for c in range(packing.num_components):
        component_of[packing.row_origin[packing.row_start[c] : packing.row_start[c + 1]]] = c
    number = {row: index for index, row in enumerate(exact.rows)}
    targets = np.zeros(packing.num_components)
    np.subtract.at(targets, component_of[component_of >= 0], alone[component_of >= 0])
    exactly = [0] * packing.num_components
    for members, cost in chosen.items():
        c = component_of[number[members[0]]]
        if c >= 0:
            targets[c] += cost / _ONE
            exactly[c] += cost
    unit = exact.unit / _ONE
    gaps = targets - component_bounds(packing, duals)
    trees = []
    for c in np.argsort(-gaps, kind="stable"):
        rows = packing.row_origin[packing.row_start[c] : packing.row_start[c + 1]]
        rounding = _CLOSED * max(1.0, abs(exactly[c] / _ONE))
        enough = targets[c] - max(rounding, unit - rounding)
        columns = int(packing.col_start[c + 1] - packing.col_start[c])
        needed = work_memory(MOST_ROWS * rows.size, columns, packing.num_sensors)
        if targets[c] - gaps[c] >= enough or not memory_allows(needed):
            continue
        component_aim = replace(aim, target=float(targets[c]), enough=float(enough))
        component_duals = duals[packing.row_start[c] : packing.row_start[c + 1]]
        tree = prove_by_tree(packing.component(int(c)), component_duals, component_aim, alone[rows])
        aim = replace(aim, nodes=max(aim.nodes - len(tree.nodes), 1))
        trees.append(_written(tree, [list(exact.rows[row]) for row in rows], alone[rows], exactly[c]))
    return trees


def _written(tree: Tree, rows: list[list[int]], alone: Floats, target: int) -> dict[str, Any]:
    """A tree with its rows as sensor and index, counted from 1."""
    names = [[sensor + 1, index] for sensor, index in rows]
    base = np.concatenate([alone, np.zeros(len(tree.sets))])
    nodes: list[dict[str, Any]] = []
    for node in tree.nodes:
        written: dict[str, Any] = {}
        if node.duals.size:
            # adding the base lengthened the rounded decimals; Python's round, as numpy's would overflow
            written["multipliers"] = [round(value, 12) for value in (node.duals + base).tolist()]
        if node.pair is not None:
            written |= {"pair": [names[row] for row in node.pair], "children": list(node.children)}
        nodes.append(written)
    cuts = [[names[row] for row in np.flatnonzero(members)] for members in tree.sets]
    return {"rows": names, "target": _decimal(target), "cuts": cuts, "nodes": nodes}


def _decimal(value: int) -> str:
    """Return a multiple of 1e-60 as an exact decimal number."""
    digits = str(abs(value)).rjust(check.DECIMALS + 1, "0")
    whole, fraction = digits[: -check.DECIMALS], digits[-check.DECIMALS :].rstrip("0")
    return ("-" if value < 0 else "") + whole + ("." + fraction if fraction else "")
