"""The form in which all solvers see a problem: weighted columns over rows, sorted by component.

A row is one measurement. With dummies, every measurement starts as a false alarm, its singleton: a column is a
tuple of two or more measurements, its weight the cost of the tuple less the costs of its singletons, and
every row has *slack* (it may stay uncovered at weight 0). The problem is then a minimum-weight set packing,
in which only columns of negative weight matter. Without dummies every tuple is a column; rows of the
smallest dimension have no slack.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc.packing.kernels.columns import first_row


class PackingArrays(NamedTuple):
    """The arrays of a packing, as kernels take them; see `Packing`."""

    cols: NDArray[np.int32]
    weights: NDArray[np.float64]
    slack: NDArray[np.bool_]
    col_start: NDArray[np.int64]
    row_start: NDArray[np.int64]
    row_ptr: NDArray[np.int64]
    row_cols: NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Packing:
    """Columns over rows; columns and rows are sorted by component.

    Attributes
    ----------
    cols : int32 array, shape (N, S)
        Rows of each column; -1 where the sensor missed.
    weights : float array, shape (N,)
        Weight of each column.
    slack : bool array, shape (R,)
        Whether a row may stay uncovered.
    col_start, row_start : int64 arrays, shape (C + 1,)
        Component c has columns ``col_start[c]:col_start[c+1]`` and rows ``row_start[c]:row_start[c+1]``.
    row_ptr, row_cols : int64 array (R + 1,), int32 array
        Columns of each row, ascending.
    origin : int32 array, shape (N,)
        Index of each column in the packing or tuples that this packing was made from.
    row_origin : int32 array, shape (R,)
        Index of each row in the packing or problem that this packing was made from.
    granularity : float
        1.0 where all weights are whole numbers, so that solutions differ by at least 1; else 0.0.
    arrays : PackingArrays
        The packing as kernels take it.
    """

    cols: NDArray[np.int32]
    weights: NDArray[np.float64]
    slack: NDArray[np.bool_]
    col_start: NDArray[np.int64]
    row_start: NDArray[np.int64]
    row_ptr: NDArray[np.int64]
    row_cols: NDArray[np.int32]
    origin: NDArray[np.int32]
    row_origin: NDArray[np.int32]
    granularity: float = 0.0
    arrays: PackingArrays = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        arrays = PackingArrays(
            self.cols, self.weights, self.slack, self.col_start, self.row_start, self.row_ptr, self.row_cols
        )
        object.__setattr__(self, "arrays", arrays)

    @property
    def num_columns(self) -> int:
        """Number of columns N."""
        return int(self.weights.size)

    @property
    def num_rows(self) -> int:
        """Number of rows R."""
        return int(self.slack.size)

    @property
    def num_sensors(self) -> int:
        """Number of sensors S, the most rows that a column can have."""
        return int(self.cols.shape[1])

    @property
    def num_components(self) -> int:
        """Number of independent components C."""
        return int(self.col_start.size - 1)

    @property
    def is_axial(self) -> bool:
        """Whether some row must be covered (a problem without dummies)."""
        return not bool(self.slack.all())

    def restrict(self, keep: NDArray[np.bool_]) -> Packing:
        """Return the packing of the columns in ``keep``, split into its components.

        Rows without slack are kept even if no column covers them any more.
        """
        chosen = np.flatnonzero(keep).astype(np.int32)
        return assemble(self.cols[chosen], self.weights[chosen], self.arrays.slack, chosen, self.granularity)

    def touching(self, rows: NDArray[np.integer]) -> NDArray[np.int32]:
        """The columns that use one of these rows, ascending."""
        used = np.zeros(self.num_columns, dtype=np.bool_)
        for r in rows.tolist():
            used[self.row_cols[self.row_ptr[r] : self.row_ptr[r + 1]]] = True
        return np.flatnonzero(used).astype(np.int32)

    def read_only(self) -> Packing:
        """Return a copy with read-only fields.

        Its ``arrays`` stay writable: for read-only arrays numba would compile all kernels again.
        """
        names = (*PackingArrays._fields, "origin", "row_origin")
        arrays = {name: getattr(self, name).copy() for name in names}
        copy = Packing(**arrays, granularity=self.granularity)
        for name, array in arrays.items():
            view = array.view()
            view.flags.writeable = False
            object.__setattr__(copy, name, view)
        return copy

    def component(self, index: int) -> Packing:
        """Return one component as a separate packing."""
        first, last = int(self.col_start[index]), int(self.col_start[index + 1])
        top, end = int(self.row_start[index]), int(self.row_start[index + 1])
        cols = self.cols[first:last].copy()
        cols[cols >= 0] -= top
        pointer = self.row_ptr[top : end + 1]
        return Packing(
            cols,
            self.arrays.weights[first:last],
            self.arrays.slack[top:end],
            np.array([0, last - first]),
            np.array([0, end - top]),
            pointer - pointer[0],
            self.row_cols[pointer[0] : pointer[-1]] - np.int32(first),
            np.arange(first, last, dtype=np.int32),
            np.arange(top, end, dtype=np.int32),
            self.granularity,
        )


def assemble(
    rows: NDArray[np.int32],
    weights: NDArray[np.float64],
    slack: NDArray[np.bool_],
    origin: NDArray[np.int32],
    granularity: float = 0.0,
) -> Packing:
    """Sort columns into components (rows in any numbering, -1 for none) and index them by row."""
    arrays: Any = assembled(rows, weights, slack, origin)
    return Packing(*(*arrays, granularity))


@inner_njit
def find(parent: NDArray[np.int32], i: int) -> int:
    """Root of i in a union-find forest; halves the path on the way."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@inner_njit
def _numbered_components(rows: NDArray[np.int32], slack: NDArray[np.bool_]) -> tuple[NDArray[np.int32], int]:
    """Component of each row, by their first rows, -1 of rows that count nowhere; and the number of components."""
    num, num_sensors = rows.shape
    total = slack.size
    parent = np.empty(total, np.int32)
    for r in range(total):
        parent[r] = r
    used = np.zeros(total, np.bool_)
    for j in range(num):
        first = -1
        for s in range(num_sensors):
            r = rows[j, s]
            if r >= 0:
                used[r] = True
                # mostly found at once
                root = parent[r]
                if root != first:
                    root = find(parent, root)
                if first < 0:
                    first = root
                elif root != first:
                    # the smaller number becomes the root: components are ordered by their first row
                    if root < first:
                        parent[first] = root
                        first = root
                    else:
                        parent[root] = first
    component = np.full(total, -1, np.int32)
    num_components = 0
    for r in range(total):
        if used[r] or not slack[r]:
            root = find(parent, r)
            if component[root] < 0:
                component[root] = num_components
                num_components += 1
            component[r] = component[root]
    return component, num_components


@inner_njit
def _indexed_by_row(cols: NDArray[np.int32], num_rows: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Where the columns of each row begin, and the columns of each row, ascending."""
    row_ptr = np.zeros(num_rows + 1, np.int64)
    for k in range(cols.shape[0]):
        for s in range(cols.shape[1]):
            if cols[k, s] >= 0:
                row_ptr[cols[k, s] + 1] += 1
    for r in range(num_rows):
        row_ptr[r + 1] += row_ptr[r]
    end = row_ptr[:-1].copy()
    row_cols = np.empty(row_ptr[-1], np.int32)
    for k in range(cols.shape[0]):
        for s in range(cols.shape[1]):
            r = cols[k, s]
            if r >= 0:
                row_cols[end[r]] = k
                end[r] += 1
    return row_ptr, row_cols


@njit
def assembled(
    rows: NDArray[np.int32], weights: NDArray[np.float64], slack: NDArray[np.bool_], origin: NDArray[np.int32]
) -> Any:
    """Return the arrays of a `Packing`, in its order, from columns over rows in any numbering.

    Rows and weights may become arrays of the packing: they must not be changed afterwards.
    """
    num, total = weights.size, slack.size
    component, num_components = _numbered_components(rows, slack)
    row_start = np.zeros(num_components + 1, np.int64)
    for r in range(total):
        if component[r] >= 0:
            row_start[component[r] + 1] += 1
    for c in range(num_components):
        row_start[c + 1] += row_start[c]
    fill = row_start[:-1].copy()
    new_row = np.full(total, -1, np.int32)
    row_origin = np.empty(row_start[-1], np.int32)
    new_slack = np.empty(row_start[-1], np.bool_)
    for r in range(total):
        c = component[r]
        if c >= 0:
            new_row[r] = fill[c]
            row_origin[fill[c]] = r
            new_slack[fill[c]] = slack[r]
            fill[c] += 1
    col_start = np.zeros(num_components + 1, np.int64)
    new_origin = np.empty(num, np.int32)
    if num_components == 1 and row_origin.size == total:
        # all rows and columns are in their places
        cols, new_weights, col_start[1] = rows, weights, num
        for j in range(num):
            new_origin[j] = origin[j]
    else:
        cols, new_weights = np.empty(rows.shape, np.int32), np.empty(num)
        for j in range(num):
            col_start[component[first_row(rows, j)] + 1] += 1
        for c in range(num_components):
            col_start[c + 1] += col_start[c]
        fill = col_start[:-1].copy()
        for j in range(num):
            c = component[first_row(rows, j)]
            k = fill[c]
            fill[c] += 1
            new_weights[k] = weights[j]
            new_origin[k] = origin[j]
            for s in range(rows.shape[1]):
                cols[k, s] = new_row[rows[j, s]] if rows[j, s] >= 0 else -1
    row_ptr, row_cols = _indexed_by_row(cols, row_origin.size)
    return cols, new_weights, new_slack, col_start, row_start, row_ptr, row_cols, new_origin, row_origin
