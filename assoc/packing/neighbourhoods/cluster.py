"""Large-neighbourhood search: free a cluster of rows, fix what its duals allow, search the rest in full.

Near the optimum the columns that a better choice can use are few. For a cluster of rows, closed under the
present choice, they are the columns of reduced cost below the cluster's excess (the sum of reduced costs of
what is chosen there). Multipliers of the cluster's own rows are then raised by smoothed coordinate ascent
(bounds.py); after each temperature the columns which the new bound excludes are dropped, and when it
excludes all the cluster is proven. What is left is searched depth first: always the row with the fewest
columns, cut off by the sum of the least reduced costs per sensor.

A row with slack that stays uncovered is a column of its own, of reduced cost -u_r.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.kernels.sorting import ascending
from assoc.packing.neighbourhoods.cluster_optimum import collect, depth_first, tighten
from assoc.packing.packing import Packing

_CAPACITY = 4000
_REACH = 3.0


@dataclass(slots=True)
class ClusterSearch:
    """The search on one component, to be called in chunks; it keeps nothing but its columns' order.

    Attributes
    ----------
    packing : Packing
        One component.
    reduced, duals : float arrays, shapes (N,) and (R,)
        Reduced costs (>= 0) and the feasible multipliers they come from.
    by_row : int32 array
        Columns of each row (``packing.row_ptr``) in order of reduced cost.
    step : float
        Least difference between two costs: 1 where all weights are integers.
    """

    packing: Packing
    reduced: Floats
    duals: Floats
    by_row: NDArray[np.int32]
    step: float

    @classmethod
    def of(cls, packing: Packing, duals: Floats) -> ClusterSearch:
        """Prepare the search on one component from feasible multipliers."""
        from assoc.packing.bounds.dual_ascent import reduced_costs

        free = np.where(packing.slack, np.minimum(duals, 0.0), duals)
        reduced = np.maximum(reduced_costs(packing, free), 0.0)
        largest = float(np.abs(packing.weights).max(initial=0.0))
        whole = largest < 1e9 and bool((packing.weights == np.rint(packing.weights)).all())
        step = 1.0 if whole else 1e-9 * max(1.0, largest)
        return cls(packing, reduced, free, _by_row(packing.cols, packing.row_ptr, ascending(reduced)), step)

    def run(
        self,
        owner: NDArray[np.int32],
        rng: np.random.Generator,
        steps: int,
        size: int,
        *,
        node_limit: int = 1000,
        sideways: float = 0.3,
        deadline: float = np.inf,
    ) -> tuple[float, float]:
        """Try some clusters.

        Parameters
        ----------
        owner : int32 array, shape (R,)
            The cover (chosen column of each row, or -1), every row without slack covered; changed in
            place, never to a worse one.
        rng : Generator
            Draws the clusters.
        steps : int
            Clusters to try.
        size : int
            Rows to free.
        node_limit : int
            Nodes of the depth-first search for one cluster.
        sideways : float
            Share of clusters in which another choice of the same weight is taken too.
        deadline : float
            No cluster is begun after this (clock.py).

        Returns
        -------
        float, float
            The change of weight (<= 0), and the share of clusters not searched to the end.
        """
        packing = self.packing
        change, cut = _search_clusters(
            packing.cols,
            packing.slack,
            packing.row_ptr,
            self.by_row,
            self.reduced,
            self.duals,
            owner,
            rng,
            steps,
            min(size, packing.num_rows),
            self.step,
            node_limit,
            sideways,
            deadline,
        )
        return float(change), float(cut) / max(steps, 1)


@njit
def _by_row(cols: Any, row_ptr: Any, order: Any) -> Any:
    """The columns of each row, in the order given."""
    place = row_ptr[:-1].copy()
    result = np.empty(row_ptr[-1], np.int32)
    for j in order:
        for s in range(cols.shape[1]):
            r = cols[j, s]
            if r >= 0:
                result[place[r]] = j
                place[r] += 1
    return result


@njit
def _take(cols: Any, owner: Any, r: int, local: Any, rows: Any, num: int) -> int:
    """Add a row and all rows of its owner to the cluster."""
    if local[r] >= 0:
        return num
    k = owner[r]
    if k < 0:
        local[r] = num
        rows[num] = r
        return num + 1
    for s in range(cols.shape[1]):
        q = cols[k, s]
        if q >= 0:
            local[q] = num
            rows[num] = q
            num += 1
    return num


@njit
def _grow(
    cols: Any, row_ptr: Any, by_row: Any, reduced: Floats, duals: Floats, owner: Any, rng: Any, size: int,
    local: Any, rows: Any
) -> int:  # fmt: skip
    """Fill ``rows`` with a cluster and ``local`` with its numbering; starts where something is to be gained."""
    num_rows = owner.size
    start = rng.integers(0, num_rows)
    if rng.random() < 0.8:
        best = 0.0
        for r in range(num_rows):
            excess = (reduced[owner[r]] if owner[r] >= 0 else -duals[r]) * rng.random()
            if excess > best:
                best = excess
                start = r
    num = _take(cols, owner, start, local, rows, 0)
    tries = 0
    while num < size and tries < 20 * size:
        tries += 1
        r = rows[rng.integers(0, num)]
        degree = row_ptr[r + 1] - row_ptr[r]
        if degree == 0:
            continue
        rank = int(-math.log(1.0 - rng.random()) * _REACH)
        j = by_row[row_ptr[r] + min(degree - 1, rank)]
        for s in range(cols.shape[1]):
            if cols[j, s] >= 0 and num < size:
                num = _take(cols, owner, cols[j, s], local, rows, num)
    return num


@njit
def _search_clusters(
    cols: Any, slack: Any, row_ptr: Any, by_row: Any, reduced: Floats, duals: Floats, owner: Any, rng: Any,
    steps: int, size: int, step: float, node_limit: int, sideways: float, deadline: float
) -> Any:  # fmt: skip
    num_rows, num_sensors = owner.size, cols.shape[1]
    local = np.full(num_rows, -1, np.int32)
    rows = np.empty(num_rows, np.int32)
    place = np.empty((_CAPACITY, num_sensors), np.int32)
    cost = np.empty(_CAPACITY)
    origin = np.empty(_CAPACITY, np.int32)
    primal = np.empty(_CAPACITY)
    pointer = np.empty(num_rows + 1, np.int64)
    by_place = np.empty(_CAPACITY * num_sensors, np.int32)
    current = np.empty(_CAPACITY, np.bool_)
    u = np.empty(num_rows)
    lists = np.empty((min(size + num_sensors, num_rows) + 2, _CAPACITY + 1), np.int32)
    best = np.empty(num_rows, np.int64)
    change = 0.0
    cut = 0
    for _ in range(steps):
        if is_over(deadline):
            break
        num = _grow(cols, row_ptr, by_row, reduced, duals, owner, rng, size, local, rows)
        excess = 0.0
        for i in range(num):
            k = owner[rows[i]]
            if k < 0:
                excess -= duals[rows[i]]
            elif _is_first(cols, k, rows[i]):
                excess += reduced[k]
        tolerance = 1e-9 * max(1.0, excess)
        budget = excess + tolerance if rng.random() < sideways else excess - step + tolerance
        if excess > step * 0.999 or budget > excess:
            limit = budget
            count = collect(cols, slack, row_ptr, by_row, reduced, duals, rows, num, local, limit, place, cost, origin)
            while count < 0:
                limit *= 0.7
                count = collect(
                    cols, slack, row_ptr, by_row, reduced, duals, rows, num, local, limit, place, cost, origin
                )
            count, base = tighten(
                place, cost, origin, count, num, budget, max(0.15 * excess, 1e-12),
                pointer, by_place, u, primal
            )  # fmt: skip
            if count > 0:
                order = np.argsort(cost[:count])
                lists[0, 0] = count
                for t in range(count):
                    e = order[t]
                    lists[0, t + 1] = e
                    k = origin[e]
                    if k >= 0:
                        current[e] = owner[_row(cols, k)] == k
                    else:
                        current[e] = owner[rows[max(place[e])]] < 0
                found, num_best, nodes = depth_first(
                    place, cost, current, num, budget - base, excess - base, step, node_limit, lists, best
                )
                if nodes > node_limit:
                    cut += 1
                if found < np.inf:
                    change += found + base - excess
                    for i in range(num):
                        owner[rows[i]] = -1
                    for t in range(num_best):
                        k = origin[best[t]]
                        if k >= 0:
                            for s in range(num_sensors):
                                if cols[k, s] >= 0:
                                    owner[cols[k, s]] = k
        for i in range(num):
            local[rows[i]] = -1
    return change, cut


@njit
def _row(cols: Any, j: int) -> int:
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0:
            return cols[j, s]
    return -1


@njit
def _is_first(cols: Any, j: int, r: int) -> bool:
    return _row(cols, j) == r
