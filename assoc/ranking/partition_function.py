"""An upper bound on the total weight of all solutions, their partition function.

With multipliers, a solution x has the excess E(x) = sum of the reduced costs of its columns and of -u_r over
its uncovered rows, all terms >= 0 (deepening.py). For a temperature 1 / a

    Z(a) = sum over all x of exp(-a E(x))

is a product over the components of the packing. Within a component every solution is found by going through
the sensors in any order and choosing for each row what covers it, unless an earlier choice does:

    Z(a) <= prod_r ( [r may stay uncovered] exp(a u_r) + sum of exp(-a rc_j) over the columns j that begin in r )

where a column begins in its row of the first sensor in that order, and the first term is 1 for a row that a
column beginning elsewhere can cover. The product also counts choices that do not fit together, so it is
sharpened by deciding rows: of the parts so far the one with the largest product is split by the choices for
one of its rows. With time enough nothing but solutions is left and the sum is exact.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.kernels.heap import pop, push
from assoc.packing.packing import Packing
from assoc.ranking.columns import Complete

# column visits for each component: about a tenth of a second in all for a hard one
WORK = 20_000_000


def log_partition(
    columns: Complete,
    sensor_of: NDArray[np.int64],
    a: float,
    work: int = WORK,
    deadline: float = math.inf,
    packing: Packing | None = None,
) -> float:
    """Return an upper bound on ln Z(a).

    Parameters
    ----------
    columns : Complete
        The problem.
    sensor_of : int64 array, shape (R,)
        Sensor of each measurement.
    a : float
        Inverse temperature >= 0; 0 counts the solutions.
    work : int
        Column visits spent on each component.
    deadline : float
        After it, in seconds of `time.monotonic`, no component is sharpened: the bound holds, but is wide.
    packing : Packing, optional
        ``columns.keep(inf)``, where it is at hand.
    """
    packing = packing or columns.keep(np.inf)
    inside = np.zeros(columns.slack.size, dtype=bool)
    inside[packing.row_origin] = True
    # a row without columns stays uncovered, at its price
    total = -a * float(columns.slack_reduced[~inside & columns.slack].sum())
    for c in range(packing.num_components):
        piece = packing.component(c)
        origin = packing.origin[packing.col_start[c] : packing.col_start[c + 1]]
        rows = packing.row_origin[packing.row_start[c] : packing.row_start[c + 1]]
        total += _component(
            np.ascontiguousarray(piece.cols),
            columns.reduced[origin],
            np.ascontiguousarray(piece.slack),
            columns.slack_reduced[rows],
            np.ascontiguousarray(piece.row_ptr),
            np.ascontiguousarray(piece.row_cols),
            sensor_of[rows],
            a,
            work,
            deadline,
        )
    return total


@njit
def _component(
    cols: Any, reduced: Floats, slack: Any, slack_reduced: Floats, row_ptr: Any, row_cols: Any, sensor_of: Any,
    a: float, work: int, deadline: float
) -> float:  # fmt: skip
    """Bound ln Z(a) of one component by splitting the part of the largest product first."""
    num_rows = slack.size
    weights = np.exp(-a * reduced)
    alone = np.zeros(num_rows)
    for r in range(num_rows):
        if slack[r]:
            alone[r] = math.exp(-a * slack_reduced[r])
    capacity = 64
    done = np.zeros((capacity, num_rows), np.bool_)
    log_spent = np.zeros(capacity)
    log_bound = np.empty(capacity)
    key = np.empty(capacity)
    item = np.empty(capacity, np.int64)
    factor = np.empty(num_rows)
    reach = np.empty(num_rows, np.bool_)
    log_bound[0] = _product(cols, weights, alone, sensor_of, done[0], factor, reach)
    push(key, item, 0, -log_bound[0], 0)
    size, used = 1, 1
    # exact parts are summed relative to the first bound, which none can exceed
    top = log_bound[0]
    if top == -np.inf:
        return top
    closed = 0.0
    visits = cols.size * cols.shape[1]
    spent_work = 0
    while size > 0 and spent_work < work and not is_over(deadline):
        node = item[0]
        # what is left below this share of the whole is not worth the time
        if log_bound[node] - top < -30.0:
            break
        row = -1
        most = -1
        for r in range(num_rows):
            if not done[node, r]:
                choices = 0
                for x in range(row_ptr[r], row_ptr[r + 1]):
                    if _fits(cols, done[node], row_cols[x]):
                        choices += 1
                if choices > most:
                    row, most = r, choices
        size -= 1
        pop(key, item, size)
        if row < 0:
            closed += math.exp(log_spent[node] - top)
            continue
        before = done[node].copy()
        spent = log_spent[node]
        for x in range(row_ptr[row] - 1, row_ptr[row + 1]):
            j = -1
            if x < row_ptr[row]:
                # to leave the row uncovered
                if alone[row] == 0.0:
                    continue
                price = math.log(alone[row])
            else:
                j = row_cols[x]
                if weights[j] == 0.0 or not _fits(cols, before, j):
                    continue
                price = -a * reduced[j]
            if is_over(deadline):
                # the part counts whole, beside those of its choices that are counted already: still a bound
                closed += math.exp(log_bound[node] - top)
                break
            if used == capacity:
                done = np.concatenate((done, np.zeros((capacity, num_rows), np.bool_)))
                log_spent = np.concatenate((log_spent, np.zeros(capacity)))
                log_bound = np.concatenate((log_bound, np.empty(capacity)))
                key = np.concatenate((key, np.empty(capacity)))
                item = np.concatenate((item, np.empty(capacity, np.int64)))
                capacity *= 2
            done[used] = before
            done[used, row] = True
            if j >= 0:
                for s in range(cols.shape[1]):
                    if cols[j, s] >= 0:
                        done[used, cols[j, s]] = True
            log_spent[used] = spent + price
            bound = _product(cols, weights, alone, sensor_of, done[used], factor, reach)
            spent_work += visits
            if bound > -np.inf:
                log_bound[used] = log_spent[used] + bound
                push(key, item, size, -log_bound[used], used)
                size += 1
                used += 1
    for n in range(size):
        closed += math.exp(-key[n] - top)
    # exp and log of many parts lose a few digits
    return min(top, top + math.log(closed)) + 1e-11 if closed > 0.0 else -np.inf


@njit
def _fits(cols: Any, done: Any, j: int) -> bool:
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0 and done[cols[j, s]]:
            return False
    return True


@njit
def _product(
    cols: Any, weights: Floats, alone: Floats, sensor_of: Any, done: Any, factor: Floats, reach: Any
) -> float:  # fmt: skip
    """Return the least logarithm of the product (module's equation) over the cyclic orders of the sensors."""
    num, num_sensors = cols.shape
    best = np.inf
    for first in range(num_sensors):
        factor[:] = 0.0
        reach[:] = False
        for j in range(num):
            if not _fits(cols, done, j):
                continue
            begun = False
            for t in range(num_sensors):
                r = cols[j, (first + t) % num_sensors]
                if r >= 0:
                    if begun:
                        reach[r] = True
                    else:
                        factor[r] += weights[j]
                        begun = True
        total = 0.0
        for r in range(factor.size):
            if done[r]:
                continue
            value = factor[r] + (1.0 if reach[r] else alone[r])
            if value == 0.0:
                return -np.inf
            total += math.log(value)
        best = min(best, total)
    return best
