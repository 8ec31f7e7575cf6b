"""Exact sub-steps: free a cluster of rows, solve what they allow to the optimum, keep it if it is better.

The cluster grows from a row over columns of small reduced cost, together with the chosen columns it
touches, so that it holds the tuples which compete with one another. The sub-problem inherits the dual
multipliers, with which branch and bound closes a cluster of some twenty targets in a few milliseconds.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assoc._compiled import njit
from assoc.solvers.branch_and_bound import _search
from assoc.solvers.packing import Packing

if TYPE_CHECKING:
    from assoc.solvers.metaheuristic import Part

Floats = NDArray[np.float64]


class ClusterSteps:
    """Exact sub-steps whose clusters grow as long as they can be solved, up to half of a part's rows."""

    def __init__(self, num_rows: int) -> None:
        self.largest = min(64, max(6, num_rows // 2))
        self.size = min(36, self.largest)

    def improve(self, part: Part, owner: NDArray[np.int32], rng: np.random.Generator, steps: int) -> float:
        """Improve a cover of the part in place; return the change of its weight (<= 0)."""
        if steps == 0:
            return 0.0
        change, solved = improve_clusters(
            part.packing, part.reduced, part.duals, owner, rng, steps, self.size, part.temperature
        )
        if solved < 0.85:
            self.size = max(self.size - 6, min(24, self.largest))
        elif change == 0.0:
            self.size = min(self.size + 2, self.largest)
        return change


def improve_clusters(
    packing: Packing,
    reduced: Floats,
    duals: Floats,
    owner: NDArray[np.int32],
    rng: np.random.Generator,
    steps: int,
    size: int,
    temperature: float,
    node_limit: int = 200,
) -> tuple[float, float]:
    """Do some exact sub-steps on one component.

    Parameters
    ----------
    packing : Packing
        One component.
    reduced, duals : float arrays, shapes (N,) and (R,)
        Reduced costs and the multipliers they come from.
    owner : int32 array, shape (R,)
        The cover; changed in place, never to a worse one.
    rng : Generator
        Draws the clusters.
    steps : int
        Clusters to try.
    size : int
        Rows to free.
    temperature : float
        Columns are drawn with probability proportional to exp(-reduced cost / temperature),
        and those above ten temperatures are left out.
    node_limit : int
        Nodes of branch and bound for one cluster.

    Returns
    -------
    float, float
        The change of weight (<= 0), and the share of clusters that were solved to the end.
    """
    change, solved = _improve_clusters(
        packing.cols,
        packing.weights,
        packing.slack,
        packing.row_ptr,
        packing.row_cols,
        reduced,
        duals,
        owner,
        rng,
        steps,
        size,
        temperature,
        node_limit,
    )
    return float(change), float(solved) / max(steps, 1)


@njit
def _grow_cluster(
    cols: Any, row_ptr: Any, row_cols: Any, reduced: Floats, owner: Any, rng: Any, size: int, temperature: float,
    local: Any, rows: Any
) -> int:  # fmt: skip
    """Fill ``rows`` with a cluster closed under ownership; ``local`` numbers its rows (else -1)."""
    num_sensors = cols.shape[1]
    num = 0
    start = rng.integers(0, owner.size)
    pending = start
    tries = 0
    while True:
        # take in a row and all rows of its owner
        if pending >= 0 and local[pending] < 0:
            k = owner[pending]
            if k < 0:
                local[pending] = num
                rows[num] = pending
                num += 1
            else:
                for s in range(num_sensors):
                    r = cols[k, s]
                    if r >= 0:
                        local[r] = num
                        rows[num] = r
                        num += 1
        if num >= size or tries > 40 * size:
            return num
        tries += 1
        # a random column of the cluster, likely one of small reduced cost, leads to the next row
        r = rows[rng.integers(0, num)]
        pending = -1
        degree = row_ptr[r + 1] - row_ptr[r]
        if degree == 0:
            continue
        j = row_cols[row_ptr[r] + rng.integers(0, degree)]
        if rng.random() < math.exp(-reduced[j] / temperature):
            for s in range(num_sensors):
                q = cols[j, s]
                if q >= 0 and local[q] < 0:
                    pending = q


@njit
def _improve_clusters(
    cols: Any,
    weights: Floats,
    slack: Any,
    row_ptr: Any,
    row_cols: Any,
    reduced: Floats,
    duals: Floats,
    owner: Any,
    rng: Any,
    steps: int,
    size: int,
    temperature: float,
    node_limit: int,
) -> Any:
    num_sensors = cols.shape[1]
    num_rows = owner.size
    local = np.full(num_rows, -1, np.int32)
    rows = np.empty(num_rows, np.int32)
    total = 0.0
    solved = 0
    for _ in range(steps):
        num = _grow_cluster(cols, row_ptr, row_cols, reduced, owner, rng, min(size, num_rows), temperature, local, rows)
        current = 0.0
        lower = 0.0
        chosen = 0
        for i in range(num):
            r = rows[i]
            lower += duals[r]
            k = owner[r]
            if k >= 0:
                for s in range(num_sensors):
                    if cols[k, s] >= 0:
                        if cols[k, s] == r:
                            current += weights[k]
                            chosen += 1
                        break
        tolerance = 1e-9 * max(1.0, abs(current))
        excess = current - lower
        # far from the optimum most columns could still pay; the first steps take the promising ones alone
        limit = min(excess, 10.0 * temperature)
        if excess > tolerance:
            # columns that lie within the cluster and can be part of something better
            count = 0
            for i in range(num):
                r = rows[i]
                for k in range(row_ptr[r], row_ptr[r + 1]):
                    j = row_cols[k]
                    if reduced[j] < limit and _first_row(cols, j) == r and _inside(cols, j, local):
                        count += 1
            sub_cols = np.empty((count, num_sensors), np.int32)
            sub_weights = np.empty(count)
            origin = np.empty(count, np.int32)
            count = 0
            for i in range(num):
                r = rows[i]
                for k in range(row_ptr[r], row_ptr[r + 1]):
                    j = row_cols[k]
                    if reduced[j] < limit and _first_row(cols, j) == r and _inside(cols, j, local):
                        for s in range(num_sensors):
                            q = cols[j, s]
                            sub_cols[count, s] = local[q] if q >= 0 else -1
                        sub_weights[count] = weights[j]
                        origin[count] = j
                        count += 1
            depth = 2 * num + 8
            arena = np.empty(count * 24 + 64, np.int32)
            arena[:count] = np.arange(count)
            first = np.zeros(depth, np.int64)
            sizes = np.zeros(depth, np.int64)
            node_duals = np.zeros((depth, num))
            node_slack = np.zeros((depth, num), np.bool_)
            node_bound = np.full(depth, -np.inf)
            found = np.empty(num, np.int32)
            sizes[0] = count
            for i in range(num):
                node_duals[0, i] = duals[rows[i]]
                node_slack[0, i] = slack[rows[i]]
            left, weight, num_found, _ = _search(
                sub_cols, sub_weights, arena, first, sizes, node_duals, node_slack, node_bound, 1,
                current, tolerance, node_limit, found,
            )  # fmt: skip
            if left == 0:
                solved += 1
            if num_found >= 0:
                total += weight - current
                for i in range(num):
                    owner[rows[i]] = -1
                for i in range(num_found):
                    j = origin[found[i]]
                    for s in range(num_sensors):
                        if cols[j, s] >= 0:
                            owner[cols[j, s]] = j
        else:
            solved += 1
        for i in range(num):
            local[rows[i]] = -1
    return total, solved


@njit
def _first_row(cols: Any, j: int) -> int:
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0:
            return cols[j, s]
    return -1


@njit
def _inside(cols: Any, j: int, local: Any) -> bool:
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0 and local[cols[j, s]] < 0:
            return False
    return True
