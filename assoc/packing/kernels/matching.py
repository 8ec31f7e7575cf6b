"""Two-dimensional assignment: exact, sparse, with slack on either side, and with its duals.

Rows are matched to columns at the cost of the edge; an unmatched row or column costs its slack
(``inf``: it must be matched). A cheap start by row minima, then auctions (auction.py) where all rows and columns must
be matched, of the cheapest edges alone where rows have many; then the augmenting row reduction of [1]_, and a
shortest augmenting path (augmenting.py) from every row that is left.

The duals solve

    max  sum(u) + sum(v)   subject to   u_i + v_j <= c_ij,   u_i <= row_slack_i,   v_j <= column_slack_j

and their sum is the optimal cost.

References
----------
.. [1] R. Jonker and A. Volgenant, "A shortest augmenting path algorithm for dense and sparse linear
   assignment problems", Computing 38, 325-340 (1987).
"""

from __future__ import annotations

import math
import sys
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats, Ints
from assoc.packing.kernels.auction import hold_auction, reduce_rows, solve_core
from assoc.packing.kernels.augmenting import augment_all, augment_dense
from assoc.packing.kernels.partial_matching import Costs, State

# edges from which a dense problem is searched without a heap
_MANY = 500
# most steps of the row reduction for each row that is left, and where rows of few edges make steps cheap
_STEPS, _CHEAP = 4, 256
# share of rows whose cheapest column is another's from which cheap edges tell little
_CONTESTED = 0.75
# rows from which more than shortest paths is worth its time on a matrix; edges a row from which the cheapest go first
_LARGE, _WIDE = 220, 40
# rows that are left where no auction is held
_FEW = 8


class Matching(NamedTuple):
    """A two-dimensional assignment and the multipliers that prove it."""

    row_edge: NDArray[np.int64]
    """The chosen edge of each row (an index into ``indices``), or -1, (n,)."""
    row_duals: Floats
    """u of the module's dual problem, (n,)."""
    column_duals: Floats
    """v of it, (m,)."""
    cost: float
    """Total cost, including that of unmatched rows and columns."""
    bound: float
    """No matching costs less, whatever was rounded."""


def match(
    indptr: ArrayLike, indices: ArrayLike, costs: ArrayLike, row_slack: ArrayLike, column_slack: ArrayLike
) -> Matching | None:
    """Solve a sparse two-dimensional assignment; None if a row or column that must be matched cannot be.

    Row i has edges ``indptr[i]:indptr[i+1]``, with columns ``indices`` (E,) and costs (E,) of any sign; parallel edges
    are allowed, and ``inf`` forbids one. ``row_slack`` (n,) and ``column_slack`` (m,) are the costs of leaving one
    unmatched; ``inf`` where it must be matched.
    """
    pointer, ends = (np.ascontiguousarray(numbers, dtype=np.int64) for numbers in (indptr, indices))
    edge_costs, rows, columns = (np.ascontiguousarray(c, dtype=np.float64) for c in (costs, row_slack, column_slack))
    row_edge, u, v = np.empty(rows.size, np.int64), np.empty(rows.size), np.empty(columns.size)
    cost = match_sparse(pointer, ends, edge_costs, rows, columns, row_edge, u, v)
    if cost == np.inf:
        return None
    v = np.minimum(v, columns)
    # what was updated in place proves nothing: u anew, by v
    _least_reduced(pointer, ends, edge_costs, v, rows, u)
    bound = math.fsum([*u.tolist(), *v.tolist()])
    # each difference and the sum are rounded once; rounding keeps the order of differences
    bound -= sys.float_info.epsilon * (float(np.abs(u).sum()) + 2.0 * abs(bound))
    return Matching(row_edge, u, v, float(cost), bound)


@njit
def _least_reduced(indptr: Ints, indices: Ints, costs: Floats, v: Floats, row_slack: Floats, u: Floats) -> None:
    """Fill in the least cost of each row's edges less the price of their columns, or its slack."""
    unsigned = indices.view(np.uint64)
    for i in range(u.size):
        least = row_slack[i]
        for k in range(indptr[i], indptr[i + 1]):
            value = costs[k] - v[unsigned[k]]
            if value < least:
                least = value
        u[i] = least


@njit
def match_sparse(
    indptr: Ints, indices: Ints, costs: Floats, row_slack: Floats, column_slack: Floats,
    row_edge: Ints, u: Floats, v: Floats,
) -> float:  # fmt: skip
    """Fill ``row_edge``, ``u`` and ``v``; return the total cost, ``inf`` where there is no matching."""
    n, m = row_slack.size, column_slack.size
    # matching all rows matches all columns: no price, which would take digits from the duals
    all_matched = n == m and _all_are(row_slack, np.inf)
    must = False
    for j in range(m):
        must = must or column_slack[j] == np.inf
    price = _price(costs[: indptr[n]], row_slack, column_slack) if must and not all_matched else 0.0
    base, above = np.empty(m), costs
    for j in range(m):
        base[j] = column_slack[j] if column_slack[j] < np.inf else price
        v[j] = 0.0
    if not _all_are(base, 0.0):
        above = np.empty(indptr[n])
        for k in range(indptr[n]):
            above[k] = costs[k] - base[indices[k]]
    owner = np.full(m, -1, np.int64)
    pending = np.empty(n, np.int64)
    num_pending = 0
    for i in range(n):
        row_edge[i] = -1
        first = indptr[i]
        row = above[first : indptr[i + 1]]
        least = _least(row)
        best = -1
        for t in range(row.size):
            # of equal ones a column that is free
            if row[t] == least:
                if owner[indices[first + t]] < 0:
                    best = first + t
                    break
                best = best if best >= 0 else first + t
        if row_slack[i] <= least:
            if least == np.inf and row_slack[i] == np.inf:
                return np.inf
            u[i] = row_slack[i]
        else:
            u[i] = least
            j = indices[best]
            if owner[j] < 0:
                owner[j] = i
                row_edge[i] = best
            else:
                pending[num_pending] = i
                num_pending += 1
    problem = Costs(indptr, indices, indices.view(np.uint64), costs, row_slack, above)
    state = State(row_edge, u, v, owner, pending)
    wide = 4 * indices.size > n * m
    dense = wide and indices.size > _MANY
    if all_matched and num_pending > _FEW:
        # free columns may keep a price here, as none stays free
        if n >= _LARGE and indices.size > _WIDE * n and num_pending < _CONTESTED * n:
            num_pending = solve_core(problem, state)
        elif not dense or n >= _LARGE:
            num_pending = hold_auction(problem, state, num_pending)
    else:
        num_pending = reduce_rows(problem, state, num_pending, _STEPS if wide else _CHEAP)
    if num_pending > 0:
        if not (augment_dense(problem, state, num_pending) if dense else augment_all(problem, state, num_pending)):
            return np.inf
    total = 0.0
    for i in range(n):
        total += row_slack[i] if row_edge[i] < 0 else costs[row_edge[i]]
    for j in range(m):
        v[j] += base[j]
        if owner[j] < 0:
            total += column_slack[j]
    return total


@inner_njit
def _all_are(values: Floats, value: float) -> bool:
    for one in values:
        if one != value:
            return False
    return True


@inner_njit
def _least(values: Floats) -> float:
    """The least of some values, ``inf`` of none: four at a time, which do not wait for each other."""
    a = b = c = d = np.inf
    whole = values.size - values.size % 4
    for t in range(0, whole, 4):
        a, b = min(a, values[t]), min(b, values[t + 1])
        c, d = min(c, values[t + 2]), min(d, values[t + 3])
    for t in range(whole, values.size):
        a = min(a, values[t])
    return min(min(a, b), min(c, d))


@inner_njit
def _price(costs: Floats, row_slack: Floats, column_slack: Floats) -> float:
    """A slack for columns that must be matched, so large that no matching can compensate for it."""
    largest = 0.0
    for values in (costs, row_slack, column_slack):
        for t in range(values.size):
            if values[t] < np.inf:
                largest = max(largest, abs(values[t]))
    return 4.0 * largest * (min(row_slack.size, column_slack.size) + 1.0) + 1.0
