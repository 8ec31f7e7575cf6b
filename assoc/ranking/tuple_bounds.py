"""Bounds on the probability of each tuple among all solutions, by a recursion over measurements.

A solution of a graph G of tuples is a set of them that uses each measurement at most once, and weighs the product of
their w = exp(-cost relative to false alarms). Let P(v; G) be the probability that measurement v is in no tuple of the
solution. The solutions with tuple t = {v, r_1, ..., r_n} are those of G without all of t, times w_t, so that

    P(v; G) = 1 / (1 + sum over tuples t of v of w_t P(r_1; G - v) P(r_2; G - v - r_1) ... P(r_n; G - v - ...)),

where G - v lacks the tuples of v, and t is in the solution with the share of its term in this sum. The right-hand side
falls in each P: upper bounds give a lower bound, and lower ones an upper. The recursion begins with 0 < P <= 1 where a
measurement matters little to the first one, and goes deeper there as long as it may take more steps.

References
----------
M. Bayati, D. Gamarnik, D. Katz, C. Nair, P. Tetali, Simple deterministic approximation algorithms for counting
matchings, STOC 2007, for pairs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats, Ints
from assoc.packing.run import Run
from assoc.ranking.columns import AllColumns

# logarithms of weights beyond which sums would overflow; lighter tuples weigh nothing
_HEAVIEST, LIGHTEST = 500.0, -700.0
# steps in all, and the most and the fewest for each measurement
_STEPS, _MOST, _FEWEST = 100_000_000, 1_000_000, 2_000
# steps between two checks of the time: some ten milliseconds
_AT_ONCE = 1_000_000
_DEEPEST = 400
# intervals are narrow enough from here on
_WIDTH = 1e-9
# influence below which the recursion begins with P <= 1, and its factor where this leaves intervals wide
_INFLUENCE, _FINER = 0.03, 0.25
ROUNDING = 1e-11
_SWEEPS = 60


class _Found(NamedTuple):
    """Bounds of the probability of N columns, and of that of R rows to be in none of them."""

    lower: Floats
    upper: Floats
    free_lower: Floats
    free_upper: Floats


class _Graph(NamedTuple):
    """Columns over rows, the columns of each row, and what each weighs there."""

    cols: NDArray[np.int32]
    weights: Floats
    row_ptr: Ints
    row_cols: Ints
    share: Floats
    """Estimated probability of each entry of ``row_cols``."""
    total: Floats
    """Weight of all columns of a row."""


class _Walk(NamedTuple):
    """Where the recursion is: whether each row is removed, the steps left (1,), and its levels."""

    removed: Ints
    left: Ints
    numbers: Ints
    values: Floats


def tuple_bounds(columns: AllColumns, run: Run) -> tuple[Floats, Floats, Floats] | None:
    """Estimate and bound the probabilities of the N columns, and that of the R rows to be in none of them.

    None where weights are too large for floats, or a row must be covered; else three arrays (N + R,).
    """
    log_weight, rows = -columns.weights, columns.slack.size
    if not columns.slack.all() or log_weight.max(initial=0.0) > _HEAVIEST:
        return None
    counts = log_weight > LIGHTEST
    graph = _graph(columns.rows, np.where(counts, np.exp(log_weight), 0.0), rows)
    num = len(log_weight)
    estimate = np.zeros(num)
    estimate[graph.row_cols] = graph.share
    found = _Found(np.zeros(num), np.ones(num), np.zeros(rows), np.ones(rows))
    most = int(np.clip(_STEPS // max(rows, 1), _FEWEST, _MOST))
    row = 0
    while row < rows and not run.should_stop():
        row = _bound_rows(graph, found, row, most)
    lower = np.maximum(np.append(found.lower, found.free_lower) - ROUNDING, 0.0)
    upper = np.minimum(np.append(found.upper, found.free_upper) + ROUNDING, 1.0)
    middle = 0.5 * (found.free_lower + found.free_upper)
    return np.clip(np.append(estimate, middle), lower, upper), lower, upper


def _graph(cols: NDArray[np.int32], weights: Floats, num_rows: int) -> _Graph:
    """Index columns by row, and estimate probabilities by damped mean-field equations."""
    column, sensor = np.nonzero(cols >= 0)
    of = cols[column, sensor]
    order = np.argsort(of, kind="stable")
    row, row_cols = of[order], column[order]
    free: Floats = np.full(num_rows, 0.5)
    sums: Floats = np.ones(num_rows)
    part: Floats = np.zeros(len(row))
    for _ in range(_SWEEPS):
        product = weights.copy()
        for s in range(cols.shape[1]):
            used = cols[:, s] >= 0
            product[used] *= free[cols[used, s]]
        part[:] = product[row_cols] / free[row]
        sums[:] = 1.0 + np.bincount(row, part, num_rows)
        np.maximum(np.sqrt(free / sums), 1e-300, out=free)
    row_ptr = np.append(0, np.cumsum(np.bincount(row, minlength=num_rows)))
    total = np.bincount(row, weights[row_cols], num_rows).astype(np.float64)
    return _Graph(cols, weights, row_ptr, row_cols, part / sums[row], total)


@njit
def _bound_rows(graph: _Graph, found: _Found, row: int, most: int) -> int:
    """Narrow the bounds of the columns of some rows, from this one on; return the next row."""
    row_ptr, row_cols = graph.row_ptr, graph.row_cols
    rows = row_ptr.size - 1
    walk = _Walk(
        np.zeros(rows, np.int64), np.zeros(1, np.int64), np.empty((_DEEPEST, 4), np.int64), np.empty((_DEEPEST, 5))
    )
    low, high = np.empty(row_cols.size), np.empty(row_cols.size)
    low_after, high_after = np.empty(row_cols.size + 1), np.empty(row_cols.size + 1)
    steps = 0
    while row < rows and steps < _AT_ONCE:
        influence, spent, width = _INFLUENCE, 0, 1.0
        # each round takes some times the steps of the one before
        while width > _WIDTH and 4 * spent <= most:
            walk.left[0] = most - spent
            walk.removed[row] = 1
            low_sum, high_sum = 1.0, 1.0
            for x in range(row_ptr[row], row_ptr[row + 1]):
                low[x], high[x] = _others_free(graph, walk, row_cols[x], row, graph.share[x], influence)
                low_sum += low[x]
                high_sum += high[x]
            walk.removed[row] = 0
            width = 1.0 / low_sum - 1.0 / high_sum
            found.free_lower[row] = max(found.free_lower[row], 1.0 / high_sum)
            found.free_upper[row] = min(found.free_upper[row], 1.0 / low_sum)
            # sums of all terms but one, from both ends: a difference of sums would lose the small ones
            low_after[row_ptr[row + 1] - row_ptr[row]], high_after[row_ptr[row + 1] - row_ptr[row]] = 0.0, 0.0
            for i in range(row_ptr[row + 1] - row_ptr[row] - 1, -1, -1):
                low_after[i] = low_after[i + 1] + low[row_ptr[row] + i]
                high_after[i] = high_after[i + 1] + high[row_ptr[row] + i]
            low_before, high_before = 1.0, 1.0
            for x in range(row_ptr[row], row_ptr[row + 1]):
                j, after, least, most_likely = row_cols[x], x + 1 - row_ptr[row], 0.0, 0.0
                if low[x] > 0.0:
                    least = low[x] / (low[x] + high_before + high_after[after])
                if high[x] > 0.0:
                    most_likely = high[x] / (high[x] + low_before + low_after[after])
                low_before += low[x]
                high_before += high[x]
                found.lower[j], found.upper[j] = max(found.lower[j], least), min(found.upper[j], most_likely)
                width = max(width, found.upper[j] - found.lower[j])
            spent = most - walk.left[0]
            influence *= _FINER
        steps += spent
        row += 1
    return row


@inner_njit
def _others_free(graph: _Graph, walk: _Walk, j: int, v: int, influence: float, least: float) -> tuple[float, float]:
    """Bounds on the weight of column j times the probability that its rows but v are free, one after the other."""
    cols, weights, row_ptr, row_cols, share = graph.cols, graph.weights, graph.row_ptr, graph.row_cols, graph.share
    removed, left, numbers, values = walk.removed, walk.left, walk.numbers, walk.values
    num_sensors = cols.shape[1]
    if influence < least or left[0] <= 0:
        return _shallow(graph, j, v)
    # each level is a column (its number, the row it was reached from, the sensor whose row is being freed, and the next
    # place in the list of that row) with its bounds so far, the two sums of the row, and its influence on the first row
    depth = 0
    _enter(walk, 0, j, v, weights[j], influence)
    while True:
        j, v, s, x = numbers[depth, 0], numbers[depth, 1], numbers[depth, 2], numbers[depth, 3]
        r = cols[j, s] if s >= 0 else -1
        if r >= 0 and x < row_ptr[r + 1]:
            numbers[depth, 3] += 1
            left[0] -= 1
            k = row_cols[x]
            there = True
            for t in range(num_sensors):
                there = there and (cols[k, t] < 0 or cols[k, t] == r or removed[cols[k, t]] == 0)
            if there:
                influence = values[depth, 4] * share[x]
                if influence >= least and left[0] > 0 and depth + 1 < _DEEPEST:
                    depth += 1
                    _enter(walk, depth, k, r, weights[k], influence)
                else:
                    low, high = _shallow(graph, k, r)
                    values[depth, 2] += low
                    values[depth, 3] += high
            continue
        if r >= 0:
            values[depth, 0] /= values[depth, 3]
            values[depth, 1] /= values[depth, 2]
        s += 1
        while s < num_sensors and (cols[j, s] < 0 or cols[j, s] == v):
            s += 1
        if s < num_sensors:
            removed[cols[j, s]] += 1
            numbers[depth, 2], numbers[depth, 3] = s, row_ptr[cols[j, s]]
            values[depth, 2], values[depth, 3] = 1.0, 1.0
            continue
        for t in range(num_sensors):
            if cols[j, t] >= 0 and cols[j, t] != v:
                removed[cols[j, t]] -= 1
        low, high = values[depth, 0], values[depth, 1]
        if depth == 0:
            return low, high
        depth -= 1
        values[depth, 2] += low
        values[depth, 3] += high


@inner_njit
def _enter(walk: _Walk, depth: int, j: int, v: int, weight: float, influence: float) -> None:
    """Begin a level of the recursion."""
    walk.numbers[depth, 0], walk.numbers[depth, 1], walk.numbers[depth, 2], walk.numbers[depth, 3] = j, v, -1, 0
    walk.values[depth, 0], walk.values[depth, 1], walk.values[depth, 4] = weight, weight, influence


@inner_njit
def _shallow(graph: _Graph, j: int, v: int) -> tuple[float, float]:
    """`_others_free` without recursion: each row is free with probability at most 1, at least 1 / (1 + its weights)."""
    low = graph.weights[j]
    for s in range(graph.cols.shape[1]):
        if graph.cols[j, s] >= 0 and graph.cols[j, s] != v:
            low /= 1.0 + graph.total[graph.cols[j, s]]
    return low, graph.weights[j]
