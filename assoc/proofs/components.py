"""Find the components of a proof that need a tree, and format the trees for the file."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from assoc import check
from assoc._types import Floats
from assoc.packing.bounds.dual_ascent import component_bounds
from assoc.packing.branching.node import work_memory
from assoc.packing.branching.root import MOST_ROWS
from assoc.packing.packing import Packing, assemble
from assoc.packing.run import memory_allows
from assoc.proofs.tree import Aim, Tree, prove_by_tree

# gaps up to this share of a component's cost are rounding
CLOSED = 1e-9
_ONE = 10**check.DECIMALS


class Parts(NamedTuple):
    """A problem's columns as a packing, and the data to convert results back."""

    packing: Packing
    """``row_origin`` are global row numbers."""
    duals: Floats
    """Multipliers of the packing, (R,)."""
    alone: Floats
    """Cost of each global row as a false alarm (0 without dummies); multipliers are relative to these."""
    rows: list[check.Row]
    """Sensor and index of each global row."""
    unit: float
    """Costs of solutions are multiples of it."""


def packing_of(columns: list[check.Column], exact: check.Problem, alone: Floats, granularity: float) -> Packing:
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


def trees_of(parts: Parts, chosen: dict[tuple[check.Row, ...], int], aim: Aim) -> list[dict[str, Any]]:
    """Trees for the components whose multipliers do not prove the chosen tuples optimal, widest gap first."""
    packing = parts.packing
    component_of = np.full(len(parts.rows), -1)
    for c in range(packing.num_components):
        component_of[packing.row_origin[packing.row_start[c] : packing.row_start[c + 1]]] = c
    number = {row: index for index, row in enumerate(parts.rows)}
    targets = np.zeros(packing.num_components)
    np.subtract.at(targets, component_of[component_of >= 0], parts.alone[component_of >= 0])
    exactly = [0] * packing.num_components
    for members, cost in chosen.items():
        c = component_of[number[members[0]]]
        if c >= 0:
            targets[c] += cost / _ONE
            exactly[c] += cost
    gaps = targets - component_bounds(packing, parts.duals)
    trees = []
    for c in np.argsort(-gaps, kind="stable"):
        rows = packing.row_origin[packing.row_start[c] : packing.row_start[c + 1]]
        rounding = CLOSED * max(1.0, abs(exactly[c] / _ONE))
        enough = targets[c] - max(rounding, parts.unit - rounding)
        columns = int(packing.col_start[c + 1] - packing.col_start[c])
        needed = work_memory(MOST_ROWS * rows.size, columns, packing.num_sensors)
        if targets[c] - gaps[c] >= enough or not memory_allows(needed):
            continue
        component_aim = replace(aim, target=float(targets[c]), enough=float(enough))
        component_duals = parts.duals[packing.row_start[c] : packing.row_start[c + 1]]
        tree = prove_by_tree(packing.component(int(c)), component_duals, component_aim, parts.alone[rows])
        aim = replace(aim, nodes=max(aim.nodes - len(tree.nodes), 1))
        trees.append(_written(tree, [list(parts.rows[row]) for row in rows], parts.alone[rows], exactly[c]))
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
    return {"rows": names, "target": decimal(target), "cuts": cuts, "nodes": nodes}


def decimal(value: int) -> str:
    """Return a multiple of 1e-60 as an exact decimal number."""
    digits = str(abs(value)).rjust(check.DECIMALS + 1, "0")
    whole, fraction = digits[: -check.DECIMALS], digits[-check.DECIMALS :].rstrip("0")
    return ("-" if value < 0 else "") + whole + ("." + fraction if fraction else "")
