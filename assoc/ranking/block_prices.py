"""Bounds on the probability of each tuple by prices of measurements, checked block by block.

Let G be a set of tuples over measurements (rows), Z(G) the sum of the weights of all its solutions, and G - R the
tuples without the rows R. The rows are split into small blocks. *Prices* v_r >= 0 are valid where for every union H of
blocks and every set R of its rows

    Z(H - R)  <=  Z(H) exp(-v(R)),    v(R) = sum of v_r over R.                                                    (1)

They are, if for every block B and every set R of its rows with v(R) > 0 some part R' of R has

    F(B - R')  <=  I(B) exp(-v(R)),                                                                                (2)

where I(S) sums the solutions within S, and F(S) all sets of tuples that cover rows of S and no other row of B, each
row at most once, with the weight w_t exp(-v of the rows of t outside of B): F forgets that two tuples may need the
same row outside. With such prices the solutions with tuple t weigh at most F_t Z(G - B) and at least I_t Z(G - B),
those without it at most F_not and at least I_not times this, so that

    I_t / (I_t + F_not)  <=  P(t)  <=  F_t / (F_t + I_not).                                                        (3)

The upper bound needs no prices where B are the rows of t: P(t) <= w_t / I(B). docs/probabilities.md proves all this.
Prices are sought from the multipliers of the dual bound: they fall where (2) fails, which makes the tuples of blocks
around heavier, until (2) holds everywhere. Where much is undecided they fall to nothing, and (3) says little.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.clock import is_over
from assoc._system.compiled import inner_njit, njit
from assoc._types import Floats, Ints
from assoc.packing.run import Run
from assoc.ranking.columns import AllColumns
from assoc.ranking.estimates.mean_field import mean_field

LIGHTEST = -700.0
"""Logarithm of a weight below which a tuple weighs nothing."""
ROUNDING = 1e-11
_HEAVIEST = 90.0
"""Logarithm of a weight beyond which the sums of a block could overflow."""
_LARGEST = (10, 14)
"""Rows of a block at most, one split after the other; larger blocks have weaker borders and cost more."""
_PASSES, _FALLING = 12, 60
"""Passes over all blocks in which prices fall and rise, and then those in which they only fall."""
_AIM, _MARGIN = 1e-6, 1e-9
"""Logarithms by which (2) is to hold, and by which it has to."""
_LOST = 1e-12
"""Share of a sum that differences lose at most."""


class _Graph(NamedTuple):
    """Columns over rows, the columns of each row, and -1 for each row (its number in the block at work)."""

    cols: NDArray[np.int32]
    log_weight: Floats
    row_ptr: Ints
    row_cols: Ints
    number: Ints


class _Tables(NamedTuple):
    """Of one block: F and I of all subsets, the largest price of all R; its entries (a column at its first row)."""

    relaxed: Floats
    inside: Floats
    limit: Floats
    ptr: Ints
    column: Ints
    bits: Ints
    weight: Floats
    inner: Floats
    """Weight of those within the block, else 0."""


def block_bounds(columns: AllColumns, which: Ints, widest: int, run: Run) -> tuple[Floats, Floats, Floats]:
    """Estimate and bound the probabilities of the N columns, and that of the R rows to be in none of them.

    All rows may be in none.

    Parameters
    ----------
    columns : AllColumns
    which : int array
        Columns of whole clusters. Nothing is said of the others (0.5, 0, 1).
    widest : int
        Most rows of a block.
    run : Run
        Its time.
    """
    num, rows = len(columns.weights), columns.slack.size
    estimate, lower, upper = np.full(num + rows, 0.5), np.zeros(num + rows), np.ones(num + rows)
    cols, log_weight = columns.rows[which], -columns.weights[which]
    if log_weight.max(initial=0.0) > _HEAVIEST:
        return estimate, lower, upper
    column, sensor = np.nonzero(cols >= 0)
    row = cols[column, sensor]
    row_ptr = np.append(0, np.cumsum(np.bincount(row, minlength=rows)))
    row_cols = column[np.argsort(row, kind="stable")]
    graph = _Graph(cols, log_weight, row_ptr, row_cols, np.full(rows, -1))
    touched = np.flatnonzero(np.diff(row_ptr))
    where = np.append(which, num + touched)
    share, free = mean_field(cols, np.exp(np.maximum(log_weight, LIGHTEST)), np.ones(rows))
    estimate[where] = np.append(share, free[touched])
    least, most = np.zeros(len(which) + rows), np.ones(len(which) + rows)
    _bound_alone(graph, _LARGEST[-1], run.deadline(), most)
    for largest in sorted({min(size, widest) for size in _LARGEST} - {0}):
        if run.should_stop():
            break
        label = _split(cols, share, rows, largest)[touched]
        order = touched[np.argsort(label, kind="stable")]
        ptr = np.append(0, np.cumsum(np.unique(label, return_counts=True)[1]))
        _bound_blocks(graph, order, ptr, np.maximum(-columns.duals, 0.0), run.deadline(), least, most)
    known = np.append(np.arange(len(which)), len(which) + touched)
    lower[where], upper[where] = np.maximum(least[known] - ROUNDING, 0.0), np.minimum(most[known] + ROUNDING, 1.0)
    return np.clip(estimate, lower, upper), lower, upper


def _split(cols: NDArray[np.int32], share: Floats, rows: int, largest: int) -> Ints:
    """Block of each row: blocks that share most by their size are joined while both prefer each other."""
    label = np.arange(rows)
    size = np.ones(rows, dtype=np.int64)
    first, second, weight = [], [], []
    for s in range(cols.shape[1]):
        for t in range(s):
            both = (cols[:, s] >= 0) & (cols[:, t] >= 0)
            first.append(cols[both, s])
            second.append(cols[both, t])
            weight.append(share[both])
    a, b, w = np.concatenate(first).astype(np.int64), np.concatenate(second).astype(np.int64), np.concatenate(weight)
    while True:
        a, b = label[a], label[b]
        a, b = np.minimum(a, b), np.maximum(a, b)
        key, number = np.unique(a * rows + b, return_inverse=True)
        w = np.asarray(np.bincount(number.reshape(-1), w), dtype=np.float64)
        a, b = np.divmod(key, rows)
        fits = (a != b) & (size[a] + size[b] <= largest)
        a, b, w = a[fits], b[fits], w[fits]
        if not len(a):
            return np.unique(label, return_inverse=True)[1].reshape(-1)
        # the best partner of each block, ties to the first
        order = np.argsort(-w / (size[a] + size[b]), kind="stable")
        rank = np.empty(len(a), dtype=np.int64)
        rank[order] = np.arange(len(a))
        best = np.full(rows, len(a))
        np.minimum.at(best, a, rank)
        np.minimum.at(best, b, rank)
        joined = (best[a] == rank) & (best[b] == rank)
        to = np.arange(rows)
        to[b[joined]] = a[joined]
        size[a[joined]] += size[b[joined]]
        label = to[label]


@njit
def _bound_alone(graph: _Graph, widest: int, deadline: float, upper: Floats) -> None:
    """Narrow the upper bound of each column of at most so many rows by the sum over these rows."""
    most = rows = 0
    for j in range(graph.log_weight.size):
        count = size = 0
        for r in graph.cols[j]:
            if r >= 0:
                count += graph.row_ptr[r + 1] - graph.row_ptr[r]
                size += 1
        if size <= widest:
            most, rows = max(most, count), max(rows, size)
    tables = _new_tables(rows, most)
    block, prices = np.empty(graph.cols.shape[1], np.int64), np.full(graph.number.size, np.inf)
    for j in range(graph.log_weight.size):
        if is_over(deadline):
            return
        count = 0
        for r in graph.cols[j]:
            if r >= 0:
                block[count] = r
                count += 1
        if count > widest:
            continue
        _summed(graph, block[:count], prices, tables)
        upper[j] = min(upper[j], math.exp(graph.log_weight[j]) / tables.inside[(1 << count) - 1])


@njit
def _bound_blocks(
    graph: _Graph, rows: Ints, ptr: Ints, prices: Floats, deadline: float, lower: Floats, upper: Floats
) -> bool:
    """Make prices valid for these blocks and narrow the bounds with them; False where they do not become so."""
    widest = entries = 0
    for b in range(ptr.size - 1):
        widest = max(widest, ptr[b + 1] - ptr[b])
        count = 0
        for r in rows[ptr[b] : ptr[b + 1]]:
            count += graph.row_ptr[r + 1] - graph.row_ptr[r]
        entries = max(entries, count)
    tables, totals = _new_tables(widest, entries), np.empty(1 << widest)
    valid = False
    # visits of blocks are counted: when each was the last, and when the price of each row changed
    visit, seen, changed = 0, np.full(ptr.size - 1, -1), np.zeros(graph.number.size, np.int64)
    for turn in range(_PASSES + _FALLING):
        # a pass without a change has seen all blocks at these prices
        valid = True
        for b in range(ptr.size - 1):
            if is_over(deadline):
                return False
            block = rows[ptr[b] : ptr[b + 1]]
            if not _is_new(graph, block, changed, seen[b]):
                continue
            visit += 1
            seen[b] = visit
            _summed(graph, block, prices, tables)
            _limited(block.size, tables)
            now = prices[block]
            if _lowered(now, tables.limit, totals):
                valid = False
            if turn < _PASSES and _raised(now, tables.limit, totals):
                valid = False
            for i in range(block.size):
                if now[i] != prices[block[i]]:
                    prices[block[i]], changed[block[i]] = now[i], visit + 1
        if valid:
            break
    if valid:
        for b in range(ptr.size - 1):
            block = rows[ptr[b] : ptr[b + 1]]
            _summed(graph, block, prices, tables)
            _narrowed(graph, block, tables, lower, upper)
    return valid


@inner_njit
def _is_new(graph: _Graph, block: Ints, changed: Ints, seen: int) -> bool:
    """Whether the price of a row that the block's tuples touch has changed since it was seen."""
    for r in block:
        for x in range(graph.row_ptr[r], graph.row_ptr[r + 1]):
            for q in graph.cols[graph.row_cols[x]]:
                if q >= 0 and changed[q] > seen:
                    return True
    return False


@inner_njit
def _new_tables(rows: int, entries: int) -> _Tables:
    """Allocate tables for blocks of this size."""
    size = 1 << rows
    ptr, column, bits = np.empty(rows + 1, np.int64), np.empty(entries, np.int64), np.empty(entries, np.int64)
    weight, inner = np.empty(entries), np.empty(entries)
    return _Tables(np.empty(size), np.empty(size), np.empty(size), ptr, column, bits, weight, inner)


@inner_njit
def _summed(graph: _Graph, block: Ints, prices: Floats, tables: _Tables) -> None:
    """Fill in F and I of all subsets of a block."""
    number, count = graph.number, 0
    for i in range(block.size):
        number[block[i]] = i
    for i in range(block.size):
        tables.ptr[i] = count
        for x in range(graph.row_ptr[block[i]], graph.row_ptr[block[i] + 1]):
            j = graph.row_cols[x]
            bits, outside, crosses, first = np.int64(0), 0.0, False, True
            for r in graph.cols[j]:
                if r >= 0 and number[r] >= 0:
                    bits |= np.int64(1) << number[r]
                    first = first and number[r] >= i
                elif r >= 0:
                    outside += prices[r]
                    crosses = True
            weight = math.exp(graph.log_weight[j] - outside)
            # one that underflows adds nothing that counts, and would make no number of a sum that has overflowed
            if first and weight > 0.0:
                tables.column[count], tables.bits[count] = j, bits
                tables.weight[count], tables.inner[count] = weight, 0.0 if crosses else weight
                count += 1
    tables.ptr[block.size] = count
    for r in block:
        number[r] = -1
    relaxed, inside = tables.relaxed, tables.inside
    relaxed[0] = inside[0] = 1.0
    for i in range(block.size - 1, -1, -1):
        # subsets whose first row is i: those of the rows after it, which are done, with it
        bit = np.int64(1) << i
        for after in range(np.int64(1) << (block.size - 1 - i)):
            subset = (after << (i + 1)) | bit
            total, within = relaxed[subset ^ bit], inside[subset ^ bit]
            for x in range(tables.ptr[i], tables.ptr[i + 1]):
                if tables.bits[x] & ~subset == 0:
                    rest = subset & ~tables.bits[x]
                    total += tables.weight[x] * relaxed[rest]
                    within += tables.inner[x] * inside[rest]
            relaxed[subset], inside[subset] = total, within


@inner_njit
def _limited(rows: int, tables: _Tables) -> None:
    """Fill in how large the prices of each R may be: by (2), or what is left of R without some rows, at least 0."""
    full = (1 << rows) - 1
    whole = math.log(tables.inside[full])
    tables.limit[0] = 0.0
    for taken in range(1, full + 1):
        limit = max(whole - math.log(tables.relaxed[full ^ taken]), 0.0)
        for i in range(rows):
            if taken >> i & 1:
                limit = max(limit, tables.limit[taken ^ (1 << i)])
        tables.limit[taken] = limit


@inner_njit
def _added_up(prices: Floats, totals: Floats) -> None:
    """Fill in the prices of all R."""
    totals[0] = 0.0
    for i in range(prices.size):
        bit = 1 << i
        for taken in range(bit):
            totals[bit | taken] = totals[taken] + prices[i]


@inner_njit
def _lowered(prices: Floats, limit: Floats, totals: Floats) -> bool:
    """Lower the prices of a block until all limits hold; False where they did."""
    changed = False
    while True:
        _added_up(prices, totals)
        worst, furthest = 0, 0.0
        for taken in range(1, 1 << prices.size):
            beyond = totals[taken] - limit[taken]
            if totals[taken] > 0.0 and beyond > -_MARGIN and beyond + _AIM > furthest:
                worst, furthest = taken, beyond + _AIM
        if worst == 0:
            return changed
        changed = True
        factor = max(limit[worst] - _AIM, 0.0) / totals[worst]
        for i in range(prices.size):
            if worst >> i & 1:
                prices[i] = prices[i] * factor if factor > 0.0 else 0.0


@inner_njit
def _raised(prices: Floats, limit: Floats, totals: Floats) -> bool:
    """Raise each price by half of what its limits leave; False where they leave nothing."""
    changed = False
    for i in range(prices.size):
        _added_up(prices, totals)
        least = np.inf
        for taken in range(1, 1 << prices.size):
            if taken >> i & 1:
                least = min(least, limit[taken] - totals[taken])
        if 4.0 * _AIM < least < np.inf:
            prices[i] += 0.5 * least
            changed = True
    return changed


@inner_njit
def _narrowed(graph: _Graph, block: Ints, tables: _Tables, lower: Floats, upper: Floats) -> None:
    """Narrow the bounds of the columns and rows of a block by (3)."""
    full = (1 << block.size) - 1
    inside, relaxed = tables.inside[full], tables.relaxed[full]
    if not relaxed < np.inf:
        return
    for x in range(block.size + tables.ptr[block.size]):
        if x < block.size:
            where, rest = graph.log_weight.size + block[x], full ^ (1 << x)
            least, most = tables.inside[rest], tables.relaxed[rest]
        else:
            e = x - block.size
            where, rest = tables.column[e], full & ~tables.bits[e]
            least, most = tables.inner[e] * tables.inside[rest], tables.weight[e] * tables.relaxed[rest]
        # differences of sums, less what they may have lost
        others = max(inside - least - _LOST * inside, 0.0)
        most_others = max(relaxed - most, 0.0) + _LOST * relaxed
        upper[where] = min(upper[where], most / (most + others) if most > 0.0 else 0.0)
        lower[where] = max(lower[where], least / (least + most_others))
