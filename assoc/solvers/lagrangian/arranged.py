"""Columns arranged for the Lagrangian method, and helpers of relaxation and recovery."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats
from assoc.packing.packing import Packing


class Arranged(NamedTuple):
    """A packing of N columns and R rows for the kernels, its sensors in order of relaxation."""

    cols: NDArray[np.int32]
    """Rows of each column, int32 (N, S), the sensors in order of relaxation."""
    weights: Floats
    """Weight of each column, (N,)."""
    slack: NDArray[np.bool_]
    """Whether a row may stay uncovered, (R,)."""
    sensor: NDArray[np.int64]
    """Sensor of each row, counted in order of relaxation, int64 (R,)."""
    by_pair: NDArray[np.int64]
    """The columns in groups that share their rows of the first two sensors, int64 (N,)."""
    group_start: NDArray[np.int64]
    """Where each group begins in ``by_pair``, and the end; groups come in order of the first row."""


def arrange(packing: Packing) -> Arranged:
    """Arrange a packing.

    Sensors whose measurements must all be used come first, so that the 2-D problem keeps the hardest constraints.
    """
    arrays = packing.arrays
    cols, sensor, by_pair, group_start = _arrange(arrays.cols, arrays.slack)
    return Arranged(cols, arrays.weights, arrays.slack, sensor, by_pair, group_start)


@njit
def _arrange(cols: Any, slack: NDArray[np.bool_]) -> Any:
    """Return the columns with sensors in order of relaxation, the sensor of each row, and the columns by pair.

    The columns of each group share their rows of the first two sensors; groups come in order of the first row.
    """
    num, num_sensors = cols.shape
    num_rows = slack.size
    sensor = np.zeros(num_rows, np.int64)
    for j in range(num):
        for s in range(num_sensors):
            if cols[j, s] >= 0:
                sensor[cols[j, s]] = s
    must = np.zeros(num_sensors, np.bool_)
    for r in range(num_rows):
        if not slack[r]:
            must[sensor[r]] = True
    rank = np.empty(num_sensors, np.int64)
    count = 0
    for wanted in (True, False):
        for s in range(num_sensors):
            if must[s] == wanted:
                rank[s] = count
                count += 1
    ordered = np.empty_like(cols)
    for j in range(num):
        for s in range(num_sensors):
            ordered[j, rank[s]] = cols[j, s]
    for r in range(num_rows):
        sensor[r] = rank[sensor[r]]
    # counting sort, by the second row and then by the first
    by_pair, other = np.empty(num, np.int64), np.empty(num, np.int64)
    for j in range(num):
        by_pair[j] = j
    for s in range(min(num_sensors, 2) - 1, -1, -1):
        start = np.zeros(num_rows + 2, np.int64)
        for j in range(num):
            start[ordered[j, s] + 2] += 1
        for r in range(num_rows + 1):
            start[r + 1] += start[r]
        for j in by_pair:
            other[start[ordered[j, s] + 1]] = j
            start[ordered[j, s] + 1] += 1
        by_pair, other = other, by_pair
    group_start = np.empty(num + 1, np.int64)
    count = 0
    for k in range(num):
        same = k > 0
        for s in range(min(num_sensors, 2)):
            same = same and ordered[by_pair[k], s] == ordered[by_pair[k - 1], s]
        if not same:
            group_start[count] = k
            count += 1
    group_start[count] = num
    return ordered, sensor, by_pair, group_start[: count + 1].copy()


@inner_njit
def priced(cols: NDArray[np.int32], weights: Floats, duals: Floats, j: int, first: int) -> float:
    """Weight of a column less the multipliers of its rows in sensors from ``first`` on."""
    value = weights[j]
    for s in range(first, cols.shape[1]):
        if cols[j, s] >= 0:
            value -= duals[cols[j, s]]
    return value


@inner_njit
def number_rows(sensor: NDArray[np.int64], which: int, local: NDArray[np.int64], rows: NDArray[np.int64]) -> int:
    """Number the rows of one sensor."""
    count = 0
    for r in range(sensor.size):
        if sensor[r] == which:
            local[r] = count
            rows[count] = r
            count += 1
    return count


@inner_njit
def alone_prices(rows: NDArray[np.int64], num: int, slack: NDArray[np.bool_]) -> Floats:
    """Cost of leaving each of these rows uncovered: 0 with slack, infinite without."""
    prices = np.zeros(num)
    for i in range(num):
        if not slack[rows[i]]:
            prices[i] = np.inf
    return prices


@inner_njit
def drop_needless_prices(left: Floats, right: Floats) -> None:
    """Set the prices on the right to 0 where all on the left must be matched and both sides have the same size."""
    if left.size != right.size:
        return
    for price in left:
        if price != np.inf:
            return
    right[:] = 0.0
