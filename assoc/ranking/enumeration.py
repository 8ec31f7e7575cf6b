"""Depth-first enumeration of the k lightest solutions of a small packing below a limit.

With feasible multipliers u (packing/bounds) a solution x weighs

    w(x) = sum(u) + sum of the reduced costs of its columns + sum of -u_r over its uncovered rows with slack,

all terms but the first >= 0. (Rows of cuts and counts have such terms, too. For the solutions of a node below the limit
they are >= 0, and are left out; other solutions may be missed, as they belong to other nodes.) The search decides row
by row, always the row with the fewest choices left, and backtracks where the terms so far exceed the limit. The limit
falls to the weight of the k-th lightest solution known, so that only ties and better ones are searched for.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import inner_njit, njit
from assoc._system.kernels.copying import copy_to
from assoc._system.kernels.sorting import order_of, sort_part
from assoc._types import Floats, Ints
from assoc.packing.kernels.heap import doubled, doubled_rows, pop, push

NOT_COMPLETE = -1
_ALONE = -1
# columns of a row above which insertion sort is too slow; decisions between two checks of the clock
_LONG = 40
_LOOK = 8


class Wanted(NamedTuple):
    """Which solutions to search for, and for how long.

    The ``k`` lightest that weigh less than ``limit``; weights that differ by ``tolerance`` are ties. ``budget`` is the
    largest number of decisions, ``deadline`` the time limit (clock.py).
    """

    k: int
    limit: float
    tolerance: float
    budget: int
    deadline: float


class PricedColumns(NamedTuple):
    """Columns over rows with feasible multipliers, the input of the enumeration."""

    cols: NDArray[np.int32]
    """Rows of each column, (N, S)."""
    names: NDArray[np.int32]
    """Numbers of the columns in the store, (N,)."""
    weights: NDArray[np.float64]
    """Weights of the columns, indexed by these numbers."""
    reduced: NDArray[np.float64]
    """Reduced costs (negative ones, due to rounding, count as 0), (N,)."""
    slack: NDArray[np.bool_]
    duals: NDArray[np.float64]
    """Multipliers of the rows; those of cuts and counts come last, and are not used."""
    row_ptr: NDArray[np.int64]
    row_cols: NDArray[np.int32]
    """Columns of each row; the enumeration sorts them by reduced cost."""
    blocked: NDArray[np.int32]
    """Buffer: how many of a column's rows are decided, (N,)."""


class Store(NamedTuple):
    """Solutions kept: a heap of (-weight, slot), the hash and the columns of each slot (-1 ends them), the count."""

    key: NDArray[np.float64]
    slot: NDArray[np.int64]
    marks: NDArray[np.uint64]
    columns: NDArray[np.int32]
    num: NDArray[np.int64]


def new_store(num_rows: int) -> Store:
    """Allocate a store for solutions of ``num_rows`` rows; in Python, so that Ctrl-C cannot spoil a kernel's result."""
    capacity = 4
    return Store(
        np.empty(capacity),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.uint64),
        np.empty((capacity, num_rows + 1), np.int32),
        np.zeros(1, np.int64),
    )


new_store_inside = inner_njit(new_store)


@njit
def cut_of(store: Store, wanted: Wanted) -> float:
    """The weight below which solutions are still wanted."""
    if store.num[0] >= wanted.k:
        return min(wanted.limit, -store.key[0] - wanted.tolerance)
    return wanted.limit


@inner_njit
def _mark(column: int) -> np.uint64:
    """Hash of a column number (splitmix64); the xor of hashes identifies a set."""
    z = np.uint64(column + 1) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@inner_njit
def _keep(store: Store, k: int, weight: float, columns: Ints, count: int, check: bool) -> Store:
    """Add a solution; if there are k, it replaces the heaviest. With ``check`` only if it is new."""
    mark = np.uint64(0)
    for t in range(count):
        mark ^= _mark(columns[t])
    ordered = columns[:count].copy()
    sort_part(ordered, 0, count)
    if check:
        for i in range(store.num[0]):
            at = store.slot[i]
            if store.marks[at] == mark and store.columns[at, count] < 0:
                same = True
                for t in range(count):
                    if store.columns[at, t] != ordered[t]:
                        same = False
                        break
                if same:
                    return store
    if store.num[0] < k:
        if store.num[0] == store.key.size:
            store = Store(
                doubled(store.key), doubled(store.slot), doubled(store.marks), doubled_rows(store.columns), store.num
            )
        at = store.num[0]
        push(store.key, store.slot, at, -weight, at)
        store.num[0] += 1
    else:
        at = store.slot[0]
        pop(store.key, store.slot, k - 1)
        push(store.key, store.slot, k - 1, -weight, at)
    store.marks[at] = mark
    for t in range(count):
        store.columns[at, t] = ordered[t]
    store.columns[at, count] = -1
    return store


@inner_njit
def enumerate_solutions(
    priced: PricedColumns, top: int, end: int, base: float, wanted: Wanted, check: bool, store: Store
) -> Any:
    """Search rows ``top:end``, whose columns use no other rows, for the wanted solutions, which are added to the store.

    A solution weighs at least ``base`` plus the reduced costs of its columns and uncovered rows. ``check``: the store
    may already have some of them. ``row_cols`` and ``blocked`` are changed. Returns the decisions made,
    ``NOT_COMPLETE`` if the budget or the time did not suffice, and the store.
    """
    _, names, weights, reduced, slack, duals, row_ptr, row_cols, blocked = priced
    k, budget, deadline = wanted.k, wanted.budget, wanted.deadline
    num_rows = end - top
    for r in range(top, end):
        if is_over(deadline):
            return NOT_COMPLETE, store
        _sort_row(reduced, row_cols[row_ptr[r] : row_ptr[r + 1]])
    done = np.zeros(num_rows, np.bool_)
    # how many of a column's rows are decided: it can be taken while this is 0
    for x in range(row_ptr[top], row_ptr[end]):
        blocked[row_cols[x]] = 0
    row_at = np.empty(num_rows, np.int64)
    cursor = np.empty(num_rows, np.int64)
    taken = np.empty(num_rows, np.int64)
    slack_left = np.empty(num_rows, np.bool_)
    spent = np.empty(num_rows + 1)
    chosen = np.empty(num_rows + 1, np.int32)
    count = 0
    depth = 0
    steps = 0
    spent[0] = base
    cut = cut_of(store, wanted)
    forward = True
    while True:
        if forward:
            row, choices = _next_row(priced, top, end, done, cut - spent[depth])
            if row < 0 or choices == 0:
                if row < 0 and spent[depth] < cut:
                    weight = _weight(weights, chosen[:count])
                    if weight < cut:
                        store = _keep(store, k, weight, chosen, count, check)
                        cut = cut_of(store, wanted)
                forward = False
                depth -= 1
                continue
            row_at[depth] = row
            cursor[depth] = row_ptr[row]
            slack_left[depth] = slack[row]
        else:
            if depth < 0:
                return steps, store
            count -= _decide(priced, top, row_at[depth], taken[depth], done, False)
        row = row_at[depth]
        room = cut - spent[depth]
        x = cursor[depth]
        while x < row_ptr[row + 1] and blocked[row_cols[x]] > 0:
            x += 1
        cost = max(reduced[row_cols[x]], 0.0) if x < row_ptr[row + 1] else np.inf
        alone = max(-duals[row], 0.0) if slack_left[depth] else np.inf
        if min(cost, alone) >= room:
            forward = False
            depth -= 1
            continue
        if alone <= cost:
            slack_left[depth] = False
            taken[depth] = _ALONE
            cost = alone
        else:
            taken[depth] = row_cols[x]
            chosen[count] = names[taken[depth]]
            x += 1
        cursor[depth] = x
        count += _decide(priced, top, row, taken[depth], done, True)
        spent[depth + 1] = spent[depth] + cost
        depth += 1
        forward = True
        steps += 1
        if steps > budget or (steps % _LOOK == 0 and is_over(deadline)):
            return NOT_COMPLETE, store


@inner_njit
def _weight(weights: Floats, columns: Ints) -> float:
    total = 0.0
    for j in columns:
        total += weights[j]
    return total


@inner_njit
def _sort_row(reduced: Floats, columns: Ints) -> None:
    """Sort columns by reduced cost; stable."""
    if columns.size <= _LONG:
        # insertion sort: most lists are short
        for x in range(1, columns.size):
            a = columns[x]
            y = x
            while y > 0 and reduced[columns[y - 1]] > reduced[a]:
                columns[y] = columns[y - 1]
                y -= 1
            columns[y] = a
        return
    ordered = True
    for x in range(1, columns.size):
        if reduced[columns[x - 1]] > reduced[columns[x]]:
            ordered = False
            break
    if not ordered:
        copy_to(columns, columns[order_of(reduced[columns])])


@inner_njit
def _next_row(priced: PricedColumns, top: int, end: int, done: NDArray[np.bool_], room: float) -> Any:
    """Return the row with the fewest choices left (-1: all are decided), and their number."""
    _, _, _, reduced, slack, duals, row_ptr, row_cols, blocked = priced
    row, least = -1, 1 << 60
    for r in range(top, end):
        if done[r - top]:
            continue
        choices = 1 if slack[r] and max(-duals[r], 0.0) < room else 0
        for x in range(row_ptr[r], row_ptr[r + 1]):
            a = row_cols[x]
            if reduced[a] >= room or choices >= least:
                break
            if blocked[a] == 0:
                choices += 1
        if choices < least:
            row, least = r, choices
            if choices <= 1:
                break
    return row, least


@inner_njit
def _decide(priced: PricedColumns, top: int, row: int, taken: int, done: NDArray[np.bool_], do: bool) -> int:
    """Take a column or leave a row uncovered, or undo that; the number of columns changed."""
    cols, row_ptr, row_cols, blocked = priced.cols, priced.row_ptr, priced.row_cols, priced.blocked
    step = 1 if do else -1
    if taken == _ALONE:
        done[row - top] = do
        for x in range(row_ptr[row], row_ptr[row + 1]):
            blocked[row_cols[x]] += step
        return 0
    for s in range(cols.shape[1]):
        q = cols[taken, s]
        if q >= 0:
            done[q - top] = do
            for x in range(row_ptr[q], row_ptr[q + 1]):
                blocked[row_cols[x]] += step
    return 1
