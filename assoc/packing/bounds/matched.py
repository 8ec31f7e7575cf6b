"""Packings whose columns join rows of two sides: one sparse matching solves them, and its duals prove it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats, Ints
from assoc.packing.kernels.matching import match_sparse
from assoc.packing.packing import Packing, PackingArrays


def matched(packing: Packing) -> tuple[float, NDArray[np.int32], Floats] | None:
    """Solve a packing by one matching; None unless each column has one row, or one of each of two sides.

    Two lists of measurements are such a packing, and so is what is left of three where two decide. Returns the weight
    of the best cover, its column of each row, -1 for none, (R,), and optimal multipliers (R,); if there is no cover the
    weight is ``inf``, and the arrays mean nothing.
    """
    owner, duals = np.full(packing.num_rows, -1, dtype=np.int32), np.zeros(packing.num_rows)
    side = np.empty(packing.num_rows, dtype=np.int64)
    if not _sides(packing.arrays, side):
        return None
    return float(_match(packing.arrays, side, owner, duals)), owner, duals


@njit
def _sides(packing: PackingArrays, side: Ints) -> bool:
    """Fill in the side of each row, 0 or 1; False if a column has more than two rows, or two of one side."""
    cols, slack, row_ptr, row_cols = packing.cols, packing.slack, packing.row_ptr, packing.row_cols
    for j in range(cols.shape[0]):
        count = 0
        for s in range(cols.shape[1]):
            count += cols[j, s] >= 0
        if count > 2:
            return False
    side[:] = -1
    waiting = np.empty(side.size, np.int64)
    for start in range(side.size):
        if side[start] >= 0:
            continue
        # rows that must be covered are on side 0 if they can be: the other side's prices stay small
        side[start], waiting[0], size = int(slack[start]), start, 1
        while size > 0:
            size -= 1
            row = waiting[size]
            for k in range(row_ptr[row], row_ptr[row + 1]):
                other = _other_row(cols, row_cols[k], row)
                if other >= 0 and side[other] < 0:
                    side[other], waiting[size] = 1 - side[row], other
                    size += 1
                elif other >= 0 and side[other] == side[row]:
                    return False
    return True


@inner_njit
def _other_row(cols: NDArray[np.int32], j: int, row: int) -> int:
    """The other row of a column, -1 for none."""
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0 and cols[j, s] != row:
            return int(cols[j, s])
    return -1


@inner_njit
def _ends(cols: NDArray[np.int32], j: int, side: Ints) -> tuple[int, int]:
    """The rows of a column on side 0 and on side 1, -1 for none."""
    left = right = -1
    for s in range(cols.shape[1]):
        r = cols[j, s]
        if r >= 0 and side[r] == 0:
            left = r
        elif r >= 0:
            right = r
    return left, right


@njit
def _match(packing: PackingArrays, side: Ints, owner: NDArray[np.int32], duals: Floats) -> float:
    """Fill in the columns and multipliers of the rows; return the weight, ``inf`` if there is no cover."""
    cols, weights, slack = packing.cols, packing.weights, packing.slack
    num = side.size
    number, count = np.empty(num, np.int64), np.zeros(2, np.int64)
    # a row alone: uncovered, or covered by its cheapest column without another row
    price, alone = np.empty((2, num)), np.full(num, -1, np.int32)
    rows = np.empty((2, num), np.int64)
    for r in range(num):
        number[r], rows[side[r], count[side[r]]] = count[side[r]], r
        price[side[r], count[side[r]]] = 0.0 if slack[r] else np.inf
        count[side[r]] += 1
    indptr = np.zeros(count[0] + 1, np.int64)
    for j in range(weights.size):
        left, right = _ends(cols, j, side)
        if left >= 0 and right >= 0:
            indptr[number[left] + 1] += 1
            continue
        r = max(left, right)
        if weights[j] < price[side[r], number[r]]:
            price[side[r], number[r]], alone[r] = weights[j], j
    for i in range(count[0]):
        indptr[i + 1] += indptr[i]
    indices, costs, column = np.empty(indptr[-1], np.int64), np.empty(indptr[-1]), np.empty(indptr[-1], np.int32)
    end = indptr[:-1].copy()
    for j in range(weights.size):
        left, right = _ends(cols, j, side)
        if left >= 0 and right >= 0:
            e = end[number[left]]
            end[number[left]] += 1
            indices[e], costs[e], column[e] = number[right], weights[j], j
    row_edge, u, v = np.empty(count[0], np.int64), np.empty(count[0]), np.empty(count[1])
    weight = match_sparse(indptr, indices, costs, price[0, : count[0]], price[1, : count[1]], row_edge, u, v)
    if weight == np.inf:
        return weight
    for r in range(num):
        owner[r] = alone[r]
        duals[r] = u[number[r]] if side[r] == 0 else v[number[r]]
    for i in range(count[0]):
        if row_edge[i] >= 0:
            owner[rows[0, i]] = owner[rows[1, indices[row_edge[i]]]] = column[row_edge[i]]
    return weight
