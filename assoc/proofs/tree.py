"""A tree that proves a lower bound of a component: multipliers at its leaves, pairs of rows at its nodes.

Each node is a linear program, with the root's cuts. If its bound is below the bound to prove, the node branches on
whether two rows are in one column (Ryan and Foster's branching), as the search of `exact` does: either no column with
only one of them remains, or none with both. Before that, columns whose reduced cost excludes them from solutions below
the target are dropped.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc._types import Floats, Ints
from assoc.packing.branching.pairs import Trials, answer, any_open_pair, decide, doubtful_pairs, new_trials
from assoc.packing.branching.root import root_with_cuts
from assoc.packing.packing import Packing
from assoc.packing.simplex.basis import Basis, basis_of
from assoc.packing.simplex.dual import OPTIMAL, Effort, most_exchanges, solve_dual
from assoc.packing.simplex.program import Allowed, Program, all_allowed, all_reduced_costs, certified, make_feasible

# rounding error, as a share of the target
_ROUNDING = 1e-9
# numbers of decimals to try for multipliers, the least first
_DIGITS = (2, 4, 6, 9)


@dataclass(slots=True)
class Node:
    """A node of the tree: a leaf, where ``pair`` is None."""

    duals: Floats
    """Of rows and cuts; at a node with a pair they determine the dropped columns; empty if none are dropped."""
    bound: float
    """Lower bound of this node, which they prove."""
    pair: tuple[int, int] | None = None
    children: tuple[int, int] = (0, 0)
    """Indices of the nodes with the rows together and apart."""


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
    """The goal and the limits of a tree."""

    target: float
    """Weight of the known solution."""
    enough: float
    """A node is closed when its bound reaches this."""
    nodes: int
    """Most nodes; open nodes then become leaves, with their bounds."""
    deadline: float
    """Time limit (clock.py)."""


class _Open(NamedTuple):
    """An open node: its index, what it allows, and its parent's basis and multipliers."""

    node: int
    allowed: Allowed
    variable: NDArray[np.int32]
    duals: Floats


def prove_by_tree(component: Packing, duals: Floats, aim: Aim, base: Floats) -> Tree:
    """Return a tree that proves the best bound within the limits of its aim, from multipliers (R,) to start with.

    ``base`` (R,) is added to the multipliers when they are written, and before they are rounded.
    """
    search = _Search(component, duals, aim, base)
    while search.waiting:
        search.visit(search.waiting.pop())
    return search.tree


class _Search:
    """A depth-first search that records its nodes."""

    def __init__(self, component: Packing, duals: Floats, aim: Aim, base: Floats) -> None:
        root = root_with_cuts(component, duals, aim.enough, aim.deadline)
        self._component, self._aim, self._program = component, aim, root.program
        self._base = np.concatenate([base, np.zeros(len(root.sets))])
        # slack of cuts is never dropped
        self._is_cut = np.arange(root.slack.size) >= component.num_rows
        self._margin = _ROUNDING * max(1.0, abs(aim.target))
        self._trials = new_trials(root.program, component.num_rows)
        self.tree = Tree(root.sets, [Node(np.empty(0), -np.inf)])
        self.waiting = [_Open(0, all_allowed(root.program, root.slack), root.variable, root.duals)]

    def visit(self, task: _Open) -> None:
        """Bound a node, and branch if the bound is not enough."""
        program, aim, tree = self._program, self._aim, self.tree
        node = tree.nodes[task.node]
        basis = basis_of(program, task.allowed, task.variable, task.duals)
        effort = Effort(aim.enough + 0.1 * self._margin, most_exchanges(program), aim.deadline)
        status, _ = solve_dual(program, task.allowed, basis, effort)
        node.duals = basis.duals.copy()
        node.bound = self._bound(task.allowed, node.duals)
        if node.bound >= aim.enough:
            self._shorten(node, task.allowed)
            return
        if status != OPTIMAL or len(tree.nodes) + 2 > aim.nodes or time.monotonic() > aim.deadline:
            return
        left = self._left(task.allowed, node)
        node.pair = self._question(left, basis)
        if node.pair is None:
            return
        if left.active.size == task.allowed.active.size and (left.slack == task.allowed.slack).all():
            node.duals = np.empty(0)
        node.children = len(tree.nodes), len(tree.nodes) + 1
        for joined in (True, False):
            side = Allowed(np.empty_like(left.active), np.zeros_like(left.columns), np.zeros_like(left.slack))
            count = answer(self._component.cols, left, node.pair, joined, side)
            side = side._replace(active=side.active[:count].copy())
            self.waiting.append(_Open(len(tree.nodes), side, basis.variable.copy(), basis.duals.copy()))
            tree.nodes.append(Node(np.empty(0), node.bound))

    def _bound(self, allowed: Allowed, duals: Floats) -> float:
        """Make the multipliers feasible and return their bound."""
        make_feasible(self._program, allowed, duals)
        return float(certified(self._program, allowed, duals))

    def _left(self, allowed: Allowed, node: Node) -> Allowed:
        """Columns and slack without those that no solution below the target has."""
        most = self._aim.target - node.bound + self._margin
        columns = allowed.columns & (all_reduced_costs(self._program, node.duals) <= most)
        slack = allowed.slack & ((-node.duals <= most) | self._is_cut)
        return Allowed(np.flatnonzero(columns).astype(np.int32), columns, slack)

    def _question(self, allowed: Allowed, basis: Basis) -> tuple[int, int] | None:
        """The pair of rows to branch on; None if there is none."""
        effort = Effort(self._aim.enough, 0, self._aim.deadline)
        counts = np.empty(self._component.num_rows, np.int32)
        first, second = _pair(self._program, self._component.cols, allowed, basis, self._trials, counts, effort)
        return None if first < 0 else (int(first), int(second))

    def _shorten(self, node: Node, allowed: Allowed) -> None:
        """Round the multipliers of a leaf to the fewest decimals that prove enough."""
        for digits in _DIGITS:
            short = np.round(node.duals + self._base, digits) - self._base
            bound = self._bound(allowed, short.copy())
            if bound >= self._aim.enough:
                node.duals, node.bound = short, bound
                return


@njit
def _pair(
    program: Program, cols: Ints, allowed: Allowed, basis: Basis, trials: Trials, counts: Ints, effort: Effort
) -> Any:
    """The pair that branch and bound would choose, or any open one; -1, -1 if there is none."""
    count = doubtful_pairs(cols, basis, trials)
    if count > 0:
        which, _ = decide(program, cols, allowed, basis, trials, count, effort)
        return int(trials.pairs[which, 0]), int(trials.pairs[which, 1])
    return any_open_pair(cols, allowed, counts)
