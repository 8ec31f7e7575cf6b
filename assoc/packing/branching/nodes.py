"""The open nodes of a depth-first branch and bound, and what is done at every node.

A node is a set of columns (a piece of the arena), multipliers, and for each row whether it may stay uncovered. Its
bound comes from the parent's multipliers, improved by smoothed passes (dual_ascent.py) on the columns that are left.
Two searches take these steps: for the best solution (search.py) and for the k best (ranking/component_ranking.py).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.packing import Packing, PackingArrays

# looks at the columns of a node before it is branched on
LEVELS = 3
# what `raise_bound` says in place of a number of columns
CLOSED, OVER = -1, -2

_DEPTH = 64
# columns swept between two looks at the clock: about a millisecond
_LOOK = 50_000


class NodeArrays(NamedTuple):
    """The stack of open nodes as kernels take it; see `OpenNodes`."""

    arena: NDArray[np.int32]
    first: NDArray[np.int64]
    size: NDArray[np.int64]
    duals: NDArray[np.float64]
    slack: NDArray[np.bool_]
    bound: NDArray[np.float64]


class Node(NamedTuple):
    """The node at work: its columns ``active[:num]``, its multipliers, and room for what is computed of them.

    Places in ``row_cols``, ``reduced`` and ``primal`` are places in ``active``, not columns of the packing.
    """

    active: NDArray[np.int32]
    slack: NDArray[np.bool_]
    duals: NDArray[np.float64]
    # those of the best bound so far, and those that the smoothed primal values belong to
    best_duals: NDArray[np.float64]
    soft_duals: NDArray[np.float64]
    row_ptr: NDArray[np.int64]
    row_cols: NDArray[np.int32]
    reduced: NDArray[np.float64]
    primal: NDArray[np.float64]
    slack_primal: NDArray[np.float64]


class OpenNodes:
    """A stack of nodes in arrays that grow; at first the root alone.

    Attributes
    ----------
    arrays : NodeArrays
        ``arena``: columns of all open nodes; ``first``, ``size``: node t has the columns
        ``arena[first[t]:first[t] + size[t]]``; ``duals`` and ``slack``, shape (depth, R): its multipliers and which
        rows may stay uncovered; ``bound``: no solution of the node weighs less.
    count : int
        Number of open nodes.
    given_up : float
        No solution of the nodes that were given up for want of memory weighs less; ``inf``: none was.
    """

    def __init__(self, packing: Packing, duals: Floats) -> None:
        num, rows = packing.num_columns, packing.num_rows
        self.arrays = NodeArrays(
            arena=np.empty(max(8 * num, 1024), dtype=np.int32),
            first=np.zeros(_DEPTH, dtype=np.int64),
            size=np.zeros(_DEPTH, dtype=np.int64),
            duals=np.zeros((_DEPTH, rows)),
            slack=np.zeros((_DEPTH, rows), dtype=np.bool_),
            bound=np.full(_DEPTH, -np.inf),
        )
        self.arrays.arena[:num] = np.arange(num)
        self.arrays.size[0] = num
        self.arrays.duals[0] = duals
        self.arrays.slack[0] = packing.slack
        self.count = 1
        self.given_up = math.inf

    @property
    def least_bound(self) -> float:
        """No solution of any node that is open or was given up weighs less; ``inf`` where there is none."""
        return min(self.given_up, float(self.arrays.bound[: self.count].min()) if self.count else math.inf)

    def grow(self, memory_allows: Callable[[float], bool]) -> None:
        """Double the room; where there is no memory for that, give up the deepest node and keep its bound.

        The search is depth first: its nodes are few, but on problems of a million columns each is large, and it may
        go down for hours. Without the deepest node it goes on, beside and above that, in the memory that it has.
        """
        grown = sum(array.nbytes for array in self.arrays)
        # the old arrays beside the new ones
        if not memory_allows(3.0 * grown):
            self.count -= 1
            self.given_up = min(self.given_up, float(self.arrays.bound[self.count]))
            return
        self.arrays = NodeArrays(*(np.concatenate([array, np.zeros_like(array)]) for array in self.arrays))


@njit
def new_node(packing: PackingArrays, stack: NodeArrays, num_open: int) -> Node:
    """Room for any of the open nodes and what follows from them."""
    most = 1
    for t in range(num_open):
        most = max(most, stack.size[t])
    num_rows = stack.duals.shape[1]
    return Node(
        np.empty(most, np.int32),
        np.empty(num_rows, np.bool_),
        np.empty(num_rows),
        np.empty(num_rows),
        np.empty(num_rows),
        np.zeros(num_rows + 1, np.int64),
        np.empty(most * packing.cols.shape[1], np.int32),
        np.empty(most),
        np.empty(most),
        np.empty(num_rows),
    )


@njit
def has_room(stack: NodeArrays, top: int) -> bool:
    """Whether there is room for two children in the place of the node at ``top``."""
    return top + 2 < stack.first.size and stack.first[top] + 2 * stack.size[top] <= stack.arena.size


@njit
def take_node(stack: NodeArrays, top: int, node: Node) -> int:
    """Make the node at ``top`` the one at work; how many columns it has."""
    num = stack.size[top]
    node.active[:num] = stack.arena[stack.first[top] : stack.first[top] + num]
    node.slack[:] = stack.slack[top]
    node.duals[:] = stack.duals[top]
    node.best_duals[:] = stack.duals[top]
    return num


@njit
def raise_bound(
    packing: PackingArrays, node: Node, num: int, lower: float, temperature: float, cut: float, limit: float,
    deadline: float,
) -> Any:  # fmt: skip
    """Improve a node's multipliers and drop the columns that no solution of interest has.

    Parameters
    ----------
    packing, node, num
        The node at work, of ``num`` columns.
    lower : float
        Its bound so far.
    temperature : float
        Of the smoothed passes before the hard ones; 0: none.
    cut : float
        The node is closed where no solution of it weighs less.
    limit : float
        Columns all of whose solutions weigh this or more are dropped.
    deadline : float
        When time is over (clock.py).

    Returns
    -------
    kept, bound, lower
        Columns left, ``CLOSED``, or ``OVER`` (the node is then as it was); the sum of the multipliers; the bound.
    """
    if is_over(deadline):
        return OVER, lower, lower
    index_by_row(packing.cols, node, num)
    if temperature > 0.0:
        smooth_sweeps(node, num, node.duals, temperature, 60, 1.5, deadline)
    reduced_of(packing, node, num, node.duals)
    if not hard_sweeps(node, node.slack, node.duals, node.reduced, 2):
        return CLOSED, lower, lower
    bound = 0.0
    for r in range(node.duals.size):
        bound += node.duals[r]
    if bound >= lower:
        lower = bound
        node.best_duals[:] = node.duals
    if lower >= cut:
        return CLOSED, bound, lower
    active, reduced = node.active, node.reduced
    kept = 0
    for a in range(num):
        if bound + reduced[a] < limit:
            active[kept] = active[a]
            reduced[kept] = reduced[a]
            kept += 1
    return kept, bound, lower


@njit
def next_temperature(gap: float, level: int, least: float) -> float:
    """Temperature of the next level's passes: some share of what is between the bound and the cut."""
    return max(gap * (0.1 if level == 0 else 0.03), least)


@njit
def soften(packing: PackingArrays, node: Node, num: int, duals: Floats, temperature: float, deadline: float) -> None:
    """Compute smoothed primal values: they say how likely each column is to be in a solution."""
    index_by_row(packing.cols, node, num)
    node.soft_duals[:] = duals
    reduced_of(packing, node, num, duals)
    smooth_sweeps(node, num, node.soft_duals, temperature, 60, 1.0, deadline)


@njit
def push_children(
    packing: PackingArrays, stack: NodeArrays, top: int, node: Node, num: int, pair: Any, lower: float, duals: Floats
) -> int:
    """Replace the node at ``top`` by its two children, two rows together and apart; how many nodes are open.

    ``pair`` is the two rows and how much they seem to belong together; the likelier child is searched first.
    """
    cols = packing.cols
    one, two, value = pair
    place = stack.first[top]
    for side in range(2):
        joined = (side == 1) == (value >= 0.5)
        child = top + side
        stack.first[child] = place
        for a in range(num):
            j = node.active[a]
            if not is_dropped(cols, j, one, two, joined):
                stack.arena[place] = j
                place += 1
        stack.size[child] = place - stack.first[child]
        stack.duals[child] = duals
        stack.slack[child] = node.slack
        if joined:
            stack.slack[child, one] = False
            stack.slack[child, two] = False
        stack.bound[child] = lower
    return top + 2


@njit
def is_dropped(cols: Any, j: int, one: int, two: int, joined: bool) -> bool:
    """Whether column j is no longer allowed where two rows are together (no column may have only one) or apart."""
    uses = 0
    for s in range(cols.shape[1]):
        if cols[j, s] == one or cols[j, s] == two:
            uses += 1
    return uses == 1 if joined else uses == 2


@njit
def index_by_row(cols: Any, node: Node, num: int) -> None:
    """List for each row the places in ``active`` of the columns that use it."""
    active, row_ptr, row_cols = node.active, node.row_ptr, node.row_cols
    num_sensors = cols.shape[1]
    num_rows = row_ptr.size - 1
    row_ptr[:] = 0
    for a in range(num):
        for s in range(num_sensors):
            r = cols[active[a], s]
            if r >= 0:
                row_ptr[r + 1] += 1
    for r in range(num_rows):
        row_ptr[r + 1] += row_ptr[r]
    place = row_ptr[:num_rows].copy()
    for a in range(num):
        for s in range(num_sensors):
            r = cols[active[a], s]
            if r >= 0:
                row_cols[place[r]] = a
                place[r] += 1


@njit
def reduced_of(packing: PackingArrays, node: Node, num: int, duals: Floats) -> None:
    """Compute the reduced costs of a node's columns."""
    cols, weights, active, reduced = packing.cols, packing.weights, node.active, node.reduced
    num_sensors = cols.shape[1]
    for a in range(num):
        j = active[a]
        value = weights[j]
        for s in range(num_sensors):
            r = cols[j, s]
            if r >= 0:
                value -= duals[r]
        reduced[a] = value


@njit
def hard_sweeps(node: Node, slack: Any, duals: Floats, reduced: Floats, sweeps: int) -> bool:
    """Hard-minimum passes; False when a row that must be covered has no column."""
    row_ptr, row_cols = node.row_ptr, node.row_cols
    for _ in range(sweeps):
        for r in range(slack.size):
            least = -duals[r] if slack[r] else np.inf
            for k in range(row_ptr[r], row_ptr[r + 1]):
                least = min(least, reduced[row_cols[k]])
            if least == np.inf:
                return False
            if least != 0.0:
                duals[r] += least
                for k in range(row_ptr[r], row_ptr[r + 1]):
                    reduced[row_cols[k]] -= least
    return True


@njit
def row_total(node: Node, r: int) -> float:
    """Sum of the primal values that cover a row: 1 where they are those of a solution."""
    total = node.slack_primal[r]
    for k in range(node.row_ptr[r], node.row_ptr[r + 1]):
        total += node.primal[node.row_cols[k]]
    return total


@njit
def scale_row(node: Node, r: int, factor: float) -> None:
    """Multiply the primal values that cover a row."""
    node.slack_primal[r] *= factor
    for k in range(node.row_ptr[r], node.row_ptr[r + 1]):
        node.primal[node.row_cols[k]] *= factor


@njit
def smooth_sweeps(
    node: Node, num: int, duals: Floats, temperature: float, passes: int, relaxation: float, deadline: float
) -> None:
    """Smoothed passes (dual_ascent.py) from multipliers whose reduced costs are given."""
    slack, row_ptr, reduced, primal = node.slack, node.row_ptr, node.reduced, node.primal
    for a in range(num):
        primal[a] = math.exp(min(-reduced[a] / temperature, 500.0))
    for r in range(slack.size):
        node.slack_primal[r] = math.exp(min(duals[r] / temperature, 500.0)) if slack[r] else 0.0
    unseen = 0
    for sweep in range(passes):
        unseen += num
        if unseen > _LOOK:
            unseen = 0
            if is_over(deadline):
                break
        omega = relaxation if sweep >= 5 else 1.0
        worst = 0.0
        for r in range(slack.size):
            if row_ptr[r] == row_ptr[r + 1]:
                continue
            total = row_total(node, r)
            if not 1e-200 < total < 1e200:
                continue
            worst = max(worst, abs(total - 1.0))
            step = omega * math.log(total)
            duals[r] -= temperature * step
            scale_row(node, r, math.exp(-step))
        if worst < 0.01:
            break
