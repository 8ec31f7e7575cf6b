"""The open nodes of a depth-first branch and bound, and what is done at every node.

A node is a set of columns (a piece of the arena), multipliers, and for each row whether it may stay uncovered.
Its bound comes from the parent's multipliers, improved by smoothed passes (bounds.py) on the columns that are left.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from assoc._system import memory
from assoc._system.clock import is_over
from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.packing import Packing

_DEPTH = 64
# columns swept between two looks at the clock: about a millisecond
_LOOK = 50_000


class OpenNodes:
    """A stack of nodes in arrays that grow; at first the root alone.

    Attributes
    ----------
    arena : int32 array
        Columns of all open nodes.
    first, size : int64 arrays
        Node t has columns ``arena[first[t]:first[t] + size[t]]``.
    duals : float array, shape (depth, R)
    slack : bool array, shape (depth, R)
    bound : float array
        No solution of the node weighs less.
    count : int
        Number of open nodes.
    given_up : float
        No solution of the nodes that were given up for want of memory weighs less; ``inf``: none was.
    """

    def __init__(self, packing: Packing, duals: Floats) -> None:
        num, rows = packing.num_columns, packing.num_rows
        self.arena = np.empty(max(8 * num, 1024), dtype=np.int32)
        self.arena[:num] = np.arange(num)
        self.first = np.zeros(_DEPTH, dtype=np.int64)
        self.size = np.zeros(_DEPTH, dtype=np.int64)
        self.duals = np.zeros((_DEPTH, rows))
        self.slack = np.zeros((_DEPTH, rows), dtype=np.bool_)
        self.bound = np.full(_DEPTH, -np.inf)
        self.size[0] = num
        self.duals[0] = duals
        self.slack[0] = packing.slack
        self.count = 1
        self.given_up = math.inf

    @property
    def least_bound(self) -> float:
        """No solution of any node that is open or was given up weighs less; ``inf`` where there is none."""
        return min(self.given_up, float(self.bound[: self.count].min()) if self.count else math.inf)

    @property
    def arrays(self) -> tuple[Any, ...]:
        """What kernels take: arena, first, size, duals, slack, bound."""
        return self.arena, self.first, self.size, self.duals, self.slack, self.bound

    def grow(self) -> None:
        """Double the room; where there is no memory for that, give up the deepest node and keep its bound.

        The search is depth first: its nodes are few, but on problems of a million columns each is large, and it may
        go down for hours. Without the deepest node it goes on, beside and above that, in the memory that it has.
        """
        grown = sum(array.nbytes for array in self.arrays)
        # the old arrays beside the new ones
        if not memory.fits(3.0 * grown):
            self.count -= 1
            self.given_up = min(self.given_up, float(self.bound[self.count]))
            return
        self.arena = np.concatenate([self.arena, np.empty_like(self.arena)])
        self.first, self.size, self.duals, self.slack, self.bound = (
            np.concatenate([a, np.zeros_like(a)]) for a in (self.first, self.size, self.duals, self.slack, self.bound)
        )


@njit
def push_children(
    cols: Any, active: Any, num: int, one: int, two: int, value: float, lower: float, duals: Floats, slack: Any,
    arena: Any, first: Any, size: Any, node_duals: Floats, node_slack: Any, node_bound: Floats, top: int
) -> int:  # fmt: skip
    """Replace the node at ``top`` by its two children, rows ``one`` and ``two`` together and apart; how many are open.

    ``value`` is how much they seem to belong together; the likelier child is searched first.
    """
    place = first[top]
    for side in range(2):
        joined = (side == 1) == (value >= 0.5)
        node = top + side
        first[node] = place
        for a in range(num):
            j = active[a]
            uses = 0
            for s in range(cols.shape[1]):
                if cols[j, s] == one or cols[j, s] == two:
                    uses += 1
            if (uses != 1) if joined else (uses != 2):
                arena[place] = j
                place += 1
        size[node] = place - first[node]
        node_duals[node] = duals
        node_slack[node] = slack
        if joined:
            node_slack[node, one] = False
            node_slack[node, two] = False
        node_bound[node] = lower
    return top + 2


@njit
def index_by_row(cols: Any, active: Any, num: int, row_ptr: Any, row_cols: Any) -> None:
    """List for each row the positions in ``active`` of the columns that use it."""
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
def reduced_of(cols: Any, weights: Floats, active: Any, num: int, duals: Floats, reduced: Floats) -> None:
    """Reduced costs of a node's columns."""
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
def hard_sweeps(slack: Any, row_ptr: Any, row_cols: Any, duals: Floats, reduced: Floats, sweeps: int) -> bool:
    """Hard-minimum passes; False when a row that must be covered has no column."""
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
def smooth_sweeps(
    slack: Any,
    row_ptr: Any,
    row_cols: Any,
    num: int,
    duals: Floats,
    reduced: Floats,
    primal: Floats,
    slack_primal: Floats,
    temperature: float,
    passes: int,
    relaxation: float,
    deadline: float,
) -> None:
    """Smoothed passes (bounds.py) from multipliers whose reduced costs are given."""
    for a in range(num):
        primal[a] = math.exp(min(-reduced[a] / temperature, 500.0))
    for r in range(slack.size):
        slack_primal[r] = math.exp(min(duals[r] / temperature, 500.0)) if slack[r] else 0.0
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
            total = slack_primal[r]
            for k in range(row_ptr[r], row_ptr[r + 1]):
                total += primal[row_cols[k]]
            if not 1e-200 < total < 1e200:
                continue
            worst = max(worst, abs(total - 1.0))
            step = omega * math.log(total)
            factor = math.exp(-step)
            duals[r] -= temperature * step
            slack_primal[r] *= factor
            for k in range(row_ptr[r], row_ptr[r + 1]):
                primal[row_cols[k]] *= factor
        if worst < 0.01:
            break
