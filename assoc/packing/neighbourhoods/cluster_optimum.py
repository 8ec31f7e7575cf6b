"""The exact part of cluster search: the columns that a cluster's multipliers leave, and the best choice of them.

See cluster.py for the method. A column is described by ``members``: the cluster's row for each sensor, or
-1; a row with slack that stays uncovered is a column with that one row and ``origin`` -1.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit
from assoc._types import Floats, Ints
from assoc.packing.bounds.priced import ReducedCosts
from assoc.packing.packing import PackingArrays

# columns listed that take as long as a node
_LISTED = 50
_LEVELS = 4
_SWEEPS = 8


class ClusterColumns(NamedTuple):
    """Buffers for the columns of a cluster: rows, costs, and columns of the packing (-1: stays uncovered)."""

    members: Ints
    cost: Floats
    origin: Ints


class Sweep(NamedTuple):
    """Buffers for the ascent on a cluster: its columns by row, its multipliers, smoothed primal values."""

    pointer: Ints
    by_member: Ints
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
    packing: PackingArrays,
    by_row: Ints,
    costs: ReducedCosts,
    rows: Ints,
    local: Ints,
    limit: float,
    found: ClusterColumns,
) -> int:
    """List the columns within the cluster of reduced cost up to ``limit``; -1 if they are too many."""
    cols, slack, row_ptr = packing.cols, packing.slack, packing.row_ptr
    reduced, duals = costs
    members, cost, origin = found
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
                members[count, s] = -1
            members[count, _sensor_of(cols, row_ptr, by_row, r)] = i
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
                members[count, s] = local[q] if q >= 0 else -1
            cost[count] = reduced[j]
            origin[count] = j
            count += 1
    return count


@inner_njit
def _index(members: Ints, count: int, num: int, pointer: Ints, by_member: Ints) -> None:
    """Index the columns by the cluster's rows."""
    num_sensors = members.shape[1]
    for i in range(num + 1):
        pointer[i] = 0
    for e in range(count):
        for s in range(num_sensors):
            if members[e, s] >= 0:
                pointer[members[e, s] + 1] += 1
    for i in range(num):
        pointer[i + 1] += pointer[i]
    for e in range(count):
        for s in range(num_sensors):
            if members[e, s] >= 0:
                by_member[pointer[members[e, s]]] = e
                pointer[members[e, s]] += 1
    for i in range(num, 0, -1):
        pointer[i] = pointer[i - 1]
    pointer[0] = 0


@inner_njit
def tighten(found: ClusterColumns, count: int, num: int, budget: float, temperature: float, sweep: Sweep) -> Any:
    """Raise the cluster's multipliers, drop the columns that they exclude; ``cost`` becomes the new reduced cost.

    Returns the number of columns left and the bound; none are left if the bound exceeds the budget.
    """
    members, cost, origin = found
    pointer, by_member, u, primal = sweep
    num_sensors = members.shape[1]
    base = 0.0
    for _ in range(_LEVELS):
        _index(members, count, num, pointer, by_member)
        for i in range(num):
            u[i] = 0.0
        for e in range(count):
            primal[e] = math.exp(-cost[e] / temperature)
        for _ in range(_SWEEPS):
            for i in range(num):
                total = 0.0
                for k in range(pointer[i], pointer[i + 1]):
                    total += primal[by_member[k]]
                if not 1e-200 < total < 1e200:
                    continue
                u[i] -= temperature * math.log(total)
                factor = 1.0 / total
                for k in range(pointer[i], pointer[i + 1]):
                    primal[by_member[k]] *= factor
        for e in range(count):
            for s in range(num_sensors):
                if members[e, s] >= 0:
                    cost[e] -= u[members[e, s]]
        for i in range(num):
            least = np.inf
            for k in range(pointer[i], pointer[i + 1]):
                least = min(least, cost[by_member[k]])
            if least == np.inf:
                return 0, np.inf
            base += u[i] + least
            if least != 0.0:
                for k in range(pointer[i], pointer[i + 1]):
                    cost[by_member[k]] -= least
        if base > budget:
            return 0, base
        left = 0
        for e in range(count):
            if cost[e] <= budget - base:
                cost[left] = max(cost[e], 0.0)
                origin[left] = origin[e]
                for s in range(num_sensors):
                    members[left, s] = members[e, s]
                left += 1
        count = left
        temperature *= 0.5
    return count, base


@inner_njit
def _to_branch_on(
    listed: Ints,
    members: Ints,
    cost: Floats,
    covered: NDArray[np.bool_],
    sensor: Ints,
    buffers: tuple[Ints, Floats, Floats],
) -> Any:
    """The open row with the fewest columns among those listed, and a bound on what covering all open rows costs.

    Buffers: columns of each row and the least cost of these, and sums of them by sensor.
    """
    number, least, per_sensor = buffers
    num = covered.size
    for i in range(num):
        number[i] = 0
        least[i] = np.inf
    for t in range(1, listed[0] + 1):
        e = listed[t]
        for s in range(members.shape[1]):
            i = members[e, s]
            if i >= 0:
                number[i] += 1
                least[i] = min(least[i], cost[e])
    for s in range(members.shape[1]):
        per_sensor[s] = 0.0
    fewest, row = 1 << 60, 0
    for i in range(num):
        if not covered[i]:
            per_sensor[sensor[i]] += least[i]
            if number[i] < fewest:
                fewest, row = number[i], i
    worst = 0.0
    for s in range(members.shape[1]):
        worst = max(worst, per_sensor[s])
    return row, worst


@inner_njit
def _list_compatible(listed: Ints, longer: Ints, members: Ints, cost: Floats, chosen: int, room: float) -> None:
    """List, of the columns in ``longer``, those that share no row with the chosen one and cost at most ``room``."""
    count = 0
    for t in range(1, longer[0] + 1):
        f = longer[t]
        if cost[f] > room:
            break
        apart = True
        for s in range(members.shape[1]):
            if members[f, s] >= 0 and members[f, s] == members[chosen, s]:
                apart = False
        if apart:
            count += 1
            listed[count] = f
    listed[0] = count


@inner_njit
def _cover(members: Ints, e: int, covered: NDArray[np.bool_], value: bool) -> int:
    """Mark the rows of a column; returns their number."""
    count = 0
    for s in range(members.shape[1]):
        if members[e, s] >= 0:
            covered[members[e, s]] = value
            count += 1
    return count


@inner_njit
def depth_first(
    members: Ints, cost: Floats, current: NDArray[np.bool_], num: int, limits: Limits, lists: Ints, best: Ints
) -> Any:
    """Choose columns that cover each of ``num`` rows once, of total cost up to ``budget``.

    ``lists[0]`` has the number of columns, and these in order of cost. A choice equal to the present one is skipped;
    after any other only those better than the present by ``step`` count. Returns the cost (``inf``: none), the number
    of columns in ``best``, and the nodes used, long lists counted as more (above the limit: not searched to the end).
    """
    budget, present, step, node_limit = limits
    depths = num + 1
    branch_row, at = np.zeros(depths, np.int64), np.zeros(depths, np.int64)
    spent, pick = np.zeros(depths), np.zeros(depths, np.int64)
    covered, num_covered = np.zeros(num, np.bool_), 0
    sensor = np.zeros(num, np.int64)
    buffers = (np.empty(num, np.int64), np.empty(num), np.empty(members.shape[1]))
    for t in range(1, lists[0, 0] + 1):
        for s in range(members.shape[1]):
            if members[lists[0, t], s] >= 0:
                sensor[members[lists[0, t], s]] = s
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
                at[depth] = lists[depth, 0] + 1
            else:
                nodes += 1 + lists[depth, 0] // _LISTED
                if nodes > node_limit:
                    break
                branch_row[depth], worst = _to_branch_on(lists[depth], members, cost, covered, sensor, buffers)
                at[depth] = 1 if spent[depth] + worst <= budget else lists[depth, 0] + 1
        # the next column that covers the row branched on
        e = -1
        while at[depth] <= lists[depth, 0]:
            f = lists[depth, at[depth]]
            at[depth] += 1
            for s in range(members.shape[1]):
                if members[f, s] == branch_row[depth]:
                    e = f
            if e >= 0:
                break
        if e < 0 or spent[depth] + cost[e] > budget:
            depth -= 1
            if depth >= 0:
                num_covered -= _cover(members, pick[depth], covered, False)
            continue
        pick[depth] = e
        _list_compatible(lists[depth + 1], lists[depth], members, cost, e, budget - spent[depth] - cost[e])
        num_covered += _cover(members, e, covered, True)
        spent[depth + 1] = spent[depth] + cost[e]
        depth += 1
        fresh = True
    return found, num_best, nodes


@inner_njit
def _sensor_of(cols: Ints, row_ptr: Ints, by_row: Ints, r: int) -> int:
    if row_ptr[r] < row_ptr[r + 1]:
        for s in range(cols.shape[1]):
            if cols[by_row[row_ptr[r]], s] == r:
                return s
    return 0
