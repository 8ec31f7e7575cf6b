"""The relaxation: constraints of all sensors but two are relaxed, and a 2-D assignment remains."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats
from assoc.packing.kernels.matching import match_sparse
from assoc.solvers.lagrangian.arranged import Arranged, alone_prices, drop_needless_prices, number_rows, priced


def relax(arranged: Arranged, duals: Floats) -> tuple[Floats, Floats] | None:
    """Solve the relaxation for the multipliers of sensors 3..S in ``duals`` (R,); None without a 2-D assignment.

    Returns feasible multipliers of all rows, whose sum is the value of the relaxation, and the subgradient (0 for the
    rows of the first two sensors).
    """
    result = duals.copy()
    subgradient = np.zeros(duals.size)
    return (result, subgradient) if _relax(arranged, result, subgradient) else None


@njit
def _relax(arranged: Arranged, duals: Floats, subgradient: Floats) -> bool:
    """Add the multipliers of the 2-D assignment; False where there is no assignment."""
    cols, weights, slack, sensor, by_pair, group_start = arranged
    num_rows, num_sensors = duals.size, cols.shape[1]
    # columns with rows of relaxed sensors only belong to no pair: lower their multipliers until none pays
    for g in range(group_start.size - 1):
        j = by_pair[group_start[g]]
        if cols[j, 0] < 0 and (num_sensors < 2 or cols[j, 1] < 0):
            for t in range(group_start[g], group_start[g + 1]):
                k = by_pair[t]
                value = priced(cols, weights, duals, k, 2)
                if value < 0.0:
                    for s in range(2, num_sensors):
                        if cols[k, s] >= 0:
                            duals[cols[k, s]] += value
                            break
    local = np.empty(num_rows, np.int64)
    left_rows, right_rows = np.empty(num_rows, np.int64), np.empty(num_rows, np.int64)
    num_left = number_rows(sensor, 0, local, left_rows)
    num_right = number_rows(sensor, 1, local, right_rows)
    left_alone = alone_prices(left_rows, num_left, slack)
    right_alone = alone_prices(right_rows, num_right, slack)
    left_column, right_column = np.full(num_left, -1, np.int64), np.full(num_right, -1, np.int64)
    indptr = np.zeros(num_left + 1, np.int64)
    capacity = group_start.size
    indices, column, costs = np.empty(capacity, np.int64), np.empty(capacity, np.int64), np.empty(capacity)
    count = 0
    at = 0
    for g in range(group_start.size - 1):
        j = by_pair[group_start[g]]
        left = cols[j, 0]
        right = cols[j, 1] if num_sensors > 1 else -1
        if left < 0 and right < 0:
            continue
        least, best = np.inf, -1
        for t in range(group_start[g], group_start[g + 1]):
            value = priced(cols, weights, duals, by_pair[t], 2)
            if value < least:
                least, best = value, by_pair[t]
        if right < 0:
            if least < left_alone[local[left]]:
                left_alone[local[left]] = least
                left_column[local[left]] = best
        elif left < 0:
            if least < right_alone[local[right]]:
                right_alone[local[right]] = least
                right_column[local[right]] = best
        else:
            # groups come in order of the left row
            while at < local[left]:
                at += 1
                indptr[at] = count
            indices[count] = local[right]
            column[count] = best
            costs[count] = least
            count += 1
    while at < num_left:
        at += 1
        indptr[at] = count
    drop_needless_prices(left_alone, right_alone)
    row_edge = np.empty(num_left, np.int64)
    u, v = np.empty(num_left), np.empty(num_right)
    if match_sparse(indptr, indices[:count], costs[:count], left_alone, right_alone, row_edge, u, v) == np.inf:
        return False
    for r in range(num_rows):
        subgradient[r] = 1.0 if sensor[r] >= 2 else 0.0
    taken = np.zeros(num_right, np.bool_)
    for i in range(num_left):
        duals[left_rows[i]] = u[i]
        e = row_edge[i]
        if e >= 0:
            taken[indices[e]] = True
        j = column[e] if e >= 0 else left_column[i]
        if j >= 0:
            _use(cols, j, subgradient)
    for i in range(num_right):
        duals[right_rows[i]] = v[i]
        if not taken[i] and right_column[i] >= 0:
            _use(cols, right_column[i], subgradient)
    return True


@inner_njit
def _use(cols: NDArray[np.int32], j: int, subgradient: Floats) -> None:
    """Count one more use of the relaxed rows of a column."""
    for s in range(2, cols.shape[1]):
        if cols[j, s] >= 0:
            subgradient[cols[j, s]] -= 1.0
