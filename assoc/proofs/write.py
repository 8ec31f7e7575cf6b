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
from assoc.errors import InvalidInputError
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.prepare import prepare
from assoc.problem import AssignmentProblem, check_problem
from assoc.proofs.components import CLOSED, Parts, decimal, packing_of, trees_of
from assoc.proofs.tree import Aim
from assoc.solution import Solution

_NODES = 100_000
# the second stage has the columns that the first does not exclude
_STAGES = 2
_ONE = 10**check.DECIMALS
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
        "cost": decimal(cost),
        "multipliers": stages,
        "trees": trees,
    }
    # as the checker reads it
    bound = check.proved(exact, json.loads(json.dumps(content), parse_float=str, parse_int=str), cost)
    content["bound"] = decimal(bound)
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
        if bound is None or cost - bound <= max(max(abs(cost), _ONE) // round(1.0 / CLOSED), exact.unit - 1):
            return stages, []
        left = check.cheap(columns, u, cost - bound)
        if len(stages) == _STAGES or len(left) == len(columns):
            break
        columns = left
        packing = packing_of(columns, exact, alone, granularity)
    return stages, trees_of(
        Parts(packing, duals, alone, exact.rows, exact.unit / _ONE), _of_columns(exact, chosen), aim
    )


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
