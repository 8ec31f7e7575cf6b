"""Auctions with falling steps [1]_: where all rows and columns must be matched they leave few rows to match.

After the last step comes the augmenting row reduction of [2]_, which begins where rows may stay unmatched.

References
----------
.. [1] D. P. Bertsekas, "The auction algorithm: a distributed relaxation method for the assignment problem", Annals of
   Operations Research 14, 105-123 (1988).
.. [2] R. Jonker and A. Volgenant, "A shortest augmenting path algorithm for dense and sparse linear
   assignment problems", Computing 38, 325-340 (1987).
"""

from __future__ import annotations

import math

import numpy as np

from assoc._system.compiled import inner_njit
from assoc._types import Floats, Ints
from assoc.packing.kernels.augmenting import augment_all
from assoc.packing.kernels.partial_matching import Costs, State, unmatch_loose

# steps of the auction: the first as a share of the spread of a row's costs (if more, a gap between its two best), the
# next as a share of the one before, the last as a share of a gap, or of 1 for whole-numbered costs
_FIRST, _FALL, _LAST, _WHOLE = 0.05, 0.1, 0.05, 0.15
# usual gap of whole numbers that are mostly tied; most steps of the row reduction, for each row that is left, after it
_TIES, _STEPS = 2.0, 32
# most bids for each row with one step
_BIDS = 40
# cheapest edges of each row that problems of wide rows are solved with at first: so many to twice as many
_CORE = 16


@inner_njit
def solve_core(problem: Costs, state: State) -> int:
    """Match the rows by their cheapest edges alone, then unmatch those that others undercut; return how many are left.

    Mostly few are: an optimal matching takes none but cheap edges.
    """
    row_edge, u, v, owner, pending = state
    places, indptr = _cheapest(problem)
    indices = np.empty(places.size, np.int64)
    above, chosen = np.empty(places.size), np.full(u.size, -1, np.int64)
    for e in range(places.size):
        indices[e], above[e] = problem.indices[places[e]], problem.above[places[e]]
    for i in range(u.size):
        pending[i] = i
    for j in range(v.size):
        owner[j] = -1
    core = Costs(indptr, indices, indices.view(np.uint64), above, problem.row_slack, above)
    part = State(chosen, u, v, owner, pending)
    left = hold_auction(core, part, u.size)
    if left > 0:
        # where the core has no matching what is found is still a beginning
        augment_all(core, part, left)
    for i in range(u.size):
        row_edge[i] = places[chosen[i]] if chosen[i] >= 0 else -1
    return unmatch_loose(problem, state)


@inner_njit
def _cheapest(problem: Costs) -> tuple[Ints, Ints]:
    """About as many of the cheapest edges of each row as a core has, and where each row's begin."""
    indptr, above = problem.indptr, problem.above
    num = indptr.size - 1
    places, begin = np.empty(2 * num * _CORE, np.int64), np.zeros(num + 1, np.int64)
    for i in range(num):
        row = above[indptr[i] : indptr[i + 1]]
        limit = _limit_of_cheap(row)
        end = begin[i]
        # from another place in each row: where many are equal, rows would take the same columns
        t = i % max(row.size, 1)
        for _ in range(row.size):
            if row[t] <= limit and end < begin[i] + 2 * _CORE:
                places[end] = indptr[i] + t
                end += 1
            t = t + 1 if t + 1 < row.size else 0
        begin[i + 1] = end
    return places[: begin[num]].copy(), begin


@inner_njit
def _limit_of_cheap(row: Floats) -> float:
    """A cost that between one and two times as many as a core has are below or at, if halving finds one."""
    low, high, least = np.inf, -np.inf, 0
    for t in range(row.size):
        low = min(low, row[t])
        if row[t] < np.inf:
            high = max(high, row[t])
    for t in range(row.size):
        least += row[t] == low
    if least >= _CORE:
        return low
    if row.size > 2 * _CORE:
        for _ in range(12):
            middle = 0.5 * (low + high)
            count = 0
            for t in range(row.size):
                count += row[t] <= middle
            if count < _CORE:
                low = middle
            else:
                high = middle
                if count <= 2 * _CORE:
                    break
    return high


@inner_njit
def hold_auction(problem: Costs, state: State, num_pending: int) -> int:
    """Bring duals near optimal ones by auctions with smaller and smaller steps; return how many rows are pending.

    Unlike the row reduction it does not stall where prices rise by little, or not at all (ties). It leaves each
    matched row at its least reduced cost, as augmenting paths need it.
    """
    gap, spread, whole = _typical_gap(problem)
    step = max(gap, _FIRST * spread)
    while True:
        bids = _bid(problem, state, num_pending, (step, gap), _BIDS * state.u.size)
        last = bids <= 0 or step <= _LAST * gap or (whole and step < _WHOLE)
        if whole and last:
            # optimal duals are whole numbers, too
            for j in range(state.v.size):
                state.v[j] = math.floor(state.v[j] + 0.5)
        num_pending = unmatch_loose(problem, state)
        if last:
            # prices that rise by nothing at ties reduce nothing
            ties = whole and gap < _TIES
            return num_pending if ties else reduce_rows(problem, state, num_pending, _STEPS)
        step *= _FALL


@inner_njit
def _typical_gap(problem: Costs) -> tuple[float, float, bool]:
    """Geometric means of the rows' gaps between least and second least cost, and largest; whether all are whole."""
    indptr, above = problem.indptr, problem.above
    total, wide, count, whole = 0.0, 0.0, 0, True
    for i in range(indptr.size - 1):
        least = second = np.inf
        largest = -np.inf
        for k in range(indptr[i], indptr[i + 1]):
            value = above[k]
            if value < np.inf:
                largest = max(largest, value)
            whole = whole and (value == math.floor(value) or value == np.inf)
            if value < least:
                least, second = value, least
            elif least < value < second:
                second = value
        if second < np.inf:
            total += math.log(second - least)
            wide += math.log(largest - least)
            count += 1
    if count == 0:
        return 1.0, 1.0, whole
    # few large costs, as of forbidden edges, do not move these means
    return math.exp(total / count), math.exp(wide / count), whole


@inner_njit
def _bid(problem: Costs, state: State, num_pending: int, sizes: tuple[float, float], bids: int) -> int:
    """Match all pending rows, each at a price that is above the second best offer by a step; return the bids left."""
    indptr, indices, unsigned, _, _, above = problem
    row_edge, _, v, owner, pending = state
    step, gap = sizes
    while num_pending > 0 and bids > 0:
        num_pending -= 1
        i = pending[num_pending]
        while i >= 0 and bids > 0:
            bids -= 1
            least, second, best = np.inf, np.inf, -1
            for k in range(indptr[i], indptr[i + 1]):
                value = above[k] - v[unsigned[k]]
                if value < least:
                    least, second, best = value, least, k
                elif value < second:
                    second = value
            if best < 0:
                break
            j = indices[best]
            # a row of one edge bids a usual gap
            v[j] -= (second - least if second < np.inf else gap) + step
            other = owner[j]
            owner[j] = i
            row_edge[i] = best
            if other >= 0:
                row_edge[other] = -1
            i = other
    return bids


@inner_njit
def reduce_rows(problem: Costs, state: State, num_pending: int, most: int) -> int:
    """Augmenting row reduction, with ``most`` steps a row: each row takes its best column at the second best's price.

    Returns how many rows are still pending.
    """
    indptr, indices, unsigned, _, row_slack, above = problem
    row_edge, u, v, owner, pending = state
    steps = most * num_pending + 8
    left = 0
    at = 0
    while at < num_pending:
        i = pending[at]
        at += 1
        while i >= 0:
            least, second, best = np.inf, row_slack[i], -1
            for k in range(indptr[i], indptr[i + 1]):
                value = above[k] - v[unsigned[k]]
                if value < least:
                    # a parallel edge to the same column is not a second choice; it would only make the step smaller
                    second = min(second, least)
                    least, best = value, k
                elif value < second:
                    second = value
            if best < 0 or row_slack[i] <= least:
                u[i] = row_slack[i]
                break
            j = indices[best]
            if owner[j] < 0:
                u[i] = least
                owner[j] = i
                row_edge[i] = best
                break
            steps -= 1
            if steps <= 0 or second == np.inf or second <= least:
                # a tie or a row without a second choice: left to the augmenting paths
                u[i] = least
                pending[left] = i
                left += 1
                break
            u[i] = second
            v[j] -= second - least
            other = owner[j]
            owner[j] = i
            row_edge[i] = best
            row_edge[other] = -1
            i = other
    return left
