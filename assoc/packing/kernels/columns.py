"""What kernels ask of one column: its first row, and whether its rows are free.

``cols`` has shape (N, S): the rows of each column by sensor, -1 where the sensor missed.
"""

from __future__ import annotations

from typing import Any

from assoc._system.compiled import inner_njit


@inner_njit
def first_row(cols: Any, j: int) -> int:
    """Row of column j in the first sensor that it has; -1 for a column without rows.

    A column is met once in each of its rows: where it must count once, it counts in this one.
    """
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0:
            return int(cols[j, s])
    return -1


@inner_njit
def fits(cols: Any, owner: Any, j: int) -> bool:
    """Whether all rows of column j are free; ``owner`` is the column that covers each row, -1 for none."""
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0 and owner[cols[j, s]] >= 0:
            return False
    return True
