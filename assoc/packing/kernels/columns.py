"""What kernels do with columns of a cover: whether one fits, to choose it, and the weight of all.

``cols`` has shape (N, S): the rows of each column by sensor, -1 where the sensor missed; ``owner`` is the
column that covers each row, -1 for none.
"""

from __future__ import annotations

import numpy as np

from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats, Ints


@inner_njit
def first_row(cols: Ints, j: int) -> int:
    """The first row of column j, by sensor; -1 for a column without rows.

    A loop over rows meets a column once in each of its rows: to count it only once, count it in its first.
    """
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0:
            return int(cols[j, s])
    return -1


@inner_njit
def fits(cols: Ints, owner: Ints, j: int) -> bool:
    """Whether all rows of column j are uncovered."""
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0 and owner[cols[j, s]] >= 0:
            return False
    return True


@inner_njit
def choose(cols: Ints, j: int, owner: Ints) -> None:
    """Choose column j: make it the owner of its rows."""
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0:
            owner[cols[j, s]] = j


@njit
def choose_all(cols: Ints, columns: Ints, owner: Ints) -> None:
    """Choose columns that share no row."""
    for j in columns:
        choose(cols, j, owner)


@inner_njit
def sum_of_weights(cols: Ints, weights: Floats, owner: Ints) -> float:
    """Weight of a cover, summed in the order of its rows."""
    total = 0.0
    for r in range(owner.size):
        j = owner[r]
        if j >= 0 and first_row(cols, j) == r:
            total += weights[j]
    return total


@inner_njit
def choose_matched(cols: Ints, row_edge: Ints, edges: tuple[Ints, Ints], alone: tuple[Ints, Ints], owner: Ints) -> None:
    """Choose the columns of a matching of left and right halves.

    ``edges`` are the right half and the column of each edge, ``alone`` the columns of left and of right halves that
    stay unmatched (-1: false alarms); ``row_edge`` is the edge of each left half, or -1.
    """
    indices, column = edges
    left_column, right_column = alone
    taken = np.zeros(right_column.size, np.bool_)
    for p in range(row_edge.size):
        e = row_edge[p]
        if e >= 0:
            taken[indices[e]] = True
        j = column[e] if e >= 0 else left_column[p]
        if j >= 0:
            choose(cols, j, owner)
    for q in range(right_column.size):
        if not taken[q] and right_column[q] >= 0:
            choose(cols, right_column[q], owner)
