"""The exact part of cluster search: the columns that a cluster's multipliers leave, and the best choice of them.

See cluster.py for the method. A column is described by ``place``: the cluster's row for each sensor, or
-1; a row with slack that stays uncovered is a column with that one row and ``origin`` -1.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit
from assoc._types import Floats, Ints
from assoc.packing.bounds.priced import Prices
from assoc.packing.packing import PackingArrays

_LEVELS = 4
_SWEEPS = 8


class ClusterColumns(NamedTuple):
    """Buffers for the columns of a cluster: places, costs, and columns of the packing (-1: stays uncovered)."""

    place: Ints
    cost: Floats
    origin: Ints


class Sweep(NamedTuple):
    """Buffers for the ascent on a cluster: its columns by place, its multipliers, smoothed primal values."""

    pointer: Ints
    by_place: Ints
    duals: Floats
    primal: Floats


class Limits(NamedTuple):
    """Limits of the depth-first search: total cost, cost of the present choice, least gain, nodes."""

    budget: float
    present: float
    step: float
    nodes: int


@inner_njit
def collect(
    packing: PackingArrays, by_row: Ints, prices: Prices, rows: Ints, local: Ints, limit: float, found: ClusterColumns
) -> int:
    """List the columns within the cluster of reduced cost up to ``limit``; -1 if they are too many."""
    cols, slack, row_ptr = packing.cols, packing.slack, packing.row_ptr
    reduced, duals = prices
    place, cost, origin = found
    num_sensors = cols.shape[1]
    count = 0
    for i in range(rows.size):
        r = rows[i]
        if slack[r] and -duals[r] <= limit:
            if count == cost.size:
                return -1
            cost[count] = -duals[r]
            origin[count] = -1
            for s in range(num_sensors):
                place[count, s] = -1
            place[count, _sensor_of(cols, row_ptr, by_row, r)] = i
            count += 1
        for k in range(row_ptr[r], row_ptr[r + 1]):
            j = by_row[k]
            if reduced[j] > limit:
                break
            inside = True
            first = True
            for s in range(num_sensors):
                q = cols[j, s]
                if q >= 0:
                    if first and q != r:
                        # a column is listed by its first row
                        inside = False
                        break
                    first = False
                    if local[q] < 0:
                        inside = False
                        break
            if not inside:
                continue
            if count == cost.size:
                return -1
            for s in range(num_sensors):
                q = cols[j, s]
                place[count, s] = local[q] if q >= 0 else -1
            cost[count] = reduced[j]
            origin[count] = j
            count += 1
    return count


@inner_njit
def _index(place: Ints, count: int, num: int, pointer: Ints, by_place: Ints) -> None:
    """Index the columns by the cluster's rows."""
    num_sensors = place.shape[1]
    for i in range(num + 1):
        pointer[i] = 0
    for e in range(count):
        for s in range(num_sensors):
            if place[e, s] >= 0:
                pointer[place[e, s] + 1] += 1
    for i in range(num):
        pointer[i + 1] += pointer[i]
    for e in range(count):
        for s in range(num_sensors):
            if place[e, s] >= 0:
                by_place[pointer[place[e, s]]] = e
                pointer[place[e, s]] += 1
    for i in range(num, 0, -1):
        pointer[i] = pointer[i - 1]
    pointer[0] = 0


@inner_njit
def tighten(found: ClusterColumns, count: int, num: int, budget: float, temperature: float, sweep: Sweep) -> Any:
    """Raise the cluster's multipliers, drop the columns that they exclude; ``cost`` becomes the new reduced cost.

    Returns the number of columns left and the bound; none are left if the bound exceeds the budget.
    """
    place, cost, origin = found
    pointer, by_place, u, primal = sweep
    num_sensors = place.shape[1]
    base = 0.0
    for _ in range(_LEVELS):
        _index(place, count, num, pointer, by_place)
        for i in range(num):
            u[i] = 0.0
        for e in range(count):
            primal[e] = math.exp(-cost[e] / temperature)
        for _ in range(_SWEEPS):
            for i in range(num):
                total = 0.0
                for k in range(pointer[i], pointer[i + 1]):
                    total += primal[by_place[k]]
                if not 1e-200 < total < 1e200:
                    continue
                u[i] -= temperature * math.log(total)
                factor = 1.0 / total
                for k in range(pointer[i], pointer[i + 1]):
                    primal[by_place[k]] *= factor
        for e in range(count):
            for s in range(num_sensors):
                if place[e, s] >= 0:
                    cost[e] -= u[place[e, s]]
        for i in range(num):
            least = np.inf
            for k in range(pointer[i], pointer[i + 1]):
                least = min(least, cost[by_place[k]])
            if least == np.inf:
                return 0, np.inf
            base += u[i] + least
            if least != 0.0:
                for k in range(pointer[i], pointer[i + 1]):
                    cost[by_place[k]] -= least
        if base > budget:
            return 0, base
        left = 0
        for e in range(count):
            if cost[e] <= budget - base:
                cost[left] = max(cost[e], 0.0)
                origin[left] = origin[e]
                for s in range(num_sensors):
                    place[left, s] = place[e, s]
                left += 1
        count = left
        temperature *= 0.5
    return count, base


@inner_njit
def depth_first(
    place: Ints, cost: Floats, current: NDArray[np.bool_], num: int, limits: Limits, lists: Ints, best: Ints
) -> Any:
    """Choose columns that cover each of ``num`` places once, of total cost up to ``budget``.

    ``lists[0]`` has the columns in order of cost. A choice equal to the present one is skipped; after
    any other only those better than the present by ``step`` count. Returns the cost (``inf``: none), the
    number of columns in ``best``, and the nodes used (more than the limit: not searched to the end).
    """
    budget, present, step, node_limit = limits
    num_sensors = place.shape[1]
    depths = num + 1
    size = np.zeros(depths, np.int64)
    size[0] = lists[0, 0]
    branch_place = np.zeros(depths, np.int64)
    at = np.zeros(depths, np.int64)
    spent = np.zeros(depths)
    pick = np.zeros(depths, np.int64)
    covered = np.zeros(num, np.bool_)
    num_covered = 0
    number = np.empty(num, np.int64)
    least = np.empty(num)
    sensor = np.zeros(num, np.int64)
    per_sensor = np.zeros(num_sensors)
    for t in range(1, size[0] + 1):
        for s in range(num_sensors):
            if place[lists[0, t], s] >= 0:
                sensor[place[lists[0, t], s]] = s
    found, num_best, nodes = np.inf, 0, 0
    depth = 0
    fresh = True
    while depth >= 0:
        if fresh:
            fresh = False
            if num_covered == num:
                same = True
                for d in range(depth):
                    same = same and current[pick[d]]
                if not same and spent[depth] < found - 1e-12:
                    found = spent[depth]
                    num_best = depth
                    for d in range(depth):
                        best[d] = pick[d]
                    budget = min(found, present) - step
                at[depth] = size[depth] + 1
            else:
                nodes += 1
                if nodes > node_limit:
                    break
                for i in range(num):
                    number[i] = 0
                    least[i] = np.inf
                for t in range(1, size[depth] + 1):
                    e = lists[depth, t]
                    for s in range(num_sensors):
                        i = place[e, s]
                        if i >= 0:
                            number[i] += 1
                            least[i] = min(least[i], cost[e])
                for s in range(num_sensors):
                    per_sensor[s] = 0.0
                fewest = 1 << 60
                for i in range(num):
                    if not covered[i]:
                        per_sensor[sensor[i]] += least[i]
                        if number[i] < fewest:
                            fewest = number[i]
                            branch_place[depth] = i
                worst = 0.0
                for s in range(num_sensors):
                    worst = max(worst, per_sensor[s])
                at[depth] = 1 if spent[depth] + worst <= budget else size[depth] + 1
        # the next column that covers the place branched on
        e = -1
        while at[depth] <= size[depth]:
            f = lists[depth, at[depth]]
            at[depth] += 1
            for s in range(num_sensors):
                if place[f, s] == branch_place[depth]:
                    e = f
            if e >= 0:
                break
        if e < 0 or spent[depth] + cost[e] > budget:
            depth -= 1
            if depth >= 0:
                for s in range(num_sensors):
                    if place[pick[depth], s] >= 0:
                        covered[place[pick[depth], s]] = False
                        num_covered -= 1
            continue
        room = budget - spent[depth] - cost[e]
        pick[depth] = e
        count = 0
        for t in range(1, size[depth] + 1):
            f = lists[depth, t]
            if cost[f] > room:
                break
            apart = True
            for s in range(num_sensors):
                if place[f, s] >= 0 and place[f, s] == place[e, s]:
                    apart = False
            if apart:
                count += 1
                lists[depth + 1, count] = f
        for s in range(num_sensors):
            if place[e, s] >= 0:
                covered[place[e, s]] = True
                num_covered += 1
        spent[depth + 1] = spent[depth] + cost[e]
        depth += 1
        size[depth] = count
        fresh = True
    return found, num_best, nodes


@inner_njit
def _sensor_of(cols: Ints, row_ptr: Ints, by_row: Ints, r: int) -> int:
    if row_ptr[r] < row_ptr[r + 1]:
        for s in range(cols.shape[1]):
            if cols[by_row[row_ptr[r]], s] == r:
                return s
    return 0
