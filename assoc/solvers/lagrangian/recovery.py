"""The recovery: from multipliers to a feasible choice of columns, sensor by sensor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats
from assoc.packing.cover import chosen_columns
from assoc.packing.kernels.columns import choose_matched
from assoc.packing.kernels.matching import match_sparse
from assoc.solvers.lagrangian.arranged import Arranged, alone_prices, drop_needless_prices, number_rows, priced


def recover(arranged: Arranged, duals: Floats) -> NDArray[np.int32] | None:
    """Return a feasible choice of columns built up sensor by sensor; None at a dead end."""
    owner = np.full(duals.size, -1, dtype=np.int32)
    if arranged.cols.shape[1] == 1:
        # with one sensor there is nothing to assign: each row takes its cheapest column
        order = np.argsort(-arranged.weights, kind="stable")
        owner[arranged.cols[order, 0]] = order
    elif not _recover(arranged, duals, owner):
        return None
    return chosen_columns(arranged.cols, owner)


@inner_njit
def _prefix(cols: NDArray[np.int32], j: int, stop: int, of_row: NDArray[np.int64], size: NDArray[np.int64]) -> int:
    """The partial tuple that column j continues: -1 for none (it has no row so far), -2 if it does not fit."""
    found = -1
    members = 0
    for s in range(stop):
        r = cols[j, s]
        if r >= 0:
            if found >= 0 and of_row[r] != found:
                return -2
            found = of_row[r]
            members += 1
    if found >= 0 and members != size[found]:
        return -2
    return found


@inner_njit
def _by_left_end(
    indptr: NDArray[np.int64], left: NDArray[np.int64], right: NDArray[np.int64], price: Floats
) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """Right ends, columns and costs of the edges, those of each left end together; ``indptr`` counts them first."""
    for p in range(indptr.size - 1):
        indptr[p + 1] += indptr[p]
    count = indptr[indptr.size - 1]
    indices, column, costs = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count)
    end = indptr[:-1].copy()
    for j in range(left.size):
        if left[j] >= 0:
            e = end[left[j]]
            end[left[j]] += 1
            indices[e] = right[j]
            column[e] = j
            costs[e] = price[j]
    return indices, column, costs


@inner_njit
def _keep_cheapest(
    indptr: NDArray[np.int64], indices: NDArray[np.int64], column: NDArray[np.int64], costs: Floats, num_right: int
) -> None:
    """Keep only the cheapest edge between two nodes: dense problems have one for each row of a sensor."""
    edge = np.full(num_right, -1, np.int64)
    end = first = 0
    for p in range(indptr.size - 1):
        begin, first = first, indptr[p + 1]
        indptr[p] = end
        for e in range(begin, first):
            q = indices[e]
            if edge[q] < indptr[p]:
                edge[q] = end
                indices[end], column[end], costs[end] = q, column[e], costs[e]
                end += 1
            elif costs[e] < costs[edge[q]]:
                column[edge[q]], costs[edge[q]] = column[e], costs[e]
    indptr[indptr.size - 1] = end


@njit
def _recover(arranged: Arranged, duals: Floats, owner: NDArray[np.int32]) -> bool:
    """Assign the tuples so far to the next sensor, from the second to the last; False at a dead end."""
    cols, weights, slack, sensor, _, _ = arranged
    num_rows, num_sensors = duals.size, cols.shape[1]
    num_columns = weights.size
    # partial tuple of each row so far, rows of each partial tuple, and whether it has a row that must be covered
    of_row = np.full(num_rows, -1, np.int64)
    size = np.zeros(num_rows, np.int64)
    must = np.zeros(num_rows, np.bool_)
    local = np.empty(num_rows, np.int64)
    rows = np.empty(num_rows, np.int64)
    num_partial = number_rows(sensor, 0, local, rows)
    for i in range(num_partial):
        of_row[rows[i]] = i
        size[i] = 1
        must[i] = not slack[rows[i]]
    left = np.empty(num_columns, np.int64)
    right = np.empty(num_columns, np.int64)
    price = np.empty(num_columns)
    for level in range(1, num_sensors):
        num_right = number_rows(sensor, level, local, rows)
        left_alone = np.zeros(num_partial)
        for p in range(num_partial):
            if must[p]:
                left_alone[p] = np.inf
        right_alone = alone_prices(rows, num_right, slack)
        left_column, right_column = np.full(num_partial, -1, np.int64), np.full(num_right, -1, np.int64)
        indptr = np.zeros(num_partial + 1, np.int64)
        for j in range(num_columns):
            p = _prefix(cols, j, level, of_row, size)
            q = cols[j, level]
            left[j] = -1
            if p == -2 or (p < 0 and q < 0):
                continue
            value = priced(cols, weights, duals, j, level + 1)
            if q < 0:
                if value < left_alone[p]:
                    left_alone[p] = value
                    left_column[p] = j
            elif p < 0:
                if value < right_alone[local[q]]:
                    right_alone[local[q]] = value
                    right_column[local[q]] = j
            else:
                left[j] = p
                right[j] = local[q]
                price[j] = value
                indptr[p + 1] += 1
        indices, column, costs = _by_left_end(indptr, left, right, price)
        _keep_cheapest(indptr, indices, column, costs, num_right)
        drop_needless_prices(left_alone, right_alone)
        row_edge = np.empty(num_partial, np.int64)
        u, v = np.empty(num_partial), np.empty(num_right)
        if match_sparse(indptr, indices, costs, left_alone, right_alone, row_edge, u, v) == np.inf:
            return False
        if level == num_sensors - 1:
            choose_matched(cols, row_edge, (indices, column), (left_column, right_column), owner)
            return True
        partner = np.full(num_partial, -1, np.int64)
        for p in range(num_partial):
            if row_edge[p] >= 0:
                partner[p] = indices[row_edge[p]]
        num_partial = _grow(arranged, (of_row, size, must), partner, left_column, rows[:num_right], level)
    return True


@inner_njit
def _grow(
    arranged: Arranged,
    partial: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]],
    partner: NDArray[np.int64],
    column: NDArray[np.int64],
    right: NDArray[np.int64],
    level: int,
) -> int:
    """Join partial tuples to their partners of the next sensor; returns the number of partial tuples.

    A partial tuple without partner that is no column itself (``column`` is -1) is broken up into its rows.
    """
    slack, sensor = arranged.slack, arranged.sensor
    of_row, size, must = partial
    num_rows, num_before, num_right = of_row.size, partner.size, right.size
    before = of_row.copy()
    before_size = size[:num_before].copy()
    number = np.full(num_before, -1, np.int64)
    of_right = np.full(num_right, -1, np.int64)
    count = 0
    for p in range(num_before):
        if partner[p] >= 0 or column[p] >= 0 or before_size[p] == 1:
            number[p] = count
            size[count] = before_size[p]
            if partner[p] >= 0:
                of_right[partner[p]] = count
                size[count] += 1
            count += 1
    for r in range(num_rows):
        if sensor[r] < level:
            p = before[r]
            if number[p] >= 0:
                of_row[r] = number[p]
            else:
                of_row[r] = count
                size[count] = 1
                count += 1
    for i in range(num_right):
        if of_right[i] < 0:
            of_right[i] = count
            size[count] = 1
            count += 1
        of_row[right[i]] = of_right[i]
    for p in range(count):
        must[p] = False
    for r in range(num_rows):
        if sensor[r] <= level and not slack[r]:
            must[of_row[r]] = True
    return count
