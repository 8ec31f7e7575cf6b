"""A tree that proves how little a component can weigh: multipliers at its leaves, pairs of rows at its nodes.

Each node is a linear program, with the cuts that the root has. Where its bound does not reach what is to be proved, the
node asks whether two rows are in one column (Ryan and Foster's branching), as the search of `exact` does: either no
column remains that has just one of them, or none that has both. Columns too dear for anything below the target are left
out before.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from assoc._types import Floats
from assoc.packing.branching.pairs import answer, any_open_pair, decide, doubtful_pairs, new_trials
from assoc.packing.branching.root import basis_of, root_with_cuts
from assoc.packing.packing import Packing
from assoc.packing.simplex.dual import OPTIMAL, Effort, solve_dual
from assoc.packing.simplex.program import Allowed, all_allowed, all_reduced_costs, certified, make_feasible

# exchanges of the simplex method at a node, and in trials of which nothing is known yet
_EXCHANGES = 100_000
# digits after the point with which multipliers are tried, the shortest first
_DIGITS = (2, 4, 6, 9)


@dataclass(slots=True)
class Node:
    """A node of the tree: a leaf, where ``pair`` is None.

    Attributes
    ----------
    duals : float array, shape (rows and cuts,), or None
        Multipliers; at a node with a pair they say which columns are left out, if any are.
    bound : float
        What they prove below this node.
    pair : (int, int) or None
        Two rows.
    children : (int, int)
        Places in the list of nodes: the rows together, the rows apart.
    """

    duals: Floats | None
    bound: float
    pair: tuple[int, int] | None = None
    children: tuple[int, int] = (0, 0)


@dataclass(slots=True)
class Tree:
    """Cuts as odd sets of rows, bool array of shape (cuts, R), and nodes: the root first, children after parents."""

    sets: NDArray[np.bool_]
    nodes: list[Node] = field(default_factory=list)

    @property
    def bound(self) -> float:
        """The least bound of the leaves."""
        return min(node.bound for node in self.nodes if node.pair is None)


@dataclass(frozen=True, slots=True)
class Aim:
    """What a tree is to prove.

    Attributes
    ----------
    target : float
        The weight that is known.
    enough : float
        A node is closed when its bound has reached this.
    nodes : int
        At the most; what is then open stays a leaf, with what it proves.
    deadline : float
        When time is over (clock.py).
    """

    target: float
    enough: float
    nodes: int
    deadline: float


@dataclass(slots=True)
class _Open:
    place: int
    allowed: Allowed
    variable: NDArray[np.int32]
    duals: Floats


def prove_by_tree(component: Packing, duals: Floats, aim: Aim, base: Floats) -> Tree:
    """Return a tree that proves as much as can be proved within its aim.

    Parameters
    ----------
    component : Packing
        One component.
    duals : float array, shape (R,)
        Multipliers to start from.
    aim : Aim
    base : float array, shape (R,)
        What is added to the multipliers where they are written: their sums are what is rounded.
    """
    root = root_with_cuts(component, duals, aim.enough, aim.deadline)
    program, num = root.program, component.num_columns
    everything = np.concatenate([base, np.zeros(len(root.sets))])
    slack_rows = np.zeros(root.slack.size, np.bool_)
    slack_rows[: component.num_rows] = True
    margin = 1e-9 * max(1.0, abs(aim.target))
    trials = new_trials(program, component.num_rows)
    room = np.empty(component.num_rows, np.int32)
    tree = Tree(root.sets)
    waiting = [_Open(0, all_allowed(program, root.slack), root.variable, root.duals)]
    tree.nodes.append(Node(None, -np.inf))
    while waiting:
        task = waiting.pop()
        node, allowed = tree.nodes[task.place], task.allowed
        basis = basis_of(program, allowed, task.variable, task.duals)
        status, _ = solve_dual(program, allowed, basis, Effort(aim.enough + 0.1 * margin, _EXCHANGES, aim.deadline))
        found = basis.duals.copy()
        make_feasible(program, allowed, found)
        node.bound = float(certified(program, allowed, found))
        node.duals = found

        def proves(multipliers: Floats, allowed: Allowed = allowed) -> float:
            make_feasible(program, allowed, multipliers)
            return float(certified(program, allowed, multipliers))

        if node.bound >= aim.enough:
            node.duals, node.bound = _shortened(found, everything, aim.enough, proves)
            continue
        if len(tree.nodes) + 2 > aim.nodes or time.monotonic() > aim.deadline or status != OPTIMAL:
            continue
        # nothing below the target has columns or slack that cost so much more
        most = aim.target - node.bound + margin
        reduced = all_reduced_costs(program, found)
        columns = allowed.columns & (reduced <= most)
        slack = allowed.slack & ((-found <= most) | ~slack_rows)
        fewer = int(columns.sum()) < allowed.active.size or bool((slack != allowed.slack).any())
        kept = Allowed(np.flatnonzero(columns).astype(np.int32), columns, slack)
        count = doubtful_pairs(component.cols, basis, trials)
        if count:
            which, _ = decide(program, component.cols, kept, basis, trials, count, Effort(aim.enough, 0, aim.deadline))
            pair = int(trials.pairs[which, 0]), int(trials.pairs[which, 1])
        else:
            one, two = any_open_pair(component.cols, kept, room)
            if one < 0:
                continue
            pair = int(one), int(two)
        node.pair, node.children = pair, (len(tree.nodes), len(tree.nodes) + 1)
        if not fewer:
            node.duals = None
        for joined in (True, False):
            side = Allowed(np.empty(num, np.int32), np.zeros(num, np.bool_), np.zeros(slack.size, np.bool_))
            size = answer(component.cols, kept, pair, joined, side)
            side = side._replace(active=side.active[:size].copy())
            waiting.append(_Open(len(tree.nodes), side, basis.variable.copy(), basis.duals.copy()))
            tree.nodes.append(Node(None, node.bound))
    return tree


def _shortened(duals: Floats, base: Floats, enough: float, proves: Callable[[Floats], float]) -> tuple[Floats, float]:
    """Return multipliers with as few digits as still prove enough, and what they prove."""
    for digits in _DIGITS:
        short = np.round(duals + base, digits) - base
        bound = proves(short.copy())
        if bound >= enough:
            return short, bound
    return duals, proves(duals.copy())
