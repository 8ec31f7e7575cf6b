"""An upper bound on the total weight of all solutions, their partition function.

With multipliers, a solution x has the excess E(x) = sum of the reduced costs of its columns and of -u_r over
its uncovered rows, all terms >= 0 (enumeration.py). For a temperature 1 / a

    Z(a) = sum over all x of exp(-a E(x))

is a product over the components of the packing. Within a component every solution results from visiting the
sensors in any order and choosing a column for each row that no earlier choice covers:

    Z(a) <= prod_r ( [r may stay uncovered] exp(a u_r) + sum of exp(-a rc_j) over the columns j that begin in r )

where a column begins in its row of the first sensor in that order, and the first term is 1 for a row that a
column beginning elsewhere can cover. The product also counts incompatible choices. To sharpen it, the part with
the largest product is split by the choices for one of its rows, again and again. With enough time only solutions
remain, and the sum is exact.

Where the linear program's bound is weak, every solution has a large excess and exp(-E) underflows. Terms are kept as
logarithms wherever their sum would underflow.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats, Ints
from assoc.packing.kernels.copying import copy_to
from assoc.packing.kernels.heap import doubled, doubled_rows, pop, push
from assoc.packing.packing import Packing
from assoc.packing.run import never
from assoc.ranking.columns import AllColumns

# column visits for each component: about a tenth of a second in all for a hard one
WORK = 20_000_000
# parts below this share of the total (a logarithm) are not split
_SMALL = -30.0
# sums below this have lost digits to underflow
_TINY = 1e-280


class Terms(NamedTuple):
    """The terms of a component's product and their logarithms."""

    cols: NDArray[np.int32]
    row_ptr: NDArray[np.int64]
    row_cols: NDArray[np.int32]
    """With ``cols`` and ``row_ptr`` as in packing.py."""
    log_weights: NDArray[np.float64]
    weights: NDArray[np.float64]
    """Of the columns: -a times the reduced cost, (N,)."""
    log_alone: NDArray[np.float64]
    alone: NDArray[np.float64]
    """Of leaving a row uncovered; -inf: not allowed, (R,)."""


def log_partition(
    columns: AllColumns,
    a: float,
    work: int = WORK,
    deadline: Callable[[], float] = never,
    packing: Packing | None = None,
) -> float:
    """Return an upper bound on ln Z(a) at inverse temperature a >= 0; 0 counts the solutions.

    ``work`` is the largest number of column visits for each component; after the deadline none is sharpened: the bound
    is valid, but weak. ``packing`` is ``columns.keep(inf)``, if already computed.
    """
    packing = packing or columns.keep(np.inf)
    log_weights = -a * columns.reduced[packing.origin]
    log_alone = np.full(columns.slack.size, -np.inf)
    log_alone[columns.slack] = -a * columns.slack_reduced[columns.slack]
    inside = np.zeros(columns.slack.size, dtype=bool)
    inside[packing.row_origin] = True
    # a row without columns stays uncovered
    total = float(log_alone[~inside & columns.slack].sum())
    log_alone = log_alone[packing.row_origin]
    for c in range(packing.num_components):
        component = packing.component(c)
        log_weight = log_weights[packing.col_start[c] : packing.col_start[c + 1]]
        log_uncovered = log_alone[packing.row_start[c] : packing.row_start[c + 1]]
        terms = Terms(
            np.ascontiguousarray(component.cols),
            np.ascontiguousarray(component.row_ptr),
            np.ascontiguousarray(component.row_cols),
            log_weight,
            np.exp(log_weight),
            log_uncovered,
            np.exp(log_uncovered),
        )
        total += _log_sum_of_solutions(terms, work, deadline())
    return total


@njit
def _log_sum_of_solutions(terms: Terms, work: int, deadline: float) -> float:
    """Bound ln Z(a) of one component by splitting the part of the largest product first."""
    cols, row_ptr, row_cols, log_weights, _, log_alone, _ = terms
    num_rows = log_alone.size
    done = np.zeros((64, num_rows), np.bool_)
    log_spent = np.zeros(64)
    log_bound = np.empty(64)
    key = np.empty(64)
    item = np.empty(64, np.int64)
    factor = np.empty(num_rows)
    reach = np.empty(num_rows, np.bool_)
    top = _log_product(terms, done[0], factor, reach)
    if top == -np.inf:
        return top
    log_bound[0] = top
    push(key, item, 0, -top, 0)
    size, used = 1, 1
    # parts that are not split any more: their sum is closed * exp(largest)
    largest, closed = -np.inf, 0.0
    visits = cols.size * cols.shape[1]
    spent_work = 0
    while size > 0 and spent_work < work and not is_over(deadline):
        node = item[0]
        if closed > 0.0 and log_bound[node] - largest - math.log(closed) < _SMALL:
            break
        row = _row_of_most_choices(terms, done[node])
        size -= 1
        pop(key, item, size)
        if row < 0:
            largest, closed = _added(largest, closed, log_spent[node])
            continue
        before = done[node].copy()
        spent = log_spent[node]
        for x in range(row_ptr[row] - 1, row_ptr[row + 1]):
            j = -1
            if x < row_ptr[row]:
                # the choice to leave the row uncovered
                if log_alone[row] == -np.inf:
                    continue
                price = log_alone[row]
            else:
                j = row_cols[x]
                if not _is_open(cols, before, j):
                    continue
                price = log_weights[j]
            if is_over(deadline):
                # the whole part is added to those of its choices that are counted already: still an upper bound
                largest, closed = _added(largest, closed, log_bound[node])
                break
            if used == log_spent.size:
                done, log_spent, log_bound = doubled_rows(done), doubled(log_spent), doubled(log_bound)
                key, item = doubled(key), doubled(item)
            _decide(cols, before, row, j, done[used])
            log_spent[used] = spent + price
            bound = _log_product(terms, done[used], factor, reach)
            spent_work += visits
            if bound > -np.inf:
                log_bound[used] = log_spent[used] + bound
                push(key, item, size, -log_bound[used], used)
                size += 1
                used += 1
    for n in range(size):
        largest, closed = _added(largest, closed, -key[n])
    if closed == 0.0:
        return -np.inf
    result = min(top, largest + math.log(closed))
    # the rounding of sums of logarithms grows with their size; exp and log of many parts lose a few digits more
    size_of_sums = abs(result) + 50.0 + num_rows * math.log(log_weights.size + 1.0)
    return result + 1e-11 + 4e-16 * (num_rows + 3) * size_of_sums


@inner_njit
def _row_of_most_choices(terms: Terms, done: NDArray[np.bool_]) -> int:
    """The undecided row with the most open columns; -1: all are decided."""
    row, most = -1, -1
    for r in range(done.size):
        if not done[r]:
            choices = 0
            for x in range(terms.row_ptr[r], terms.row_ptr[r + 1]):
                if _is_open(terms.cols, done, terms.row_cols[x]):
                    choices += 1
            if choices > most:
                row, most = r, choices
    return row


@inner_njit
def _decide(cols: Ints, before: NDArray[np.bool_], row: int, column: int, after: NDArray[np.bool_]) -> None:
    """Fill in which rows are decided after a row is covered by a column, or stays uncovered (-1)."""
    copy_to(after, before)
    after[row] = True
    if column >= 0:
        for s in range(cols.shape[1]):
            if cols[column, s] >= 0:
                after[cols[column, s]] = True


@inner_njit
def _added(largest: float, total: float, term: float) -> Any:
    """Add exp(term) to total * exp(largest); ``largest`` becomes the largest term so far."""
    if term == -np.inf:
        return largest, total
    if term <= largest:
        return largest, total + math.exp(term - largest)
    return term, total * math.exp(largest - term) + 1.0


@inner_njit
def _is_open(cols: Ints, done: NDArray[np.bool_], j: int) -> bool:
    """Whether none of a column's rows is decided."""
    for s in range(cols.shape[1]):
        if cols[j, s] >= 0 and done[cols[j, s]]:
            return False
    return True


@inner_njit
def _log_product(terms: Terms, done: NDArray[np.bool_], factor: Floats, reach: NDArray[np.bool_]) -> float:
    """Return the least logarithm of the product (see the module) over the cyclic orders of the sensors."""
    cols, weights, alone = terms.cols, terms.weights, terms.alone
    num, num_sensors = cols.shape
    best = np.inf
    for first in range(num_sensors):
        factor[:] = 0.0
        reach[:] = False
        for j in range(num):
            if not _is_open(cols, done, j):
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
            if value > _TINY:
                total += math.log(value)
            else:
                total += _log_row(terms, done, r, first)
                if total == -np.inf:
                    return total
        best = min(best, total)
    return best


@inner_njit
def _log_row(terms: Terms, done: NDArray[np.bool_], row: int, first: int) -> float:
    """Logarithm of a row's sum where it underflows: over the columns that begin in it, and leaving it uncovered."""
    cols, num_sensors = terms.cols, terms.cols.shape[1]
    largest, total = _added(-np.inf, 0.0, terms.log_alone[row])
    for x in range(terms.row_ptr[row], terms.row_ptr[row + 1]):
        j = terms.row_cols[x]
        if _is_open(cols, done, j):
            for t in range(num_sensors):
                r = cols[j, (first + t) % num_sensors]
                if r >= 0:
                    if r == row:
                        largest, total = _added(largest, total, terms.log_weights[j])
                    break
    return largest + math.log(total) if total > 0.0 else -np.inf
