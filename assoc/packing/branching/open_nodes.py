"""The open nodes of a depth-first branch and bound.

A node is a set of columns (a slice of the arena), a mask of rows that may stay uncovered, and the basis and the
multipliers from which its linear program starts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import lean_inner_njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Floats
from assoc.packing.branching.root import Root
from assoc.packing.simplex.basis import Basis
from assoc.packing.simplex.program import Allowed

_DEPTH = 64


class Stack(NamedTuple):
    """The stack of open nodes as kernels take it; see `OpenNodes`."""

    arena: NDArray[np.int32]
    first: NDArray[np.int64]
    size: NDArray[np.int64]
    slack: NDArray[np.bool_]
    bound: NDArray[np.float64]
    variable: NDArray[np.int32]
    duals: NDArray[np.float64]


class OpenNodes:
    """A stack of ``count`` nodes in arrays that grow; at first only the root.

    Node t has the columns ``arena[first[t]:first[t] + size[t]]``; ``slack``, ``variable`` and ``duals``, of shape
    (depth, rows of the program), are the rows that may stay uncovered, its basis and its multipliers. ``given_up`` is a
    lower bound of the nodes given up for want of memory; ``inf`` if none was.
    """

    def __init__(self, root: Root) -> None:
        num, rows = root.program.weights.size, root.slack.size
        self.arrays = Stack(
            arena=np.empty(max(8 * num, 1024), dtype=np.int32),
            first=np.zeros(_DEPTH, dtype=np.int64),
            size=np.zeros(_DEPTH, dtype=np.int64),
            slack=np.zeros((_DEPTH, rows), dtype=np.bool_),
            bound=np.full(_DEPTH, -np.inf),
            variable=np.zeros((_DEPTH, rows), dtype=np.int32),
            duals=np.zeros((_DEPTH, rows)),
        )
        self.hold(np.arange(num), root.slack, root.variable, root.duals)
        self.given_up = math.inf

    def hold(
        self,
        columns: NDArray[np.int64],
        slack: NDArray[np.bool_],
        variable: NDArray[np.int32],
        duals: Floats,
    ) -> None:
        """Replace all nodes by one: its columns, the rows that may stay uncovered, its basis and multipliers."""
        arrays = self.arrays
        arrays.arena[: columns.size] = columns
        arrays.first[0], arrays.size[0], arrays.bound[0] = 0, columns.size, -np.inf
        arrays.slack[0], arrays.variable[0], arrays.duals[0] = slack, variable, duals
        self.count = 1

    @property
    def least_bound(self) -> float:
        """Lower bound of all nodes that are open or were given up; ``inf`` if there are none."""
        return min(self.given_up, float(self.arrays.bound[: self.count].min()) if self.count else math.inf)

    def give_up(self) -> None:
        """Give up the deepest node, and keep its bound."""
        self.count -= 1
        self.given_up = min(self.given_up, float(self.arrays.bound[self.count]))

    def grow(self, memory_allows: Callable[[float], bool]) -> None:
        """Double the capacity; without memory for that, give up the deepest node.

        A depth-first search has few open nodes, but on problems of a million columns each is large, and the search may
        descend for hours. Without the deepest node it continues with the others in the memory that it has.
        """
        grown = sum(array.nbytes for array in self.arrays)
        # old and new arrays exist at the same time
        if not memory_allows(3.0 * grown):
            self.give_up()
            return
        self.arrays = Stack(*(np.concatenate([array, np.zeros_like(array)]) for array in self.arrays))


@lean_inner_njit
def has_room(stack: Stack, top: int) -> bool:
    """Whether there is room to replace the node at ``top`` by two children."""
    return top + 2 < stack.first.size and stack.first[top] + 2 * stack.size[top] <= stack.arena.size


@lean_inner_njit
def take_node(stack: Stack, top: int, node: Allowed) -> int:
    """Load the node at ``top``; return its number of columns."""
    num = stack.size[top]
    copy_to(node.active[:num], stack.arena[stack.first[top] : stack.first[top] + num])
    copy_to(node.slack, stack.slack[top])
    node.columns[:] = False
    for j in node.active[:num]:
        node.columns[j] = True
    return num


@lean_inner_njit
def push_node(stack: Stack, top: int, node: Allowed, basis: Basis, lower: float) -> None:
    """Push a node above those below ``top``; its columns follow theirs."""
    position = stack.first[top - 1] + stack.size[top - 1] if top > 0 else 0
    num = node.active.size
    stack.first[top] = position
    stack.size[top] = num
    copy_to(stack.arena[position : position + num], node.active)
    copy_to(stack.slack[top], node.slack)
    stack.bound[top] = lower
    copy_to(stack.variable[top], basis.variable)
    copy_to(stack.duals[top], basis.duals)
