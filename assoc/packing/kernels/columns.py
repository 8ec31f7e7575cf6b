"""Queries on one column: its first row, and whether its rows are uncovered.

``cols`` has shape (N, S): the rows of each column by sensor, -1 where the sensor missed.
"""

from __future__ import annotations

from assoc._system.compiled import inner_njit
from assoc._types import Ints


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
    """Whether all rows of column j are uncovered; ``owner`` is the column that covers each row, -1 for none."""
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0 and owner[cols[j, s]] >= 0:
            return False
    return True
