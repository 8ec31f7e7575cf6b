"""Cluster search: free a cluster of rows, fix columns by its multipliers, search the rest exhaustively.

Near the optimum few columns can be part of a better choice. For a cluster of rows, closed under the present
choice, they are the columns of reduced cost below the cluster's excess (the sum of reduced costs of
the columns chosen there). The multipliers of the cluster's rows are then raised by smoothed coordinate ascent
(as in bounds/dual_ascent.py). After each temperature the columns that the new bound excludes are dropped; if it
excludes all, the present choice is proved optimal. The rest is searched depth first: always the row with the fewest
columns, with the sum of the least reduced costs per sensor as the bound.

A row with slack that stays uncovered is a separate column of reduced cost -u_r.

Clusters grow while they can be solved, and shrink when they cannot.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.sorting import ascending, order_of
from assoc._types import Ints
from assoc.packing.bounds.dual_ascent import reduced_costs
from assoc.packing.bounds.priced import Priced, ReducedCosts
from assoc.packing.kernels.columns import choose, first_row
from assoc.packing.neighbourhoods.cluster_optimum import ClusterColumns, Limits, Sweep, collect, depth_first, tighten
from assoc.packing.packing import Packing, PackingArrays

_CAPACITY = 4000
_REACH = 3.0
# rows of a cluster: about twenty targets of three sensors are solved in a millisecond or less
_START, _LEAST, _MOST = 45, 24, 600
# nodes of the depth-first search for one cluster
_NODES = 1000
# share of clusters in which another choice of the same weight is taken too
_SIDEWAYS = 0.3
# share of clusters not searched to the end, from which clusters shrink
_TOO_LARGE = 0.2


class _Effort(NamedTuple):
    """Limits of a search: clusters, rows of each, least difference of two costs, nodes, share of ties taken."""

    tries: int
    size: int
    step: float
    nodes: int
    sideways: float


class ClusterSearch:
    """The cluster search of one component, whose present multipliers are kept.

    ``costs`` are reduced costs (>= 0) and the feasible multipliers they come from, ``by_row`` the columns of each row
    (``packing.row_ptr``) in order of reduced cost, ``step`` the least difference between two costs: 1 where all weights
    are whole numbers; ``size`` is the number of rows of the next clusters.
    """

    def __init__(self, priced: Priced) -> None:
        packing = priced.packing
        duals = np.where(packing.slack, np.minimum(priced.duals, 0.0), priced.duals)
        self.costs = ReducedCosts(np.maximum(reduced_costs(packing, duals), 0.0), duals)
        largest = float(np.abs(packing.weights).max(initial=0.0))
        whole = largest < 1e9 and bool((packing.weights == np.rint(packing.weights)).all())
        self.step = 1.0 if whole else 1e-9 * max(1.0, largest)
        self.by_row = _by_row(packing.arrays.cols, packing.arrays.row_ptr, ascending(self.costs.reduced))
        # a cluster of all rows would be an exact solver, not a local search
        self._most = min(_MOST, max(6, 2 * packing.num_rows // 3))
        self.size = min(_START, self._most)

    def improve(
        self,
        packing: Packing,
        owner: NDArray[np.int32],
        weight: float,
        rng: np.random.Generator,
        tries: int,
        deadline: float = np.inf,
    ) -> float:
        """Improve a complete cover of this weight in place by some clusters; return its new weight."""
        change, unfinished = self.search(packing.arrays, owner, rng, tries, deadline)
        if unfinished > _TOO_LARGE:
            self.size = max(self.size * 7 // 8, min(_LEAST, self._most))
        elif change == 0.0:
            self.size = min(self.size + 1 + self.size // 24, self._most)
        return weight + change

    def search(
        self,
        packing: PackingArrays,
        owner: NDArray[np.int32],
        rng: np.random.Generator,
        tries: int,
        deadline: float = np.inf,
        nodes: int = _NODES,
    ) -> tuple[float, float]:
        """Try some clusters; return the change of weight (<= 0), and the share of clusters not searched to the end.

        ``owner`` (R,) is the cover (chosen column of each row, or -1), every row without slack covered; changed in
        place, never to a worse one. ``nodes`` limits the depth-first search for one cluster; none is begun after the
        deadline (clock.py).
        """
        effort = _Effort(tries, min(self.size, owner.size), self.step, nodes, _SIDEWAYS)
        change, cut = _search_clusters(packing, self.by_row, self.costs, owner, rng, effort, deadline)
        return float(change), float(cut) / max(tries, 1)


@njit
def _by_row(cols: Ints, row_ptr: Ints, order: Ints) -> Any:
    """The columns of each row, in the order given."""
    end = row_ptr[:-1].copy()
    result = np.empty(row_ptr[-1], np.int32)
    for j in order:
        for s in range(cols.shape[1]):
            r = cols[j, s]
            if r >= 0:
                result[end[r]] = j
                end[r] += 1
    return result


@inner_njit
def _take(cols: Ints, owner: Ints, r: int, local: Ints, rows: Ints, num: int) -> int:
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


@inner_njit
def _grow(
    packing: PackingArrays,
    by_row: Ints,
    costs: ReducedCosts,
    owner: Ints,
    rng: Any,
    size: int,
    local: Ints,
    rows: Ints,
) -> int:
    """Fill ``rows`` with a cluster and ``local`` with its numbering; starts at a row with a possible gain."""
    cols, row_ptr = packing.cols, packing.row_ptr
    reduced, duals = costs
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
    packing: PackingArrays, by_row: Ints, costs: ReducedCosts, owner: Ints, rng: Any, effort: _Effort, deadline: float
) -> Any:
    """Try clusters; return the change of weight, and the number not searched to the end."""
    cols = packing.cols
    reduced, duals = costs
    tries, size, step, node_limit, sideways = effort
    num_rows, num_sensors = owner.size, cols.shape[1]
    local = np.full(num_rows, -1, np.int32)
    rows = np.empty(num_rows, np.int32)
    found = ClusterColumns(
        np.empty((_CAPACITY, num_sensors), np.int32), np.empty(_CAPACITY), np.empty(_CAPACITY, np.int32)
    )
    members, cost, origin = found
    sweep = Sweep(
        np.empty(num_rows + 1, np.int64),
        np.empty(_CAPACITY * num_sensors, np.int32),
        np.empty(num_rows),
        np.empty(_CAPACITY),
    )
    current = np.empty(_CAPACITY, np.bool_)
    lists = np.empty((min(size + num_sensors, num_rows) + 2, _CAPACITY + 1), np.int32)
    best = np.empty(num_rows, np.int64)
    change = 0.0
    cut = 0
    for _ in range(tries):
        if is_over(deadline):
            break
        num = _grow(packing, by_row, costs, owner, rng, size, local, rows)
        excess = 0.0
        for i in range(num):
            k = owner[rows[i]]
            if k < 0:
                excess -= duals[rows[i]]
            elif first_row(cols, k) == rows[i]:
                excess += reduced[k]
        tolerance = 1e-9 * max(1.0, excess)
        budget = excess + tolerance if rng.random() < sideways else excess - step + tolerance
        if excess > step * 0.999 or budget > excess:
            limit = budget
            count = collect(packing, by_row, costs, rows[:num], local, limit, found)
            while count < 0:
                limit *= 0.7
                count = collect(packing, by_row, costs, rows[:num], local, limit, found)
            count, base = tighten(found, count, num, budget, max(0.15 * excess, 1e-12), sweep)
            if count > 0:
                order = order_of(cost[:count])
                lists[0, 0] = count
                for t in range(count):
                    e = order[t]
                    lists[0, t + 1] = e
                    k = origin[e]
                    if k >= 0:
                        current[e] = owner[first_row(cols, k)] == k
                    else:
                        current[e] = owner[rows[max(members[e])]] < 0
                limits = Limits(budget - base, excess - base, step, node_limit)
                total, num_best, nodes = depth_first(members, cost, current, num, limits, lists, best)
                if nodes > node_limit:
                    cut += 1
                if total < np.inf:
                    change += total + base - excess
                    for i in range(num):
                        owner[rows[i]] = -1
                    for t in range(num_best):
                        k = origin[best[t]]
                        if k >= 0:
                            choose(cols, k, owner)
        for i in range(num):
            local[rows[i]] = -1
    return change, cut
