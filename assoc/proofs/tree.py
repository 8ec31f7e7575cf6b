"""A tree that proves how little a component can weigh: multipliers at its leaves, pairs of rows at its nodes.

Each node is a linear program. Where its bound does not reach the weight of the best cover, the node asks whether two
rows are in one column (Ryan and Foster's branching): either no column remains that has just one of them, or none that
has both. The pair is the one whose answers raise the bound the most, of those on which the linear program is undecided.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.packing import Packing
from assoc.packing.simplex.linear_program import LinearProgram, Relaxation

# pairs that are tried at a node, and steps of the simplex method for each answer
_TRIED = 8
_STEPS = 60
# a share of a pair that is as good as none or all of it
_WHOLE = 1e-6


@dataclass(slots=True)
class Node:
    """A node of the tree: a leaf, where ``pair`` is None.

    Attributes
    ----------
    duals : float array, shape (R,)
        Multipliers of the component's rows.
    bound : float
        What they prove below this node.
    pair : (int, int) or None
        Two rows.
    children : (int, int)
        Places in the list of nodes: the rows together, the rows apart.
    """

    duals: Floats
    bound: float
    pair: tuple[int, int] | None = None
    children: tuple[int, int] = (0, 0)


@dataclass(slots=True)
class _Open:
    place: int
    columns: NDArray[np.bool_]
    slack: NDArray[np.bool_]
    relaxed: Relaxation


def prove_by_tree(component: Packing, duals: Floats, weight: float, nodes: int) -> list[Node]:
    """Return the nodes of a tree; its first is the root, and children come after their parents.

    Parameters
    ----------
    component : Packing
        One component.
    duals : float array, shape (R,)
        Multipliers to start from.
    weight : float
        A node is not divided when its bound has reached this.
    nodes : int
        At the most; what is then open stays a leaf, with what it proves.
    """
    program = LinearProgram(component)
    columns, slack = np.ones(component.num_columns, np.bool_), component.slack.copy()
    root = program.solve(duals=duals)
    tree = [Node(root.duals, root.bound)]
    waiting = [_Open(0, columns, slack, root)]
    while waiting:
        task = waiting.pop()
        if task.relaxed.bound >= weight or len(tree) + 2 > nodes:
            continue
        pair = _pair(program, component, task, weight)
        if pair is None:
            continue
        tree[task.place].pair = pair
        tree[task.place].children = len(tree), len(tree) + 1
        for together in (True, False):
            columns, slack = _divided(component, task, pair, together)
            relaxed = program.solve(columns=columns, slack=slack, duals=task.relaxed.duals)
            waiting.append(_Open(len(tree), columns, slack, relaxed))
            tree.append(Node(relaxed.duals, relaxed.bound))
    return tree


def _divided(
    component: Packing, task: _Open, pair: tuple[int, int], together: bool
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Columns and slack that remain when the rows of a pair are in one column, or in different ones."""
    one, other = ((component.cols == row).any(axis=1) for row in pair)
    if not together:
        return task.columns & ~(one & other), task.slack
    slack = task.slack.copy()
    slack[list(pair)] = False
    return task.columns & (one == other), slack


def _pair(program: LinearProgram, component: Packing, task: _Open, weight: float) -> tuple[int, int] | None:
    """The pair on which to divide a node; None where the linear program is undecided about none."""
    shares: dict[tuple[int, int], float] = {}
    primal = task.relaxed.primal
    for j in np.flatnonzero(task.columns & (primal > _WHOLE)):
        rows = component.cols[j][component.cols[j] >= 0].tolist()
        for k, row in enumerate(rows):
            for other in rows[k + 1 :]:
                shares[row, other] = shares.get((row, other), 0.0) + float(primal[j])
    undecided = sorted((abs(share - 0.5), pair) for pair, share in shares.items() if _WHOLE < share < 1.0 - _WHOLE)
    best, gain = None, -np.inf
    program.mark()
    for _, pair in undecided[:_TRIED]:
        rises = []
        for together in (True, False):
            columns, slack = _divided(component, task, pair, together)
            relaxed = program.solve(columns=columns, slack=slack, duals=task.relaxed.duals, exchanges=_STEPS)
            rises.append(min(relaxed.bound, weight) - task.relaxed.bound)
        # both answers count: a node is done when both are
        value = max(rises[0], 1e-9) * max(rises[1], 1e-9)
        if value > gain:
            best, gain = pair, value
    program.back()
    return best
